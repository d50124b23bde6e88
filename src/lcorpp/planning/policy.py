"""Policies of alpha vectors: piecewise linear value functions and their actions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError, PolicyError
from lcorpp.notebook import html_table, join_some
from lcorpp.planning.arguments import check_type
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import MAX_BYTES
from lcorpp.values import Array, Belief, Indices, share_frozen

MAX_CHUNK_NUMBERS = 1_000_000
"""Values of vectors that are kept in memory while the actions at many beliefs are found."""


@dataclass(frozen=True, eq=False)
class AlphaVectors:
    """A set of alpha vectors over some of the states, for beliefs with their support among these states.

    states: (n,) indices, increasing.
    vectors: (K, n) value of each vector's plan, by initial state.
    actions: (K,) index of each plan's first action.

    Raises:
        PolicyError: the shapes do not match, or a number is not finite.

    Examples:
        >>> from lcorpp.planning import AlphaVectors
        >>> AlphaVectors([0, 1], [[-100, 10], [10, -100], [-1, -1]], [1, 2, 0])
        <AlphaVectors: 3 over 2 states>
    """

    states: Indices
    vectors: Array
    actions: Indices

    def __post_init__(self) -> None:
        object.__setattr__(self, "vectors", share_frozen(self.vectors))
        for field in ("states", "actions"):
            array = np.array(getattr(self, field), dtype=np.intp)
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        vectors, states, actions = self.vectors, self.states, self.actions
        if states.ndim != 1 or vectors.ndim != 2 or not len(vectors) or vectors.shape[1] != len(states):
            raise PolicyError(f"vectors of shape {vectors.shape} are not a policy for {len(states)} states")
        if not len(states) or (np.diff(states) <= 0).any():
            raise PolicyError("the states of a vector set must be increasing and not empty")
        if not np.isfinite(vectors).all():
            raise PolicyError("an alpha vector contains a number that is not finite")
        if actions.shape != (len(vectors),):
            raise PolicyError(f"{len(vectors)} vectors need as many actions, not {actions.shape}")

    def __repr__(self) -> str:
        return f"<AlphaVectors: {len(self.actions)} over {len(self.states)} states>"


class UpperBound(Protocol):
    """An upper bound on the optimal value."""

    def value(self, belief: Belief) -> float:
        """Return the bound at a belief (S,)."""


@dataclass(frozen=True, eq=False)
class Policy:
    """Alpha vectors over S states. At a belief, the policy takes the action of the best vector.

    Most policies have one set of vectors, over all states. With mixed observability there is one set for each
    value of the observed parts, and possibly another one for beliefs over several values.

    vector_sets: at least one; see `AlphaVectors`.
    state_names, action_names: the names of the model.
    fingerprint: `Pomdp.fingerprint` of the policy's model; "" if unknown.
    model: name of the model's file, for messages.
    floor: lower bound on the value of any policy in any state; the value of states outside a vector set.
    upper_bound: bound on the optimal value, if the solver computed one; see `gap`.
    horizon: the number of remaining steps that the vectors are for; None for an infinite horizon.

    Raises:
        PolicyError: shapes do not match, or an index is out of range.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.planning import AlphaVectors, Policy
        >>> tiger = AlphaVectors([0, 1], [[-100, 10], [10, -100], [-1, -1]], [1, 2, 0])
        >>> policy = Policy([tiger], ("left", "right"), ("listen", "open_left", "open_right"))
        >>> policy.action_names[policy.action(np.array([0.5, 0.5]))]
        'listen'
    """

    vector_sets: tuple[AlphaVectors, ...]
    state_names: tuple[str, ...]
    action_names: tuple[str, ...]
    fingerprint: str = ""
    model: str = ""
    floor: float = 0.0
    upper_bound: UpperBound | None = None
    horizon: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "vector_sets", tuple(self.vector_sets))
        if not self.vector_sets:
            raise PolicyError("a policy needs alpha vectors; there are none")
        for part in self.vector_sets:
            if part.states[0] < 0 or part.states[-1] >= len(self.state_names):
                raise PolicyError(f"a state index is outside 0 to {len(self.state_names) - 1}")
            if part.actions.min() < 0 or part.actions.max() >= len(self.action_names):
                raise PolicyError(f"an action index is outside 0 to {len(self.action_names) - 1}")
        if not self.covers_all_states and not np.isfinite(self.floor):
            raise PolicyError("a policy of several vector sets needs a finite floor")

    @classmethod
    def of(cls, pomdp: Pomdp, vectors: npt.ArrayLike, actions: npt.ArrayLike) -> Policy:
        """Return the policy for `pomdp` with vectors (K, S) and action indices (K,)."""
        table = np.asarray(vectors, dtype=np.float64)
        if table.ndim != 2 or table.shape[1] != len(pomdp.states):
            raise PolicyError(
                f"vectors of shape {table.shape} are not a policy for {len(pomdp.states)} states"
            )
        return cls.of_sets(pomdp, [AlphaVectors(np.arange(len(pomdp.states)), table, np.asarray(actions))])

    @classmethod
    def of_sets(
        cls, pomdp: Pomdp, vector_sets: Iterable[AlphaVectors], upper_bound: UpperBound | None = None
    ) -> Policy:
        """Return the policy for `pomdp` with the given vector sets."""
        # with discount 1 only a policy for all states has no need of a floor
        floor = float(pomdp.reward.min()) / (1 - pomdp.discount) if pomdp.discount < 1 else -np.inf
        names = pomdp.states, pomdp.actions
        return cls(tuple(vector_sets), *names, pomdp.fingerprint, pomdp.file, floor, upper_bound)

    @property
    def covers_all_states(self) -> bool:
        """Whether the policy has a single vector set, over all states."""
        return len(self.vector_sets) == 1 and len(self.vector_sets[0].states) == len(self.state_names)

    def __len__(self) -> int:
        """The number of vectors."""
        return sum(len(part.actions) for part in self.vector_sets)

    def __repr__(self) -> str:
        sets = "" if self.covers_all_states else f" in {len(self.vector_sets)} sets"
        names = [self.action_names[action] for action in np.unique(self.actions)]
        model = f"{self.model}: " if self.model else ""
        return (
            f"<Policy {model}{len(self)} vectors{sets} over {len(self.state_names)} states,"
            f" actions {join_some(names)}>"
        )

    def _repr_html_(self) -> str:
        used, counts = np.unique(self.actions, return_counts=True)
        rows = [(self.action_names[action], f"{count}") for action, count in zip(used, counts, strict=True)]
        return html_table(
            ("action", "vectors"), rows, caption=f"Policy for {Path(self.model).name}", limit=20
        )

    @cached_property
    def vectors(self) -> Array:
        """(K, S) all vectors; the floor is the value of states outside a vector set.

        Raises:
            ModelError: the array is larger than `MAX_BYTES`.
        """
        if self.covers_all_states:
            return self.vector_sets[0].vectors
        size = 8 * len(self) * len(self.state_names)
        if size > MAX_BYTES:
            raise ModelError(f"the dense vectors of the policy take {size / 2**30:.1f} GiB")
        table = np.full((len(self), len(self.state_names)), self.floor)
        begin = 0
        for part in self.vector_sets:
            table[begin : begin + len(part.actions), part.states] = part.vectors
            begin += len(part.actions)
        table.setflags(write=False)
        return table

    @cached_property
    def actions(self) -> Indices:
        """(K,) index of the first action of each vector's plan."""
        return np.concatenate([part.actions for part in self.vector_sets])

    def action(self, belief: Belief) -> int:
        """Return the index of the action at a belief (S,), that of the best vector; the first of equals."""
        return self.value_and_action(belief)[1]

    def actions_at(self, beliefs: Array) -> Indices:
        """Return the index of the action at each of n beliefs (n, S): the same as `action`, faster."""
        actions = np.empty(len(beliefs), np.intp)
        for rows in self._group_by_sets(beliefs):
            sets = tuple(self._find_sets(beliefs[rows[0]]))
            size = max(1, MAX_CHUNK_NUMBERS // max(len(part.actions) for part in sets))
            for i in range(0, len(rows), size):
                actions[rows[i : i + size]] = self._find_actions(sets, beliefs[rows[i : i + size]])
        return actions

    def value(self, belief: Belief) -> float:
        """Return the lower bound on the policy's discounted reward from a belief (S,)."""
        return self.value_and_action(belief)[0]

    def gap(self, belief: Belief) -> float:
        """Return upper minus lower bound on the optimal value at a belief (S,), in reward units.

        Raises:
            PolicyError: the policy has no upper bound; a policy read from a file has none.
        """
        if self.upper_bound is None:
            raise PolicyError("this policy has no upper bound; solve the model to get one")
        return max(0.0, self.upper_bound.value(belief) - self.value(belief))

    def value_and_action(self, belief: Belief) -> tuple[float, int]:
        """Return the maximum over the vectors at a belief (S,), and the index of its action."""
        best, action = -np.inf, -1
        for part in self._find_sets(belief):
            inside = belief if len(part.states) == len(belief) else belief[part.states]
            values = part.vectors.dot(inside)  # `@` takes twice as long for small sets
            k = int(values.argmax())
            value = float(values[k])
            if inside is not belief:
                value += self.floor * max(0.0, float(belief.sum() - inside.sum()))
            if value > best:
                best, action = value, int(part.actions[k])
        return best, action

    def value_of_action(self, belief: Belief, action: int) -> float:
        """Return the maximum over the vectors of one action at a belief (S,); -inf if it has none."""
        best = -np.inf
        for part in self._find_sets(belief):
            inside = belief[part.states]
            values = part.vectors[part.actions == action] @ inside
            rest = max(0.0, float(belief.sum() - inside.sum()))
            if len(values):
                best = max(best, float(values.max()) + (self.floor * rest if rest else 0.0))
        return best

    def _find_sets(self, belief: Belief) -> Iterable[AlphaVectors]:
        """Return the vector sets that cover the support of a belief; all sets if none does."""
        if len(self.vector_sets) == 1:
            return self.vector_sets
        count = np.count_nonzero(belief)
        covering = [
            part
            for part in self._sets_by_state.get(int(belief.argmax()), ())
            if len(part.states) == len(belief) or np.count_nonzero(belief[part.states]) == count
        ]
        return covering or self.vector_sets

    def _group_by_sets(self, beliefs: Array) -> list[Indices]:
        """Return the indices of the beliefs (n, S) in groups, for each of which `_find_sets` is the same."""
        if len(self.vector_sets) == 1:
            return [np.arange(len(beliefs))] if len(beliefs) else []
        supports = np.packbits(beliefs != 0, axis=1)
        _, group, counts = np.unique(supports, axis=0, return_inverse=True, return_counts=True)
        order = np.argsort(group.reshape(-1), kind="stable")
        return np.split(order, np.cumsum(counts)[:-1]) if len(beliefs) else []

    def _find_actions(self, sets: Sequence[AlphaVectors], beliefs: Array) -> Indices:
        """Return the action index of the best vector of `sets` at each of n beliefs (n, S)."""
        best, actions = np.full(len(beliefs), -np.inf), np.full(len(beliefs), -1, np.intp)
        for part in sets:
            covers = len(part.states) == beliefs.shape[1]
            inside = beliefs if covers else np.ascontiguousarray(beliefs[:, part.states])
            # a product for each belief, as in `action`: one for all may round equal values differently
            products = (part.vectors @ inside[:, :, None])[:, :, 0]
            k = products.argmax(axis=1)
            values = products[np.arange(len(beliefs)), k]
            if not covers:
                values = values + self.floor * np.maximum(0.0, beliefs.sum(axis=1) - inside.sum(axis=1))
            better = values > best
            best[better], actions[better] = values[better], part.actions[k[better]]
        return actions

    @cached_property
    def _sets_by_state(self) -> Mapping[int, list[AlphaVectors]]:
        """The vector sets that cover each state."""
        sets: dict[int, list[AlphaVectors]] = {}
        for part in self.vector_sets:
            for state in part.states.tolist():
                sets.setdefault(state, []).append(part)
        return sets


def check_same_model(pomdp: Pomdp, policy: Policy) -> None:
    """Reject arguments of wrong types (ModelError), and a policy for another model (PolicyError)."""
    check_type("pomdp", pomdp, Pomdp)
    check_type("policy", policy, Policy)
    if policy.state_names != pomdp.states or policy.action_names != pomdp.actions:
        raise PolicyError("the policy is for another model: its states or actions have other names")
    if policy.fingerprint and policy.fingerprint != pomdp.fingerprint:
        raise PolicyError(
            "the policy is for another model: the names are the same, but transitions, observations,"
            " rewards or discount have changed since; solve again"
        )
