"""Docstrings as reStructuredText: they are plain text with backticks, sections as Google's, and fields.

A field of a class is a line `name: text`, without a heading; several may share a line.
"""

from __future__ import annotations

import re
from itertools import groupby
from operator import itemgetter

_SECTION = re.compile(r"[A-Z]\w*( \w+)?:")
_SPAN = re.compile(r"(``.+?``|`[^`]+`)", re.DOTALL)


def convert_docstring(lines: list[str], names: set[str]) -> None:
    """Rewrite a docstring for napoleon.

    names: the fields, or the parameters of a function.
    """
    _split_fields(lines, names)
    result = list[str]()
    for part, is_code in _split_code(lines):
        if is_code and part[0].startswith(" ") and not part[0].lstrip().startswith(">>>"):
            result += ["::", ""]
        result += part if is_code else _escape("\n".join(part)).split("\n")
    lines[:] = result


def escape_references(lines: list[str]) -> None:
    """Escape what reStructuredText takes for references, after napoleon: underscores at the ends of names."""
    result = list[str]()
    for part, is_code in _split_code(lines):
        result += part if is_code else _escape_names("\n".join(part)).split("\n")
    lines[:] = result


def _split_code(lines: list[str]) -> list[tuple[list[str], bool]]:
    """Return the parts of a docstring that are code or not."""
    groups = groupby(_mark_code(lines), key=itemgetter(1))
    return [([line for line, _ in group], is_code) for is_code, group in groups]


def _mark_code(lines: list[str]) -> list[tuple[str, bool]]:
    """Return each line and whether it is code: an indented block after an empty line, or of doctest."""
    marked = list[tuple[str, bool]]()
    before, mode = "", ""
    for k, line in enumerate(lines):
        is_empty = not line.strip()
        follows_empty = k > 0 and not lines[k - 1].strip()
        if line.lstrip().startswith(">>>"):
            mode = "doctest"
        elif (mode == "doctest" and is_empty) or (mode == "block" and line[:1].strip()):
            mode = ""
        elif not mode and line.startswith("    ") and follows_empty and before[:1].strip():
            mode = "" if _SECTION.fullmatch(before) else "block"
        marked.append((line, bool(mode)))
        before = before if is_empty else line
    return marked


def _escape(text: str) -> str:
    """Escape asterisks and bars outside of backticks, except those of parameters `*args:`."""
    parts = _SPAN.split(text)
    for k, part in enumerate(parts):
        if k % 2 == 0:
            parts[k] = re.sub(r"(?<!\\)([*|])(?!\*?\w+:)", r"\\\1", part)
            if k and re.match(r"\w", part):
                parts[k] = "\\ " + parts[k]
    return "".join(parts)


def _escape_names(text: str) -> str:
    parts = _SPAN.split(text)
    parts[::2] = [re.sub(r"(?<=\w)(?<!\\)_(?![\w`])", r"\\_", part) for part in parts[::2]]
    return re.sub(r"(?<=[*)]) -- ", " – ", "".join(parts))  # napoleon's, between a name and its text


def _split_fields(lines: list[str], names: set[str]) -> None:
    """Put fields into a section "Fields", and each field or parameter on a line of its own."""
    if not names:
        return
    name = "(?:" + "|".join(sorted(map(re.escape, names), key=len, reverse=True)) + ")"
    entry = re.compile(rf"(?P<names>\*{{0,2}}{name}(?:, {name})*):(?: +|$)(?P<text>.*)")
    begins = re.compile(rf"(?<=[.;)] )(?={name}(?:, {name})*: )")
    result: list[str] = []
    is_open = False
    for line in lines:
        text = line.strip()
        indent = line[: len(line) - len(line.lstrip())]
        for part in begins.split(text) if entry.match(text) else [text]:
            part, found = part.strip(), entry.match(part)
            if found and not indent:
                result += [] if is_open else ["", "Fields:"]
                result.append(f"    {found['names']}: {found['text'].strip()}")
                is_open = True
            elif is_open and part:
                result.append(f"        {part}")
            else:
                is_open = is_open and bool(part)
                result.append(indent + part)
    lines[:] = result
