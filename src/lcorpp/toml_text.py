"""Text of TOML files: parsed with the place of each error, whatever the text is."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any

from lcorpp.errors import LcorppError, ParseError

MAX_KEY_PARTS = 32
"""Maximum number of parts of a dotted key."""

_TOKEN = re.compile(
    r'"""(?:[^\\]|\\.)*?(?:"""|\Z)'
    r"|'''.*?(?:'''|\Z)"
    r'|"(?:[^"\\\n]|\\.)*"?'
    r"|'[^'\n]*'?"
    r"|#[^\n]*"
    r"|[\w-]+"
    r"|[^\S\n]+"
    r"|.",
    re.DOTALL,
)


def parse_toml(file: str, text: str, error: type[LcorppError]) -> dict[str, Any]:
    """Parse a text.

    Args:
        error: the type of errors without a place.

    Raises:
        ParseError: the text is not TOML, or a key has more than `MAX_KEY_PARTS` parts.
        LcorppError: it is nested too deeply, or a number is too long.
    """
    _check_key_parts(file, text)
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as found:
        raise _make_parse_error(found, file, text) from None
    except (RecursionError, ValueError) as found:  # nested too deeply; a number of thousands of digits
        raise error(f"{file}: cannot be read: {found}") from None
    _check_integers(file, table, error)
    return table


def _check_key_parts(file: str, text: str) -> None:
    """Raise `ParseError` if a key has more than `MAX_KEY_PARTS` parts."""
    if text.count(".") < MAX_KEY_PARTS:
        return
    dots, line = 0, 1  # dots since the last token that is neither a part of a key nor white space
    for match in _TOKEN.finditer(text):
        token = match[0]
        if token == ".":
            dots += 1
            if dots >= MAX_KEY_PARTS:
                start = text.rfind("\n", 0, match.start()) + 1
                column, shown = match.start() - start + 1, text[start : start + 10_000].partition("\n")[0]
                message = f"a key of more than {MAX_KEY_PARTS} parts"
                raise ParseError(file, line, column, message, shown)
        elif token[0] in "=,#[]{}\n":
            dots = 0
        line += token.count("\n")


def _check_integers(file: str, table: Mapping[str, Any], error: type[LcorppError]) -> None:
    """Raise an error if an integer has more than the 64 bits of TOML, e.g. more than any float."""
    pending: list[Any] = [table]
    while pending:
        value = pending.pop()
        if isinstance(value, dict | list):
            pending.extend(value.values() if isinstance(value, dict) else value)
        elif type(value) is int and not -(2**63) <= value < 2**63:
            raise error(f"{file}: an integer of {value.bit_length()} bits; TOML has 64")


def _make_parse_error(error: tomllib.TOMLDecodeError, file: str, text: str) -> ParseError:
    """Return the error with the line and column that tomllib appends to its message."""
    lines = text.splitlines()
    match = re.search(r"\s*\(at line (\d+), column (\d+)\)", str(error))
    # the alternative is "(at end of document)": after the last character
    line = int(match[1]) if match else max(len(lines), 1)
    column = int(match[2]) if match else (len(lines[-1]) + 1 if lines else 1)
    message = re.sub(r"\s*\(at [^)]*\)", "", str(error))
    if message == r"Illegal character '\n'":
        message = "a text without its closing quote"
    elif message == "Unclosed array":
        message = "a list without ',' or ']' here"
    return ParseError(file, line, column, message, lines[line - 1] if line <= len(lines) else "")
