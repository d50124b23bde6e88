"""Limits of TOML texts: size, parts of a key, in which tomllib takes quadratic time, and integers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lcorpp.errors import DomainError, ParseError

MAX_TOML_BYTES = 2**22
"""Maximum size of a file."""

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


def check_key_parts(path: Path, text: str) -> None:
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
                raise ParseError(str(path), line, column, message, shown)
        elif token[0] in "=,#[]{}\n":
            dots = 0
        line += token.count("\n")


def check_integers(path: Path, table: Mapping[str, Any]) -> None:
    """Raise `DomainError` if an integer has more than the 64 bits of TOML, e.g. more than any float."""
    pending: list[Any] = [table]
    while pending:
        value = pending.pop()
        if isinstance(value, dict | list):
            pending.extend(value.values() if isinstance(value, dict) else value)
        elif type(value) is int and not -(2**63) <= value < 2**63:
            raise DomainError(f"{path}: an integer of {value.bit_length()} bits; TOML has 64")
