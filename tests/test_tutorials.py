"""Run the code cells of the tutorials in docs/tutorials/, and check values that their text states.

The site executes them as notebooks; here they are plain Python. ``!lcorpp ...``, and the only line of a
``%%sh`` cell, run a command in this process, ``%%writefile FILE`` writes a file, and other lines that begin
with ``%`` are for notebooks alone.
"""

from __future__ import annotations

import re
import shlex
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Ended

TUTORIALS = Path(__file__).parents[1] / "docs" / "tutorials"


def list_cells(page: str) -> list[str]:
    """Return the code of each cell, without its header."""
    cells = re.findall(r"^```\{code-cell\}[^\n]*\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    return [re.sub(r"\A---\n.*?^---\n", "", cell, flags=re.MULTILINE | re.DOTALL) for cell in cells]


class Notebook:
    """The names that the cells define, everything that they print, and the number of failed commands."""

    def __init__(self, lcorpp: Callable[..., Ended], capsys: pytest.CaptureFixture[str]) -> None:
        self.names: dict[str, Any] = {"run_command": self.run_command}
        self.printed, self.failed, self._lcorpp, self._capsys = "", 0, lcorpp, capsys

    def run_command(self, line: str) -> None:
        self.printed += "".join(self._capsys.readouterr())  # of the cell so far
        program, *arguments = shlex.split(line)
        assert program == "lcorpp"
        ended = self._lcorpp(*arguments)
        self.failed += ended.code != 0
        self.printed += ended.out + ended.err

    def run(self, cell: str) -> None:
        magic, _, text = cell.partition("\n")
        if magic.startswith("%%writefile "):
            Path(magic.split()[1]).write_text(text, encoding="utf-8")
            return
        if magic == "%%sh":
            cell = "!" + text
        lines = [line for line in cell.replace("\\\n", " ").splitlines() if not line.startswith("%")]
        commands = [re.sub(r"^!(.*)$", lambda found: f"run_command({found[1]!r})", line) for line in lines]
        exec(textwrap.dedent("\n".join(commands)), self.names)
        self.printed += "".join(self._capsys.readouterr())


STATED = {
    "paper": ["LCORPP  F1 0.848   cost  9.28   return 51.53", "L+R          0.724    0.70"],
    "own-domain": [
        "'studying' is not a member of the sort wishes",
        "evening, gaze_study: ask, report_study",
    ],
    "own-classifier": [
        "accuracy 0.725 [0.680, 0.767]",
        "pr(classifier=one | intention=interested) = 103/134.",
    ],
    "robot": [
        "6.0 s  1 m  report_not_interested",
        "3 actions: OK",
    ],
    "plog": ["0.225000", "corridor  0.444444", "winter  0.166667"],
    "pomdp": ["at .8 the best action is: listen", "worse hearing   value   2.00, enters from P(free) = 0.85"],
    "trust": [
        "low    P 41.38, R+P 34.03, L+P 45.00, LCORPP 39.99",
        "after 47 people: knowledge: intention identity=professor and identity=visitor exchanged",
        "after 104 people: hearing",
        "other numbers of time and location",
        "LCORPP+trust  return 57.6",
    ],
}
"""Tutorial -> texts that its cells print, on which its sentences depend."""

FAILED_COMMANDS = {"own-domain": 1, "plog": 1, "robot": 1}
"""Tutorial -> number of its commands that show an error."""


SLOW = {"own-classifier", "trust"}
"""Tutorials of more than three seconds; the site executes them, too."""


def test_all_tutorials_are_run():
    assert {path.stem for path in TUTORIALS.glob("*.md")} == {*STATED, "index"}


@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=pytest.mark.slow if x in SLOW else ()) for x in STATED]
)
def test_a_tutorial_is_true(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    lcorpp: Callable[..., Ended],
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    notebook = Notebook(lcorpp, capsys)
    for cell in list_cells((TUTORIALS / f"{name}.md").read_text(encoding="utf-8")):
        notebook.run(cell)
    for file in tmp_path.glob("*.py"):
        sys.modules.pop(file.stem, None)
    assert notebook.failed == FAILED_COMMANDS.get(name, 0)
    for text in STATED[name]:
        assert text in notebook.printed
