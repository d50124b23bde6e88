"""Run the pages in docs/ from top to bottom: commands succeed, outputs and values are as printed there.

Blocks: ``sh`` is run, the ``text`` after it is its output (``...`` matches anything); each line of ``python``
with ``# =`` has that value; blocks of another kind with a name are files, those without are not used. A
second word after ``sh`` or ``text`` is the reason why the block is not run; after ``python`` it names a
required package. Directives, ``{name}``, are not used. Notebooks, pages with the header
``file_format: mystnb``, run when the site is built.
"""

from __future__ import annotations

import ast
import re
import shlex
import subprocess
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import Ended

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BLOCK = re.compile(r"^```(\{?[\w-]+\}?)(?: (\S+)[^\n]*)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NOTEBOOK = "file_format: mystnb"
MAX_WORDS = 1500
"""Words of a page, without its code blocks."""

CHECKS = {
    "limits.md": 2,
    "guides/data/formats.md": 2,
    "guides/data/recordings.md": 4,
    "guides/data/repairs.md": 2,
    "guides/data/simulated.md": 2,
    "guides/data/store.md": 6,
    "guides/domains/folder.md": 2,
    "guides/domains/learnt.md": 2,
    "guides/domains/logged.md": 1,
    "guides/domains/models.md": 5,
    "guides/domains/scores.md": 1,
    "guides/domains/senses.md": 1,
    "guides/domains/several-variables.md": 1,
    "guides/domains/simulated.md": 2,
    "guides/domains/strategies.md": 1,
    "guides/learning/corrected-labels.md": 1,
    "guides/learning/early.md": 4,
    "guides/learning/evaluation.md": 1,
    "guides/learning/features.md": 4,
    "guides/learning/likelihoods.md": 1,
    "guides/learning/lstm.md": 2,
    "guides/learning/prediction-sets.md": 1,
    "guides/learning/prefixes.md": 6,
    "guides/learning/seen-enough.md": 2,
    "guides/learning/series.md": 5,
    "guides/learning/streaming.md": 6,
    "guides/learning/tables.md": 3,
    "guides/planning/bounds.md": 7,
    "guides/planning/dialogues.md": 1,
    "guides/planning/certificate.md": 3,
    "guides/planning/files.md": 2,
    "guides/planning/gymnasium.md": 0,
    "guides/planning/horizons.md": 5,
    "guides/planning/models.md": 3,
    "guides/planning/simulation.md": 2,
    "guides/planning/solve.md": 5,
    "guides/planning/solvers.md": 8,
    "guides/reasoning/answer-sets.md": 3,
    "guides/reasoning/decisions.md": 3,
    "guides/reasoning/fit.md": 2,
    "guides/reasoning/markov-logic.md": 2,
    "guides/reasoning/networks.md": 3,
    "guides/reasoning/own.md": 1,
    "guides/reasoning/python.md": 4,
    "guides/reasoning/records.md": 3,
    "guides/reasoning/soft-evidence.md": 2,
    "guides/reasoning/tables.md": 2,
    "guides/reasoning/time.md": 4,
    "guides/results/figures.md": 3,
    "guides/results/play.md": 2,
    "guides/results/sweeps.md": 2,
    "guides/robot/camera.md": 3,
    "guides/robot/gaze.md": 2,
    "guides/robot/several-people.md": 2,
    "guides/robot/speech.md": 1,
    "guides/robot/worlds.md": 4,
    "guides/trust/audit.md": 3,
    "guides/trust/log.md": 6,
    "guides/trust/people.md": 1,
    "guides/trust/trust.md": 2,
    "guides/trust/watch.md": 3,
    "start/index.md": 3,
    "start/plog.md": 8,
    "start/pomdp.md": 5,
    "start/trajectories.md": 5,
}
"""Page -> how many values and outputs it has at least. A page whose checks are removed fails."""

PAGES = {str(path.relative_to(DOCS)): path.read_text(encoding="utf-8") for path in DOCS.rglob("*.md")}
GALLERY = "gallery.md"
"""Its commands are run by tests/test_gallery.py."""


def find_runnable_pages() -> list[str]:
    """Return the pages with commands or Python that run here."""
    kinds = re.compile(r"^```(?:python\b|sh$)", re.MULTILINE)
    pages = {name: page for name, page in PAGES.items() if NOTEBOOK not in page[:500] and name != GALLERY}
    return sorted(name for name, page in pages.items() if kinds.search(page))


@pytest.mark.parametrize("name", find_runnable_pages())
def test_a_page_is_true(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lcorpp: Callable[..., Ended]
) -> None:
    blocks = BLOCK.findall(PAGES[name])
    assert PAGES[name].count("\n```") == 2 * len(blocks)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    printed, checks = "", 0
    for kind, note, text in blocks:
        if kind == "python":
            if not note or find_spec(note):
                checks += run(text, names)
        elif kind == "sh" and not note:
            printed = "".join(run_command(line, lcorpp) for line in text.splitlines())
        elif kind == "text" and not note:
            pattern = re.escape(text).replace(re.escape("..."), ".*")
            assert re.fullmatch(pattern, printed, re.DOTALL), printed
            checks += 1
        elif note and kind not in ("sh", "text") and not kind.startswith("{"):
            Path(note).write_text(text)
    assert checks >= CHECKS.get(name, 0)
    assert name in CHECKS or not checks, f"add {name} with {checks} checks to CHECKS"


def test_every_page_with_checks_exists() -> None:
    assert CHECKS.keys() <= set(find_runnable_pages())


@pytest.mark.parametrize("name", sorted(PAGES))
def test_a_page_is_short(name: str) -> None:
    prose = re.sub(r"^(`{3,}).*?^\1[ \t]*$", "", PAGES[name], flags=re.MULTILINE | re.DOTALL)
    assert len(prose.split()) < MAX_WORDS


def test_paths_of_pages_in_sources_exist() -> None:
    """Messages, docstrings and comments name pages by their path, `docs/...`."""
    files = [*(ROOT / "src" / "lcorpp").rglob("*"), *ROOT.glob("*.md"), *(ROOT / "examples").rglob("*")]
    texts = [
        path.read_text(encoding="utf-8") for path in files if path.suffix in (".py", ".js", ".md", ".toml")
    ]
    found = {path for text in texts for path in re.findall(r"\bdocs/[\w/-]+\.md\b", text)}
    assert len(found) > 20
    assert [path for path in sorted(found) if not (ROOT / path).exists()] == []


def test_the_readme_s_tiger_can_be_pasted(tmp_path, monkeypatch, lcorpp):
    page = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    copy, *commands = re.search(r"^```sh\n(sed .*?)^```$", page, re.MULTILINE | re.DOTALL)[1].splitlines()
    (tmp_path / "docs").symlink_to(DOCS)
    monkeypatch.chdir(tmp_path)
    subprocess.run(copy, shell=True, check=True)
    assert commands[0].startswith("lcorpp solve tiger.pomdp -o tiger.policy")
    for command in commands:
        run_command(command, lcorpp)
    assert {path.name for path in tmp_path.iterdir()} >= {"tiger.policy", "beliefs.png", "graph.png"}


def run_command(line: str, lcorpp: Callable[..., Ended]) -> str:
    """Return the output of a command, or its error message."""
    program, *arguments = shlex.split(line, comments=True)
    assert program == "lcorpp"
    ended = lcorpp(*arguments)
    if ended.code == 2 and ended.err.strip().startswith("lcorpp: broken"):
        return ended.err.lstrip("\n")
    assert ended.code == 0, ended.err
    return ended.out


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
