"""Expected immediate rewards from rewards that depend on the next state and the observation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import prod

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.formats.pomdp.preamble import ALL
from lcorpp.planning.formats.pomdp.tables import Columns, find_last_occurrences
from lcorpp.planning.sparse import SparseTables, ragged_indices
from lcorpp.values import Array, Indices

CHUNK_CASES = 2**20
"""Number of cases (state, next state, observation) that are processed at once."""

MAX_CASES = 2**28
"""Maximum number of cases; ten million take some seconds."""

PRODUCT_COST = 1 / 64
"""Time of a multiplication in a sparse matrix product, relative to that of looking up a case."""

_Case = tuple[Indices, Indices, Indices | None, Indices | None]
_Flags = npt.NDArray[np.bool_]
_Cases = Iterator[tuple[Indices, Indices | None, Indices | None, Array]]


def expected_rewards(transition: SparseTables, observation: SparseTables, statements: Columns) -> Array:
    """Return (A, S) the sum over s', o of P(s' | s, a) P(o | a, s') R(a, s, s', o).

    Later statements override earlier ones. Only cases with nonzero T and Z are expanded, and only for those
    actions and states, and along those axes, that statements mention; no table of R is allocated.

    Args:
        transition: (A, S, S). observation: (A, S, O).
        statements: R by action, state, next state and observation.

    Raises:
        ModelError: there are too many cases.
    """
    A, S, _ = transition.shape
    indices, values = statements.arrays()
    total = np.zeros(A * S)
    rewards = _Rewards(indices, values, (A, S, S, observation.shape[2]))
    by_next, by_observation = rewards.find_rows_depending_on(2), rewards.find_rows_depending_on(3)
    # an overflowing sum of huge rewards becomes inf here; the Pomdp constructor reports it
    with np.errstate(over="ignore", invalid="ignore"):
        for row, next_state, observed, weight in _expand_cases(
            transition, observation, by_next, by_observation
        ):
            value = rewards.look_up((row // S, row % S, next_state, observed))
            total += np.bincount(row, weight * value, minlength=len(total))
    plain = np.flatnonzero(~by_next & ~by_observation)
    total[plain] = rewards.look_up((plain // S, plain % S, None, None))
    return total.reshape(A, S)


def _expand_cases(
    transition: SparseTables, observation: SparseTables, by_next: _Flags, by_observation: _Flags
) -> _Cases:
    """Chunks of the sum: for (n,) cases the row a S + s, next state, observation and probability.

    The observation is None for rows (A S,) that depend on the next state only, and the next state may be None
    for those that depend on the observation only.
    """
    if not (by_next | by_observation).any():
        return
    T, Z, S = transition, observation, transition.shape[1]
    next_rows = T.rows // S * S + T.columns  # of Z, for each nonzero of T
    widths = np.diff(Z.begins)[next_rows]
    only_next = np.flatnonzero((by_next & ~by_observation)[T.rows])
    only_observed = by_observation & ~by_next
    products = int(widths[only_observed[T.rows]].sum())
    if products <= CHUNK_CASES:  # a matrix product does not pay off
        only_observed = np.zeros_like(only_observed)
        products = 0
    joint = np.flatnonzero((by_observation & ~only_observed)[T.rows])
    count = len(only_next) + int(widths[joint].sum()) + int(products * PRODUCT_COST)
    if count > MAX_CASES:
        raise ModelError(
            f"rewards by next state and observation are sums over {count} cases;"
            f" at most {MAX_CASES} are summed"
        )
    for part in _split(only_next, np.ones(len(only_next), dtype=np.int64)):
        yield T.rows[part], T.columns[part].astype(np.int64), None, T.values[part]
    for part in _split(joint, widths[joint]):
        source = np.repeat(part, widths[part])
        target = ragged_indices(Z.begins[next_rows[part]], widths[part])
        weight = T.values[source] * Z.values[target]
        yield T.rows[source], T.columns[source].astype(np.int64), Z.columns[target].astype(np.int64), weight
    yield from _sum_over_next_states(T, Z, np.flatnonzero(only_observed))


def _split(items: npt.NDArray[np.intp], sizes: Indices) -> list[npt.NDArray[np.intp]]:
    """Split items (n,) of sizes (n,), in their order, into parts of about `CHUNK_CASES`."""
    ends = np.cumsum(sizes)
    steps = np.arange(CHUNK_CASES, ends[-1] if len(ends) else 0, CHUNK_CASES)
    return [part for part in np.split(items, np.searchsorted(ends, steps)) if len(part)]


def _sum_over_next_states(
    transition: SparseTables, observation: SparseTables, rows: npt.NDArray[np.intp]
) -> _Cases:
    """Return P(o | s, a) of the given rows: T times Z."""
    if not len(rows):
        return
    from scipy.sparse import csr_array

    S, count = observation.shape[1:]

    def make_matrix(table: SparseTables, action: int) -> csr_array:
        part = table.action_slice(action)
        begins = table.begins[action * S : (action + 1) * S + 1] - part.start
        return csr_array((table.values[part], table.columns[part], begins), shape=table.shape[1:])

    for action in np.unique(rows // S).tolist():
        T, Z = make_matrix(transition, action), make_matrix(observation, action)
        action_rows = rows[rows // S == action]
        for part in _split(action_rows, np.full(len(action_rows), count)):
            product = (T[part % S] @ Z).tocoo()
            yield part[product.row], None, product.col.astype(np.int64), product.data


class _Rewards:
    """R statements, sorted to find the last one that covers a case.

    Statements that name the same axes form a group; the indices on these axes are encoded in one integer.
    """

    def __init__(self, indices: Indices, values: Array, sizes: tuple[int, int, int, int]) -> None:
        self.indices, self.sizes = indices, sizes
        self.groups: list[tuple[list[int], Indices, npt.NDArray[np.intp], Array]] = []
        code_of = (indices != ALL) @ np.array([1, 2, 4, 8])
        for code in np.flatnonzero(np.bincount(code_of)).tolist():
            axes = [axis for axis in range(4) if code >> axis & 1]
            group = np.flatnonzero(code_of == code)
            keys = self._encode_keys(axes, [indices[group, axis] for axis in axes], len(group))
            last = find_last_occurrences(keys)
            last = last[np.argsort(keys[last])]
            self.groups.append((axes, keys[last], group[last], values[group[last]]))

    def _encode_keys(self, axes: list[int], columns: Sequence[Indices], count: int) -> Indices:
        if prod(self.sizes[axis] for axis in axes) >= 2**63:
            raise ModelError(f"rewards over {self.sizes} cases are too many to be numbered")
        keys = np.zeros(count, dtype=np.int64)
        for axis, column in zip(axes, columns, strict=True):
            keys = keys * self.sizes[axis] + column
        return keys

    def find_rows_depending_on(self, axis: int) -> _Flags:
        """Return (A S,) whether a statement about the action and state names an index on an axis."""
        A, S, _, _ = self.sizes
        named = self.indices[self.indices[:, axis] != ALL]
        flags = np.zeros((A + 1, S + 1), dtype=bool)
        flags[named[:, 0], named[:, 1]] = True  # `ALL`, -1, is the last row or column
        flags[:A, :S] |= flags[A:, :S] | flags[:A, S:] | flags[A, S]
        return flags[:A, :S].reshape(-1)

    def look_up(self, case: _Case) -> Array:
        """Return (n,) the reward of each case.

        An axis of the case may be None if no statement about the cases names an index on it.
        """
        count = len(case[0])
        latest = np.full(count, -1, dtype=np.intp)
        rewards = np.zeros(count)
        for axes, keys, order, values in self.groups:
            columns = [column for axis in axes if (column := case[axis]) is not None]
            if len(columns) < len(axes):
                continue
            case_keys = self._encode_keys(axes, columns, count)
            at = np.minimum(np.searchsorted(keys, case_keys), len(keys) - 1)
            later = (keys[at] == case_keys) & (order[at] > latest)
            latest[later] = order[at[later]]
            rewards[later] = values[at[later]]
        return rewards
