"""Convert batches of rows of any format to the tracks of one file."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from lcorpp.learning.data.assembly import TrackAssembler
from lcorpp.learning.data.cleaning import MAX_GAP, split_tracks
from lcorpp.learning.data.csv_reader import Progress, RowBatch
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.learning.data.tracks import Track
from lcorpp.learning.data.units import convert_to_metres


@dataclass(frozen=True, eq=False)
class ReadOptions:
    """Options for reading a file.

    repair_log: the requested repairs; each one made is added.
    labels: label in the file -> class; None takes the labels unchanged.
    only: the ids to read; None reads all.
    gap: maximum number of seconds between two samples of one person.
    progress: callback with (bytes read, bytes in all).
    """

    repair_log: RepairLog = field(default_factory=RepairLog)
    labels: Mapping[str, str] | None = None
    only: Collection[str] | None = None
    gap: float = MAX_GAP
    progress: Progress | None = None


def assemble_tracks(
    source: RowSource,
    batches: Iterable[RowBatch],
    options: ReadOptions,
    names: tuple[str, ...],
    words: tuple[str, ...] = (),
    scale: Mapping[str, float] | None = None,
) -> list[Track]:
    """Return the tracks in batches of rows, in metres; faults are repaired on request or are errors.

    Args:
        names, words, scale: as in `TrackAssembler`.
    """
    assembler = TrackAssembler(names, words, scale)
    for batch in batches:
        assembler.add(_select_rows(batch, source, options.only))
    if not source.ended:
        assembler.drop_cut_word(source)
    tracks, lines = list[Track](), list[int]()
    for raw in assembler.iterate_tracks():
        tracks += split_tracks(raw, source, labels=options.labels, gap=options.gap)
        lines += [int(raw.lines[0])] * (len(tracks) - len(lines))
    return convert_to_metres(tracks, lines, source)


def _select_rows(batch: RowBatch, source: RowSource, only: Collection[str] | None) -> RowBatch:
    """Return the rows of a batch that have an id, restricted to the ids to read."""
    names = batch.texts["track"]
    if only is None and "" not in names:
        return batch
    for row, name in enumerate(names):
        if not name:
            source.repair_or_raise("rows", int(batch.lines[row]), "no track", field="track")
    rows = [row for row, name in enumerate(names) if name and (only is None or name in only)]
    index = np.array(rows, dtype=np.intp)
    return RowBatch(
        batch.lines[index],
        {name: values[index] for name, values in batch.numbers.items()},
        {name: [words[row] for row in rows] for name, words in batch.texts.items()},
    )
