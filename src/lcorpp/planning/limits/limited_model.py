"""The model of a problem with limits: what the limits count is in its states.

A state has four parts: the state of the stated model, how often each limited event has happened, the class of
the decision (of the conditions of the limits) and, if the limits are for several models, which of them is the
true one. All are hidden; counts follow from the actions and the state.

Return and costs may have different discounts. A solver takes one: the largest, `Pomdp.discount` of
`planning_model`. A criterion with discount g counts in a state that is reached with probability
(g / largest)**t after t steps, its level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.arguments import check_type
from lcorpp.planning.limits.limit import Limit, check_limit_set
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import SparseTables, ragged_indices
from lcorpp.planning.undiscounted import DiscountedForm
from lcorpp.values import Array, Indices

MAX_STATES = 500_000
"""Maximum number of states, counted before those that cannot be reached are left out."""

NEARLY_UNDISCOUNTED = 0.9999
"""Least discount that takes the place of 1 for costs in the search, where a policy may go on forever. Costs
are not negative, so that the bound on the return holds for the smaller, discounted costs, too."""


class Steps(NamedTuple):
    """The steps of an action: those from state x are begins[x] to begins[x + 1].

    begins: (X + 1,). targets, observations: (m,) next state and observation. chances: (m,) of both.
    """

    begins: npt.NDArray[np.int64]
    targets: Indices
    observations: Indices
    chances: Array


@dataclass(frozen=True, eq=False)
class LimitedModel:
    """A model with the states of limits: X states; criterion 0 is the return, the others are limits.

    limits: those of the criteria from 1 on; with several models, each limit once for each of them.
    base: (X,) the stated model's state. count: (X,) the counts. model: (X,) which of the models.
    first: index of the stated model among the models.
    transitions: for each action a sparse matrix (X, X). observations: for each action (X, O).
    criteria: (1 + K, A, X) rewards, then costs. discounts: (1 + K,).
    starts: (N, X) beliefs. weights: (N,) their probabilities.
    stated: the stated model. truths: the models for which the limits hold.
    stated_limits: the limits as stated. factors: (K', N, S) of their costs, by start and initial state.
    """

    stated: Pomdp
    truths: tuple[Pomdp, ...]
    stated_limits: tuple[Limit, ...]
    factors: Array
    limits: tuple[Limit, ...]
    base: Indices
    count: Indices
    model: Indices
    first: int
    transitions: Sequence[Any]
    observations: Sequence[Any]
    criteria: Array
    discounts: Array
    starts: Array
    weights: Array

    @property
    def bounds(self) -> Array:
        """(K,) of the limits."""
        return np.array([limit.bound for limit in self.limits], dtype=np.float64)

    @property
    def n_models(self) -> int:
        """The number of models, the stated one and those for which the limits hold."""
        return int(self.model.max()) + 1

    @cached_property
    def steps(self) -> list[Steps]:
        """All steps of each action."""
        found = []
        for transition, table in zip(self.transitions, self.observations, strict=True):
            moves = transition.tocsr()
            sizes = np.diff(table.indptr)[moves.indices]
            at = ragged_indices(table.indptr[moves.indices].astype(np.int64), sizes.astype(np.int64))
            ends = np.concatenate([[0], np.cumsum(sizes)])
            found.append(
                Steps(
                    ends[moves.indptr].astype(np.int64),
                    np.repeat(moves.indices, sizes).astype(np.intp),
                    table.indices[at].astype(np.intp),
                    np.repeat(moves.data, sizes) * table.data[at],
                )
            )
        return found

    @cached_property
    def levels(self) -> Array:
        """(1 + K,) the level from which each criterion counts."""
        return np.searchsorted(-self._distinct, -self.discounts).astype(np.intp)

    @cached_property
    def _distinct(self) -> Array:
        """The distinct discounts, the largest first."""
        return -np.unique(-self.discounts)

    @cached_property
    def planning_model(self) -> Pomdp:
        """The model with levels, without rewards; its states are those of this one, level by level."""
        from scipy.sparse import csr_array, kron

        largest = self._find_discount()
        shares = np.minimum(self._distinct / largest, 1.0)
        n_levels, n_states = len(shares), len(self.base)
        lower = np.zeros((n_levels, n_levels))
        for level in range(n_levels):
            reached = np.append(shares[: level + 1], 0.0)
            reached[0] = 1.0
            lower[level, : level + 1] = reached[:-1] - reached[1:]
        transition = [csr_array(kron(csr_array(lower), own, format="csr")) for own in self.transitions]
        observation = [
            csr_array(kron(np.ones((n_levels, 1)), own, format="csr")) for own in self.observations
        ]
        return Pomdp(
            tuple(f"{level}.{x}" for level in range(n_levels) for x in range(n_states)),
            self.stated.actions,
            self.stated.observations,
            SparseTables.of(transition),
            SparseTables.of(observation),
            np.zeros((len(self.stated.actions), n_levels * n_states)),
            largest,
            self.place(self.weights @ self.starts),
            self.stated.file,
        )

    def _find_discount(self) -> float:
        largest = float(self._distinct[0])
        if largest < 1:
            return largest
        undiscounted = Pomdp(
            tuple(map(str, range(len(self.base)))),
            self.stated.actions,
            self.stated.observations,
            SparseTables.of(list(self.transitions)),
            SparseTables.of(list(self.observations)),
            np.abs(self.criteria).sum(axis=0),
            1.0,
            self.starts[0],
        )
        try:
            DiscountedForm.of(undiscounted)
        except ModelError:
            if self.discounts[0] == 1 and self.criteria[0].max() > 0:  # the bound would not hold
                names = ", ".join(limit.name for limit in self.limits)
                raise ModelError(
                    f"with discount 1, one of the limits {names} counts in a state that is never left;"
                    " expected states before the end"
                ) from None
            below = self.discounts[self.discounts < 1]
            return max(NEARLY_UNDISCOUNTED, float(below.max(initial=0.0)))
        return 1.0

    def place(self, beliefs: Array) -> Array:
        """Return beliefs (..., X) as those of the planning model, at its highest level."""
        lower = np.zeros((*beliefs.shape[:-1], (len(self._distinct) - 1) * len(self.base)))
        return np.concatenate([lower, beliefs], axis=-1)

    def combine(self, multipliers: Array, values: Array) -> Array:
        """Return sums of values (1 + K, ..., X) of the criteria in the states of the planning model.

        Args:
            multipliers: (1 + K,) factors of the criteria.
        """
        parts = [np.zeros(values.shape[1:]) for _ in self._distinct]
        for i in np.flatnonzero(multipliers):  # infinite costs count only if they have a multiplier
            for level in range(self.levels[i], len(parts)):
                parts[level] += multipliers[i] * values[i]
        combined: Array = np.concatenate(parts, axis=-1)
        return combined

    def make_problem(self, multipliers: Array) -> Pomdp:
        """Return the planning model with the sum of the criteria as reward; multipliers as of `combine`."""
        return replace(self.planning_model, reward=self.combine(multipliers, self.criteria))


def build_limited_model(
    pomdp: Pomdp,
    limits: Sequence[Limit],
    starts: Array,
    weights: Array,
    *,
    models: Sequence[Pomdp] = (),
    factors: Array | None = None,
) -> LimitedModel:
    """Return the model of a problem with limits.

    Args:
        pomdp: the stated model, whose rewards are the return.
        starts: (N, S) beliefs from which decisions begin. weights: (N,) their probabilities.
        models: those for which the limits hold; by default the stated one. Names, rewards and discount are
            those of the stated model.
        factors: (K, N, S) by which the costs are multiplied in a decision that begins from a belief in a
            state; by default those of `Limit.given`.

    Raises:
        ModelError: a limit is for another model; its condition has no probability; the model is too large.
    """
    limits = check_limit_set(pomdp, limits)
    if pomdp.discount == 1:
        DiscountedForm.of(pomdp)  # raises an error if a policy may go on forever
    if factors is None:
        factors = np.array([_find_factors(limit, starts, weights) for limit in limits])
    truths = list(models) or [pomdp]
    check_names(truths, pomdp)
    for own in truths:
        if own.discount != pomdp.discount:
            raise ModelError(
                f"{own.file or 'a model'}: its discount is {own.discount:g}; expected that of the stated"
                f" model, {pomdp.discount:g}"
            )
    has_stated = any(own is pomdp or own.fingerprint == pomdp.fingerprint for own in truths)
    all_models = truths if has_stated else [pomdp, *truths]
    first = next(m for m, own in enumerate(all_models) if own.fingerprint == pomdp.fingerprint)
    classes, class_of = _find_classes(factors, starts)
    sizes = [limit.more_than + 2 if limit.kind == "probability" else 1 for limit in limits]
    n_states, n_counts, n_copies = len(pomdp.states), prod(sizes), len(all_models) * len(classes)
    if n_states * n_counts * n_copies > MAX_STATES:
        raise ModelError(
            f"the counts of the limits make {n_states * n_counts * n_copies} states of {n_states};"
            f" expected at most {MAX_STATES}: fewer limits, or smaller counts after '>'"
        )
    counts = np.array(np.unravel_index(np.arange(n_counts), sizes))  # (K, C)
    happens = np.array([limit.cost > 0 for limit in limits])  # (K, A, S)
    total = n_copies * n_counts * n_states
    copy, count, base = (own.ravel() for own in np.indices((n_copies, n_counts, n_states)))
    model, group = np.divmod(copy, len(classes))
    placed = np.zeros((len(starts), total))
    for n, start in enumerate(starts):
        for s in np.flatnonzero(start).tolist():
            for m in range(len(all_models)):
                own_copy = m * len(classes) + class_of[n, s]
                placed[n, own_copy * n_counts * n_states + s] += start[s] / len(all_models)
    transitions = [
        _move(a, [own.transition for own in all_models], counts, sizes, happens[:, a], len(classes))
        for a in range(len(pomdp.actions))
    ]
    kept = _find_reachable(transitions, placed)
    model, group, count, base = model[kept], group[kept], count[kept], base[kept]
    criteria = [len(all_models) * pomdp.reward[:, base] * (model == first)]
    discounts, repeated = [pomdp.discount], list[Limit]()
    for m, truth in enumerate(all_models):
        if truth not in truths:
            continue
        for k, limit in enumerate(limits):
            cost = limit.cost[:, base] * (len(all_models) * classes[group, k] * (model == m))
            if limit.kind == "probability":
                cost = cost * (counts[k, count] == limit.more_than)
            criteria.append(cost)
            discounts.append(pomdp.discount if limit.kind == "discounted" else 1.0)
            repeated.append(replace(limit, name=name_limit(limit, len(repeated) // len(limits), len(truths))))
    observations = [
        _observe([own.observation.matrix(a) for own in all_models], model, base)
        for a in range(len(pomdp.actions))
    ]
    return LimitedModel(
        stated=pomdp,
        truths=tuple(truths),
        stated_limits=tuple(limits),
        factors=np.array(factors),
        limits=tuple(repeated),
        base=base,
        count=count,
        model=model,
        first=first,
        transitions=[own[kept][:, kept] for own in transitions],
        observations=observations,
        criteria=np.array(criteria),
        discounts=np.array(discounts),
        starts=placed[:, kept],
        weights=np.asarray(weights, dtype=np.float64),
    )


def check_names(models: Sequence[Pomdp], pomdp: Pomdp) -> None:
    """Raise a `ModelError` if a model has other states, actions or observations than the planner's model."""
    for own in models:
        check_type("a model", own, Pomdp)
        if (own.states, own.actions, own.observations) != (pomdp.states, pomdp.actions, pomdp.observations):
            raise ModelError(f"{own.file or 'a model'}: limits hold for models with the same names only")


def name_limit(limit: Limit, number: int, count: int) -> str:
    """Return the name of a limit in one of some models, numbered from 0."""
    return limit.name if count == 1 else f"{limit.name} in model {number + 1}"


def _find_factors(limit: Limit, starts: Array, weights: Array) -> Array:
    """Return (N, S) 1 / P(condition) in the states of the condition, else 0; 1 without condition."""
    if limit.given is None:
        return np.ones(starts.shape)
    probability = float(weights @ (starts @ limit.given))
    if probability <= 0:
        raise ModelError(f"limit {limit.name}: no decision begins in a state of the condition")
    return np.broadcast_to(limit.given / probability, starts.shape)


def _find_classes(factors: Array, starts: Array) -> tuple[Array, Indices]:
    """Return (J, K) the distinct factors of decisions, and (N, S) the index of those of each."""
    possible = starts > 0
    rows = factors[:, possible].T
    classes, inverse = np.unique(rows, axis=0, return_inverse=True)
    class_of = np.zeros(starts.shape, np.intp)
    class_of[possible] = inverse.reshape(-1)
    return classes, class_of


def _move(
    action: int,
    tables: Sequence[SparseTables],
    counts: Indices,
    sizes: Sequence[int],
    happens: npt.NDArray[np.bool_],
    n_classes: int,
) -> Any:
    """Return the transitions of an action between states with counts, of all copies of all models."""
    from scipy.sparse import block_diag, csr_array

    n_counts, n_states = counts.shape[1], tables[0].shape[1]
    limit = np.array(sizes)[:, None, None] - 1
    after = np.minimum(counts[:, :, None] + happens[:, None, :], limit)  # (K, C, S)
    following = np.ravel_multi_index(tuple(after), sizes)
    blocks = []
    for table in tables:
        entries = table.matrix(action).tocoo()
        source, target = entries.coords
        rows = (np.arange(n_counts)[:, None] * n_states + source).ravel()
        columns = (following[:, source] * n_states + target).ravel()
        size = n_counts * n_states
        own = csr_array((np.tile(entries.data, n_counts), (rows, columns)), shape=(size, size))
        blocks += [own] * n_classes
    return csr_array(block_diag(blocks, format="csr"))


def _observe(tables: Sequence[Any], model: Indices, base: Indices) -> Any:
    """Return the observation probabilities (X, O) of an action."""
    from scipy.sparse import csr_array, vstack

    stacked = csr_array(vstack(tables, format="csr"))
    return stacked[model * tables[0].shape[0] + base]


def _find_reachable(transitions: Sequence[Any], starts: Array) -> Indices:
    """Return the states that some policy reaches from the starts, increasing."""
    reached = starts.sum(axis=0) > 0
    front = np.flatnonzero(reached)
    while len(front):
        found = np.unique(np.concatenate([own[front].indices for own in transitions]))
        front = found[~reached[found]]
        reached[front] = True
    return np.flatnonzero(reached)
