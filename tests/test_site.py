"""The documentation's site: pages, links, figures, generated references; built in `make check-slow`."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections import Counter
from fnmatch import fnmatch
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
REPOSITORY_PAGES = [*sorted(ROOT.glob("[A-Z]*.md")), *sorted((ROOT / "benchmarks/results").glob("*.md"))]
MAX_WORDS = 1500
"""Words of a page, without code; tables of measurements are not counted."""


@pytest.fixture(scope="module")
def extensions() -> dict[str, ModuleType]:
    """Return the modules of docs/_extensions that import without Sphinx."""
    sys.path.insert(0, str(DOCS / "_extensions"))
    try:
        names = ("api_reference", "blocks", "command_reference", "docstrings", "repository")
        return {name: import_module(name) for name in names}
    finally:
        sys.path.remove(str(DOCS / "_extensions"))


def read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def prose(text: str) -> str:
    """Return a page without its blocks of code and spans of code."""
    text = re.sub(r"^(`{3,}|:{3,}\{raw).*?^\1[ \t]*$", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", text)


def find_links(text: str, mark: str = r"(?<!!)\[") -> list[str]:
    """Return the targets of a page's links, without those to other sites."""
    targets = re.findall(rf"{mark}[^\[\]]*\]\(([^()\s]+)\)", prose(text))
    return [target for target in targets if not re.match(r"[a-z]+:", target)]


def find_anchors(page: Path, extensions: dict[str, ModuleType]) -> set[str]:
    repository = extensions["repository"]
    counts = Counter[str]()
    anchors = set()
    for _, _, title in repository.find_headings(read(page)):
        anchor = repository.make_anchor(title)
        anchors.add(f"{anchor}-{counts[anchor]}" if counts[anchor] else anchor)
        counts[anchor] += 1
    return anchors


