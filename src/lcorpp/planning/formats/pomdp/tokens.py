"""Tokens of a .pomdp file, with their offsets in the text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import islice
from math import inf

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ParseError
from lcorpp.planning.formats.numbers import NUMBER, ROW_TOLERANCE, is_number
from lcorpp.values import Array

PREAMBLE_KEYWORDS = ("discount", "values", "states", "actions", "observations")
TABLE_KEYWORDS = ("T", "O", "R")

MIN_BATCH, MAX_BATCH = 4, 8192
"""How many plain entries are matched at once."""

Offsets = npt.NDArray[np.int64]
"""Offsets in the text."""

_SKIP = r"\s*+(?:#[^\r\n]*+\s*+)*+"  # white space and comments; a comment needs no space before it
_WORD = r"(?:\*|[^\s:#*][^\s:#]*+)"  # a star is a word of its own, also without a space after it
_FIRST = re.compile(_SKIP)
_TOKEN = re.compile(rf"(:|{_WORD}){_SKIP}")
_KEYWORDS = "|".join(
    (*PREAMBLE_KEYWORDS, *TABLE_KEYWORDS, rf"start(?:(?![^\s:#]){_SKIP}(?:include|exclude))?")
)
_STATEMENT = re.compile(rf"(?:{_KEYWORDS}){_SKIP}:")
_COMMENT = re.compile(r"#[^\r\n]*+")
_LINE_END = re.compile(r"\r\n|\r|\n")


def _make_entry_pattern(keyword: str, names: int) -> re.Pattern[str]:
    """Pattern of an entry, ``T: a : s : s' 0.5``, optionally with a stray colon before its number."""
    references = rf":{_SKIP}({_WORD}){_SKIP}" * names
    return re.compile(rf"{keyword}{_SKIP}{references}(?::{_SKIP})?({NUMBER})(?![^\s:#]){_SKIP}")


_ENTRIES = {keyword: _make_entry_pattern(keyword, names) for keyword, names in (("T", 3), ("O", 3), ("R", 4))}


@lru_cache(maxsize=64)
def _make_numbers_pattern(count: int) -> re.Pattern[str]:
    return re.compile(rf"(?:{NUMBER}(?![^\s:#]){_SKIP}){{{count}}}+")


