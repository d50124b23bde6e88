"""Split the rows of one id into tracks; each fault is an error unless its repair was requested."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from lcorpp.learning.data.assembly import RawTrack
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.learning.data.tracks import MAX_NUMBER, Track
from lcorpp.values import Array

MAX_GAP = 5.0
"""Seconds without a sample after which an id denotes another person."""

MIN_RUN = 10
"""Minimum mean length of a run, in samples, at which decreasing times mean a new person, not disorder."""

ClassOf = Callable[[str, int, RawTrack], str | None]
"""Callback (label as in the file, its line, its track) -> class; None leaves the track out."""


def split_tracks(
    raw: RawTrack, source: RowSource, repair_log: RepairLog, *, class_of: ClassOf, gap: float
) -> Iterator[Track]:
    """Yield the tracks among the rows of one id, in the order of time.

    Args:
        raw: the rows. source: their file. repair_log: the requested repairs; each one made is added.
        class_of: converts a label. gap: maximum number of seconds between two samples of one person.

    Raises:
        ParseError, DataError: a fault whose repair was not requested.
    """
    words = _check_words(raw, source, repair_log)
    if words is None:
        return
    label, group = words
    label_class = None
    if label is not None:
        label_class = class_of(*label, raw)
        if label_class is None:
            return
    pieces = [
        piece
        for run in _split_runs(_drop_nonfinite(raw, source, repair_log), source, repair_log, gap)
        for piece in _split_gaps(
            _drop_duplicates(_sort(run, source, repair_log), source, repair_log), source, repair_log, gap
        )
    ]
    for number, piece in enumerate(pieces, start=1):
        if _check_motion(piece, raw, source, repair_log):
            name = raw.id if number == 1 else f"{raw.id}#{number}"
            yield Track(name, piece.times, piece.columns, label_class, group or raw.id)


def _check_words(
    raw: RawTrack, source: RowSource, repair_log: RepairLog
) -> tuple[tuple[str, int] | None, str] | None:
    """Return the only label, with its line, and the only group of a track; None leaves the track out."""
    words: dict[str, tuple[str, int]] = {}
    for word, lines_of in raw.words.items():
        if len(lines_of) > 1:
            (first, line), (other, place) = list(lines_of.items())[:2]
            message = f"{word} {other!r} after {first!r} in line {line}; expected one {word} for a track"
            reason = {"field": word, "track": raw.id, "rows": len(raw)}
            repair_log.repair_or_raise("labels", source, place, message, "left out", **reason)  # type: ignore[arg-type]
            return None
        words[word] = next(iter(lines_of.items()))
    return words.get("label"), words.get("group", ("", 0))[0]


def _drop_nonfinite(raw: RawTrack, source: RowSource, repair_log: RepairLog) -> RawTrack:
    columns = {"time": raw.times, **raw.columns}
    most = {name: MAX_NUMBER if name != "time" else np.finfo(np.float64).max for name in columns}
    bad = ~np.all([np.abs(values) <= most[name] for name, values in columns.items()], axis=0)
    for row in np.flatnonzero(bad).tolist():
        name, value = next((n, v[row]) for n, v in columns.items() if not abs(v[row]) <= most[n])
        what = "missing or NaN" if np.isnan(value) else "infinite" if np.isinf(value) else f"{value:g}"
        message = f"the {name} is {what}; expected a finite number" + (
            f" up to {MAX_NUMBER:g}" if np.isfinite(value) else ""
        )
        line = int(raw.lines[row])
        repair_log.repair_or_raise("nonfinite", source, line, message, "left out", field=name, track=raw.id)
    return raw.take(np.flatnonzero(~bad)) if bad.any() else raw


def _split_runs(raw: RawTrack, source: RowSource, repair_log: RepairLog, gap: float) -> list[RawTrack]:
    """Split the rows of an id that several people had: the times of each begin again."""
    ends = np.flatnonzero(np.diff(raw.times) < -gap) + 1
    if not len(ends) or len(raw) < MIN_RUN * (len(ends) + 1):
        return [raw]
    runs = [raw.take(rows) for rows in np.split(np.arange(len(raw)), ends)]
    spans = sorted((float(run.times.min()), float(run.times.max())) for run in runs)
    if all(end < start for (_, end), (start, _) in pairwise(spans)):
        return [raw]  # parts of one track in another order
    for run in runs[1:]:
        message = f"its times begin anew at {run.times[0]:.15g} s; expected an id that is one person's"
        _repair_time(
            "gaps", run, 0, source, repair_log, message, f"a track of its own, {len(run)} rows", len(run)
        )
    return runs


def _sort(raw: RawTrack, source: RowSource, repair_log: RepairLog) -> RawTrack:
    latest = np.maximum.accumulate(raw.times)
    late = np.flatnonzero(raw.times < latest)
    for row in late.tolist():
        message = f"time {raw.times[row]:.15g} s after {latest[row]:.15g} s; expected times that rise"
        _repair_time("order", raw, row, source, repair_log, message, "sorted")
    return raw.take(np.argsort(raw.times, kind="stable")) if len(late) else raw


def _drop_duplicates(raw: RawTrack, source: RowSource, repair_log: RepairLog) -> RawTrack:
    again = np.flatnonzero(np.diff(raw.times) == 0) + 1
    for row in again.tolist():
        same = all(values[row] == values[row - 1] for values in raw.columns.values())
        which = "the same sample" if same else "another sample"
        message = f"{which} at time {raw.times[row]:.15g} s as in line {raw.lines[row - 1]}; expected one"
        _repair_time("duplicates", raw, row, source, repair_log, message, "left out")
    return raw.take(np.delete(np.arange(len(raw)), again)) if len(again) else raw


def _split_gaps(raw: RawTrack, source: RowSource, repair_log: RepairLog, gap: float) -> list[RawTrack]:
    silences = np.diff(raw.times)
    ends = np.flatnonzero(silences > gap) + 1
    pieces = [raw.take(rows) for rows in np.split(np.arange(len(raw)), ends)]
    for end, piece in zip(ends.tolist(), pieces[1:], strict=True):
        message = f"silent for {silences[end - 1]:.3f} s before; expected at most {gap:g} s of one person"
        _repair_time(
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


def _check_motion(piece: RawTrack, raw: RawTrack, source: RowSource, repair_log: RepairLog) -> bool:
    """Return whether the piece is a track with motion."""
    line = int((piece if len(piece) else raw).lines[0])
    if len(piece) < 2:
        message = f"{len(piece)} samples show no motion; expected at least 2"
        repair_log.repair_or_raise("short", source, line, message, "left out", track=raw.id, rows=len(piece))
        return False
    x, y = piece.columns["x"], piece.columns["y"]
    if _is_constant(x) and _is_constant(y):
        message = f"all {len(piece)} samples are at ({x[0]:g}, {y[0]:g}) m; expected motion"
        repair_log.repair_or_raise(
            "constant", source, line, message, "left out", track=raw.id, rows=len(piece), field="x"
        )
        return False
    return True


def _is_constant(values: Array) -> bool:
    return bool(np.all(values == values[0]))


def _repair_time(
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
