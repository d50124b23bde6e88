"""Which alpha vector is best at each of many beliefs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.planning.evaluation.sparse_beliefs import Beliefs, Indices, added_up, ragged
from lcorpp.values import Array

if TYPE_CHECKING:
    from lcorpp.planning.policy import Policy

MOST_VALUES = 2**22
"""Values of vectors at beliefs that are worked out together."""

SPARSE = 8
"""Beliefs are multiplied without their zeros where less than one number in so many is none."""

CLOSE = 1e-12
"""How far rounding may move a value, as a share of the largest number in the vectors, and more."""


class Chosen(NamedTuple):
    """What n beliefs are worth, and by which vectors.

    values: (n,). vectors: (n,) the number of the best vector at each, counted through the pieces.
    """

    values: Array
    vectors: Indices


class Choice:
    """The vectors of a policy, laid out by state.

    What is found at a belief does not depend on the others that are asked about with it: where a fast product
    leaves several vectors close to the highest, their values are added up in the order of the states.
    """

    def __init__(self, policy: Policy) -> None:
        pieces = policy.pieces
        self._size, self._floor = len(policy.state_names), policy.floor
        self._tables = [np.ascontiguousarray(piece.vectors.T) for piece in pieces]
        self._states = [piece.states for piece in pieces]
        self._first = np.cumsum([0, *(len(piece.actions) for piece in pieces)])
        # the pieces that hold each state, in their order
        state = np.concatenate(self._states)
        number = np.repeat(np.arange(len(pieces)), [len(states) for states in self._states])
        order = np.argsort(state, kind="stable")
        self._holding = number[order]
        self._begins = np.searchsorted(state[order], np.arange(self._size + 1))

    def best(self, beliefs: Beliefs) -> Chosen:
        """The values at some beliefs and the vectors they come from, the first among equals.

        A belief is held against the pieces that have all its states; against every piece where none has, the
        floor standing for what a piece does not speak of.
        """
        best = Chosen(np.full(len(beliefs), -np.inf), np.zeros(len(beliefs), dtype=np.intp))
        asked, numbers = self._holding_first(beliefs)
        order = np.argsort(numbers, kind="stable")
        ends = np.searchsorted(numbers[order], np.arange(len(self._tables) + 1))
        alone = np.ones(len(beliefs), dtype=bool)
        for number in np.flatnonzero(np.diff(ends)).tolist():
            which = asked[order[ends[number] : ends[number + 1]]]
            part, missing = self._within(number, beliefs.take(which))
            held = np.flatnonzero(missing == 0)
            alone[which[held]] = False
            self._compare(number, part if len(held) == len(part) else part.take(held), which[held], best)
        left = np.flatnonzero(alone)
        for number in range(len(self._tables)) if len(left) else ():
            part, missing = self._within(number, beliefs.take(left))
            self._compare(number, part, left, best, self._floor * missing)
        return best

    def _holding_first(self, beliefs: Beliefs) -> tuple[Indices, Indices]:
        """Pairs of a belief and a piece that has its first state."""
        filled = np.flatnonzero(beliefs.sizes)
        first = beliefs.states[beliefs.begins[filled]]
        sizes = self._begins[first + 1] - self._begins[first]
        return np.repeat(filled, sizes), self._holding[ragged(self._begins[first], sizes)]

    def _within(self, number: int, beliefs: Beliefs) -> tuple[Beliefs, Array]:
        """Beliefs as a piece has them, by the places of its states, and the weight that it misses of each."""
        states = self._states[number]
        if len(states) == self._size:
            return beliefs, np.zeros(len(beliefs))
        place = np.minimum(np.searchsorted(states, beliefs.states), len(states) - 1).astype(np.int32)
        inside = states[place] == beliefs.states
        owners = beliefs.owners
        begins = np.concatenate([[0], np.cumsum(np.bincount(owners[inside], minlength=len(beliefs)))])
        missing = added_up(owners[~inside], beliefs.weights[~inside], len(beliefs))
        return Beliefs(begins, place[inside], beliefs.weights[inside]), missing

    def _compare(
        self, number: int, part: Beliefs, which: Indices, best: Chosen, floor: Array | None = None
    ) -> None:
        """Note the best vector of a piece at each belief where it is better than what is noted."""
        table = self._tables[number]
        step = max(MOST_VALUES // sum(table.shape), 1)
        for begin in range(0, len(part), step):
            rows = slice(begin, begin + step)
            value, vector = _highest(table, part.take(np.arange(begin, min(begin + step, len(part)))))
            if floor is not None:
                value = value + floor[rows]
            better = value > best.values[which[rows]]
            at = which[rows][better]
            best.values[at] = value[better]
            best.vectors[at] = self._first[number] + vector[better]


def _highest(table: Array, beliefs: Beliefs) -> tuple[Array, Indices]:
    """The highest value of vectors, `table` (n, K), at each of some beliefs over n states, and which it is.

    A product of matrices finds those that may be highest; its rounding depends on what else is in it, so
    those close to the highest are added up anew, in the order of the states. The first among equals counts.
    """
    sizes, totals = beliefs.sizes, beliefs.totals()
    found = _product(beliefs, table)
    close = CLOSE * float(np.abs(table).max()) * totals
    near = np.flatnonzero(found >= (found.max(axis=1) - close)[:, None])
    row, vector = np.divmod(near, table.shape[1])
    at = ragged(beliefs.begins[row], sizes[row])
    terms = table[beliefs.states[at], np.repeat(vector, sizes[row])] * beliefs.weights[at]
    value = added_up(np.repeat(np.arange(len(row)), sizes[row]), terms, len(row))
    # by belief, then by value, the highest first and the first vector first
    order = np.lexsort((vector, -value, row))
    first = order[np.searchsorted(row, np.arange(len(beliefs)))]
    return value[first], vector[first]


def _product(beliefs: Beliefs, table: Array) -> Array:
    """(k, K) the value of each vector at each belief, up to rounding."""
    shape = (len(beliefs), len(table))
    if SPARSE * len(beliefs.states) < shape[0] * shape[1]:
        from scipy.sparse import csr_array

        rows: Any = csr_array((beliefs.weights, beliefs.states, beliefs.begins), shape=shape)
        return np.asarray(rows @ table, dtype=np.float64)
    dense: npt.NDArray[np.float64] = np.zeros(shape)
    dense[beliefs.owners, beliefs.states] = beliefs.weights
    return dense @ table
