"""docs/background/paper.md and departures.md: every path in them exists, every name is defined."""

import re
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = "".join(
    (ROOT / "docs" / "background" / name).read_text(encoding="utf-8")
    for name in ("paper.md", "departures.md")
)


def test_every_path_exists():
    """Paths are below src/lcorpp or the repository; `file.py: name` is defined in the file."""
    spans = re.findall(r"`([^`]+)`", PAGE)
    paths = [span for span in spans if "/" in span and re.fullmatch(r"[\w./*]+(: \w+)?", span)]
    assert len(paths) > 30
    for span in paths:
        path, _, name = span.partition(": ")
        found = [*(ROOT / "src" / "lcorpp").glob(path), *ROOT.glob(path)]
        assert found, span
        assert not name or re.search(rf"^(def|class) {name}\b", found[0].read_text(), re.MULTILINE), span


def test_every_value_and_protocol_exists():
    names = re.findall(r"`(values|protocols)\.([A-Z]\w+)`", PAGE)
    assert len(names) > 4
    for module, name in names:
        assert hasattr(import_module(f"lcorpp.{module}"), name), name
