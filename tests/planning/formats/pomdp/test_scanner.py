"""The compiled scanner and the one in Python read the same statements, with the bits of Python's numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning.formats.pomdp import _scanner
from tests.planning.formats.pomdp import python_scanner

INDICES = ({"*": -1, "go": 0, "é": 1}, {"*": -1, "0": 0, "1": 1, "a-b": 1}, {"*": -1, "0": 2, "1": 0, "2": 1})
WORDS = "- + T O R T: O: R: : * go é 0 1 2 a-b no # .5 1. -0 +1e0 1e-3 1e400 0.3x uniform 2.5e 1.00005"
GLUED = "0.5T: 1uniform 0O 1R : 0.25reset 1values:"
PIECES = st.sampled_from([*WORDS.split(" "), *GLUED.split(" "), " ", "\n", "\r", "\t", "# : 1 T\n", "R: go"])
ENTRIES = st.sampled_from(
    [
        "T: go : 0 : 1 0.5\n",
        "O:*:a-b:2 1e-5#\n",
        "R: é : * : * : * -3\n",
        "R: é : 0 : 1 : * - 3\n",
        "R: go : 1 : * + 2.5\n",
        "O: go : 1 + # sign\n 0.25 0 .75\n",
        "T: go : 1\n0.25 .75\n",
        "O : * : * 0 0 1\n",
    ]
)


def scan(
    implementation: Any, text: bytes, offset: int = 0, max_numbers: int = 100, references: int = 4
) -> list[Any]:
    names = [implementation.Names(indices) for indices in INDICES]
    end, *tables = implementation.scan_statements(text, offset, *names, 2, 3, references, 1.0001, max_numbers)
    arrays = [array for table in tables for array in table]
    return [end, *((array.dtype, array.shape, array.tolist()) for array in arrays)]


@given(
    parts=st.lists(ENTRIES | PIECES, max_size=12),
    limit=st.sampled_from([1, 3, 100]),
    references=st.sampled_from([3, 4]),
)
@settings(max_examples=100)
def test_both_scanners_read_the_same_statements(parts, limit, references):
    text = "".join(parts).encode()
    found = [scan(each, text, 0, limit, references) for each in (_scanner, python_scanner)]
    assert found[0] == found[1]


@given(
    text=st.from_regex(
        r"[+-]?([0-9]{1,25}\.?[0-9]{0,25}|\.[0-9]{1,30})([eE][+-]?[0-9]{1,4})?", fullmatch=True
    )
    | st.floats(allow_nan=False, allow_infinity=False).map(repr)
)
@settings(max_examples=125)
def test_numbers_have_the_bits_of_float(text):
    found = _scanner.scan_rows(text.encode(), 0, 1, 1)
    if not np.isfinite(float(text)):
        assert found is None
    else:
        end, _, _, _, values = found
        assert end == len(text)
        assert values.tolist() == [float(text)] * (float(text) != 0)


@given(
    parts=st.lists(
        st.sampled_from(["0", "1", "-2.5", "-", "+", " ", "\n", "#1\n", "x", ":", "1e999"]), max_size=12
    )
)
def test_both_scanners_read_the_same_rows(parts):
    text, found = "".join(parts).encode(), []
    for implementation in (_scanner, python_scanner):
        rows = implementation.scan_rows(text, 0, 2, 2)
        found.append(rows and [rows[0], *((array.dtype, array.tolist()) for array in rows[1:])])
    assert found[0] == found[1]


def test_wrong_arguments_are_refused():
    with pytest.raises(ValueError, match="the offset is behind the end of the text"):
        scan(_scanner, b"T", 2)
    with pytest.raises(ValueError, match="the offset is behind the end of the text"):
        _scanner.scan_rows(b"1", 2, 1, 1)
    with pytest.raises(TypeError):
        scan(_scanner, "T: go")  # type: ignore[arg-type]
