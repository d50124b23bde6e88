"""The words of a .pomdp file, with their places."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import islice
from math import inf

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ParseError
from lcorpp.planning.formats.numbers import NUMBER, is_number
from lcorpp.values import Array

PREAMBLE = ("discount", "values", "states", "actions", "observations")
TABLES = ("T", "O", "R")

ROW_TOLERANCE = 1e-4
"""Published files print few digits: rows off by up to 5e-6 are common; beyond this they are wrong."""

LEAST_AT_ONCE, MOST_AT_ONCE = 4, 8192
"""How many plain entries are looked for together: the words of the most need little room."""

Places = npt.NDArray[np.int64]
"""Offsets into the text."""

_SKIP = r"\s*+(?:#[^\r\n]*+\s*+)*+"  # white space and comments; a comment needs no space before it
_WORD = r"[^\s:#]++"
_FIRST = re.compile(_SKIP)
_TOKEN = re.compile(rf"(:|{_WORD}){_SKIP}")
_KEYWORDS = "|".join((*PREAMBLE, *TABLES, rf"start(?:(?![^\s:#]){_SKIP}(?:include|exclude))?+"))
_STATEMENT = re.compile(rf"(?:{_KEYWORDS}){_SKIP}:")
_COMMENT = re.compile(r"#[^\r\n]*+")
_LINE_END = re.compile(r"\r\n|\r|\n")


def _entry(keyword: str, names: int) -> re.Pattern[str]:
    """A whole entry, ``T: a : s : s' 0.5``, with a stray colon before its number or not."""
    references = rf":{_SKIP}({_WORD}){_SKIP}" * names
    return re.compile(rf"{keyword}{_SKIP}{references}(?::{_SKIP})?+({NUMBER})(?![^\s:#]){_SKIP}")


_ENTRIES = {"T": _entry("T", 3), "O": _entry("O", 3), "R": _entry("R", 4)}


@lru_cache(maxsize=64)
def _numbers(count: int) -> re.Pattern[str]:
    return re.compile(rf"(?:{NUMBER}(?![^\s:#]){_SKIP}){{{count}}}+")


