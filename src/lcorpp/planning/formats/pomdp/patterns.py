"""Regular expressions of the parts of .pomdp text, for bytes in UTF-8."""

from __future__ import annotations

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

NUMBER = rb"%s(?:(?![^\s:#])|(?=%s))" % (_NUMBER, _KEYWORD)
"""A word that is a number, or a number that ends before a keyword."""
