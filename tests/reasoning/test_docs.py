"""The examples of docs/plog.md: answers, error messages and the Python block."""

from __future__ import annotations

import ast
import re
import shutil
from fractions import Fraction
from pathlib import Path

import pytest

from lcorpp.domains import load_domain
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
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
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
                exec(compile(source, "docs/plog.md", "exec"), names)
    assert distributions == 4
    assert (tmp_path / "intention.npz").exists()
    assert str(names["reasoner"]).startswith("Reasoner(<Program knowledge.plog: ")
