"""Finite-state controllers: policies of finite memory, and their exact values under several criteria."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import PolicyError
from lcorpp.planning.limits.limited_model import LimitedModel
from lcorpp.planning.sparse import ragged_indices
from lcorpp.values import Array, Indices, freeze

MAX_DENSE, DENSITY = 4_000, 0.02
"""Equations up to this number are solved as a dense matrix if more than this share of it is not 0."""

MAX_FACTORISED, MAX_ITERATED, PRECISION = 12_000, 0.995, 1e-14
"""More equations are solved by sweeps up to this discount: their factors may fill the memory. Relative change
of the last sweep."""


@dataclass(frozen=True, eq=False)
class Controller:
    """A policy whose memory is one of n nodes: each has an action, and a next node for each observation.

    actions: (n,) indices. successors: (n, O) nodes.

    Raises:
        PolicyError: the shapes do not match, or an index is out of range.

    Examples:
        >>> from lcorpp.planning import Controller
        >>> Controller([1, 0], [[0, 1], [1, 1]])
        <Controller: 2 nodes>
    """

    actions: Indices
    successors: Indices

    def __post_init__(self) -> None:
        for field in ("actions", "successors"):
            array = np.array(getattr(self, field), dtype=np.intp)
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        if self.actions.ndim != 1 or not len(self.actions) or self.successors.shape[:1] != self.actions.shape:
            raise PolicyError("a controller needs nodes, each with an action and successors")
        if self.successors.ndim != 2 or self.actions.min() < 0:
            raise PolicyError("the actions and successors of a controller are indices")
        if self.successors.size and not 0 <= self.successors.min() <= self.successors.max() < len(self):
            raise PolicyError(f"a successor is outside of the {len(self)} nodes")

    def __len__(self) -> int:
        return len(self.actions)

    def __repr__(self) -> str:
        return f"<Controller: {len(self)} node{'s' * (len(self) != 1)}>"

    def minimise(self) -> tuple[Controller, Indices]:
        """Return the smallest controller with the same plans, and (n,) its node for each node of this one.

        Source: partition refinement of Moore, "Gedanken-experiments on sequential machines", 1956.
        """
        _, part = np.unique(self.actions, return_inverse=True)
        while True:
            rows = np.column_stack([part, part[self.successors]])
            _, first, finer = np.unique(rows, axis=0, return_index=True, return_inverse=True)
            finer = finer.reshape(-1)
            if len(first) == part.max() + 1:
                return Controller(self.actions[first], finer[self.successors[first]]), finer
            part = finer

    def keep(self, starts: Indices) -> tuple[Controller, Indices]:
        """Return the controller without nodes that are not reached from some nodes, and their new numbers."""
        reached = np.zeros(len(self), bool)
        front = np.unique(starts)
        while len(front):
            reached[front] = True
            following = np.unique(self.successors[front])
            front = following[~reached[following]]
        kept = np.flatnonzero(reached)
        number = np.cumsum(reached) - 1
        return Controller(self.actions[kept], number[self.successors[kept]]), number[starts]


def repeat_actions(n_actions: int, n_observations: int) -> Controller:
    """Return a controller with a node for each action, which it repeats."""
    nodes = np.arange(n_actions)
    return Controller(nodes, np.repeat(nodes[:, None], n_observations, axis=1))


def evaluate_controller(
    model: LimitedModel, controller: Controller, known: Array, nodes: Indices, states: Indices
) -> Array:
    """Return (1 + K, n, X) the value of each criterion, by node and state; inf where a total has no end.

    Args:
        known: the same, NaN where a value is not known.
        nodes, states: (m,) pairs whose values are to be known; those that they depend on become known, too.

    Source: the linear equations of a finite-state controller (Hansen, "Solving POMDPs by searching in policy
    space", UAI 1998, equation 1), solved by sparse LU factorisation.
    """
    n_states = len(model.base)
    values = known.reshape(len(known), -1).copy()
    unknown = np.isnan(values[0])
    wanted = np.unique(nodes * n_states + states)
    pairs = _find_needed(model, controller, wanted[unknown[wanted]], unknown)
    if not len(pairs):
        return known
    rows, targets, chances = _list_steps(model, controller, pairs)
    position = np.full(len(unknown), -1)
    position[pairs] = np.arange(len(pairs))
    inner, outer = _make_matrices(rows, targets, chances, position, len(pairs))
    costs = model.criteria[:, controller.actions[pairs // n_states], pairs % n_states]
    for discount in np.unique(model.discounts):
        own = np.flatnonzero(model.discounts == discount)
        due = costs[own]
        if len(outer[0]):
            sources, ends, weights = outer
            later = np.array([np.bincount(sources, weights * row[ends], len(pairs)) for row in values[own]])
            due = due + discount * later
        if discount < 1:
            values[np.ix_(own, pairs)] = _solve(discount * inner, due, discount)
        else:
            for i, row in zip(own, due, strict=True):
                values[i, pairs] = _sum_costs(inner, row, outer[0])
    return values.reshape(known.shape)


def _find_needed(
    model: LimitedModel, controller: Controller, front: Indices, unknown: npt.NDArray[np.bool_]
) -> Indices:
    """Return the pairs of node and state with unknown values on which those of some pairs depend."""
    needed = np.zeros(len(unknown), bool)
    while len(front):
        needed[front] = True
        found = np.unique(_list_steps(model, controller, front)[1])
        front = found[unknown[found] & ~needed[found]]
    return np.flatnonzero(needed)


def _list_steps(
    model: LimitedModel, controller: Controller, pairs: Indices
) -> tuple[Indices, Indices, Array]:
    """Return the steps from pairs of node and state: position of the pair, next pair, and probability."""
    nodes, states = np.divmod(pairs, len(model.base))
    parts = []
    actions = controller.actions[nodes]
    for action in np.unique(actions).tolist():
        steps, own = model.steps[action], np.flatnonzero(actions == action)
        begins = steps.begins[states[own]]
        sizes = steps.begins[states[own] + 1] - begins
        at = ragged_indices(begins, sizes)
        rows = np.repeat(own, sizes)
        following = controller.successors[nodes[rows], steps.observations[at]]
        parts.append((rows, following * len(model.base) + steps.targets[at], steps.chances[at]))
    rows, targets, chances = (np.concatenate(column) for column in zip(*parts, strict=True))
    return rows, targets, chances


def _make_matrices(
    rows: Indices, targets: Indices, chances: Array, position: Indices, size: int
) -> tuple[Any, tuple[Indices, Indices, Array]]:
    """Return the matrix between pairs that are solved for, and the steps to pairs with known values."""
    from scipy.sparse import csr_array

    columns = position[targets]
    inside = columns >= 0
    inner = csr_array((chances[inside], (rows[inside], columns[inside])), shape=(size, size))
    return inner, (rows[~inside], targets[~inside], chances[~inside])


def _solve(matrix: Any, costs: Array, discount: float = 1.0) -> Array:
    """Return (k, size) the solutions of v = c + matrix v, whose rows sum to at most the discount."""
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import splu

    size = matrix.shape[0]
    if size <= MAX_DENSE and matrix.nnz > DENSITY * size**2:  # the factors would be dense, too
        solved: Array = np.linalg.solve(np.eye(size) - matrix.toarray(), costs.T).T
        return solved
    if size > MAX_FACTORISED and discount <= MAX_ITERATED:
        return _iterate(matrix, costs)
    factors = splu(csc_array(eye_array(size) - matrix))
    solution: Array = factors.solve(np.ascontiguousarray(costs.T)).T
    return solution


def _iterate(matrix: Any, costs: Array) -> Array:
    """Return the solutions by sweeps, each of which multiplies the error by the discount."""
    values = np.zeros(costs.T.shape)
    while True:
        after = costs.T + matrix @ values
        change = np.abs(after - values).max()
        values = after
        if change <= PRECISION * max(1.0, np.abs(values).max()):
            return np.ascontiguousarray(values.T)


def _sum_costs(matrix: Any, costs: Array, leaving: Indices) -> Array:
    """Return (size,) the expected sums of costs without discount.

    Only pairs that reach a cost matter. Among them, those that are never left for others recur.

    Args:
        leaving: rows with steps to pairs that are not in the matrix.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    backward = csr_array(matrix.T)
    matters = costs != 0
    front = np.flatnonzero(matters)
    while len(front):
        found = np.unique(backward[front].indices)
        front = found[~matters[found]]
        matters[front] = True
    values, places = np.zeros(len(costs)), np.flatnonzero(matters)
    if not len(places):
        return values
    inner = matrix[places][:, places]
    n_parts, part = connected_components(inner, directed=True, connection="strong")
    sources, targets = inner.tocoo().coords
    steps = np.diff(matrix.indptr)[places] - np.diff(inner.indptr)
    leaves = (steps > 0) | np.isin(places, leaving)
    crosses = part[sources] != part[targets]
    left = np.bincount(part, leaves, n_parts) + np.bincount(part[sources], crosses, n_parts)
    endless = (left == 0)[part] | np.isinf(costs[places])
    if endless.any():
        forever, back = endless.copy(), csr_array(inner.T)
        front = np.flatnonzero(forever)
        while len(front):
            found = np.unique(back[front].indices)
            front = found[~forever[found]]
            forever[front] = True
        values[places[forever]] = -np.inf if costs.min() < 0 else np.inf
        ending = np.flatnonzero(~forever)
        places, inner = places[ending], inner[ending][:, ending]
    if len(places):
        values[places] = _solve(inner, costs[places][None])[0]
    return values


def start_values(model: LimitedModel, values: Array) -> Array:
    """Return (1 + K, N, n) the values of nodes (1 + K, n, X) at the starts; NaN where one is not known."""
    supports = [np.flatnonzero(start) for start in model.starts]
    found = [
        (values[:, :, own] * start[own]).sum(axis=2)
        for own, start in zip(supports, model.starts, strict=True)
    ]
    return freeze(np.stack(found, axis=1))
