"""Numbers in the text of a program: replace those of pr-atoms, and keep comments and layout."""

from __future__ import annotations

from collections.abc import Mapping

from lcorpp.errors import ProgramError
from lcorpp.reasoning.language.lexer import END, Cursor


def replace_numbers(text: str, numbers: Mapping[tuple[int, int], str], file: str) -> str:
    """Replace the numbers of pr-atoms.

    Args:
        numbers: (line, column) of a statement -> its new number.

    Raises:
        ProgramError: no pr-atom begins at a given place.
    """
    cursor, remaining = Cursor(text, file), dict(numbers)
    parts: list[str] = []
    copied = 0
    while cursor.kind != END:
        place = cursor.at.line, cursor.at.column
        if place in remaining and (cursor.word == "pr" or cursor.texts[cursor.index - 1] == "["):
            first = last = 0
            while cursor.kind not in (".", END):
                last = cursor.index
                if cursor.take() in ("=", "=="):
                    first = cursor.index  # the number is between the last equals sign and the full stop
            if first:
                parts += [text[copied : cursor.starts[first]], remaining.pop(place)]
                copied = cursor.starts[last] + len(cursor.texts[last])
        cursor.index += 1
    if remaining:
        line, column = next(iter(remaining))
        raise ProgramError(f"{file}:{line}:{column}: expected the pr-atom of the program, not another text")
    return "".join([*parts, text[copied:]])
