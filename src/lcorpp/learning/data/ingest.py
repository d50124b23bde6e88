"""Convert batches of rows of any format to tracks: collect the rows of each id, then clean them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from lcorpp.errors import LcorppError
from lcorpp.learning.data.cleaning import RawTrack, split_tracks
from lcorpp.learning.data.csv_reader import Lines, Progress, RowBatch
from lcorpp.learning.data.labels import normalize_id
from lcorpp.learning.data.measures import UNKNOWN, Measures
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.learning.data.times import check_times
from lcorpp.learning.data.tracks import Track
from lcorpp.learning.data.units import LENGTHS, convert_units
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class ReadOptions:
    """Options for reading a file.

    repair_log: the requested repairs; each one made is added.
    labels: label in the file -> class; None takes the labels unchanged.
    only: the ids to read; None reads all.
    gap: maximum number of seconds between two samples of one person.
    progress: callback with (bytes read, bytes in all).
    columns: column of the long format -> name in the file.
    measures: the units that the caller gives.
    """

    repair_log: RepairLog
    labels: Mapping[str, str] | None
    only: Collection[str] | None
    gap: float
    progress: Progress | None
    columns: Mapping[str, str] = field(default_factory=dict)
    measures: Measures = UNKNOWN


def assemble_tracks(
    source: RowSource,
    batches: Iterable[RowBatch],
    options: ReadOptions,
    empty: LcorppError,
    names: tuple[str, ...],
    words: tuple[str, ...] = (),
    measures: Measures = UNKNOWN,
) -> list[Track]:
    """Return the tracks in batches of rows, in metres; faults are repaired on request or are errors.

    Args:
        empty: the error raised if there are no rows. names, words: as in `TrackAssembler`.
        measures: the units of the format; those of the options have precedence, and are not guessed.
    """
    given = options.measures
    length = given.length or measures.length or 1.0
    assembler = TrackAssembler(names, words, length, given.per_second or measures.per_second or 1.0)
    for batch in batches:
        assembler.add(_select_rows(batch, source, options.only))
    lost = next((repair for repair in options.repair_log.repairs if repair.reason == "rows"), None)
    if options.only is None and lost is not None and not assembler.sample(1):
        raise source.error_at(lost.line, "", f"no row can be read; {lost.done.removesuffix(': left out')}")
    if not source.ended:
        assembler.drop_cut_word(source)
    check_times(assembler.sample(), source, options.gap)
    tracks, lines = list[Track](), list[int]()
    for raw in assembler.iterate_tracks():
        tracks += split_tracks(raw, source, labels=options.labels, gap=options.gap)
        lines += [int(raw.lines[0])] * (len(tracks) - len(lines))
    if not tracks and options.only is None and not options.repair_log.repairs:
        raise empty
    return convert_units(tracks, lines, source, length=length, is_given=given.length is not None)


def _select_rows(batch: RowBatch, source: RowSource, only: Collection[str] | None) -> RowBatch:
    """Return the rows of a batch that have an id, restricted to the ids to read."""
    names = batch.texts["track"]
    ids = {name: normalize_id(name) for name in set(names)}
    if any(name != other for name, other in ids.items()):
        names = [ids[name] for name in names]
        batch = RowBatch(batch.lines, batch.numbers, {**batch.texts, "track": names})
    if only is None and "" not in ids:
        return batch
    for row, name in enumerate(names):
        if not name:
            source.repair_or_raise("rows", int(batch.lines[row]), "no track", field="track")
    rows = [row for row, name in enumerate(names) if name and (only is None or name in only)]
    return batch.take(np.array(rows, dtype=np.intp))


class TrackAssembler:
    """Assemble batches of rows into one `RawTrack` per id, in the order of first appearance.

    Args:
        names: the numeric columns besides "time".
        words: which of "label" and "group" the batches have.
        length: metres per unit of length. per_second: units of time per second.
    """

    def __init__(
        self, names: tuple[str, ...], words: tuple[str, ...], length: float = 1.0, per_second: float = 1.0
    ) -> None:
        self._names, self._words = names, words
        self._scale = dict.fromkeys((*LENGTHS, "velocity"), length)
        self._per_second = per_second
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

    def sample(self, limit: int = 50) -> list[RawTrack]:
        """Return the rows of the first ids."""
        codes = list(self._codes.items())[:limit]
        return [self._join(name, self._pieces[code], self._distinct_words[code]) for name, code in codes]

    def iterate_tracks(self) -> Iterator[RawTrack]:
        """Yield the rows of each id and release their memory."""
        for name, code in self._codes.items():
            pieces, self._pieces[code] = self._pieces[code], []
            yield self._join(name, pieces, self._distinct_words[code])

    def _join(
        self, name: str, pieces: list[tuple[Lines, Array]], words: dict[str, dict[str, int]]
    ) -> RawTrack:
        lines = np.concatenate([lines for lines, _ in pieces])
        table = np.concatenate([table for _, table in pieces], axis=1)
        scale = self._scale
        columns = {
            column: values * scale[column] if scale.get(column, 1.0) != 1.0 else values
            for column, values in zip(self._names, table[1:], strict=True)
        }
        times = table[0] if self._per_second == 1.0 else table[0] / self._per_second
        return RawTrack(name, lines, times, columns, words)
