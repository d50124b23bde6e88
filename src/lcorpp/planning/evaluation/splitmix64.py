"""SplitMix64: whole numbers of 64 bits turned into others that look drawn by chance."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

GOLDEN = 0x9E3779B97F4A7C15
"""2**64 divided by the golden ratio: what SplitMix64 counts in."""

Words = npt.NDArray[np.uint64]


def splitmix64(words: Words) -> Words:
    """Each number hashed, in place.

    Source: Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014, with the constants
    of Stafford's variant 13.
    """
    turned = words >> np.uint64(30)
    words ^= turned
    words *= np.uint64(0xBF58476D1CE4E5B9)
    np.right_shift(words, np.uint64(27), out=turned)
    words ^= turned
    words *= np.uint64(0x94D049BB133111EB)
    np.right_shift(words, np.uint64(31), out=turned)
    words ^= turned
    return words


def hash_counter(numbers: npt.NDArray[np.integer], offset: int = 0) -> Words:
    """Small whole numbers, far apart from each other and other ones for another offset."""
    words = numbers.astype(np.uint64) * np.uint64(GOLDEN)
    words += np.uint64(offset * 0xD1B54A32D192ED03 % 2**64)
    return splitmix64(words)
