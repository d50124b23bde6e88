"""Tokens of a .pomdp file, with their offsets in the text."""

from __future__ import annotations

import mmap
import re
from itertools import islice
from math import isfinite
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ParseError
from lcorpp.planning.formats.numbers import ROW_TOLERANCE
from lcorpp.planning.formats.pomdp.patterns import NUMBER, SKIP, WORD, join_signs
from lcorpp.planning.formats.pomdp.scanner import PlainTable, Scanner, Text, scan_rows
from lcorpp.values import Array

PREAMBLE_KEYWORDS = ("discount", "values", "states", "actions", "observations")
TABLE_KEYWORDS = ("T", "O", "R")

FOREIGN_KEYWORDS = ("costs", "init_state", "agents")
"""Keywords of statements of other tools; see `dialects.py`."""

NUMBERED_KEYWORDS = ("atom", "prio")
"""Those with a number before their colon."""

RELEASED_BYTES = 2**24
"""The pages of a mapped text are released in parts of this size, once they have been read."""

Offsets = npt.NDArray[np.int64]
"""Offsets in the text, in bytes."""

_BYTE_ORDER_MARK = "\ufeff".encode()
_FIRST = re.compile(rb"(?:%s)?%s" % (_BYTE_ORDER_MARK, SKIP))
_TOKEN = re.compile(rb"(:|%s)%s" % (WORD, SKIP))
_NUMBER = re.compile(rb"(%s)%s" % (NUMBER, SKIP))
_KEYWORDS = "|".join((*PREAMBLE_KEYWORDS, *TABLE_KEYWORDS)).encode()
_FOREIGN = rb"%s|(?:%s)(?![^\s:#])%s[0-9]+" % (
    "|".join(FOREIGN_KEYWORDS).encode(),
    "|".join(NUMBERED_KEYWORDS).encode(),
    SKIP,
)
_STATEMENT = re.compile(
    rb"(?:%s|start(?:(?![^\s:#])%s(?:include|exclude))?|%s)%s:" % (_KEYWORDS, SKIP, _FOREIGN, SKIP)
)
_LINE_END = re.compile(rb"\r\n|\r|\n")


class NumberRows(NamedTuple):
    """Rows of numbers without the zeros.

    width: of a row. offsets: (rows,) of the first number of each row.
    begins: (rows + 1,) index of the first entry of each row. columns, values: (entries,).
    """

    width: int
    offsets: Offsets
    begins: npt.NDArray[np.int64]
    columns: npt.NDArray[np.int32]
    values: Array

    def dense(self) -> Array:
        """Return the numbers (rows, width)."""
        table = np.zeros((len(self.offsets), self.width))
        table[np.repeat(np.arange(len(table)), np.diff(self.begins)), self.columns] = self.values
        return table


