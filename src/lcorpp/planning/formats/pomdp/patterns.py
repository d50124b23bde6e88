"""Regular expressions of the parts of .pomdp text, for bytes in UTF-8."""

from __future__ import annotations

import re

from lcorpp.planning.formats import numbers

SKIP = rb"\s*+(?:#[^\r\n]*+\s*+)*+"
"""White space and comments; a comment needs no space before it."""

_ROW = rb"(?:identity|uniform|reset)(?![^\s:#])"
_PREAMBLE = rb"(?:discount|values|states|actions|observations|start)\s*+:"
_KEYWORD = rb"%s|%s|[TOR]\s*+:" % (_ROW, _PREAMBLE)

# As for pomdp-solve, a number ends before a keyword, but names may start with digits here: 3R is one.
_NUMBER = numbers.NUMBER.encode()
_BEFORE_KEYWORD = rb"[0-9]++(?=%s|%s)|[0-9]*+\.[0-9]*+(?=%s)" % (_ROW, _PREAMBLE, _KEYWORD)

WORD = rb"(?:\*|%s|[^\s:#*][^\s:#]*+)" % _BEFORE_KEYWORD
"""A name, a number or a star, which needs no space after it."""

_SIGN = rb"(?:[+-]%s(?=[0-9.]))?" % SKIP

NUMBER = rb"%s%s(?:(?![^\s:#])|(?=%s))" % (_SIGN, _NUMBER, _KEYWORD)
"""A word that is a number, or a number that ends before a keyword. A sign is a token of its own: `- 5`."""

_SIGN_WITH_SPACE = re.compile(rb"([+-])%s" % SKIP)


def join_signs(numbers: bytes) -> bytes:
    """Return numbers without the white space and comments behind their signs."""
    return _SIGN_WITH_SPACE.sub(rb"\1", numbers)
