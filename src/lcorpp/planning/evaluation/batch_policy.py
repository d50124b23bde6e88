"""A policy at many beliefs at once: the best alpha vector of each."""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs, segment_sum
from lcorpp.planning.policy import Policy
from lcorpp.planning.sparse import ragged_indices
from lcorpp.values import Array, Indices

MAX_PRODUCTS = 2**22
"""The maximal number of products of a vector and a belief that are computed together."""

SPARSE_RATIO = 8
"""Sparse matrix products are used if at most one in this many belief entries is non-zero."""

ROUNDING = 1e-12
"""Bound on the rounding error of a product, relative to the largest vector entry."""

MAX_NEAR = 16
"""Maximal number of near-maximal vectors of a belief whose values are recomputed one by one."""


class BestVectors(NamedTuple):
    """The best vectors at n beliefs.

    values: (n,). vectors: (n,) index of the best vector in `Policy.vectors`.
    """

    values: Array
    vectors: Indices


class BatchPolicy:
    """The vectors of a policy in a layout for many beliefs at once.

    The result at a belief does not depend on the other beliefs of its batch: if a fast matrix product leaves
    several vectors close to the maximum, their values are summed again in the order of the states.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> from lcorpp.planning import BatchPolicy
        >>> pomdp = load_domain("intention").pomdp
        >>> beliefs = [[1, 0, 0, 0, 0], pomdp.start]
        >>> values, actions = BatchPolicy(solve(pomdp).policy).values_and_actions(beliefs)
        >>> [pomdp.actions[action] for action in actions], values.round(1).tolist()
        (['report_interested', 'move_forward'], [80.0, 66.5])
    """

    def __init__(self, policy: Policy) -> None:
        sets = policy.vector_sets
        self._actions = policy.actions
        self._size, self._floor = len(policy.state_names), policy.floor
        self._tables = [np.ascontiguousarray(part.vectors.T) for part in sets]
        self._states = [part.states for part in sets]
        self._first = np.cumsum([0, *(len(part.actions) for part in sets)])
        # the vector sets that cover each state, in their order
        state = np.concatenate(self._states)
        number = np.repeat(np.arange(len(sets)), [len(states) for states in self._states])
        order = np.argsort(state, kind="stable")
        self._covering = number[order]
        self._begins = np.searchsorted(state[order], np.arange(self._size + 1))

    def __repr__(self) -> str:
        return f"<BatchPolicy: {len(self._actions)} vectors over {self._size} states>"

    def values_and_actions(self, beliefs: npt.ArrayLike) -> tuple[Array, Indices]:
        """Return (n,) values and (n,) action indices at beliefs (n, S).

        Raises:
            ModelError: the beliefs do not have the shape (n, S).
        """
        dense = np.asarray(beliefs, dtype=np.float64)
        if dense.ndim != 2 or dense.shape[1] != self._size:
            raise ModelError(f"beliefs over {self._size} states cannot have shape {dense.shape}")
        values, vectors = self.best(SparseBeliefs.of(dense))
        return values, self._actions[vectors]

    def best(self, beliefs: SparseBeliefs) -> BestVectors:
        """Return the best vector at each belief, the first of equals.

        A belief is compared with the vector sets that cover all its states. If none does, it is compared with
        every set, and the floor is the value of the states outside a set.
        """
        best = BestVectors(np.full(len(beliefs), -np.inf), np.zeros(len(beliefs), dtype=np.intp))
        candidates, numbers = self._sets_with_first_state(beliefs)
        order = np.argsort(numbers, kind="stable")
        ends = np.searchsorted(numbers[order], np.arange(len(self._tables) + 1))
        uncovered = np.ones(len(beliefs), dtype=bool)
        for number in np.flatnonzero(np.diff(ends)).tolist():
            which = candidates[order[ends[number] : ends[number + 1]]]
            part, missing = self._restrict(number, beliefs.take(which))
            covered = np.flatnonzero(missing == 0)
            uncovered[which[covered]] = False
            inside = part if len(covered) == len(part) else part.take(covered)
            self._compare(number, inside, which[covered], best)
        left = np.flatnonzero(uncovered)
        for number in range(len(self._tables)) if len(left) else ():
            part, missing = self._restrict(number, beliefs.take(left))
            self._compare(number, part, left, best, self._floor * missing)
        return best

    def _sets_with_first_state(self, beliefs: SparseBeliefs) -> tuple[Indices, Indices]:
        """Return all pairs of a belief and a vector set that covers its first state."""
        filled = np.flatnonzero(beliefs.sizes)
        first = beliefs.states[beliefs.begins[filled]]
        sizes = self._begins[first + 1] - self._begins[first]
        return np.repeat(filled, sizes), self._covering[ragged_indices(self._begins[first], sizes)]

    def _restrict(self, number: int, beliefs: SparseBeliefs) -> tuple[SparseBeliefs, Array]:
        """Restrict beliefs to the states of a vector set; the second result is (n,) the weight outside."""
        states = self._states[number]
        if len(states) == self._size:
            return beliefs, np.zeros(len(beliefs))
        place = np.minimum(np.searchsorted(states, beliefs.states), len(states) - 1).astype(np.int32)
        inside = states[place] == beliefs.states
        owners = beliefs.owners
        begins = np.concatenate([[0], np.cumsum(np.bincount(owners[inside], minlength=len(beliefs)))])
        missing = segment_sum(owners[~inside], beliefs.weights[~inside], len(beliefs))
        return SparseBeliefs(begins, place[inside], beliefs.weights[inside]), missing

    def _compare(
        self, number: int, part: SparseBeliefs, which: Indices, best: BestVectors, floor: Array | None = None
    ) -> None:
        """Update `best` with the vectors of one set at the beliefs `which`, given as `part`."""
        table = self._tables[number]
        step = max(MAX_PRODUCTS // sum(table.shape), 1)
        for begin in range(0, len(part), step):
            rows = slice(begin, begin + step)
            value, vector = _best_of_table(table, part.take(np.arange(begin, min(begin + step, len(part)))))
            if floor is not None:
                value = value + floor[rows]
            better = value > best.values[which[rows]]
            at = which[rows][better]
            best.values[at] = value[better]
            best.vectors[at] = self._first[number] + vector[better]


_BATCH_POLICIES: WeakKeyDictionary[Policy, BatchPolicy] = WeakKeyDictionary()


def batch_policy(policy: Policy) -> BatchPolicy:
    """Return the layout of a policy's vectors, which is computed once as long as the policy exists."""
    batch = _BATCH_POLICIES.get(policy)
    if batch is None:
        batch = _BATCH_POLICIES[policy] = BatchPolicy(policy)
    return batch


def _best_of_table(table: Array, beliefs: SparseBeliefs) -> tuple[Array, Indices]:
    """Return the maximal value over the vectors (columns of `table`, (n, K)) at each belief, and its index.

    The rounding of a matrix product depends on the whole batch. Vectors close to the maximum are therefore
    summed again in the order of the states; the first of equals is returned.
    """
    products = _multiply(beliefs, table)
    margin = ROUNDING * float(np.abs(table).max()) * beliefs.totals()
    row, vector = np.divmod(
        np.flatnonzero(products >= (products.max(axis=1) - margin)[:, None]), table.shape[1]
    )
    values, vectors = np.empty(len(beliefs)), np.empty(len(beliefs), dtype=np.intp)
    has_many = np.bincount(row, minlength=len(beliefs)) > MAX_NEAR
    if has_many.any():
        many, is_few = np.flatnonzero(has_many), ~has_many[row]
        values[many], vectors[many] = _best_of_all(table, beliefs.take(many))
        row, vector = row[is_few], vector[is_few]
    sizes = beliefs.sizes[row]
    at = ragged_indices(beliefs.begins[row], sizes)
    terms = table[beliefs.states[at], np.repeat(vector, sizes)] * beliefs.weights[at]
    value = segment_sum(np.repeat(np.arange(len(row)), sizes), terms, len(row))
    # by belief, then by descending value, then by vector
    order = np.lexsort((vector, -value, row))
    few, begins = np.unique(row, return_index=True)
    values[few], vectors[few] = value[order[begins]], vector[order[begins]]
    return values, vectors


def _best_of_all(table: Array, beliefs: SparseBeliefs) -> tuple[Array, Indices]:
    """As `_best_of_table`, by a sparse product, which adds the values in the order of the states."""
    products = _multiply_sparse(beliefs, table)
    vectors = products.argmax(axis=1)
    return products[np.arange(len(beliefs)), vectors], vectors


def _multiply(beliefs: SparseBeliefs, table: Array) -> Array:
    """Return (k, K) the value of each vector at each belief, up to rounding."""
    shape = (len(beliefs), len(table))
    if SPARSE_RATIO * len(beliefs.states) < shape[0] * shape[1]:
        return _multiply_sparse(beliefs, table)
    dense: npt.NDArray[np.float64] = np.zeros(shape)
    dense[beliefs.owners, beliefs.states] = beliefs.weights
    return dense @ table


def _multiply_sparse(beliefs: SparseBeliefs, table: Array) -> Array:
    """Return (k, K) the value of each vector at each belief, added in the order of the states."""
    from scipy.sparse import csr_array

    shape = (len(beliefs), len(table))
    rows: Any = csr_array((beliefs.weights, beliefs.states, beliefs.begins), shape=shape)
    return np.asarray(rows @ table, dtype=np.float64)