class Tokens:
    """A cursor over the tokens of one text: colons and words, without comments.

    text: the whole text in UTF-8, in memory or mapped.
    offset: of the next token, in bytes; the length of the text after the last one.
    """

    def __init__(self, text: Text, file: str) -> None:
        self.file, self.text = file, text
        self._ahead: list[tuple[str, int]] = []  # tokens from `offset` on, each with the next one's offset
        first = _FIRST.match(text)
        self.offset = self._first = first.end() if first else 0
        self._released = 0

    def _move_to(self, offset: int) -> None:
        self.offset = offset
        self._ahead.clear()

    def _release_read_pages(self) -> None:
        """Release the memory of the text before the next token; the system reads it again for a message."""
        begin, size = self._released, (self.offset - self._released) // RELEASED_BYTES * RELEASED_BYTES
        if size and isinstance(self.text, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
            self.text.madvise(mmap.MADV_DONTNEED, begin, size)
            self._released += size

    def peek(self, ahead: int = 0) -> str:
        """Return a token ahead, "" after the last one."""
        known = self._ahead
        while len(known) <= ahead:
            match = _TOKEN.match(self.text, known[-1][1] if known else self.offset)
            if match is None:
                return ""
            known.append((_decode(match[1]), match.end()))
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
        """Return whether the next token starts a statement, maybe of another tool: keyword and colon."""
        return _STATEMENT.match(self.text, self.offset) is not None

    def at_number(self) -> bool:
        """Return whether a number follows, the sign of which may be a token of its own."""
        return _NUMBER.match(self.text, self.offset) is not None

    # --- errors ---

    def error(self, message: str, offset: int | None = None) -> ParseError:
        """Return a ParseError at an offset; by default that of the next token, or the end of the text."""
        place = self.offset if offset is None else offset
        if place == len(self.text):  # the end of the file is behind its last character
            while place and self.text[place - 1 : place].isspace():
                place -= 1
        line, start = 1, len(_BYTE_ORDER_MARK) if self.text[:3] == _BYTE_ORDER_MARK else 0
        for match in _LINE_END.finditer(self.text, 0, place):
            line, start = line + 1, match.end()
        end = _LINE_END.search(self.text, start)
        # a comment may contain bytes of another encoding
        text = self.text[start : end.start() if end else len(self.text)].decode("utf-8", "replace")
        column = len(self.text[start:place].decode("utf-8", "replace")) + 1
        return ParseError(self.file, line, column, message, text)

    def describe_next(self) -> str:
        """Return the next token, for a message."""
        return repr(self.peek()) if not self.at_end() else "the end of the file"

    def unexpected_token(self) -> ParseError:
        """Return the error for a token that should start a statement but does not."""
        if self.at_number() and self.offset != self._first:
            return self.error(f"too many numbers: {self.peek()} is left over; expected a new statement")
        names = ", ".join(f"{name}:" for name in (*PREAMBLE_KEYWORDS, "start", *TABLE_KEYWORDS))
        return self.error(f"expected one of {names}, found {self.describe_next()}")

    def _find_number(self, start: int, count: int) -> tuple[str, int]:
        """Return the number that is `count` numbers after the one at an offset, and its own offset."""
        match = next(islice(_NUMBER.finditer(self.text, start), count, None))
        return _decode(join_signs(match[1])), match.start()

    # --- statements and numbers ---

    def plain_statements(self, scanner: Scanner) -> tuple[PlainTable, PlainTable, PlainTable] | None:
        """Read the plain statements of T, O and R that follow, at most a batch; None if there are none."""
        end, T, Z, R = scanner.scan(self.text, self.offset)
        if end == self.offset:
            return None
        self._move_to(end)
        self._release_read_pages()
        return T, Z, R

    def numbers(self, count: int, what: str, rows: int = 1) -> NumberRows:
        """Read rows of `count` numbers; `what` describes them in messages."""
        found = None
        if 2 * rows * count - 1 <= len(self.text) - self.offset:  # a shorter text has too few
            found = scan_rows(self.text, self.offset, rows, count)
        if found is None:
            raise self._make_missing_numbers_error(rows * count, what)
        end, *arrays = found
        self._move_to(end)
        return NumberRows(count, *arrays)

    def number(self, what: str) -> float:
        """Read one number."""
        return float(self.numbers(1, what).dense()[0, 0])

    def _make_missing_numbers_error(self, count: int, what: str) -> ParseError:
        """Return the error if fewer than `count` numbers follow."""
        needed = "a number" if count == 1 else f"{count} numbers"
        for index in range(count):
            word, match = self.peek(), _NUMBER.match(self.text, self.offset)
            if not word:
                return self.error(f"{what} needs {needed}, found {index} before the end of the file")
            if match is None:
                return self.error(f"{what} needs {needed}, found {index} and then {word!r}")
            if not isfinite(float(join_signs(match[1]))):
                return self.error(f"{_decode(join_signs(match[1]))} is too large for a number")
            self._move_to(match.end())
        raise AssertionError(f"{what}: no number is missing")

    def probabilities(self, count: int, what: str, rows: int = 1) -> NumberRows:
        """`numbers`, each checked to be between 0 and 1."""
        numbers = self.numbers(count, what, rows)
        values = numbers.values
        if not len(values) or 0 <= values.min() <= values.max() <= 1 + ROW_TOLERANCE:
            return numbers
        entry = int(values.argmin() if values.min() < 0 else values.argmax())
        row = int(np.searchsorted(numbers.begins, entry, side="right")) - 1
        word, at = self._find_number(int(numbers.offsets[row]), int(numbers.columns[entry]))
        if values[entry] < 0:
            raise self.error(f"negative probability {word} in {what}", at)
        raise self.error(f"{word} is not a probability in {what}", at)


def _decode(text: bytes) -> str:
    return text.decode("utf-8", "surrogatepass")
