"""Split the rows of one id into tracks; each fault is an error unless its repair was requested."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lcorpp.learning.data.csv_reader import Lines
from lcorpp.learning.data.labels import class_of_label, describe_unknown_label
from lcorpp.learning.data.repairs import RowSource
from lcorpp.learning.data.tracks import MAX_NUMBER, Track
from lcorpp.learning.data.units import MAX_SPEED, find_jumps
from lcorpp.values import Array

MAX_GAP = 5.0
"""Seconds without a sample after which an id denotes another person."""

MIN_RUN = 10
"""Minimum mean length of a run, in samples, at which decreasing times mean a new person, not disorder."""


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


def split_tracks(
    raw: RawTrack, source: RowSource, *, labels: Mapping[str, str] | None, gap: float
) -> Iterator[Track]:
    """Yield the tracks among the rows of one id, in the order of time; labels, gap: as in `ReadOptions`."""
    words = _check_words(raw, source)
    if words is None:
        return
    label, group = words
    label_class = None
    if label is not None:
        word, line = label
        label_class = class_of_label(word, labels)
        if label_class is None:
            message = describe_unknown_label(word, labels)
            source.repair_or_raise("labels", line, message, field="label", track=raw.id, rows=len(raw))
            return
    pieces = [
        piece
        for run in _split_runs(_drop_nonfinite(raw, source), source, gap)
        for piece in _split_gaps(_drop_duplicates(_sort(run, source), source), source, gap)
    ]
    for number, piece in enumerate(pieces, start=1):
        if _check_motion(piece, raw, source):
            name = raw.id if number == 1 else f"{raw.id}#{number}"
            yield Track(name, piece.times, piece.columns, label_class, group or raw.id)


def _check_words(raw: RawTrack, source: RowSource) -> tuple[tuple[str, int] | None, str] | None:
    """Return the only label, with its line, and the only group of a track; None leaves the track out."""
    words: dict[str, tuple[str, int]] = {}
    for word, lines_of in raw.words.items():
        if len(lines_of) > 1:
            (first, line), (other, place) = list(lines_of.items())[:2]
            message = f"{word} {other!r} after {first!r} in line {line}; expected one {word} for a track"
            source.repair_or_raise("labels", place, message, field=word, track=raw.id, rows=len(raw))
            return None
        words[word] = next(iter(lines_of.items()))
    return words.get("label"), words.get("group", ("", 0))[0]


def _drop_nonfinite(raw: RawTrack, source: RowSource) -> RawTrack:
    columns = {"time": raw.times, **raw.columns}
    most = {name: MAX_NUMBER if name != "time" else np.finfo(np.float64).max for name in columns}
    bad = {name: ~(np.abs(values) <= most[name]) for name, values in columns.items()}
    if "velocity" in bad:
        bad["velocity"] |= columns["velocity"] < 0
    is_bad = np.any(list(bad.values()), axis=0)
    for row in np.flatnonzero(is_bad).tolist():
        name = next(name for name, flags in bad.items() if flags[row])
        value = columns[name][row]
        what = "missing or NaN" if np.isnan(value) else "infinite" if np.isinf(value) else f"{value:g}"
        limit = ""
        if np.isfinite(value):
            limit = " from 0, a speed" if name == "velocity" and value < 0 else f" up to {MAX_NUMBER:g}"
        message = f"the {name} is {what}; expected a finite number{limit}"
        source.repair_or_raise("nonfinite", int(raw.lines[row]), message, field=name, track=raw.id)
    return raw.take(np.flatnonzero(~is_bad)) if is_bad.any() else raw


def _split_runs(raw: RawTrack, source: RowSource, gap: float) -> list[RawTrack]:
    """Split the rows of an id that several people had: the times of each begin again."""
    ends = np.flatnonzero(np.diff(raw.times) < -gap) + 1
    if not len(ends) or len(raw) < MIN_RUN * (len(ends) + 1):
        return [raw]
    runs = [raw.take(rows) for rows in np.split(np.arange(len(raw)), ends)]
    spans = sorted((float(run.times.min()), float(run.times.max())) for run in runs)
    if all(end < start for (_, end), (start, _) in pairwise(spans)):
        return [raw]  # parts of one track in another order
    for run in runs[1:]:
        message = f"its times start again at {run.times[0]:.15g} s; expected one person for each id"
        _split_off(run, message, source)
    return runs


def _sort(raw: RawTrack, source: RowSource) -> RawTrack:
    latest = np.maximum.accumulate(raw.times)
    late = np.flatnonzero(raw.times < latest)
    for row in late.tolist():
        message = f"time {raw.times[row]:.15g} s after {latest[row]:.15g} s; expected times that rise"
        source.repair_or_raise("order", int(raw.lines[row]), message, "sorted", field="time", track=raw.id)
    return raw.take(np.argsort(raw.times, kind="stable")) if len(late) else raw


def _drop_duplicates(raw: RawTrack, source: RowSource) -> RawTrack:
    again = np.flatnonzero(np.diff(raw.times) == 0) + 1
    for row in again.tolist():
        same = all(values[row] == values[row - 1] for values in raw.columns.values())
        which = "the same sample" if same else "another sample"
        message = f"{which} at time {raw.times[row]:.15g} s as in line {raw.lines[row - 1]}; expected one"
        source.repair_or_raise("duplicates", int(raw.lines[row]), message, field="time", track=raw.id)
    return raw.take(np.delete(np.arange(len(raw)), again)) if len(again) else raw


def _split_gaps(raw: RawTrack, source: RowSource, gap: float) -> list[RawTrack]:
    """Split the rows of a track where its person is silent for too long, or jumps as no human can."""
    silences, x, y = np.diff(raw.times), raw.columns["x"], raw.columns["y"]
    ends = np.flatnonzero((silences > gap) | find_jumps(raw.times, x, y)) + 1
    pieces = [raw.take(rows) for rows in np.split(np.arange(len(raw)), ends)]
    for end, piece in zip(ends.tolist(), pieces[1:], strict=True):
        silence = f"{silences[end - 1]:.3f} s"
        if silences[end - 1] > gap:
            message = f"silent for {silence} before; expected at most {gap:g} s of one person"
        else:
            distance = np.hypot(x[end] - x[end - 1], y[end] - y[end - 1])
            message = (
                f"a jump of {distance:.3g} m in {silence}; expected at most {MAX_SPEED:g} m/s of a human"
            )
        _split_off(piece, message, source)
    return pieces


def _split_off(piece: RawTrack, message: str, source: RowSource) -> None:
    """Record that a piece becomes a track, or raise the error."""
    line, done = int(piece.lines[0]), f"a track of its own, {len(piece)} rows"
    source.repair_or_raise("gaps", line, message, done, field="time", track=piece.id, rows=len(piece))


def _check_motion(piece: RawTrack, raw: RawTrack, source: RowSource) -> bool:
    """Return whether the piece is a track with motion."""
    x, y = piece.columns["x"], piece.columns["y"]
    if len(piece) < 2:
        reason, field = "short", ""
        message = f"{len(piece)} samples show no motion; expected at least 2"
    elif np.all(x == x[0]) and np.all(y == y[0]):
        reason, field = "constant", "x"
        message = f"all {len(piece)} samples are at ({x[0]:g}, {y[0]:g}) m; expected motion"
    else:
        return True
    line = int((piece if len(piece) else raw).lines[0])
    source.repair_or_raise(reason, line, message, field=field, track=raw.id, rows=len(piece))
    return False
