"""Chance: draws from rows of weights, by numbers that belong to a seed, a trial and a step alone."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.evaluation.sparse_beliefs import ragged_indices
from lcorpp.planning.evaluation.splitmix64 import GOLDEN, Words, hash_counter, splitmix64
from lcorpp.planning.sparse import Int32Array, Int64Array
from lcorpp.values import Array

LONG = 64
"""Rows of more entries are added up one by one, shorter ones all together."""

Numbers = npt.NDArray[np.integer]


class CounterRng:
    """Numbers in [0, 1) for every trial and step, each the same whatever else is drawn.

    A number is the hash of its place: SplitMix64 (Steele, Lea and Flood, 2014) at the sum of what it gives
    for the trial and for the step. The generators of numpy can only run through their numbers, and trials
    end at different times. Policies that are tried with one seed meet the same luck.

    Raises:
        ModelError: the seed is not a whole number from 0.
    """

    def __init__(self, seed: int) -> None:
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
            raise ModelError(f"a seed is a whole number from 0, not {seed!r}")
        self._seed = np.random.SeedSequence(int(seed)).generate_state(1, np.uint64)

    def trial_keys(self, first: int, count: int) -> Words:
        """(count,) what the trials from `first` draw with."""
        counted = np.arange(first, first + count, dtype=np.uint64) * np.uint64(GOLDEN)
        return splitmix64(counted + self._seed)

    def numbers(self, lots: Words, place: int) -> Array:
        """(n,) the numbers of some lots (n,) at a place from 0: each step has places of its own."""
        words = splitmix64(lots + hash_counter(np.array([place]), 1))
        words >>= np.uint64(11)
        numbers: Array = words * np.float64(2.0**-53)
        return numbers


class InverseCdfSampler:
    """Rows of weights made ready to be drawn from: the sums of each row up to each of its entries.

    begins: (R + 1,) where the entries of each row begin; no row is empty. columns, values: (entries,).

    The entry for a number u in [0, 1) is found by bisection: the first of its row whose sum exceeds u. Rows
    are filled up to a power of two with sums of 1; a row's own last sum is 1 exactly, so neither what fills
    it nor an entry of zero is ever found.
    """

    def __init__(self, begins: Int64Array, columns: Int32Array, values: Array) -> None:
        sizes = np.diff(begins)
        halves = np.array([0, *(2 ** ((n - 1).bit_length() - 1) for n in range(2, int(sizes.max()) + 1))])
        self._halves = halves[np.maximum(sizes, 1) - 1]
        widths = np.maximum(2 * self._halves, 1)
        self._begins = np.cumsum(widths) - widths
        place = ragged_indices(self._begins, sizes)
        self._columns = np.zeros(int(widths.sum()), dtype=np.int64)
        self._columns[place] = columns
        sums = np.ones(len(self._columns))
        sums[place] = _running(begins, sizes, values)
        # the sum up to the entry before: what u is held against when a half is skipped
        self._before = np.concatenate([[0.0], sums])
        self._halvings = int(self._halves.max()).bit_length()
        self._alike = int(self._halves[0]) if (self._halves == self._halves[0]).all() else None

    def draw(self, rows: Numbers, numbers: Array) -> npt.NDArray[np.int64]:
        """(n,) the columns that numbers (n,) in [0, 1) stand for, each in its row."""
        place = self._begins.take(rows)
        if self._halvings:
            half = self._halves.take(rows) if self._alike is None else np.array([self._alike])
            for _ in range(self._halvings):
                place += half * (self._before.take(place + half) <= numbers)
                half = half >> 1
        found: npt.NDArray[np.int64] = self._columns.take(place)
        return found


def _running(begins: Int64Array, sizes: Numbers, values: Array) -> Array:
    """The sums of each row up to each of its entries, scaled so that the last is 1 exactly."""
    sums = np.array(values)
    for row in np.flatnonzero(sizes > LONG):
        part = slice(int(begins[row]), int(begins[row + 1]))
        sums[part] = np.cumsum(sums[part])
    sizes = np.where(sizes > LONG, 0, sizes)
    order = np.argsort(-sizes, kind="stable")
    longer = len(sizes) - np.searchsorted(np.sort(sizes), np.arange(int(sizes.max())), side="right")
    for k in range(1, len(longer)):  # rows of more than k entries come first
        at = begins[order[: longer[k]]] + k
        sums[at] += sums[at - 1]
    return sums / np.repeat(sums[begins[1:] - 1], np.diff(begins))
