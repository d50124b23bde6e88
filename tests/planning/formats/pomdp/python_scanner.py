"""The scanner in Python: the oracle of `_scanner` in C++."""

from __future__ import annotations

import mmap
import re
from collections.abc import Mapping
from functools import lru_cache
from math import inf
from typing import Any

import numpy as np

from lcorpp.planning.formats.pomdp.patterns import NUMBER, SKIP, WORD, join_signs


class Names:
    """Names and numbers of the states, actions or observations, with their indices; -1 for ``*``."""

    def __init__(self, indices: Mapping[str, int]) -> None:
        self.index = {name.encode("utf-8", "surrogatepass"): index for name, index in indices.items()}


_REFERENCE = rb":%s(%s)%s" % (SKIP, WORD, SKIP)
_COLON = rb"(?::%s)?" % SKIP  # a stray colon of published files; in an MDP possibly before an observation
_ENTRIES = {
    (keyword, references): re.compile(
        rb"%s%s%s%s(%s)%s" % (keyword, SKIP, _REFERENCE * references, colon, NUMBER, SKIP)
    )
    for keyword, references, colon in (
        (b"T", 3, _COLON),
        (b"O", 3, _COLON),
        (b"R", 4, _COLON),
        (b"R", 3, b""),
    )
}
_ROW = re.compile(rb"([TO])%s%s(?=[^:])" % (SKIP, _REFERENCE * 2))
_COMMENT = re.compile(rb"#[^\r\n]*+")


def scan_statements(
    text: bytes | mmap.mmap,
    offset: int,
    actions: Names,
    states: Names,
    observations: Names,
    n_states: int,
    n_observations: int,
    reward_references: int,
    max_probability: float,
    max_numbers: int,
) -> tuple[Any, ...]:
    """Read plain statements; see `scanner.Scanner.scan`."""
    kinds = {
        b"T": (actions.index, states.index, states.index),
        b"O": (actions.index, states.index, observations.index),
        b"R": (actions.index, states.index, states.index, observations.index)[:reward_references],
    }
    tables = {keyword: _Table(len(kinds[keyword])) for keyword in kinds}
    numbers = 0
    while numbers < max_numbers and (keyword := text[offset : offset + 1]) in kinds:
        table = tables[keyword]
        if match := _ENTRIES[keyword, len(kinds[keyword])].match(text, offset):
            words = match.groups()
            indices = [index.get(word) for index, word in zip(kinds[keyword], words, strict=False)]
            value = float(join_signs(words[-1]))
            valid = (
                abs(value) < inf if keyword == b"R" else 0 <= value <= max_probability and indices[2] != -1
            )
            if None in indices or not valid:
                break
            table.entries.append((indices, value, match.start(len(words))))
            offset, numbers = match.end(), numbers + 1
            continue
        match = _ROW.match(text, offset)
        if match is None:
            break
        words = match.groups()[1:]
        indices = [index.get(word) for index, word in zip(kinds[keyword], words, strict=False)]
        if None in indices:
            break
        count = n_states if keyword == b"T" else n_observations
        row = _scan_row(text, match.end(), count)
        if row is None or not all(0 <= value <= max_probability for value in row[1]):
            break
        table.rows.append((indices, match.end(), row[1]))
        offset, numbers = row[0], numbers + count
    return offset, *(table.arrays() for table in tables.values())


class _Table:
    def __init__(self, references: int) -> None:
        self._references = references
        self.entries: list[tuple[list[Any], float, int]] = []
        self.rows: list[tuple[list[Any], int, list[float]]] = []

    def arrays(self) -> tuple[Any, ...]:
        """Return the fields of `scanner.PlainTable`."""
        indices, values, offsets = zip(*self.entries, strict=True) if self.entries else ((), (), ())
        scopes, row_offsets, rows = zip(*self.rows, strict=True) if self.rows else ((), (), ())
        return (
            np.array(indices, dtype=np.int32).reshape(-1, self._references),
            np.array(values, dtype=np.float64),
            np.array(offsets, dtype=np.int64),
            np.array(scopes, dtype=np.int32).reshape(-1, 2),
            np.array(row_offsets, dtype=np.int64),
            *_compress(rows),
        )


def scan_rows(text: bytes | mmap.mmap, offset: int, rows: int, count: int) -> tuple[Any, ...] | None:
    """Read rows of numbers; see `scanner.scan_rows`."""
    offsets, numbers = [], []
    for _ in range(rows):
        row = _scan_row(text, offset, count)
        if row is None:
            return None
        offsets.append(offset)
        offset = row[0]
        numbers.append(row[1])
    return offset, np.array(offsets, dtype=np.int64), *_compress(numbers)


def _scan_row(text: bytes | mmap.mmap, offset: int, count: int) -> tuple[int, list[float]] | None:
    """Return the offset after `count` finite numbers, and these."""
    match = _make_numbers_pattern(count).match(text, offset)
    if match is None:
        return None
    words = match[0] if b"#" not in match[0] else _COMMENT.sub(b" ", match[0])
    numbers = list(map(float, join_signs(words).split()))
    return None if inf in numbers or -inf in numbers else (match.end(), numbers)


@lru_cache(maxsize=64)
def _make_numbers_pattern(count: int) -> re.Pattern[bytes]:
    return re.compile(rb"(?:%s%s){%d}+" % (NUMBER, SKIP, count))


def _compress(rows: Any) -> tuple[Any, ...]:
    """Return begins, columns and values of the nonzero numbers of rows."""
    columns = [np.flatnonzero(row).astype(np.int32) for row in rows]
    begins = np.concatenate([[0], np.cumsum([len(part) for part in columns])]).astype(np.int64)
    values = [np.array(row)[part] for row, part in zip(rows, columns, strict=True)]
    none = np.zeros(0)
    return begins, np.concatenate([none.astype(np.int32), *columns]), np.concatenate([none, *values])
