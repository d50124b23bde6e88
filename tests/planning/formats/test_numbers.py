"""Three ways to recognise numbers that must agree."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, strategies as st

from lcorpp.planning.formats.numbers import find_invalid_number, is_number, parse_numbers

# the same grammar without possessive quantifiers, too slow for long words
SLOW = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")

WORDS = st.text("0123456789.eE+-_ ny\u0663", max_size=8).map(lambda word: word.replace(" ", ""))


@pytest.mark.parametrize("word", ["1", "-1.", "+.5", "1e5", "1.5E-3", "007", "-0"])
def test_is_number_accepts_each_form_of_a_number(word):
    assert is_number(word)


@pytest.mark.parametrize(
    "word", ["", ".", "e5", "1e", "1_0", "nan", "inf", "0x1", "--1", "1,5", "\u0663", "1 "]
)
def test_is_number_rejects_other_words(word):
    assert not is_number(word)


@given(WORDS)
def test_is_number_agrees_with_the_grammar(word):
    assert is_number(word) == (SLOW.fullmatch(word) is not None)


@given(st.lists(WORDS.filter(bool)))
def test_parse_numbers_agrees_with_is_number(words):
    values = parse_numbers("  ".join(words))
    index, message = find_invalid_number(words)
    right = [is_number(word) and bool(np.isfinite(float(word))) for word in words]
    assert (values is not None) == all(right) == (message == "")
    assert index == ([*right, False].index(False))
    if values is not None:
        assert values.tolist() == [float(word) for word in words]


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False)))
def test_numbers_are_read_exactly(values):
    found = parse_numbers(" ".join(map(repr, values)))
    assert found is not None
    assert found.tobytes() == np.array(values, dtype=float).tobytes()
