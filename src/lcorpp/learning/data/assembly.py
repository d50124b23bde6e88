"""Rows of many people in turn, gathered into one track after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lcorpp.learning.data.csv_reader import Lines, RowBatch
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class RawTrack:
    """All rows of one id in the order of the file, unchecked.

    lines: (rows,) where they are. times: (rows,) seconds. columns: name -> (rows,).
    words: "label" and "group", where the file has them -> every different word -> the line it is first on.
    """

    id: str
    lines: Lines
    times: Array
    columns: dict[str, Array]
    words: dict[str, dict[str, int]]

    def __len__(self) -> int:
        return len(self.lines)

    def take(self, rows: Lines | slice) -> RawTrack:
        """Some of the rows, in the given order."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        return RawTrack(self.id, self.lines[rows], self.times[rows], columns, self.words)


class TrackAssembler:
    """Batches go in, one `RawTrack` for every id comes out, in the order in which the ids first appear.

    Args:
        names: the number columns besides "time".
        words: those of "label" and "group" that the batches have.
        scale: name -> factor for a column that is in other units.
    """

    def __init__(
        self, names: tuple[str, ...], words: tuple[str, ...] = (), scale: dict[str, float] | None = None
    ) -> None:
        self._names, self._words, self._scale = names, words, scale or {}
        self._codes: dict[str, int] = {}
        self._pieces: list[list[tuple[Lines, Array]]] = []
        self._found: list[dict[str, dict[str, int]]] = []

    def add(self, batch: RowBatch) -> None:
        """Take in the rows of a batch, whose text "track" says whose each is."""
        codes = np.array(
            [self._codes.setdefault(name, len(self._codes)) for name in batch.texts["track"]], dtype=np.intp
        )
        while len(self._pieces) < len(self._codes):
            self._pieces.append([])
            self._found.append({word: {} for word in self._words})
        table = np.stack([batch.numbers["time"], *(batch.numbers[name] for name in self._names)])
        order = np.argsort(codes, kind="stable")
        ends = np.flatnonzero(np.diff(codes[order])) + 1
        for rows in np.split(order, ends) if len(order) else ():
            code = codes[rows[0]]
            self._pieces[code].append((batch.lines[rows], table[:, rows]))
            for word in self._words:
                seen, texts = self._found[code][word], batch.texts[word]
                for text in dict.fromkeys(texts[row] for row in rows.tolist()):
                    if text not in seen:
                        first = next(row for row in rows.tolist() if texts[row] == text)
                        seen[text] = int(batch.lines[first])

    def without_cut_word(self, source: RowSource, repair_log: RepairLog) -> None:
        """Leave out the very last row if the file ends in the middle of its label or group.

        That is told by a word of its own, which is the beginning of the word that the track had before.
        """
        if not self._pieces:
            return
        last = max((int(pieces[-1][0][-1]), code) for code, pieces in enumerate(self._pieces))
        line, code = last
        for word, seen in self._found[code].items():
            for text, first in list(seen.items()):
                whole = next((other for other in seen if other != text and other.startswith(text)), None)
                if first == line and whole is not None:
                    message = f"the file ends in the middle of its last line: {word} {text!r} after {whole!r}"
                    name = list(self._codes)[code]
                    repair_log.repair_or_raise(
                        "cut", source, line, message, "left out", field=word, track=name
                    )
                    del seen[text]
                    lines, table = self._pieces[code][-1]
                    self._pieces[code][-1] = lines[:-1], table[:, :-1]
                    return

    def raw_tracks(self) -> Iterator[RawTrack]:
        """Every id's rows; what is handed out is forgotten here."""
        for name, code in self._codes.items():
            pieces, self._pieces[code] = self._pieces[code], []
            lines = np.concatenate([lines for lines, _ in pieces])
            table = np.concatenate([table for _, table in pieces], axis=1)
            columns = {
                column: values * self._scale.get(column, 1.0)
                for column, values in zip(self._names, table[1:], strict=True)
            }
            yield RawTrack(name, lines, table[0], columns, self._found[code])
