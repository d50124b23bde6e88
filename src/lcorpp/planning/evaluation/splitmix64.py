"""SplitMix64: a hash of 64-bit integers with the statistical quality of a random generator."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

GOLDEN = 0x9E3779B97F4A7C15
"""2**64 divided by the golden ratio: the increment of SplitMix64's counter."""

Words = npt.NDArray[np.uint64]


def splitmix64(words: Words) -> Words:
    """Hash each word in place.

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
