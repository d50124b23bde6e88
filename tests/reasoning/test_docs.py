"""Examples of docs/reference/plog/ and docs/background/coming-from.md: answers and errors."""

from __future__ import annotations

import re
from fractions import Fraction
from importlib import import_module
from pathlib import Path

import pytest

from lcorpp.errors import LcorppError
from lcorpp.reasoning import Enumeration, ask, parse_plog, parse_query, program_text

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [path.read_text(encoding="utf-8") for path in sorted((DOCS / "reference" / "plog").glob("*.md"))]
LIMITS = (DOCS / "reference" / "plog" / "limits.md").read_text(encoding="utf-8")
NEIGHBOURS = (DOCS / "background" / "coming-from.md").read_text(encoding="utf-8")


def find_blocks(page: str, kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)


EXAMPLES = [block for page in [*PAGES, NEIGHBOURS] for block in find_blocks(page, "plog")]


def test_the_pages_have_examples() -> None:
    assert len(EXAMPLES) >= 28
    assert "".join([*PAGES, NEIGHBOURS]).count("```plog") == len(EXAMPLES)


def test_the_problog_example_has_the_answers_in_its_comment() -> None:
    (text,) = find_blocks(NEIGHBOURS, "problog")
    program = parse_plog(text)
    expected = re.search(r"% expect: (.*)", text)[1].split()
    assert [f"{float(ask(program, query)):.6f}" for query in program.queries] == expected


def test_the_table_of_limits_has_the_numbers_of_the_code() -> None:
    rows = re.findall(r"^\|.*\| ([\d,]+) \| `([\w.]+)\.(\w+)` \|", LIMITS, re.MULTILINE)
    assert len(rows) >= 15
    for number, module, name in rows:
        value = getattr(import_module(f"lcorpp.reasoning.{module}"), name)
        assert value == int(number.replace(",", "")), name


def use(text: str) -> None:
    """Read a program, answer its queries and enumerate its worlds."""
    reasoner = Enumeration(parse_plog(text))
    for query in reasoner.program.queries:
        reasoner.ask(query)
    assert reasoner.worlds


@pytest.mark.parametrize("text", EXAMPLES, ids=range(len(EXAMPLES)))
def test_examples_have_the_answers_in_their_comments(text: str) -> None:
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
        answer = reasoner.ask(parse_query(query, program))
        if "." in value:  # published to at most six digits
            assert abs(answer - Fraction(value)) <= Fraction(1, 2_000_000), query
        else:
            assert answer == Fraction(value), query
