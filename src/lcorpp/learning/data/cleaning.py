"""Split the rows of one id into tracks; each fault is an error unless its repair was requested."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from lcorpp.learning.data.assembly import RawTrack
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.learning.data.tracks import LARGEST, Track
from lcorpp.values import Array

GAP = 5.0
"""Seconds of silence after which an id is held to be somebody else's."""

LONG_RUN = 10
"""Samples of a run, on average, from which on times that go back are a new person, not disorder."""

ClassOf = Callable[[str, int, RawTrack], str | None]
"""From a label as it is written, its line and its track to a class; None leaves the track out."""


def split_tracks(
    raw: RawTrack, source: RowSource, repair_log: RepairLog, *, class_of: ClassOf, gap: float
) -> Iterator[Track]:
    """The tracks among the rows of one id, in the order of time.

    Args:
        raw: the rows. source: where they are from. repair_log: which repairs are allowed, and what was done.
        class_of: what a written label means. gap: the longest silence of one person, seconds.

    Raises:
        ParseError, DataError: there is a fault that `repair_log` does not allow to be repaired.
    """
    words = _words(raw, source, repair_log)
    if words is None:
        return
    label, group = words
    known = None
    if label is not None:
        known = class_of(*label, raw)
        if known is None:
            return
    pieces = [
        piece
        for run in _runs(_finite(raw, source, repair_log), source, repair_log, gap)
        for piece in _unbroken(
            _once(_sorted(run, source, repair_log), source, repair_log), source, repair_log, gap
        )
    ]
    for number, piece in enumerate(pieces, start=1):
        if _moves(piece, raw, source, repair_log):
            name = raw.id if number == 1 else f"{raw.id}#{number}"
            yield Track(name, piece.times, piece.columns, known, group or raw.id)


def _words(
    raw: RawTrack, source: RowSource, repair_log: RepairLog
) -> tuple[tuple[str, int] | None, str] | None:
    """The one label, with its line, and the one group of a track; None leaves it out."""
    found: dict[str, tuple[str, int]] = {}
    for word, seen in raw.words.items():
        if len(seen) > 1:
            (first, line), (other, place) = list(seen.items())[:2]
            message = f"{word} {other!r} after {first!r} in line {line}; expected one {word} for a track"
            reason = {"field": word, "track": raw.id, "rows": len(raw)}
            repair_log.repair_or_raise("labels", source, place, message, "left out", **reason)  # type: ignore[arg-type]
            return None
        found[word] = next(iter(seen.items()))
    return found.get("label"), found.get("group", ("", 0))[0]


def _finite(raw: RawTrack, source: RowSource, repair_log: RepairLog) -> RawTrack:
    columns = {"time": raw.times, **raw.columns}
    most = {name: LARGEST if name != "time" else np.finfo(np.float64).max for name in columns}
    bad = ~np.all([np.abs(values) <= most[name] for name, values in columns.items()], axis=0)
    for row in np.flatnonzero(bad).tolist():
        name, value = next((n, v[row]) for n, v in columns.items() if not abs(v[row]) <= most[n])
        what = "missing or NaN" if np.isnan(value) else "infinite" if np.isinf(value) else f"{value:g}"
        message = f"the {name} is {what}; expected a finite number" + (
            f" up to {LARGEST:g}" if np.isfinite(value) else ""
        )
        line = int(raw.lines[row])
        repair_log.repair_or_raise("nonfinite", source, line, message, "left out", field=name, track=raw.id)
    return raw.take(np.flatnonzero(~bad)) if bad.any() else raw


def _runs(raw: RawTrack, source: RowSource, repair_log: RepairLog, gap: float) -> list[RawTrack]:
    """The rows of each person who had the id, told by times that begin anew."""
    ends = np.flatnonzero(np.diff(raw.times) < -gap) + 1
    if not len(ends) or len(raw) < LONG_RUN * (len(ends) + 1):
        return [raw]
    runs = [raw.take(rows) for rows in np.split(np.arange(len(raw)), ends)]
    spans = sorted((float(run.times.min()), float(run.times.max())) for run in runs)
    if all(end < start for (_, end), (start, _) in pairwise(spans)):
        return [raw]  # parts of one track in another order
    for run in runs[1:]:
        message = f"its times begin anew at {run.times[0]:.15g} s; expected an id that is one person's"
        _note("gaps", run, 0, source, repair_log, message, f"a track of its own, {len(run)} rows", len(run))
    return runs


def _sorted(raw: RawTrack, source: RowSource, repair_log: RepairLog) -> RawTrack:
    latest = np.maximum.accumulate(raw.times)
    late = np.flatnonzero(raw.times < latest)
    for row in late.tolist():
        message = f"time {raw.times[row]:.15g} s after {latest[row]:.15g} s; expected times that rise"
        _note("order", raw, row, source, repair_log, message, "sorted")
    return raw.take(np.argsort(raw.times, kind="stable")) if len(late) else raw


def _once(raw: RawTrack, source: RowSource, repair_log: RepairLog) -> RawTrack:
    again = np.flatnonzero(np.diff(raw.times) == 0) + 1
    for row in again.tolist():
        same = all(values[row] == values[row - 1] for values in raw.columns.values())
        which = "the same sample" if same else "another sample"
        message = f"{which} at time {raw.times[row]:.15g} s as in line {raw.lines[row - 1]}; expected one"
        _note("duplicates", raw, row, source, repair_log, message, "left out")
    return raw.take(np.delete(np.arange(len(raw)), again)) if len(again) else raw


def _unbroken(raw: RawTrack, source: RowSource, repair_log: RepairLog, gap: float) -> list[RawTrack]:
    silences = np.diff(raw.times)
    ends = np.flatnonzero(silences > gap) + 1
    pieces = [raw.take(rows) for rows in np.split(np.arange(len(raw)), ends)]
    for end, piece in zip(ends.tolist(), pieces[1:], strict=True):
        message = f"silent for {silences[end - 1]:.3f} s before; expected at most {gap:g} s of one person"
        _note(
            "gaps",
            piece,
            0,
            source,
            repair_log,
            message,
            f"a track of its own, {len(piece)} rows",
            len(piece),
        )
    return pieces


def _moves(piece: RawTrack, raw: RawTrack, source: RowSource, repair_log: RepairLog) -> bool:
    """Whether it is a track of somebody who moves."""
    line = int((piece if len(piece) else raw).lines[0])
    if len(piece) < 2:
        message = f"{len(piece)} samples show no motion; expected at least 2"
        repair_log.repair_or_raise("short", source, line, message, "left out", track=raw.id, rows=len(piece))
        return False
    x, y = piece.columns["x"], piece.columns["y"]
    if _constant(x) and _constant(y):
        message = f"all {len(piece)} samples are at ({x[0]:g}, {y[0]:g}) m; expected motion"
        repair_log.repair_or_raise(
            "constant", source, line, message, "left out", track=raw.id, rows=len(piece), field="x"
        )
        return False
    return True


def _constant(values: Array) -> bool:
    return bool(np.all(values == values[0]))


def _note(
    reason: str,
    raw: RawTrack,
    row: int,
    source: RowSource,
    repair_log: RepairLog,
    message: str,
    done: str,
    rows: int = 1,
) -> None:
    line = int(raw.lines[row])
    repair_log.repair_or_raise(reason, source, line, message, done, field="time", track=raw.id, rows=rows)
