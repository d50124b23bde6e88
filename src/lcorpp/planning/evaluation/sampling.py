"""Counter-based random numbers by SplitMix64, a hash of 64-bit integers; sampling from rows of weights."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.sparse import Int32Array, Int64Array, ragged_indices
from lcorpp.values import Array

LONG_ROW = 64
"""Rows of more entries are summed one by one, shorter rows all together."""

GOLDEN = 0x9E3779B97F4A7C15
"""2**64 divided by the golden ratio: the increment of SplitMix64's counter."""

Numbers = npt.NDArray[np.integer]
Words = npt.NDArray[np.uint64]


def splitmix64(words: Words) -> Words:
    """Hash each word in place, with the statistical quality of a random generator.

    Source: Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014, with the constants
    of Stafford's variant 13.
    """
    shifted = words >> np.uint64(30)
    words ^= shifted
    words *= np.uint64(0xBF58476D1CE4E5B9)
    np.right_shift(words, np.uint64(27), out=shifted)
    words ^= shifted
    words *= np.uint64(0x94D049BB133111EB)
    np.right_shift(words, np.uint64(31), out=shifted)
    words ^= shifted
    return words


def hash_counter(numbers: npt.NDArray[np.integer], stream: int = 0) -> Words:
    """Hash small integers to words, independently for each stream."""
    words = numbers.astype(np.uint64) * np.uint64(GOLDEN)
    words += np.uint64(stream * 0xD1B54A32D192ED03 % 2**64)
    return splitmix64(words)


class CounterRng:
    """Uniform random numbers that depend on seed, trial and step only.

    A number is the SplitMix64 hash (Steele, Lea and Flood, 2014) of its trial's key and its step's counter.
    numpy's generators are sequential, but trials end at different times. Policies simulated with the same
    seed use common random numbers.

    Raises:
        ModelError: the seed is not an integer from 0.
    """

    def __init__(self, seed: int) -> None:
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
            raise ModelError(f"a seed is a whole number from 0, not {seed!r}")
        self._seed = np.random.SeedSequence(int(seed)).generate_state(1, np.uint64)

    def trial_keys(self, first: int, count: int) -> Words:
        """Return (count,) the keys of the trials from `first`."""
        counters = np.arange(first, first + count, dtype=np.uint64) * np.uint64(GOLDEN)
        return splitmix64(counters + self._seed)

    def uniforms(self, keys: Words, counter: int) -> Array:
        """Return (n,) numbers in [0, 1) for trial keys (n,) and a counter from 0, unique to a draw."""
        words = splitmix64(keys + hash_counter(np.array([counter]), 1))
        words >>= np.uint64(11)
        uniforms: Array = words * np.float64(2.0**-53)
        return uniforms


class InverseCdfSampler:
    """A sampler of columns from rows of weights, by inversion of each row's cumulative distribution.

    begins: (R + 1,) the entries of row i are begins[i] to begins[i + 1]; no row is empty.
    columns, values: (entries,).

    The column of a number u in [0, 1) is that of the first entry whose cumulative sum exceeds u, found by
    bisection. Rows are padded with ones to a power of two. The last sum of a row is exactly 1, so neither
    padding nor a zero entry is ever returned.
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
        sums[place] = _cumulate(begins, sizes, values)
        # the sum before each entry: bisection compares u with it to skip the lower half
        self._before = np.concatenate([[0.0], sums])
        self._halvings = int(self._halves.max()).bit_length()
        self._common_half = int(self._halves[0]) if (self._halves == self._halves[0]).all() else None

    def draw(self, rows: Numbers, uniforms: Array) -> npt.NDArray[np.int64]:
        """Return (n,) columns for numbers (n,) in [0, 1), each in its row (n,)."""
        place = self._begins.take(rows)
        if self._halvings:
            half = self._halves.take(rows) if self._common_half is None else np.array([self._common_half])
            for _ in range(self._halvings):
                place += half * (self._before.take(place + half) <= uniforms)
                half = half >> 1
        columns: npt.NDArray[np.int64] = self._columns.take(place)
        return columns


def _cumulate(begins: Int64Array, sizes: Numbers, values: Array) -> Array:
    """Return the cumulative sums of each row, divided by the row's sum."""
    sums = np.array(values)
    for row in np.flatnonzero(sizes > LONG_ROW):
        part = slice(int(begins[row]), int(begins[row + 1]))
        sums[part] = np.cumsum(sums[part])
    sizes = np.where(sizes > LONG_ROW, 0, sizes)
    order = np.argsort(-sizes, kind="stable")
    longer = len(sizes) - np.searchsorted(np.sort(sizes), np.arange(int(sizes.max())), side="right")
    for k in range(1, len(longer)):  # rows of more than k entries come first
        at = begins[order[: longer[k]]] + k
        sums[at] += sums[at - 1]
    return sums / np.repeat(sums[begins[1:] - 1], np.diff(begins))
