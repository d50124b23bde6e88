"""Collect the rows of a file into one raw track per id."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from lcorpp.learning.data.csv_reader import Lines, RowBatch
from lcorpp.learning.data.repairs import RowSource
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class RawTrack:
    """All rows of one id in the order of the file, unchecked.

    lines: (rows,) line numbers. times: (rows,) seconds. columns: name -> (rows,).
    words: "label" and "group", if the file has them -> each distinct word -> its first line.
    """

    id: str
    lines: Lines
    times: Array
    columns: dict[str, Array]
    words: dict[str, dict[str, int]]

    def __len__(self) -> int:
        return len(self.lines)

    def take(self, rows: Lines | slice) -> RawTrack:
        """Return the given rows, in their order."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        return RawTrack(self.id, self.lines[rows], self.times[rows], columns, self.words)


class TrackAssembler:
    """Assemble batches of rows into one `RawTrack` per id, in the order of first appearance.

    Args:
        names: the numeric columns besides "time".
        words: which of "label" and "group" the batches have.
        scale: name -> factor, for columns in other units.
    """

    def __init__(
        self, names: tuple[str, ...], words: tuple[str, ...], scale: Mapping[str, float] | None = None
    ) -> None:
        self._names, self._words, self._scale = names, words, scale or {}
        self._codes: dict[str, int] = {}
        self._pieces: list[list[tuple[Lines, Array]]] = []
        self._distinct_words: list[dict[str, dict[str, int]]] = []

    def add(self, batch: RowBatch) -> None:
        """Add the rows of a batch; its text column "track" has the ids."""
        codes = np.array(
            [self._codes.setdefault(name, len(self._codes)) for name in batch.texts["track"]], dtype=np.intp
        )
        while len(self._pieces) < len(self._codes):
            self._pieces.append([])
            self._distinct_words.append({word: {} for word in self._words})
        table = np.stack([batch.numbers["time"], *(batch.numbers[name] for name in self._names)])
        order = np.argsort(codes, kind="stable")
        ends = np.flatnonzero(np.diff(codes[order])) + 1
        for rows in np.split(order, ends) if len(order) else ():
            code = codes[rows[0]]
            self._pieces[code].append((batch.lines[rows], table[:, rows]))
            for word in self._words:
                lines_of, texts = self._distinct_words[code][word], batch.texts[word]
                for row in rows.tolist():
                    if texts[row] not in lines_of:
                        lines_of[texts[row]] = int(batch.lines[row])

    def drop_cut_word(self, source: RowSource) -> None:
        """Drop the last row if the file ends in the middle of its label or group.

        Such a word appears once and is a prefix of the track's earlier word.
        """
        if not self._pieces:
            return
        line, code = max((int(pieces[-1][0][-1]), code) for code, pieces in enumerate(self._pieces))
        for word, lines_of in self._distinct_words[code].items():
            for text, first in list(lines_of.items()):
                whole = next((other for other in lines_of if other != text and other.startswith(text)), None)
                if first == line and whole is not None:
                    message = f"the file ends in the middle of its last line: {word} {text!r} after {whole!r}"
                    source.repair_or_raise("cut", line, message, field=word, track=list(self._codes)[code])
                    del lines_of[text]
                    lines, table = self._pieces[code][-1]
                    self._pieces[code][-1] = lines[:-1], table[:, :-1]
                    return

    def iterate_tracks(self) -> Iterator[RawTrack]:
        """Yield the rows of each id and release their memory."""
        for name, code in self._codes.items():
            pieces, self._pieces[code] = self._pieces[code], []
            lines = np.concatenate([lines for lines, _ in pieces])
            table = np.concatenate([table for _, table in pieces], axis=1)
            columns = {
                column: values * self._scale.get(column, 1.0)
                for column, values in zip(self._names, table[1:], strict=True)
            }
            yield RawTrack(name, lines, table[0], columns, self._distinct_words[code])
