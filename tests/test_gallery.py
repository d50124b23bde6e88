"""The gallery in docs/: each picture exists and is described; the commands make the pictures."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "gallery.md").read_text(encoding="utf-8")
PICTURES = re.findall(r"^!\[(.*)\]\((.*)\)$", PAGE, re.MULTILINE)


def test_each_picture_is_there_and_described():
    assert len(PICTURES) == PAGE.count("![") >= 11
    assert [path for _, path in PICTURES if not (DOCS / path).is_file()] == []
    assert min(len(text.split()) for text, _ in PICTURES) >= 20
    shown = {Path(path).name for _, path in PICTURES}
    assert {file.name for file in (DOCS / "images" / "gallery").iterdir()} <= shown


@pytest.mark.slow
def test_the_commands_make_the_pictures(tmp_path, monkeypatch, lcorpp):
    """Blocks of ``sh`` with a second word are not run, apart from ``exit-code-1``; named blocks are files."""
    monkeypatch.chdir(tmp_path)
    for kind, note, text in re.findall(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL):
        if kind != "sh":
            Path(note).write_text(text)
            continue
        for line in text.replace("\\\n", "").splitlines() if note in ("", "exit-code-1") else ():
            program, *arguments = shlex.split(line)
            assert program == "lcorpp"
            assert lcorpp(*arguments).code == (note == "exit-code-1"), line
    names = {"strategies": "strategies/results", "trial": "figures/trial", "sweep": "sweep/sweep"}
    names |= {"report": "learnt/report"}
    made = [Path(path).stem for _, path in PICTURES if "/gallery/" in path and "bounds" not in path]
    assert [name for name in made if not Path(f"{names.get(name, name)}.svg").is_file()] == []
