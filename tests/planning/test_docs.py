"""docs/planning.md from top to bottom: commands end well and print what it says, lines have their values."""

from __future__ import annotations

import ast
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lcorpp.cli.main import main

PAGE = (Path(__file__).parents[2] / "docs" / "planning.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def test_every_block_is_run() -> None:
    assert PAGE.count("\n```") == 2 * len(BLOCKS)
    assert {kind for kind, _, _ in BLOCKS} == {"pomdp", "sh", "text", "python"}


def test_the_page_is_true(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    names: dict[str, Any] = {}
    printed = ""
    values = 0
    for kind, about, text in BLOCKS:
        if kind == "pomdp":
            Path(about).write_text(text)
        elif kind == "sh":
            printed = "".join(ended(line, monkeypatch, capsys) for line in text.splitlines())
        elif kind == "text":
            pattern = re.escape(text).replace(re.escape("..."), ".*")
            assert re.fullmatch(pattern, printed, re.DOTALL), printed
        elif not about or find_spec(about):
            values += run(text, names)
    assert values > 15


def ended(line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    """What a command prints; it must end well."""
    monkeypatch.setattr("sys.argv", line.split())
    with pytest.raises(SystemExit) as code:
        main()
    said = capsys.readouterr()
    assert code.value.code in (0, None), said.err
    return said.out


def run(text: str, names: dict[str, Any]) -> int:
    """Run a block; how many of its lines had a value, each being what the page says."""
    lines = text.splitlines()
    told = 0
    for statement in ast.parse(text).body:
        source = ast.get_source_segment(text, statement)
        assert source is not None
        _, mark, value = lines[(statement.end_lineno or 0) - 1].partition("  # = ")
        if not mark:
            exec(source, names)
            continue
        told += 1
        found = eval(source, names)
        shown = np.array2string(found, precision=4) if isinstance(found, np.ndarray) else str(found)
        assert shown == value, source
    return told