class Tokens:
    """A cursor over the tokens of one text: colons and words, comments left out.

    text: all of it. at: the offset of the next token; the length of the text past the last one.
    """

    def __init__(self, text: str, file: str) -> None:
        self.file, self.text = file, text
        self._ahead: list[tuple[str, int]] = []  # tokens from `at` on, each with where the next one begins
        first = _FIRST.match(text)
        self.at = self._first = first.end() if first else 0
        self._batch = LEAST_AT_ONCE  # doubled while entries are plain, so that few words are read in vain

    def _move(self, at: int) -> None:
        self.at = at
        self._ahead.clear()

    def peek(self, ahead: int = 0) -> str:
        """A token ahead, "" past the end."""
        known = self._ahead
        while len(known) <= ahead:
            match = _TOKEN.match(self.text, known[-1][1] if known else self.at)
            if match is None:
                return ""
            known.append((match[1], match.end()))
        return known[ahead][0]

    def take(self) -> str:
        """Step over the next token and return it, "" past the end."""
        word = self.peek()
        if self._ahead:
            self.at = self._ahead.pop(0)[1]
        return word

    def done(self) -> bool:
        """Whether all tokens are read."""
        return self.at >= len(self.text)

    def at_statement(self) -> bool:
        """Whether the next token begins a statement: a keyword with its colon."""
        return _STATEMENT.match(self.text, self.at) is not None

    # --- what is said of an issue ---

    def error(self, message: str, at: int | None = None) -> ParseError:
        """A ParseError at an offset, by default that of the next token or else the end of the text."""
        offset = min(self.at if at is None else at, len(self.text.rstrip()))
        line, start = 1, 0
        for match in _LINE_END.finditer(self.text, 0, offset):
            line, start = line + 1, match.end()
        end = _LINE_END.search(self.text, start)
        return ParseError(
            self.file, line, offset - start + 1, message, self.text[start : end.start() if end else None]
        )

    def found(self) -> str:
        """The next token for a message."""
        return repr(self.peek()) if not self.done() else "the end of the file"

    def stray(self) -> ParseError:
        """The error for what stands where a statement must begin."""
        if is_number(self.peek()) and self.at != self._first:
            return self.error(f"too many numbers: {self.peek()} is left over; expected a new statement")
        names = ", ".join(f"{name}:" for name in (*PREAMBLE, "start", *TABLES))
        return self.error(f"expected one of {names}, found {self.found()}")

    def offset(self, start: int, count: int) -> int:
        """Where the token begins that comes `count` tokens after the one at an offset."""
        for match in islice(_TOKEN.finditer(self.text, start), count):
            start = match.end()
        return start

    def _word(self, at: int) -> str:
        match = _TOKEN.match(self.text, at)
        return match[1] if match else ""

    # --- numbers ---

    def numbers(self, count: int, what: str, rows: int = 1) -> tuple[Array, Places]:
        """The next rows * count numbers; `what` names them in messages.

        Returns:
            (rows, count) the numbers, and (rows,) the offset of the first one of each row.
        """
        first = self.at
        if 2 * rows * count - 1 > len(self.text) - first:  # perhaps there is no room for the array
            raise self._no_numbers(rows * count, what)
        pattern = _numbers(count)
        values = np.empty((rows, count))
        places = np.empty(rows, dtype=np.int64)
        at, finite = first, True
        for row in range(rows):
            match = pattern.match(self.text, at)
            if match is None:
                raise self._no_numbers(rows * count, what)
            words = match[0] if "#" not in match[0] else _COMMENT.sub(" ", match[0])
            found = list(map(float, words.split()))
            finite = finite and inf not in found and -inf not in found
            values[row] = found
            places[row], at = at, match.end()
        if not finite:
            at = self.offset(first, int(np.argmin(np.isfinite(values))))
            raise self.error(f"{self._word(at)} is too large for a number", at)
        self._move(at)
        return values, places

    def _no_numbers(self, count: int, what: str) -> ParseError:
        """The error for `count` numbers that are not all there."""
        needed = "a number" if count == 1 else f"{count} numbers"
        for index in range(count):
            word = self.peek()
            if not word:
                return self.error(f"{what} needs {needed}, found {index} before the end of the file")
            if not is_number(word):
                return self.error(f"{what} needs {needed}, found {index} and then {word!r}")
            self.take()
        raise AssertionError(f"{what}: all numbers are there")

    def probabilities(self, count: int, what: str, rows: int = 1) -> tuple[Array, Places]:
        """`numbers`, each a probability as far as one number can tell."""
        first = self.at
        values, places = self.numbers(count, what, rows)
        if values.min() < 0:
            at = self.offset(first, int(values.argmin()))
            raise self.error(f"negative probability {self._word(at)} in {what}", at)
        if values.max() > 1 + ROW_TOLERANCE:
            at = self.offset(first, int(values.argmax()))
            raise self.error(f"{self._word(at)} is no probability in {what}", at)
        return values, places

    def entries(
        self, known: Sequence[Mapping[str, int]], least: float, most: float
    ) -> tuple[npt.NDArray[np.int64], Array, Places] | None:
        """Plain entries of one table that come next, up to some number; None where there is none.

        A plain entry has nothing but names that are known and a number from `least` to `most`. What is not
        plain is left to whoever reads statements one at a time and can say what is wrong.

        Args:
            known: for each reference of an entry the names and their indices.

        Returns:
            (n, references) indices, (n,) numbers and (n,) offsets of the numbers.
        """
        pattern = _ENTRIES[self.peek()]
        matches: list[re.Match[str]] = []
        at = self.at
        while len(matches) < self._batch and (match := pattern.match(self.text, at)) is not None:
            matches.append(match)
            at = match.end()
        n = len(matches)
        if not n:
            return None
        columns = list(zip(*(match.groups() for match in matches), strict=True))
        indices = [list(map(names.get, column)) for names, column in zip(known, columns, strict=False)]
        for column in indices:
            if None in column:
                n = min(n, column.index(None))
        values = list(map(float, columns[-1][:n])) if n else []
        if values and not least <= min(values) <= max(values) <= most:
            n = next(i for i, value in enumerate(values) if not least <= value <= most)
        self._batch = min(2 * self._batch, MOST_AT_ONCE) if n == self._batch else LEAST_AT_ONCE
        if not n:
            return None
        self._move(matches[n - 1].end())
        places = [match.start(len(known) + 1) for match in matches[:n]]
        return np.array([column[:n] for column in indices]).T, np.array(values[:n]), np.array(places)
