"""Pages of the repository on the site, and links from pages of the site to files of the repository.

A page contains a Markdown file of the repository, or some of its sections:

    ```{repository-page} ARCHITECTURE.md
    :from: Decisions
    :until: A heading after it
    ```

If the page has no title of its own, the first heading of the part becomes its title. Relative links lead to
the page of the site that contains the file and, where there is none, to the file in the repository.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from blocks import expand_blocks, find_blocks, mark_code

DOCS = Path(__file__).parents[1]
ROOT = DOCS.parent
URL = "https://github.com/lcorpp/lcorpp"

_HEADING = re.compile(r"^(#{1,6}) +(.*?)\s*$")
_LINK = re.compile(r"(!?\[[^\[\]]*|)\]\((?P<target>[^()\s]+)\)")
_CODE_SPAN = re.compile(r"(`+[^`]*`+)")


def find_headings(text: str) -> list[tuple[int, int, str]]:
    """Return number of the line, level and text of each heading."""
    lines = enumerate(mark_code(text))
    found = [(k, _HEADING.match(line)) for k, (line, is_code) in lines if not is_code]
    return [(k, len(match[1]), match[2]) for k, match in found if match]


def make_anchor(heading: str) -> str:
    """Return the anchor of a heading, as GitHub and MyST form it."""
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.replace("`", ""))
    return re.sub(r"[^\w\- ]", "", plain.strip().lower().replace("*", "")).replace(" ", "-")


def cut_part(text: str, options: Mapping[str, str]) -> str:
    """Return the part of a file from one heading until before another."""
    lines, headings = text.splitlines(keepends=True), find_headings(text)
    places = {title: k for k, _, title in headings}
    for end in ("from", "until"):
        if end in options and options[end] not in places:
            raise ValueError(f"no heading {options[end]!r}; expected one of {', '.join(places)}")
    begin = places[options["from"]] if "from" in options else 0
    end = places[options["until"]] if "until" in options else len(lines)
    return "".join(lines[begin:end])


def fit_headings(part: str, title: str | None) -> str:
    """Return a part for a page with this title, without it a second time.

    Without a title the first heading becomes the title, and the others are raised by as many levels.
    """
    headings = find_headings(part)
    lines = [line for line, _ in mark_code(part)]
    if title is None:
        for k, level, text in headings:
            lines[k] = f"{'#' * (1 + max(0, level - headings[0][1]))} {text}\n"
    elif headings and (headings[0][1] == 1 or headings[0][2] == title):
        del lines[headings[0][0]]
    return "".join(lines)


def find_pages() -> dict[str, list[tuple[Path, set[str]]]]:
    """Return for each file of the repository the pages of the site that contain it, with their anchors."""
    pages: dict[str, list[tuple[Path, set[str]]]] = {}
    for page in sorted(DOCS.rglob("*.md")):
        for file, options in find_blocks(page.read_text(encoding="utf-8"), "repository-page"):
            part = cut_part((ROOT / file).read_text(encoding="utf-8"), options)
            anchors = {make_anchor(title) for _, _, title in find_headings(part)}
            pages.setdefault(file, []).append((page, anchors))
    return pages


def resolve_link(
    target: str, base: Path, page: Path, pages: Mapping[str, list[tuple[Path, set[str]]]]
) -> str:
    """Return a link of a page as the site needs it.

    target: as written. base: the folder to which it is relative.
    """
    path, mark, anchor = target.partition("#")
    if re.match(r"[a-z]+:|/", path) or not path:
        return target
    file = Path(os.path.normpath(base / path))
    if file.is_relative_to(DOCS) or not file.exists():
        return os.path.relpath(file, page.parent) + mark + anchor
    name = file.relative_to(ROOT).as_posix()
    for containing, anchors in pages.get(name, []):
        if not anchor or anchor in anchors:
            return os.path.relpath(containing, page.parent) + mark + anchor
    return f"{URL}/{'tree' if file.is_dir() else 'blob'}/main/{name}{mark}{anchor}"


def resolve_links(text: str, base: Path, page: Path, pages: Mapping[str, Any]) -> str:
    """Return a text with all its links resolved, except in code; images stay relative files."""

    def replace(found: re.Match[str]) -> str:
        target = found["target"]
        if found[1].startswith("!"):
            if re.match(r"[a-z]+:", target):
                return found[0]
            return f"{found[1]}]({os.path.relpath(os.path.normpath(base / target), page.parent)})"
        return f"{found[1]}]({resolve_link(target, base, page, pages)})"

    def resolve_line(line: str) -> str:
        parts = _CODE_SPAN.split(line)
        return "".join(part if k % 2 else _LINK.sub(replace, part) for k, part in enumerate(parts))

    return "".join(line if is_code else resolve_line(line) for line, is_code in mark_code(text))


def _read_page(app: Any, docname: str, source: list[str]) -> None:
    page = Path(app.env.doc2path(docname))
    if page.suffix != ".md":
        return
    pages = app.env.lcorpp_repository_pages
    text = resolve_links(source[0], page.parent, page, pages)
    title = next((title for _, level, title in find_headings(text) if level == 1), None)

    def expand(file: str, options: Mapping[str, str]) -> str:
        app.env.note_dependency(str(ROOT / file))
        part = cut_part((ROOT / file).read_text(encoding="utf-8"), options)
        return resolve_links(fit_headings(part, title), (ROOT / file).parent, page, pages)

    source[0] = expand_blocks(text, "repository-page", expand)


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.connect("builder-inited", lambda app: setattr(app.env, "lcorpp_repository_pages", find_pages()))
    app.connect("source-read", _read_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