@pytest.mark.parametrize("page", [*PAGES, *REPOSITORY_PAGES], ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(page: Path, extensions: dict[str, ModuleType]):
    links = find_links(read(page)) + find_links(read(page), r"!\[")
    for link in links:
        path, _, anchor = link.partition("#")
        target = Path(os.path.normpath(page.parent / path)) if path else page
        assert target.exists(), link
        assert target.is_relative_to(ROOT), link
        if anchor and not anchor.startswith(("lcorpp.", "L")):  # names of Python, lines of a source
            assert anchor in find_anchors(target, extensions), link


def list_entries(page: Path, names: set[str]) -> set[str]:
    """Return the pages that a page's tables of contents list; a pattern leaves out those listed before."""
    own = page.relative_to(DOCS).with_suffix("")
    listed = set[str]()
    for block in re.findall(r"^`{3,}\{toctree\}\n(.*?)^`{3,}$", read(page), re.MULTILINE | re.DOTALL):
        entries = [line for line in block.splitlines() if line and not line.startswith(":")]
        in_block = set[str]()
        for entry in entries:
            pattern = os.path.normpath(own.parent / re.sub(r".*<(.*)>", r"\1", entry))
            found = {name for name in names - {str(own)} if fnmatch(name, pattern)}
            found = {name for name in found if name.count("/") == pattern.count("/")} - in_block
            assert found, f"{page}: {entry} names no page"
            in_block |= found
        assert not in_block & listed, page
        listed |= in_block
    return listed


def test_every_page_is_in_one_table_of_contents():
    names = {page.relative_to(DOCS).with_suffix("").as_posix() for page in PAGES}
    counts = Counter(name for page in PAGES for name in list_entries(page, names))
    assert names - counts.keys() == {"index"}
    assert {name: count for name, count in counts.items() if count > 1} == {}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_images_have_alternative_texts(page: Path):
    for alternative in re.findall(r"!\[([^\]]*)\]\(", prose(read(page))):
        assert len(alternative.split()) >= 5, alternative
    for frame in re.findall(r"<(?:img|iframe)\b[^>]*>", read(page)):
        assert re.search(r'(?:alt|title)="[^"]{20,}"', frame), frame


def test_pages_of_the_repository_are_short_on_the_site(extensions: dict[str, ModuleType]):
    """`tests/test_guides.py` checks all other pages."""
    lengths = {}
    for page in PAGES:
        text = read(page)
        for file, options in extensions["blocks"].find_blocks(text, "repository-page"):
            part = extensions["repository"].cut_part(read(ROOT / file), options)
            rows = r"^\|.*$" if file.startswith("benchmarks/") else r"(?!)"
            text += re.sub(rows, "", part, flags=re.MULTILINE)
            prose_alone = re.sub(r"^(`{3,}).*?^\1[ \t]*$", "", text, flags=re.MULTILINE | re.DOTALL)
            lengths[str(page.relative_to(DOCS))] = len(prose_alone.split())
    assert len(lengths) > 15
    assert {name: words for name, words in lengths.items() if words >= MAX_WORDS} == {}


def test_every_command_is_in_the_reference_once(extensions: dict[str, ModuleType]):
    blocks, commands = extensions["blocks"], extensions["command_reference"].list_commands()
    assert len(commands) > 20
    folder = DOCS / "reference/commands"
    pages = [read(page) for page in folder.glob("*.md")]
    described = [name for page in pages for name, _ in blocks.find_blocks(page, "command")]
    assert sorted(described) == sorted([*commands, "lcorpp"])
    listed = set(re.findall(r"\blcorpp (\w+)", read(folder / "index.md")))
    assert {name.split()[0] for name in commands} <= listed


def test_every_option_is_in_the_reference(extensions: dict[str, ModuleType]):
    """The options that `--help` prints are those of the generated text, with their defaults."""
    from typer.main import get_command

    from lcorpp.cli.app import app

    reference = extensions["command_reference"]
    root = get_command(app)
    options = 0
    for name in reference.list_commands():
        command = root
        for part in name.split():
            command = command.commands[part]
        text = reference.describe_command(name)
        for parameter in command.params:
            options += 1
            for flag in parameter.opts if parameter.param_type_name == "option" else []:
                line = re.search(rf"^`+{{option}} (?:.*, )?{re.escape(flag)}\b.*\n(.*)$", text, re.MULTILINE)
                assert line, (name, flag)
                is_plain = isinstance(parameter.default, (int, float)) and not parameter.is_flag
                assert not is_plain or f"{parameter.default}" in line[1], (name, flag, line[1])
    assert options > 300


def test_every_public_name_is_in_the_api_reference_once(extensions: dict[str, ModuleType]):
    api = extensions["api_reference"]
    described = Counter[tuple[str, str]]()
    for page in sorted((DOCS / "reference").rglob("*.md")):
        for package, options in extensions["blocks"].find_blocks(read(page), "api"):
            described.update((package, name) for name in api.choose_names(package, options))
    stubs = sorted((ROOT / "src/lcorpp").glob("*/__init__.pyi"))
    packages = [f"lcorpp.{stub.parent.name}" for stub in stubs] + ["lcorpp.errors"]
    assert len(packages) > 15
    expected = {(package, name) for package in packages for name in api.list_names(package)}
    assert described == Counter(expected)


def test_a_docstring_s_fields_become_a_section(extensions: dict[str, ModuleType]):
    lines = [
        "A pair.",
        "",
        "first, second: the numbers. unit: theirs,",
        "    in metres.",
        "",
        "Raises:",
        "    E: a * b.",
    ]
    extensions["docstrings"].convert_docstring(lines, {"first", "second", "unit"})
    assert lines == [
        "A pair.", "", "", "Fields:",
        "    first, second: the numbers.", "    unit: theirs,", "        in metres.",
        "", "Raises:", r"    E: a \* b.",
    ]  # fmt: skip


def test_code_in_a_docstring_is_unchanged(extensions: dict[str, ModuleType]):
    example = ["Example:", "    >>> add_(*pair) | 1", "    3_", "", "    >>> add_(*pair)", "    3", ""]
    lines = ["Add.", "", "    add(*pair)", "", *example, "name_ ends so."]
    extensions["docstrings"].convert_docstring(lines, {"pair"})
    extensions["docstrings"].escape_references(lines)
    assert lines == ["Add.", "", "::", "", "    add(*pair)", "", *example, r"name\_ ends so."]


def test_links_to_files_lead_to_their_pages_or_the_repository(extensions: dict[str, ModuleType]):
    repository = extensions["repository"]
    pages = repository.find_pages()
    guide = DOCS / "guides" / "trust" / "trust.md"

    def resolve(target: str) -> str:
        return repository.resolve_link(target, guide.parent, guide, pages)

    assert resolve("../../../benchmarks/results/trust.md") == "../../background/benchmarks/trust.md"
    assert resolve("../../../ARCHITECTURE.md#decisions") == "../../background/decisions.md#decisions"
    assert resolve("../../../examples/drinks") == f"{repository.URL}/tree/main/examples/drinks"
    assert (
        resolve("../../../src/lcorpp/errors.py#L9") == f"{repository.URL}/blob/main/src/lcorpp/errors.py#L9"
    )
    assert resolve("watch.md#limits") == "watch.md#limits"
    text = repository.resolve_links("`[a](b.md)` ![x](../../images/loop.svg)\n", guide.parent, guide, pages)
    assert text == "`[a](b.md)` ![x](../../images/loop.svg)\n"


class _Links(HTMLParser):
    """Collects what a page loads from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.loaded: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        values = dict(attributes)
        if tag in ("script", "img", "iframe", "source"):
            self.loaded.append(values.get("src") or "")
        if tag == "link" and values.get("rel") in ("stylesheet", "preload", "icon"):
            self.loaded.append(values.get("href") or "")


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path):
    """Warnings are errors; no page loads anything from elsewhere; the page to play on is in it."""
    for package in ("sphinx", "furo", "myst_nb", "sphinx_design", "sphinx_copybutton"):
        pytest.importorskip(package)
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-q",
        "-W",
        "--keep-going",
        "-b",
        "html",
        str(DOCS),
        str(tmp_path),
    ]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert ended.returncode == 0, ended.stderr
    built = [page for page in tmp_path.rglob("*.html") if page.parent.name != "play"]
    assert len(built) >= len(PAGES)
    for page in built:
        links = _Links()
        links.feed(read(page))
        assert [address for address in links.loaded if re.match(r"https?:|//", address)] == [], page
    assert len(read(tmp_path / "play" / "index.html")) > 100_000
    assert 'id="cmdoption-lcorpp-solve-precision"' in read(tmp_path / "reference/commands/planning.html")
    assert 'id="lcorpp.planning.Pomdp"' in read(tmp_path / "reference/api/planning/models.html")
