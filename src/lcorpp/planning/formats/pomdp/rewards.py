"""Rewards that depend on the next state and the observation, folded into the expected immediate reward."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import prod

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.formats.pomdp.entries import Entries, Indices, last_of_each
from lcorpp.planning.formats.pomdp.preamble import ALL
from lcorpp.planning.formats.pomdp.tables import ranges
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array

AT_ONCE = 2**20
"""How many cases of state, next state and observation are looked up together."""

MAX_CASES = 2**28
"""The most cases that are looked up: some seconds for each ten million."""

PRODUCT_COST = 1 / 64
"""What a multiplication of a sparse matrix product takes of the time that looking up a case does."""

_Case = tuple[Indices, Indices, Indices | None, Indices | None]
_Flags = npt.NDArray[np.bool_]
_Cases = Iterator[tuple[Indices, Indices | None, Indices | None, Array]]


def expected_rewards(transition: SparseTables, observation: SparseTables, statements: Entries) -> Array:
    """(A, S) sum over s', o of P(s' | s, a) P(o | a, s') R(a, s, s', o).

    Later statements override earlier ones. Cases are unfolded only where T and Z are not zero, and only for
    those actions and states, and along those axes, that statements mention; no table of R is made.

    Args:
        transition: (A, S, S). observation: (A, S, O).
        statements: R by action, state, next state and observation.

    Raises:
        ModelError: there are too many cases.
    """
    A, S, _ = transition.shape
    indices, values, _ = statements.arrays()
    total = np.zeros(A * S)
    rewards = _Rewards(indices, values, (A, S, S, observation.shape[2]))
    by_next, by_observation = rewards.mentioned(2), rewards.mentioned(3)
    # an overflowing sum of huge rewards becomes inf here and is refused by name when the model is made
    with np.errstate(over="ignore", invalid="ignore"):
        for row, following, observed, weight in _cases(transition, observation, by_next, by_observation):
            value = rewards.look_up((row // S, row % S, following, observed))
            total += np.bincount(row, weight * value, minlength=len(total))
    plain = np.flatnonzero(~by_next & ~by_observation)
    total[plain] = rewards.look_up((plain // S, plain % S, None, None))
    return total.reshape(A, S)


def _cases(
    transition: SparseTables, observation: SparseTables, by_next: _Flags, by_observation: _Flags
) -> _Cases:
    """Pieces of the sum: for (n,) cases the row a S + s, next state, observation and probability.

    Of rows (A S,) flagged `by_next` alone the observation is left open, of those flagged `by_observation`
    alone the next state may be.
    """
    if not (by_next | by_observation).any():
        return
    T, Z, S = transition, observation, transition.shape[1]
    reached = T.rows // S * S + T.columns
    widths = np.diff(Z.begins)[reached]
    only_next = np.flatnonzero((by_next & ~by_observation)[T.rows])
    only_observed = by_observation & ~by_next
    multiplied = int(widths[only_observed[T.rows]].sum())
    if multiplied <= AT_ONCE:  # too few to be worth a matrix product
        only_observed = np.zeros_like(only_observed)
        multiplied = 0
    joined = np.flatnonzero((by_observation & ~only_observed)[T.rows])
    count = len(only_next) + int(widths[joined].sum()) + int(multiplied * PRODUCT_COST)
    if count > MAX_CASES:
        raise ModelError(
            f"rewards by next state and observation are sums over {count} cases;"
            f" at most {MAX_CASES} are summed"
        )
    for part in _split(only_next, np.ones(len(only_next), dtype=np.int64)):
        yield T.rows[part], T.columns[part].astype(np.int64), None, T.values[part]
    for part in _split(joined, widths[joined]):
        source = np.repeat(part, widths[part])
        seen = ranges(Z.begins[reached[part]], widths[part])
        weight = T.values[source] * Z.values[seen]
        yield T.rows[source], T.columns[source].astype(np.int64), Z.columns[seen].astype(np.int64), weight
    yield from _observed(T, Z, np.flatnonzero(only_observed))


def _split(items: npt.NDArray[np.intp], sizes: Indices) -> list[npt.NDArray[np.intp]]:
    """Items (n,) in their order, some at a time, with sizes (n,) of about `AT_ONCE` together."""
    ends = np.cumsum(sizes)
    steps = np.arange(AT_ONCE, ends[-1] if len(ends) else 0, AT_ONCE)
    return [part for part in np.split(items, np.searchsorted(ends, steps)) if len(part)]


def _observed(transition: SparseTables, observation: SparseTables, rows: npt.NDArray[np.intp]) -> _Cases:
    """P(o | s, a) of the rows given: T times Z."""
    if not len(rows):
        return
    from scipy.sparse import csr_array

    S, count = observation.shape[1:]

    def matrix(table: SparseTables, action: int) -> csr_array:
        part = table.action_slice(action)
        begins = table.begins[action * S : (action + 1) * S + 1] - part.start
        return csr_array((table.values[part], table.columns[part], begins), shape=table.shape[1:])

    for action in np.unique(rows // S).tolist():
        T, Z = matrix(transition, action), matrix(observation, action)
        own = rows[rows // S == action]
        for part in _split(own, np.full(len(own), count)):
            product = (T[part % S] @ Z).tocoo()
            yield part[product.row], None, product.col.astype(np.int64), product.data


class _Rewards:
    """R statements, sorted so that the last one that speaks of a case is found.

    Statements that leave the same axes open are together, each under one whole number.
    """

    def __init__(self, indices: Indices, values: Array, sizes: tuple[int, int, int, int]) -> None:
        self.indices, self.sizes = indices, sizes
        self.groups: list[tuple[list[int], Indices, npt.NDArray[np.intp], Array]] = []
        named = (indices != ALL) @ np.array([1, 2, 4, 8])
        for code in np.flatnonzero(np.bincount(named)).tolist():
            axes = [axis for axis in range(4) if code >> axis & 1]
            own = np.flatnonzero(named == code)
            keys = self._keys(axes, [indices[own, axis] for axis in axes], len(own))
            kept = last_of_each(keys)
            kept = kept[np.argsort(keys[kept])]
            self.groups.append((axes, keys[kept], own[kept], values[own[kept]]))

    def _keys(self, axes: list[int], columns: Sequence[Indices], count: int) -> Indices:
        if prod(self.sizes[axis] for axis in axes) >= 2**63:
            raise ModelError(f"rewards over {self.sizes} cases are too many to be numbered")
        keys = np.zeros(count, dtype=np.int64)
        for axis, column in zip(axes, columns, strict=True):
            keys = keys * self.sizes[axis] + column
        return keys

    def mentioned(self, axis: int) -> npt.NDArray[np.bool_]:
        """(A S,) the actions and states of which a statement names a value of an axis."""
        A, S, _, _ = self.sizes
        named = self.indices[self.indices[:, axis] != ALL]
        found = np.zeros((A + 1, S + 1), dtype=bool)
        found[named[:, 0], named[:, 1]] = True  # `ALL` is the index of what comes last
        found[:A, :S] |= found[A:, :S] | found[:A, S:] | found[A, S]
        return found[:A, :S].reshape(-1)

    def look_up(self, case: _Case) -> Array:
        """(n,) the reward of each case; an axis is None where no statement on these cases names it."""
        count = len(case[0])
        latest = np.full(count, -1, dtype=np.intp)
        found = np.zeros(count)
        for axes, keys, times, values in self.groups:
            columns = [column for axis in axes if (column := case[axis]) is not None]
            if len(columns) < len(axes):
                continue
            wanted = self._keys(axes, columns, count)
            at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            later = (keys[at] == wanted) & (times[at] > latest)
            latest[later] = times[at[later]]
            found[later] = values[at[later]]
        return found