class Tokens:
    """A cursor over the tokens of one text: colons and words, without comments.

    text: the whole text. offset: of the next token; the length of the text after the last one.
    """

    def __init__(self, text: str, file: str) -> None:
        self.file, self.text = file, text
        self._ahead: list[tuple[str, int]] = []  # tokens from `offset` on, each with the next one's offset
        first = _FIRST.match(text)
        self.offset = self._first = first.end() if first else 0
        self._batch = MIN_BATCH  # doubles while entries are plain, so that few words are matched in vain

    def _move_to(self, offset: int) -> None:
        self.offset = offset
        self._ahead.clear()

    def peek(self, ahead: int = 0) -> str:
        """Return a token ahead, "" after the last one."""
        known = self._ahead
        while len(known) <= ahead:
            match = _TOKEN.match(self.text, known[-1][1] if known else self.offset)
            if match is None:
                return ""
            known.append((match[1], match.end()))
        return known[ahead][0]

    def take(self) -> str:
        """Advance by one token and return it, "" after the last one."""
        word = self.peek()
        if self._ahead:
            self.offset = self._ahead.pop(0)[1]
        return word

    def at_end(self) -> bool:
        """Return whether all tokens have been read."""
        return self.offset >= len(self.text)

    def at_statement(self) -> bool:
        """Return whether the next token starts a statement: a keyword with its colon."""
        return _STATEMENT.match(self.text, self.offset) is not None

    # --- errors ---

    def error(self, message: str, offset: int | None = None) -> ParseError:
        """Return a ParseError at an offset; by default that of the next token, or the end of the text."""
        place = min(self.offset if offset is None else offset, len(self.text.rstrip()))
        line, start = 1, 0
        for match in _LINE_END.finditer(self.text, 0, place):
            line, start = line + 1, match.end()
        end = _LINE_END.search(self.text, start)
        return ParseError(
            self.file, line, place - start + 1, message, self.text[start : end.start() if end else None]
        )

    def describe_next(self) -> str:
        """Return the next token, for a message."""
        return repr(self.peek()) if not self.at_end() else "the end of the file"

    def unexpected_token(self) -> ParseError:
        """Return the error for a token that should start a statement but does not."""
        if is_number(self.peek()) and self.offset != self._first:
            return self.error(f"too many numbers: {self.peek()} is left over; expected a new statement")
        names = ", ".join(f"{name}:" for name in (*PREAMBLE_KEYWORDS, "start", *TABLE_KEYWORDS))
        return self.error(f"expected one of {names}, found {self.describe_next()}")

    def _find_token(self, start: int, count: int) -> tuple[str, int]:
        """Return the token that is `count` tokens after the one at an offset, and its own offset."""
        match = next(islice(_TOKEN.finditer(self.text, start), count, None))
        return match[1], match.start()

    # --- numbers ---

    def numbers(self, count: int, what: str, rows: int = 1) -> tuple[Array, Offsets]:
        """Read rows * count numbers; `what` describes them in messages.

        Returns:
            (rows, count) the numbers, and (rows,) the offset of the first number of each row.
        """
        first = self.offset
        if 2 * rows * count - 1 > len(self.text) - first:  # too short a text; do not allocate the array
            raise self._make_missing_numbers_error(rows * count, what)
        pattern = _make_numbers_pattern(count)
        values = np.empty((rows, count))
        offsets = np.empty(rows, dtype=np.int64)
        at, finite = first, True
        for row in range(rows):
            match = pattern.match(self.text, at)
            if match is None:
                raise self._make_missing_numbers_error(rows * count, what)
            words = match[0] if "#" not in match[0] else _COMMENT.sub(" ", match[0])
            numbers = list(map(float, words.split()))
            finite = finite and inf not in numbers and -inf not in numbers
            values[row] = numbers
            offsets[row], at = at, match.end()
        if not finite:
            word, at = self._find_token(first, int(np.argmin(np.isfinite(values))))
            raise self.error(f"{word} is too large for a number", at)
        self._move_to(at)
        return values, offsets

    def _make_missing_numbers_error(self, count: int, what: str) -> ParseError:
        """Return the error if fewer than `count` numbers follow."""
        needed = "a number" if count == 1 else f"{count} numbers"
        for index in range(count):
            word = self.peek()
            if not word:
                return self.error(f"{what} needs {needed}, found {index} before the end of the file")
            if not is_number(word):
                return self.error(f"{what} needs {needed}, found {index} and then {word!r}")
            self.take()
        raise AssertionError(f"{what}: no number is missing")

    def probabilities(self, count: int, what: str, rows: int = 1) -> tuple[Array, Offsets]:
        """`numbers`, each checked to be between 0 and 1."""
        first = self.offset
        values, offsets = self.numbers(count, what, rows)
        if values.min() < 0:
            word, at = self._find_token(first, int(values.argmin()))
            raise self.error(f"negative probability {word} in {what}", at)
        if values.max() > 1 + ROW_TOLERANCE:
            word, at = self._find_token(first, int(values.argmax()))
            raise self.error(f"{word} is no probability in {what}", at)
        return values, offsets

    def plain_entries(
        self, indices: Sequence[Mapping[str, int]], low: float, high: float
    ) -> tuple[npt.NDArray[np.int64], Array, Offsets] | None:
        """Read the plain entries of one table that follow, at most a batch; None if there is none.

        A plain entry has only known names and a number from `low` to `high`. All other statements are left
        to the caller, who reads them one at a time and reports errors.

        Args:
            indices: for each reference of an entry: name -> index.

        Returns:
            (n, references) indices, (n,) numbers and (n,) offsets of the numbers.
        """
        pattern = _ENTRIES[self.peek()]
        matches: list[re.Match[str]] = []
        at = self.offset
        while len(matches) < self._batch and (match := pattern.match(self.text, at)) is not None:
            matches.append(match)
            at = match.end()
        n = len(matches)
        if not n:
            return None
        words = list(zip(*(match.groups() for match in matches), strict=True))
        columns = [list(map(index.get, column)) for index, column in zip(indices, words, strict=False)]
        n = min([n, *(column.index(None) for column in columns if None in column)])
        values = list(map(float, words[-1][:n])) if n else []
        if values and not low <= min(values) <= max(values) <= high:
            n = next(i for i, value in enumerate(values) if not low <= value <= high)
        self._batch = min(2 * self._batch, MAX_BATCH) if n == self._batch else MIN_BATCH
        if not n:
            return None
        self._move_to(matches[n - 1].end())
        offsets = [match.start(len(indices) + 1) for match in matches[:n]]
        return np.array([column[:n] for column in columns]).T, np.array(values[:n]), np.array(offsets)
