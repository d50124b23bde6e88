"""Blocks that pages of the site contain instead of a copied or hand-kept text, e.g. the options of a command.

A block looks like a directive, and is replaced by Markdown before the page is parsed:

    ```{command} solve
    ```
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping

_BLOCK = r"^```\{%s\} (?P<argument>\S.*)\n(?P<options>(?::\w+: .*\n)*)```$"
_FENCE = re.compile(r"^ *(`{3,}|~{3,}|:{3,})")


def find_blocks(text: str, name: str) -> Iterator[tuple[str, Mapping[str, str]]]:
    """Return argument and options of each block of this name."""
    for found in re.finditer(_BLOCK % re.escape(name), text, re.MULTILINE):
        yield found["argument"], _read_options(found)


def expand_blocks(text: str, name: str, expand: Callable[[str, Mapping[str, str]], str]) -> str:
    """Return the text with each block of this name replaced by `expand(argument, options)`."""
    return re.sub(
        _BLOCK % re.escape(name),
        lambda found: expand(found["argument"], _read_options(found)),
        text,
        flags=re.MULTILINE,
    )


def _read_options(found: re.Match[str]) -> Mapping[str, str]:
    pairs = (line[1:].split(": ", 1) for line in found["options"].splitlines())
    return {key: value.strip() for key, value in pairs}


def mark_code(text: str) -> Iterator[tuple[str, bool]]:
    """Return each line of a page, and whether it belongs to a block of code, its fences included."""
    fence = ""
    for line in text.splitlines(keepends=True):
        found = _FENCE.match(line)
        if not fence and found:
            fence = found[1]
            yield line, True
        elif fence and found and found[1].startswith(fence) and line.strip() == found[1]:
            fence = ""
            yield line, True
        else:
            yield line, bool(fence)
