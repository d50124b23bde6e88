"""Examples of docs/reference/plog/plog.md and docs/background/coming-from.md: answers, errors, Python."""

from __future__ import annotations

import ast
import re
import shutil
from fractions import Fraction
from importlib import import_module
from pathlib import Path

import pytest

from lcorpp.domains import load_domain
from lcorpp.errors import LcorppError
from lcorpp.reasoning import Enumeration, ask, parse_plog, parse_query, program_text

DOCS = Path(__file__).parents[2] / "docs"
PAGE, NEIGHBOURS = (
    (DOCS / name).read_text(encoding="utf-8")
    for name in ("reference/plog/plog.md", "background/coming-from.md")
)


def find_blocks(page: str, kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)


EXAMPLES = find_blocks(PAGE + NEIGHBOURS, "plog")


def test_the_pages_have_examples() -> None:
    assert len(EXAMPLES) >= 28
    assert (PAGE + NEIGHBOURS).count("```plog") == len(EXAMPLES)


def test_the_problog_example_has_the_answers_in_its_comment() -> None:
    (text,) = find_blocks(NEIGHBOURS, "problog")
    program = parse_plog(text)
    expected = re.search(r"% expect: (.*)", text)[1].split()
    assert [f"{float(ask(program, query)):.6f}" for query in program.queries] == expected


def test_the_table_of_limits_has_the_numbers_of_the_code() -> None:
    rows = re.findall(r"^\|.*\| ([\d,]+) \| `([\w.]+)\.(\w+)` \|", PAGE, re.MULTILINE)
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


def test_the_python_blocks_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = find_blocks(PAGE, "python")
    shutil.copy(load_domain("intention").folder / "knowledge.plog", tmp_path)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    distributions = 0
    for block in blocks:
        for statement in ast.parse(block).body:
            source = ast.get_source_segment(block, statement)
            shown = re.search(r"  # (Distribution\(.*)", block.splitlines()[statement.lineno - 1])
            if shown:
                assert repr(eval(source, names)) == shown[1]
                distributions += 1
            else:
                exec(compile(source, "docs/reference/plog/plog.md", "exec"), names)
    assert distributions == 6
    assert (tmp_path / "intention.npz").exists()
    assert str(names["reasoner"]).startswith("Reasoner(<Program knowledge.plog: ")
