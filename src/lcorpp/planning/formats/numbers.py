"""Syntax of numbers in all file formats of models and policies, and the precision of models."""

from __future__ import annotations

import re

import numpy as np

from lcorpp.values import Array

ROW_TOLERANCE = 1e-4
"""Tolerance of row sums: published files have few digits, and errors up to 5e-6 are common."""

# Possessive quantifiers: a word of a million digits followed by a letter is rejected in one pass. Groups have
# none: Python before 3.11.5 goes on after a partial match of such a group (CPython issue 106052).
NUMBER = r"[+-]?+(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?+[0-9]++)?"
"""Pattern of a number; ``nan``, ``inf``, ``1_0`` and digits of other scripts do not match."""

_NUMBER = re.compile(NUMBER)
_NUMBER_CHARACTERS = re.compile(r"[\s0-9.eE+-]*+")


def is_number(text: str) -> bool:
    """Return whether `text` is a number; ``nan``, ``inf`` and ``1_0`` are not."""
    return _NUMBER.fullmatch(text) is not None


def is_count(text: str) -> bool:
    """Return whether `text` is a whole number without a sign."""
    return text.isascii() and text.isdigit()


def parse_numbers(text: str) -> Array | None:
    """Return the finite numbers (n,) of a text that contains nothing else but white space, else None."""
    # for words of these characters, float() accepts exactly what `is_number` accepts, and it is faster
    if _NUMBER_CHARACTERS.fullmatch(text) is None:
        return None
    try:
        values = np.array(list(map(float, text.split())), dtype=np.float64)
    except ValueError:
        return None
    return values if np.isfinite(values).all() else None


def find_invalid_number(words: list[str]) -> tuple[int, str]:
    """Return the index of the first word that is not a finite number, and an error message.

    If all words are finite numbers, return the number of words and "".
    """
    for index, word in enumerate(words):
        if not is_number(word) and word.lower().lstrip("+-") not in ("nan", "inf", "infinity"):
            return index, f"expected a number, found {word[:40]!r}"
        if not is_number(word) or not np.isfinite(float(word)):
            return index, f"{word[:40]} is not a finite number"
    return len(words), ""
