"""Names with any characters: how a name is written in a program, and its text in answers and evidence.

A name of P-log begins with a small letter. Another one is written in quotes, ``'HISTORY'`` or ``'12+'``; its
text, the key of evidence and answers, is without them unless the text would then mean something else.
"""

from __future__ import annotations

import re
from functools import lru_cache

_PLAIN = re.compile(r"[a-z][A-Za-z0-9_']*")

_SAFE = re.compile(r"[^\s'\"(),?|{}\[\]%#\\]+")
"""Names whose text needs no quotes, as neither arguments nor joints can be read into it."""

_RESERVED = frozenset(
    {"attributes", "boolean", "do", "mod", "not", "obs", "or", "and", "pr", "random", "sorts", "statements"}
)

_ESCAPED = re.compile(r"\\(.)")


def make_name_text(name: str) -> str:
    """Return the text of a name: itself, or in quotes if it would mean something else, such as an integer."""
    if _SAFE.fullmatch(name) and name not in _RESERVED and not name.removeprefix("-").isdigit():
        return name
    escaped = name.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"


def make_value_text(name: str) -> str:
    """Return the text of a value: an integer of at most nine digits is itself, others are names."""
    digits = name.removeprefix("-")
    is_short = digits.isdigit() and digits.isascii() and len(digits) < 10
    return name if is_short and str(int(name)) == name else make_name_text(name)


def strip_quotes(text: str) -> str:
    """Return the characters of a name, given its text."""
    return _ESCAPED.sub(r"\1", text[1:-1]) if text.startswith("'") else text


def unquote(token: str) -> str:
    """Return the text of a name that is written in quotes."""
    return make_name_text(_ESCAPED.sub(r"\1", token[1:-1]))


@lru_cache(4096)
def write_name(text: str) -> str:
    """Write a name or an integer, given its text, as the parser reads it; ``#s`` is a sort."""
    is_written_so = (
        text.startswith(("'", "#")) or _PLAIN.fullmatch(text) or text.removeprefix("-").isdecimal()
    )
    return text if is_written_so else f"'{text}'"


def is_quoted(text: str) -> bool:
    """Whether a name, given its text, is written in quotes; an integer is not."""
    return text.startswith("'") or write_name(text) != text
