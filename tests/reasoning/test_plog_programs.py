"""The programs in tests/plog with their answers: ``% expect: query = value``, decimals to 6 digits."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from lcorpp.reasoning import Enumeration, ask, parse_plog, parse_query, program_text, read_plog
from lcorpp.reasoning.reasoner import Reasoner

PROGRAMS = sorted((Path(__file__).parent.parent / "plog").glob("*.plog"))


def expectations(path: Path) -> list[tuple[str, str]]:
    lines = [line for line in path.read_text().splitlines() if line.startswith("% expect:")]
    pairs = [line.removeprefix("% expect:").rpartition(" = ") for line in lines]
    return [(query.strip(), value.strip()) for query, _, value in pairs]


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_programs_have_the_answers_in_their_comments(path: Path) -> None:
    program = read_plog(path)
    reasoner = Enumeration(program)
    assert expectations(path)
    for text, value in expectations(path):
        answer = reasoner.ask(parse_query(text, program))
        assert isinstance(answer, Fraction)
        if "." in value:  # published to at most six digits
            assert abs(answer - Fraction(value)) <= Fraction(1, 2_000_000), (text, float(answer))
        else:
            assert answer == Fraction(value), (text, answer)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_reasoner_and_enumeration_agree_on_fractions(path: Path) -> None:
    program = read_plog(path)
    worlds, engine = Enumeration(program), Reasoner(program)
    for text, _ in expectations(path):
        query = parse_query(text, program)
        expected = worlds.ask(query)
        assert engine.ask(query, exact=True) == expected, text
        assert engine.ask(query) == pytest.approx(float(expected), abs=1e-12), text


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_program_text_reads_back_equal(path: Path) -> None:
    program = read_plog(path)
    again = parse_plog(program_text(program), file="again.plog")
    assert again == program
    assert program_text(again) == program_text(program)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_windows_line_ends_change_nothing(path: Path) -> None:
    assert parse_plog(path.read_text().replace("\n", "\r\n")) == read_plog(path)


def test_queries_of_a_program_are_answered() -> None:
    program = read_plog(Path(__file__).parent.parent / "plog" / "monty_hall_2.plog")
    (query,) = program.queries
    assert ask(program, query) == Fraction(1, 3)
