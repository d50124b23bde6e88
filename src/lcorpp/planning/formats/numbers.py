"""What is a number in the flat formats: one rule for models, policies and alpha vectors."""

from __future__ import annotations

import re

import numpy as np

from lcorpp.values import Array

# Possessive throughout: a word of a million digits that ends in a letter is refused in one pass.
NUMBER = r"[+-]?+(?:[0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)(?:[eE][+-]?+[0-9]++)?+"
"""The pattern of a number; ``nan``, ``inf``, ``1_0`` and digits of other scripts are none."""

_NUMBER = re.compile(NUMBER)
_LETTERS = re.compile(r"[\s0-9.eE+-]*+")


def is_number(text: str) -> bool:
    """Whether `text` is a number of the formats; ``nan``, ``inf`` and ``1_0`` are not."""
    return _NUMBER.fullmatch(text) is not None


def is_count(text: str) -> bool:
    """Whether `text` is a whole number without a sign."""
    return text.isascii() and text.isdigit()


def finite_numbers(text: str) -> Array | None:
    """(n,) the numbers in a text of nothing but finite numbers and white space; None for any other text."""
    # of words made of these letters, float() accepts exactly those that `is_number` does, and it is faster
    if _LETTERS.fullmatch(text) is None:
        return None
    try:
        values = np.array(list(map(float, text.split())), dtype=np.float64)
    except ValueError:
        return None
    return values if np.isfinite(values).all() else None


def first_fault(words: list[str]) -> tuple[int, str]:
    """Which of some words is not a finite number, and what to say of it.

    Returns:
        The index of the first such word and a message; the number of words and "" where all are right.
    """
    for index, word in enumerate(words):
        if not is_number(word):
            named = word.lower().lstrip("+-") in ("nan", "inf", "infinity")
            shown = word[:40]
            return (
                index,
                f"{shown} is not a finite number" if named else f"expected a number, found {shown!r}",
            )
        if not np.isfinite(float(word)):
            return index, f"{word[:40]} is not a finite number"
    return len(words), ""
