"""Many beliefs at once, zeros left out: what an action and an observation make of each of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.planning.evaluation.splitmix64 import hash_counter, splitmix64
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import Int32Array, Int64Array, SparseTables
from lcorpp.values import Array, Belief

Indices = npt.NDArray[np.intp]

MOST_ENTRIES = 2**22
"""Entries that are worked on together: some hundred MiB of scratch."""

MOST_DENSE = 2**22
"""A table of at most so many numbers is written out, zeros and all, where single entries are looked up."""


@dataclass(frozen=True, eq=False)
class SparseBeliefs:
    """n weighings of the states; belief i has the entries begins[i] to the next one's.

    begins: (n + 1,). states: (entries,) rising within a belief. weights: (entries,) positive.
    """

    begins: Int64Array
    states: Int32Array
    weights: Array

    @classmethod
    def of(cls, dense: Array) -> SparseBeliefs:
        """From beliefs (n, S)."""
        owner, states = np.nonzero(dense)
        begins = np.searchsorted(owner, np.arange(len(dense) + 1))
        return cls(begins.astype(np.int64), states.astype(np.int32), dense[owner, states])

    @classmethod
    def joined(cls, parts: Iterable[SparseBeliefs]) -> SparseBeliefs:
        """Some after others."""
        kept = [NOTHING, *parts]
        ends = np.cumsum([0, *(len(part.states) for part in kept)])
        begins = [part.begins[1:] + end for part, end in zip(kept, ends[:-1], strict=True)]
        return cls(
            np.concatenate([np.zeros(1, dtype=np.int64), *begins]),
            np.concatenate([part.states for part in kept]),
            np.concatenate([part.weights for part in kept]),
        )

    def __len__(self) -> int:
        return len(self.begins) - 1

    @property
    def sizes(self) -> Int64Array:
        """(n,) the number of states that each holds."""
        return np.diff(self.begins)

    @property
    def owners(self) -> Indices:
        """(entries,) the belief that each entry is of."""
        return np.repeat(np.arange(len(self)), self.sizes)

    def take(self, which: npt.NDArray[np.integer]) -> SparseBeliefs:
        """The beliefs of some numbers (k,), in their order."""
        sizes = self.begins[which + 1] - self.begins[which]
        at = ragged_indices(self.begins[which], sizes)
        return SparseBeliefs(np.concatenate([[0], np.cumsum(sizes)]), self.states[at], self.weights[at])

    def belief(self, number: int, size: int) -> Belief:
        """One of them as (S,), S being `size`."""
        part = slice(int(self.begins[number]), int(self.begins[number + 1]))
        dense = np.zeros(size)
        dense[self.states[part]] = self.weights[part]
        return dense

    def totals(self) -> Array:
        """(n,) what the weights of each add up to, added in their order."""
        return segment_sum(self.owners, self.weights, len(self))

    def average(self, worth: Array) -> Array:
        """(n,) the mean under each of numbers (entries,)."""
        return segment_sum(self.owners, self.weights * worth, len(self)) / self.totals()

    def predict(self, pomdp: Pomdp, actions: npt.NDArray[np.integer]) -> SparseBeliefs:
        """Where the states go with an action each (n,), before anything is observed."""
        table, owners = pomdp.transition, self.owners
        at, sizes = _rows_of(table, actions[owners], self.states)
        mass = np.repeat(self.weights, sizes) * table.values[at]
        return _added(len(self), np.repeat(owners, sizes), table.columns[at], mass, table.shape[2])

    def condition(
        self, pomdp: Pomdp, actions: npt.NDArray[np.integer], observations: npt.NDArray[np.integer]
    ) -> SparseBeliefs:
        """What was spread, each weighed with how likely it is to show an observation each (n,)."""
        owners = self.owners
        chances = gather_entries(pomdp.observation, actions[owners], self.states, observations[owners])
        weights = self.weights * chances
        kept = weights > 0
        begins = np.concatenate([[0], np.cumsum(np.bincount(owners[kept], minlength=len(self)))])
        return SparseBeliefs(begins, self.states[kept], weights[kept])

    def posteriors(self, pomdp: Pomdp, actions: npt.NDArray[np.integer]) -> Posteriors:
        """What was spread, by all that may be observed."""
        table, owners = pomdp.observation, self.owners
        at, sizes = _rows_of(table, actions[owners], self.states)
        weights = np.repeat(self.weights, sizes) * table.values[at]
        keys = np.repeat(owners, sizes) * table.shape[2] + table.columns[at]
        states = np.repeat(self.states, sizes)
        kept = np.flatnonzero(weights > 0)
        order = kept[np.argsort(keys[kept], kind="stable")]
        found, begins = np.unique(keys[order], return_index=True)
        parts = SparseBeliefs(np.append(begins, len(order)).astype(np.int64), states[order], weights[order])
        owner, observation = np.divmod(found, table.shape[2])
        return Posteriors(owner, observation, parts)

    def rounded(self) -> SparseBeliefs:
        """Each scaled to add up to 1, and every weight rounded to 40 binary digits.

        Beliefs that differ by the order of their arithmetic alone become one and the same. Rounding changes a
        weight by at most its 2**-41th part; ratios of weights are what Bayes' rule and a transition never
        drive further apart (Hilbert's metric; Birkhoff, 1957), so after t steps no weight is off by more
        than about its t 2**-40th part.
        """
        scaled = self.weights / self.totals()[self.owners]
        bits = scaled.view(np.uint64)
        digits = ((bits + np.uint64(1 << 11)) & ~np.uint64((1 << 12) - 1)).view(np.float64)
        return SparseBeliefs(self.begins, self.states, digits)

    def keys(self) -> list[bytes]:
        """A hash of 128 bits of each: the same for the same states and weights, and hardly else."""
        words = np.zeros((len(self), 2), dtype=np.uint64)
        filled = np.flatnonzero(self.sizes)
        for half in range(2):
            mixture = splitmix64(hash_counter(self.states, half) ^ self.weights.view(np.uint64))
            words[filled, half] = np.add.reduceat(mixture, self.begins[filled]) if len(filled) else 0
        return words.view("V16")[:, 0].tolist()  # type: ignore[no-any-return]

    def chunks(self, factor: int = 1) -> Iterator[slice]:
        """Runs of beliefs that have few entries together, each entry counting `factor` times."""
        begin, most = 0, max(MOST_ENTRIES // max(factor, 1), 1)
        while begin < len(self):
            end = int(np.searchsorted(self.begins, self.begins[begin] + most, side="right")) - 1
            end = max(end, begin + 1)
            yield slice(begin, end)
            begin = end


class Posteriors(NamedTuple):
    """What may be observed, in the order of the beliefs and then of the observations.

    owner: (k,) the belief it follows. observation: (k,). parts: k weighings; what one adds up to is how
    likely it is.
    """

    owner: Int64Array
    observation: Int64Array
    parts: SparseBeliefs


NOTHING = SparseBeliefs(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int32), np.zeros(0))


def ragged_indices(begins: npt.NDArray[np.integer], sizes: npt.NDArray[np.integer]) -> Int64Array:
    """sizes[i] numbers from begins[i] on, for each i in turn."""
    ends = np.cumsum(sizes)
    total = int(ends[-1]) if len(ends) else 0
    numbers: Int64Array = np.arange(total, dtype=np.int64) + np.repeat(begins - (ends - sizes), sizes)
    return numbers


def _rows_of(
    table: SparseTables, actions: npt.NDArray[np.integer], rows: npt.NDArray[np.integer]
) -> tuple[Int64Array, Int64Array]:
    """Where the entries of some rows are, and how many each row has."""
    row = actions.astype(np.int64) * table.shape[1] + rows
    sizes = table.begins[row + 1] - table.begins[row]
    return ragged_indices(table.begins[row], sizes), sizes


def gather_entries(
    table: SparseTables,
    actions: npt.NDArray[np.integer],
    rows: npt.NDArray[np.integer],
    columns: npt.NDArray[np.integer],
) -> Array:
    """(n,) the entry of each action, row and column; zero where there is none."""
    row = actions.astype(np.int64) * table.shape[1] + rows
    if np.prod(table.shape, dtype=np.int64) <= MOST_DENSE:
        found: Array = table.dense.reshape(-1)[row * table.shape[2] + columns]
        return found
    low, high = table.begins[row], table.begins[row + 1]
    end = high
    for _ in range(int((high - low).max(initial=0)).bit_length()):
        middle = (low + high) // 2
        less = (middle < high) & (table.columns[np.minimum(middle, len(table.columns) - 1)] < columns)
        low, high = np.where(less, middle + 1, low), np.where(less, high, middle)
    at = np.minimum(low, len(table.columns) - 1)
    return np.where((low < end) & (table.columns[at] == columns), table.values[at], 0.0)


def _added(count: int, owners: Indices, states: Int32Array, mass: Array, size: int) -> SparseBeliefs:
    """Entries of one belief and state added up, in the order in which they come."""
    keys = owners * size + states
    if count * size <= 4 * len(keys):
        sums = segment_sum(keys, mass, count * size)
        found = np.flatnonzero(sums)
        sums = sums[found]
    else:
        found, place = np.unique(keys, return_inverse=True)
        sums = segment_sum(place, mass, len(found))
        found, sums = found[sums > 0], sums[sums > 0]
    owner, state = np.divmod(found, size)
    begins = np.searchsorted(owner, np.arange(count + 1))
    return SparseBeliefs(begins, state.astype(np.int32), sums)


def segment_sum(places: npt.NDArray[np.integer], numbers: Array, count: int) -> Array:
    """(count,) the numbers of each place added up, in the order in which they come."""
    return np.bincount(places, numbers, minlength=count).astype(np.float64, copy=False)
