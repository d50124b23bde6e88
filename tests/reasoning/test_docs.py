"""The examples of docs/plog.md: each program answers as it says, or is refused in the words it gives."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import pytest

from lcorpp.errors import LcorppError
from lcorpp.reasoning import Enumeration, parse_plog, parse_query, program_text

PAGE = (Path(__file__).parents[2] / "docs" / "plog.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```plog\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def test_the_page_has_examples() -> None:
    assert len(EXAMPLES) >= 25
    assert PAGE.count("```plog") == len(EXAMPLES)


def use(text: str) -> None:
    """Read a program, answer its queries and enumerate its worlds."""
    reasoner = Enumeration(parse_plog(text))
    for query in reasoner.program.queries:
        reasoner.ask(query)
    assert reasoner.worlds


@pytest.mark.parametrize("text", EXAMPLES, ids=range(len(EXAMPLES)))
def test_example_says_what_happens(text: str) -> None:
    refused = re.findall(r"^% refused: (.*)$", text, re.MULTILINE)
    expected = re.findall(r"^% expect: (.*) = (\S+)$", text, re.MULTILINE)
    assert bool(refused) != bool(expected)
    if refused:
        with pytest.raises(LcorppError) as caught:
            use(text)
        assert refused[0] in str(caught.value)
        return
    program = parse_plog(text)
    assert parse_plog(program_text(program)) == program
    reasoner = Enumeration(program)
    for query, value in expected:
        answer = reasoner.probability(parse_query(query, program))
        if "." in value:  # published to at most six digits
            assert abs(answer - Fraction(value)) <= Fraction(1, 2_000_000), query
        else:
            assert answer == Fraction(value), query
