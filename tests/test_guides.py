"""The guides in docs/ from top to bottom: commands end well and print what is told, lines have their values.

Blocks: ``sh`` is run, the ``text`` after it is what is printed (``...`` stands for anything); of ``python``
each line with ``# =`` has that value; blocks of another kind with a name are files. A second word after
``sh`` or ``text`` says why the block is not run; after ``python`` it names a package that is needed.
"""

from __future__ import annotations

import ast
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lcorpp.cli.main import main

DOCS = Path(__file__).parents[1] / "docs"


@pytest.mark.parametrize(("guide", "least"), [("planning.md", 16), ("learning.md", 15), ("data.md", 10)])
def test_a_guide_is_true(
    guide: str,
    least: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = (DOCS / guide).read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert page.count("\n```") == 2 * len(blocks)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    names: dict[str, Any] = {}
    printed, values = "", 0
    for kind, about, text in blocks:
        if kind == "python":
            if not about or find_spec(about):
                values += run(text, names)
        elif kind == "sh" and not about:
            printed = "".join(said(line, monkeypatch, capsys) for line in text.splitlines())
        elif kind == "text" and not about:
            pattern = re.escape(text).replace(re.escape("..."), ".*")
            assert re.fullmatch(pattern, printed, re.DOTALL), printed
        elif kind not in ("sh", "text"):
            Path(about).write_text(text)
    assert values >= least


def said(line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    """What a command prints; where it refuses, the message."""
    monkeypatch.setattr("sys.argv", line.split())
    with pytest.raises(SystemExit) as code:
        main()
    told = capsys.readouterr()
    if code.value.code == 2 and told.err.strip().startswith("lcorpp: broken"):
        return told.err.lstrip("\n")
    assert code.value.code in (0, None), told.err
    return told.out


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


def test_every_path_of_the_paper_s_page_exists() -> None:
    """Paths in docs/paper.md are below src/lcorpp or the repository, and `file.py: name` is defined there."""
    root = DOCS.parent
    page = (DOCS / "paper.md").read_text(encoding="utf-8")
    spans = re.findall(r"`([^`]+)`", page)
    paths = [span for span in spans if re.fullmatch(r"[\w./*]+(/|\.\w+)(: \w+)?|\w+(/\w+)+", span)]
    paths = [span for span in paths if "/" in span]
    assert len(paths) > 30
    for span in paths:
        path, _, name = span.partition(": ")
        found = [*(root / "src" / "lcorpp").glob(path), *root.glob(path)]
        assert found, span
        assert not name or re.search(rf"^(def|class) {name}\b", found[0].read_text(), re.MULTILINE), span
    names = {"values", "protocols"}
    for module, name in re.findall(r"`(\w+)\.([A-Z]\w+)`", page):
        assert module not in names or hasattr(import_module(f"lcorpp.{module}"), name), name
