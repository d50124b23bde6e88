"""The words of a .pomdp file, with their places."""

from __future__ import annotations

import re

import numpy as np

from lcorpp.errors import ParseError
from lcorpp.values import Array

PREAMBLE = ("discount", "values", "states", "actions", "observations")
TABLES = ("T", "O", "R")

_TOKEN = re.compile(r"#[^\r\n]*|:|[^\s:#]+")
_LINE_END = re.compile(r"\r\n|\r|\n")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


def is_number(text: str) -> bool:
    """Whether `text` is a number of the format; ``nan``, ``inf`` and ``1_0`` are not."""
    return _NUMBER.fullmatch(text) is not None


def is_count(text: str) -> bool:
    """Whether `text` is a whole number without a sign."""
    return text.isascii() and text.isdigit()


class Tokens:
    """A cursor over the tokens of one text: colons and words, comments left out.

    texts: the tokens. at: index of the next one.
    """

    def __init__(self, text: str, file: str) -> None:
        self.file, self._text = file, text
        self.texts: list[str] = []
        self._offsets: list[int] = []
        for match in _TOKEN.finditer(text):
            token = match.group()
            if token[0] != "#":
                self.texts.append(token)
                self._offsets.append(match.start())
        self.at = 0

    def peek(self, ahead: int = 0) -> str:
        """A token ahead, "" past the end."""
        index = self.at + ahead
        return self.texts[index] if index < len(self.texts) else ""

    def done(self) -> bool:
        """Whether all tokens are read."""
        return self.at >= len(self.texts)

    def at_statement(self) -> bool:
        """Whether the next token begins a statement: a keyword with its colon."""
        if self.peek() == "start" and self.peek(1) in ("include", "exclude"):
            return self.peek(2) == ":"
        return self.peek(1) == ":" and (self.peek() in PREAMBLE + TABLES or self.peek() == "start")

    def error(self, message: str, index: int | None = None) -> ParseError:
        """A ParseError at a token (default: the next one); past the last token it is the end of the text."""
        index = self.at if index is None else index
        offset = self._offsets[index] if index < len(self._offsets) else len(self._text.rstrip())
        line, start = 1, 0
        for match in _LINE_END.finditer(self._text, 0, offset):
            line, start = line + 1, match.end()
        end = _LINE_END.search(self._text, start)
        return ParseError(
            self.file, line, offset - start + 1, message, self._text[start : end.start() if end else None]
        )

    def found(self) -> str:
        """The next token for a message."""
        return repr(self.peek()) if not self.done() else "the end of the file"

    def skip_colon(self) -> None:
        """Step over the colon that must be next."""
        if self.peek() != ":":
            raise self.error(f"expected ':', found {self.found()}")
        self.at += 1

    def numbers(self, count: int, what: str) -> Array:
        """(count,) the next numbers; `what` names them in messages."""
        texts = self.texts[self.at : self.at + count]
        for i, text in enumerate(texts):
            if not is_number(text):
                self.at += i
                raise self.error(f"{what} needs {_numbers(count)}, found {i} and then {text!r}")
        if len(texts) < count:
            self.at = len(self.texts)
            raise self.error(f"{what} needs {_numbers(count)}, found {len(texts)} before the end of the file")
        values = np.array([float(text) for text in texts])
        if not np.isfinite(values).all():
            self.at += int(np.argmin(np.isfinite(values)))
            raise self.error(f"{self.peek()} is too large for a number")
        self.at += count
        return values

    def probabilities(self, count: int, what: str) -> Array:
        """(count,) the next numbers, each a probability as far as one number can tell."""
        first = self.at
        values = self.numbers(count, what)
        if values.min() < 0:
            index = int(values.argmin())
            raise self.error(f"negative probability {self.texts[first + index]} in {what}", first + index)
        if values.max() > 1 + ROW_TOLERANCE:
            index = int(values.argmax())
            raise self.error(f"{self.texts[first + index]} is no probability in {what}", first + index)
        return values


ROW_TOLERANCE = 1e-4
"""Published files print few digits: rows off by up to 5e-6 are common; beyond this they are wrong."""


def _numbers(count: int) -> str:
    return "a number" if count == 1 else f"{count} numbers"
