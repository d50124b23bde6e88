"""What the readers of all formats have in common: from batches of rows to the tracks of one file."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from lcorpp.learning.data.assembly import Assembly
from lcorpp.learning.data.cleaning import GAP, tracks_of
from lcorpp.learning.data.csv_reader import Batch, Progress
from lcorpp.learning.data.labels import class_reader
from lcorpp.learning.data.repairs import Ledger, Source
from lcorpp.learning.data.tracks import Track
from lcorpp.learning.data.units import in_metres


@dataclass(frozen=True, eq=False)
class Request:
    """How a file is to be read.

    ledger: which repairs are allowed; it is told of each.
    labels: written label -> class; None takes the labels as they are.
    only: the ids to read; None reads all.
    gap: the longest silence of one person, seconds.
    progress: told (bytes read, bytes in all).
    """

    ledger: Ledger = field(default_factory=Ledger)
    labels: Mapping[str, str] | None = None
    only: Collection[str] | None = None
    gap: float = GAP
    progress: Progress | None = None


def gathered(source: Source, batches: Iterable[Batch], assembly: Assembly, request: Request) -> list[Track]:
    """The tracks in batches of rows, in metres, each fault refused or repaired as `request` has it."""
    for batch in batches:
        assembly.add(_wanted(batch, source, request))
    if not source.ended:
        assembly.without_cut_word(source, request.ledger)
    class_of = class_reader(request.labels, source, request.ledger)
    tracks, lines = [], []
    for raw in assembly.raws():
        found = list(tracks_of(raw, source, request.ledger, class_of=class_of, gap=request.gap))
        tracks += found
        lines += [int(raw.lines[0])] * len(found)
    return in_metres(tracks, lines, source, request.ledger)


def _wanted(batch: Batch, source: Source, request: Request) -> Batch:
    """The rows of a batch that are somebody's, and of the ids that are asked for."""
    names = batch.texts["track"]
    if "" in names:
        for row, name in enumerate(names):
            if not name:
                line = int(batch.lines[row])
                request.ledger.mend("rows", source, line, "no track", "left out", field="track")
    elif request.only is None:
        return batch
    only = request.only
    rows = [row for row, name in enumerate(names) if name and (only is None or name in only)]
    index = np.array(rows, dtype=np.intp)
    return Batch(
        batch.lines[index],
        {name: values[index] for name, values in batch.numbers.items()},
        {name: [words[row] for row in rows] for name, words in batch.texts.items()},
    )
