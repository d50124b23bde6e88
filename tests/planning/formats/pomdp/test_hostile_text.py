"""Any .pomdp text gives a model or a typed error with a position."""

from __future__ import annotations

import pytest
from hypothesis import example, given, settings, strategies as st

from lcorpp.errors import ModelError, ParseError
from lcorpp.planning import Pomdp, parse_pomdp
from tests.planning.formats.pomdp.texts import BODY, HEAD
from tests.planning.models import LCORPP, SHARED, TIGER

WORDS = st.sampled_from(
    [
        *HEAD.split(),
        *BODY.split(),
        *("R:", "start:", ":", "*", "0.5", "1", "-1", "include", "include:", "exclude:", "\n", "#", "reset"),
        *(
            "startinclude:",
            "start",
            "T",
            ":0",
            "01",
            "1e999",
            "nan",
            "1_0",
            "\r",
            "\u2028",
            "\x00",
            "T:x:a:b 1",
        ),
    ]
)


def check_result(text: str) -> None:
    found: Pomdp | ParseError | ModelError
    try:
        found = parse_pomdp(text, file="soup.pomdp")
    except (ParseError, ModelError) as error:
        found = error
    if isinstance(found, ParseError):
        assert 1 <= found.line <= text.count("\n") + text.count("\r") + 1
        assert 1 <= found.column <= len(text) + 1
    assert isinstance(found, Pomdp) or str(found).startswith("soup.pomdp:")


@given(
    st.one_of(
        st.text(),
        st.lists(WORDS).map(" ".join),
        st.lists(WORDS).map(lambda words: HEAD + BODY + " ".join(words)),
    )
)
@example(LCORPP)
@example("startinclude: a")
@example(HEAD + "startinclude: a\n" + BODY)
@settings(max_examples=60)
def test_any_text_ends_in_a_model_or_a_typed_error(text):
    check_result(text)


CUTS = st.lists(st.tuples(st.floats(0, 1), st.integers(0, 20), WORDS | st.text(max_size=2)), max_size=4)
NAMES = (
    "light_maze.POMDP",
    "network.pomdp",
    "hallway.pomdp",
    "mini-hall2.pomdp",
    "ejs3.pomdp",
    "shuttle.95.pomdp",
)
REAL = [path.read_text(errors="replace") for name in NAMES if (path := SHARED / name).exists()]


@pytest.mark.parametrize("text", [TIGER, LCORPP, *REAL], ids=str.__len__)
@given(cuts=CUTS)
@settings(max_examples=12)
def test_damaged_files_end_in_a_model_or_a_typed_error(text, cuts):
    for place, length, piece in cuts:
        at = int(place * len(text))
        text = text[:at] + piece + text[at + length :]
    check_result(text)
