"""Regular expressions of the parts of .pomdp text, for bytes in UTF-8."""

from __future__ import annotations

from lcorpp.planning.formats import numbers

SKIP = rb"\s*+(?:#[^\r\n]*+\s*+)*+"
"""White space and comments; a comment needs no space before it."""

WORD = rb"(?:\*|[^\s:#*][^\s:#]*+)"
"""A name, a number or a star, which needs no space after it."""

NUMBER = numbers.NUMBER.encode() + rb"(?![^\s:#])"
"""A word that is a number."""
