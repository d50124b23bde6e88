"""Many sparse beliefs at once: prediction by an action, conditioning on an observation, posteriors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.planning.evaluation.sampling import hash_counter, splitmix64
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import Int32Array, Int64Array, SparseTables, ragged_indices
from lcorpp.values import Array, Belief, Indices

MAX_CHUNK_ENTRIES = 2**22
"""The maximal number of entries that are processed together, in some 100 MiB of memory."""

MAX_DENSE_ENTRIES = 2**22
"""Single entries of tables up to this size are read from a dense copy."""


@dataclass(frozen=True, eq=False)
class SparseBeliefs:
    """n beliefs, not necessarily normalised; belief i has the entries begins[i] to begins[i + 1].

    begins: (n + 1,). states: (entries,) increasing within a belief. weights: (entries,) positive.
    """

    begins: Int64Array
    states: Int32Array
    weights: Array

    @classmethod
    def of(cls, dense: Array) -> SparseBeliefs:
        """Convert dense beliefs (n, S)."""
        owner, states = np.nonzero(dense)
        begins = np.searchsorted(owner, np.arange(len(dense) + 1))
        return cls(begins.astype(np.int64), states.astype(np.int32), dense[owner, states])

    def __len__(self) -> int:
        return len(self.begins) - 1

    def __repr__(self) -> str:
        return f"<SparseBeliefs: {len(self)} with {len(self.states)} entries>"

    @property
    def sizes(self) -> Int64Array:
        """(n,) the number of states with positive weight in each belief."""
        return np.diff(self.begins)

    @property
    def owners(self) -> Indices:
        """(entries,) the index of each entry's belief."""
        return np.repeat(np.arange(len(self)), self.sizes)

    def take(self, which: npt.NDArray[np.integer]) -> SparseBeliefs:
        """Return the beliefs with indices (k,), in their order."""
        sizes = self.begins[which + 1] - self.begins[which]
        at = ragged_indices(self.begins[which], sizes)
        return SparseBeliefs(np.concatenate([[0], np.cumsum(sizes)]), self.states[at], self.weights[at])

    def dense(self, index: int, states: int) -> Belief:
        """Return one belief as a dense array (S,) for S = `states`."""
        part = slice(int(self.begins[index]), int(self.begins[index + 1]))
        dense = np.zeros(states)
        dense[self.states[part]] = self.weights[part]
        return dense

    def totals(self) -> Array:
        """Return (n,) the sum of each belief's weights, added in their order."""
        return segment_sum(self.owners, self.weights, len(self))

    def average(self, numbers: Array) -> Array:
        """Return (n,) the mean of numbers (entries,) under each belief."""
        return segment_sum(self.owners, self.weights * numbers, len(self)) / self.totals()

    def predict(self, pomdp: Pomdp, actions: npt.NDArray[np.integer]) -> SparseBeliefs:
        """Return the beliefs after actions (n,), before an observation."""
        table, owners = pomdp.transition, self.owners
        at, sizes = _rows_of(table, actions[owners], self.states)
        mass = np.repeat(self.weights, sizes) * table.values[at]
        return _sum_duplicates(len(self), np.repeat(owners, sizes), table.columns[at], mass, table.shape[2])

    def condition(
        self, pomdp: Pomdp, actions: npt.NDArray[np.integer], observations: npt.NDArray[np.integer]
    ) -> SparseBeliefs:
        """Weight predicted beliefs with the likelihood of observations (n,), without normalisation."""
        owners = self.owners
        likelihood = gather_entries(pomdp.observation, actions[owners], self.states, observations[owners])
        weights = self.weights * likelihood
        kept = weights > 0
        begins = np.concatenate([[0], np.cumsum(np.bincount(owners[kept], minlength=len(self)))])
        return SparseBeliefs(begins, self.states[kept], weights[kept])

    def posteriors(self, pomdp: Pomdp, actions: npt.NDArray[np.integer]) -> Posteriors:
        """Split predicted beliefs by all possible observations."""
        table, owners = pomdp.observation, self.owners
        at, sizes = _rows_of(table, actions[owners], self.states)
        weights = np.repeat(self.weights, sizes) * table.values[at]
        keys = np.repeat(owners, sizes) * table.shape[2] + table.columns[at]
        states = np.repeat(self.states, sizes)
        kept = np.flatnonzero(weights > 0)
        order = kept[np.argsort(keys[kept], kind="stable")]
        distinct, begins = np.unique(keys[order], return_index=True)
        parts = SparseBeliefs(np.append(begins, len(order)).astype(np.int64), states[order], weights[order])
        owner, observation = np.divmod(distinct, table.shape[2])
        return Posteriors(owner, observation, parts)

    def round_weights(self) -> SparseBeliefs:
        """Return the beliefs normalised and with weights of 40 binary digits.

        Beliefs that differ only by rounding become equal. The relative error of a weight is at most 2**-41.
        Bayes' rule and transitions do not increase errors of ratios (Hilbert's metric; Birkhoff, 1957), so
        after t steps the relative error is at most about t 2**-40.
        """
        scaled = self.weights / self.totals()[self.owners]
        bits = scaled.view(np.uint64)
        digits = ((bits + np.uint64(1 << 11)) & ~np.uint64((1 << 12) - 1)).view(np.float64)
        return SparseBeliefs(self.begins, self.states, digits)

    def keys(self) -> list[bytes]:
        """Return a 128-bit hash of each belief's states and weights."""
        words = np.zeros((len(self), 2), dtype=np.uint64)
        filled = np.flatnonzero(self.sizes)
        for half in range(2):
            mixed = splitmix64(hash_counter(self.states, half) ^ self.weights.view(np.uint64))
            words[filled, half] = np.add.reduceat(mixed, self.begins[filled]) if len(filled) else 0
        return words.view("V16")[:, 0].tolist()  # type: ignore[no-any-return]

    def chunks(self, factor: int = 1) -> Iterator[slice]:
        """Yield slices of at most `MAX_CHUNK_ENTRIES / factor` entries, but at least one belief."""
        begin, limit = 0, max(MAX_CHUNK_ENTRIES // max(factor, 1), 1)
        while begin < len(self):
            end = int(np.searchsorted(self.begins, self.begins[begin] + limit, side="right")) - 1
            end = max(end, begin + 1)
            yield slice(begin, end)
            begin = end


class Posteriors(NamedTuple):
    """All pairs of a belief and a possible observation, by belief and then by observation.

    owner: (k,) index of the predicted belief. observation: (k,).
    parts: k posteriors, not normalised: the total of one is the probability of its observation.
    """

    owner: Int64Array
    observation: Int64Array
    parts: SparseBeliefs


def _rows_of(
    table: SparseTables, actions: npt.NDArray[np.integer], rows: npt.NDArray[np.integer]
) -> tuple[Int64Array, Int64Array]:
    """Return the indices of the entries of some rows, and the number of entries of each row."""
    row = actions.astype(np.int64) * table.shape[1] + rows
    sizes = table.begins[row + 1] - table.begins[row]
    return ragged_indices(table.begins[row], sizes), sizes


def gather_entries(
    table: SparseTables,
    actions: npt.NDArray[np.integer],
    rows: npt.NDArray[np.integer],
    columns: npt.NDArray[np.integer],
) -> Array:
    """Return (n,) the entry of each action, row and column; zero if it is not stored."""
    row = actions.astype(np.int64) * table.shape[1] + rows
    if np.prod(table.shape, dtype=np.int64) <= MAX_DENSE_ENTRIES:
        entries: Array = table.dense.reshape(-1)[row * table.shape[2] + columns]
        return entries
    low, high = table.begins[row], table.begins[row + 1]
    end = high
    for _ in range(int((high - low).max(initial=0)).bit_length()):
        middle = (low + high) // 2
        less = (middle < high) & (table.columns[np.minimum(middle, len(table.columns) - 1)] < columns)
        low, high = np.where(less, middle + 1, low), np.where(less, high, middle)
    at = np.minimum(low, len(table.columns) - 1)
    return np.where((low < end) & (table.columns[at] == columns), table.values[at], 0.0)


def _sum_duplicates(count: int, owners: Indices, states: Int32Array, mass: Array, size: int) -> SparseBeliefs:
    """Add up the entries of equal belief and state, in their order."""
    keys = owners * size + states
    if count * size <= 4 * len(keys):
        sums = segment_sum(keys, mass, count * size)
        distinct = np.flatnonzero(sums)
        sums = sums[distinct]
    else:
        distinct, place = np.unique(keys, return_inverse=True)
        sums = segment_sum(place, mass, len(distinct))
        distinct, sums = distinct[sums > 0], sums[sums > 0]
    owner, state = np.divmod(distinct, size)
    begins = np.searchsorted(owner, np.arange(count + 1))
    return SparseBeliefs(begins, state.astype(np.int32), sums)


def segment_sum(segments: npt.NDArray[np.integer], numbers: Array, count: int) -> Array:
    """Return (count,) the sum of the numbers of each segment, added in their order."""
    return np.bincount(segments, numbers, minlength=count).astype(np.float64, copy=False)
