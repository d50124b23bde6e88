"""Run the guides in docs/ from top to bottom: commands succeed, outputs and values are as printed there.

Blocks: ``sh`` is run, the ``text`` after it is its output (``...`` matches anything); each line of ``python``
with ``# =`` has that value; blocks of another kind with a name are files, those without are not used. A
second word after ``sh`` or ``text`` is the reason why the block is not run; after ``python`` it names a
required package.
"""

from __future__ import annotations

import ast
import re
import subprocess
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lcorpp.cli.main import main

DOCS = Path(__file__).parents[1] / "docs"


@pytest.mark.parametrize(
    ("guide", "min_values"),
    [
        ("planning/planning.md", 16),
        ("learning/learning.md", 15),
        ("data/data.md", 10),
        ("domains/domains.md", 4),
        ("robot/worlds.md", 4),
        ("domains/strategies.md", 1),
        ("trust/log.md", 6),
        ("trust/trust.md", 2),
        ("trust/watch.md", 3),
        ("trust/audit.md", 3),
        ("results/figures.md", 3),
        ("results/sweeps.md", 2),
        ("results/play.md", 2),
        ("robot/camera.md", 3),
        ("learning/early.md", 4),
        ("robot/speech.md", 0),
        ("robot/several-people.md", 2),
    ],
)
def test_a_guide_is_true(
    guide: str,
    min_values: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = (DOCS / "guides" / guide).read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert page.count("\n```") == 2 * len(blocks)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    names: dict[str, Any] = {}
    printed, values = "", 0
    for kind, note, text in blocks:
        if kind == "python":
            if not note or find_spec(note):
                values += run(text, names)
        elif kind == "sh" and not note:
            printed = "".join(run_command(line, monkeypatch, capsys) for line in text.splitlines())
        elif kind == "text" and not note:
            pattern = re.escape(text).replace(re.escape("..."), ".*")
            assert re.fullmatch(pattern, printed, re.DOTALL), printed
        elif note and kind not in ("sh", "text"):
            Path(note).write_text(text)
    assert values >= min_values


def test_the_readme_s_tiger_can_be_pasted(tmp_path, monkeypatch, capsys):
    page = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    copy, *commands = re.search(r"^```sh\n(sed .*?)^```$", page, re.MULTILINE | re.DOTALL)[1].splitlines()
    (tmp_path / "docs").symlink_to(DOCS)
    monkeypatch.chdir(tmp_path)
    subprocess.run(copy, shell=True, check=True)
    assert commands[0].startswith("lcorpp solve tiger.pomdp -o tiger.policy")
    for command in commands:
        run_command(command, monkeypatch, capsys)
    assert {path.name for path in tmp_path.iterdir()} >= {"tiger.policy", "beliefs.png", "graph.png"}


def run_command(line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the output of a command, or its error message."""
    monkeypatch.setattr("sys.argv", line.split())
    with pytest.raises(SystemExit) as code:
        main()
    output = capsys.readouterr()
    if code.value.code == 2 and output.err.strip().startswith("lcorpp: broken"):
        return output.err.lstrip("\n")
    assert code.value.code in (0, None), output.err
    return output.out


def run(text: str, names: dict[str, Any]) -> int:
    """Run a block, check its values against the page and return how many it has."""
    lines = text.splitlines()
    values = 0
    for statement in ast.parse(text).body:
        source = ast.get_source_segment(text, statement)
        assert source is not None
        _, mark, value = lines[(statement.end_lineno or 0) - 1].partition("  # = ")
        if not mark:
            exec(source, names)
            continue
        values += 1
        result = eval(source, names)
        text_of = np.array2string(result, precision=4) if isinstance(result, np.ndarray) else str(result)
        assert text_of == value, source
    return values
