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
    cursor = Cursor(text, file)
    parts: list[str] = []
    copied, remaining = 0, dict(numbers)
    while cursor.kind != END:
        at = cursor.at.line, cursor.at.column
        if at in remaining and (cursor.word == "pr" or cursor.texts[cursor.index - 1] == "["):
            start, end = _find_number(cursor)
            parts += [text[copied:start], remaining.pop(at)]
            copied = end
        cursor.index += 1
    if remaining:
        line, column = next(iter(remaining))
        raise ProgramError(f"{file}:{line}:{column}: expected the pr-atom of the program, not another text")
    return "".join([*parts, text[copied:]])


def _find_number(cursor: Cursor) -> tuple[int, int]:
    """Return the offsets of the first and after the last character of the number of the next pr-atom."""
    texts, starts = cursor.texts, cursor.starts
    index = texts.index("pr", cursor.index) + 1
    depth = 0
    while index < len(starts):  # to the bracket that closes `pr(`
        depth += {"(": 1, ")": -1}.get(texts[index], 0)
        index += 1
        if not depth:
            break
    first = index + 1  # after the equals sign
    last = texts.index(".", first) - 1
    cursor.index = last
    return starts[first], starts[last] + len(texts[last])
