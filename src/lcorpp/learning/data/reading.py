"""Read recordings of any format, detected by content rather than by name."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, FileError, ParseError
from lcorpp.files import keep_pipes, locate_bad_byte, open_text
from lcorpp.learning.data.authors import read_authors
from lcorpp.learning.data.cleaning import MAX_GAP
from lcorpp.learning.data.csv_formats import ATC_COLUMNS, REQUIRED, read_atc, read_long_csv
from lcorpp.learning.data.csv_reader import Progress, detect_delimiter, is_number, parse_line
from lcorpp.learning.data.ingest import ReadOptions
from lcorpp.learning.data.labels import attach_labels, class_of_label, describe_unknown_label, read_labels
from lcorpp.learning.data.npz import SUFFIX, load_dataset, to_recording
from lcorpp.learning.data.parquet import SUFFIXES, ParquetFile, read_parquet
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.learning.data.table import has_table_columns, read_table
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.learning.data.units import convert_units, note_implausible
from lcorpp.learning.data.windows import INTERVAL, POINTS, to_dataset
from lcorpp.learning.store import Snapshot, is_store, read_store
from lcorpp.notebook import join_some
from lcorpp.values import Dataset, count_window, stack_signals

Format = Literal["authors", "npz", "store", "parquet", "atc", "long", "table"]

DATASETS = ("authors", "npz", "store", "table")
"""Formats of data sets: tracks of one interval, or tables of features."""

RAW_LABELS = {"0": "0", "1": "1"}
"""Labels of the authors' files, if the caller does not name their classes."""

MAX_HEADING = 1_000_000
"""Maximum length of a heading in letters."""

Pose = tuple[float, float, float]


@check_arguments
@keep_pipes()
def read_data(
    path: str | Path,
    *,
    labels: Mapping[str, str] | None = None,
    label_file: str | Path | None = None,
    interval: float | None = None,
    points: int | None = None,
    seconds: float | None = None,
    channels: Sequence[str] | None = None,
    repair: str | Collection[str] = (),
    robot: Pose | None = None,
    gap: float = MAX_GAP,
    progress: Progress | None = None,
) -> Dataset:
    """Read labelled tracks of any format, or a table of features, as a data set to learn from.

    The authors' files, .npz and stores stay unchanged unless an argument changes them; other formats of
    tracks are cut to the last ten seconds of each track, at most 304 points .033 s apart, see `to_dataset`.

    Args:
        interval, points, channels: as in `to_dataset`. seconds: the duration, instead of points.
        others: as in `read_recording`.

    Raises:
        FileError, ParseError, DataError: as `read_recording`, `read_table` and `to_dataset`; or an argument
            for tracks is given for other data.
    """
    kind = detect_format(path)
    if points is not None and seconds is not None:
        raise DataError(f"{points} points and {seconds:g} seconds are given; expected one of them")
    changes = (interval, points, seconds, channels, robot, label_file)
    if kind in DATASETS:
        whole = _read_dataset(Path(path), kind, labels, RepairLog(repair), progress)
        if all(argument is None for argument in changes):
            return whole
        if seconds is not None and whole.kind == "series" and changes.count(None) == len(changes) - 1:
            return whole.last(seconds)
        if whole.kind != "motion":
            raise DataError(
                f"{path}: has no tracks of motion, but {join_some(whole.channels)}; durations, rates, poses"
                " and files of labels are for tracks"
            )
        interval = whole.interval if interval is None else interval
        if points is None and seconds is None:
            points = whole.trajectories.shape[2]
    interval = INTERVAL if interval is None else interval
    if seconds is not None:
        points = count_window(seconds, interval)
    recording = read_recording(
        path, labels=labels, label_file=label_file, repair=repair, robot=robot, gap=gap, progress=progress
    )
    try:
        return to_dataset(
            recording, interval=interval, points=POINTS if points is None else points, channels=channels
        )
    except DataError as error:
        reason = str(error).removeprefix(f"{recording.source}: ")
        raise DataError(f"{path}: {reason}") from None


@check_arguments
@keep_pipes()
def read_recording(
    path: str | Path,
    *,
    labels: Mapping[str, str] | None = None,
    label_file: str | Path | None = None,
    repair: str | Collection[str] = (),
    robot: Pose | None = None,
    gap: float = MAX_GAP,
    progress: Progress | None = None,
) -> Recording:
    """Read tracks: a folder of the authors' files, a long CSV, ATC tracking data, Parquet, .npz, or a store.

    From a store (see `lcorpp.learning.store`) only the labelled tracks are read.

    Args:
        labels: label in the file -> class, e.g. {"1": "interested", "0": "not_interested"}; a class maps to
            itself, too. None takes every label unchanged.
        label_file: a CSV of ids and labels, for a file without labels; only those tracks are read.
        repair: names from `REPAIRS`, or "all"; a fault whose repair is not requested is an error.
        robot: the pose of the robot in the frame of the file (x and y in metres, angle in radians); None if
            the file is in the robot's frame.
        gap: maximum number of seconds between two samples of one person.
        progress: callback with (bytes read, bytes in all).

    Raises:
        FileError: a file is missing or cannot be read.
        ParseError: a row or a track has a fault whose repair was not requested.
        DataError: likewise, for files without lines; or an argument is wrong.
    """
    file, kind = Path(path), detect_format(path)
    if not gap > 0:
        raise DataError(f"the longest silence is {gap} s; expected a number above 0")
    repair_log = RepairLog(repair)
    classes = None if label_file is None else read_labels(label_file, labels)
    if kind in DATASETS:
        if classes is not None:
            raise DataError(f"{path}: has labels of its own; {label_file} cannot give others")
        data = _read_dataset(file, kind, labels, repair_log, progress)
        if data.kind != "motion":
            raise DataError(f"{path}: has no tracks of motion, but {join_some(data.channels)}")
        whole = to_recording(data)
        recording = replace(whole, repairs=tuple(repair_log.repairs))
    else:
        only = None if classes is None else classes.keys()
        options = ReadOptions(repair_log, labels, only, gap, progress)
        reader = {"atc": read_atc, "long": read_long_csv, "parquet": read_parquet}[kind]
        tracks, notes = reader(file, options)
        if classes is not None:
            labelled = attach_labels(tracks, classes, RowSource(file, repair_log))
            missing = len(classes) - len({track.group for track in labelled})
            if missing:
                notes = (*notes, f"{missing} of {len(classes)} ids of {label_file} have no tracks")
            tracks = labelled
        notes = (*notes, *note_implausible(tracks))
        recording = Recording(tuple(tracks), file.name, notes, tuple(repair_log.repairs))
    return recording if robot is None else recording.in_robot_frame(*robot)


@keep_pipes()
def read_features(
    path: str | Path,
    *,
    labels: Mapping[str, str] | None,
    repair_log: RepairLog,
    progress: Progress | None = None,
) -> Dataset | None:
    """Read a table of features, or channels of a domain's own; return None if the file has tracks of motion.

    Raises:
        FileError, ParseError, DataError: as `read_data`.
    """
    kind = detect_format(path)
    if kind not in ("npz", "table", "store") or (kind == "store" and read_store(path).schema.is_motion):
        return None
    whole = _read_dataset(Path(path), kind, labels, repair_log, progress)
    return None if whole.kind == "motion" else whole


@check_arguments
def convert_snapshot(snapshot: Snapshot) -> Recording:
    """Convert all tracks of a store, of any length, with their labels, e.g. for `write_recording`.

    Raises:
        DataError: the tracks have no x or y. FileError: the file of the store was changed or damaged.
    """
    schema = snapshot.schema
    tracks = [
        Track(
            stored.id,
            np.arange(float(stored.points)) * schema.interval,
            dict(zip(schema.channels, trajectory, strict=True)),
            stored.label,
            stored.group,
        )
        for stored, trajectory in zip(snapshot, snapshot.iterate_trajectories(snapshot.tracks), strict=True)
    ]
    return Recording(tuple(tracks), str(snapshot.path))


def detect_format(path: str | Path) -> Format:
    """Detect the format of a file or a folder.

    Raises:
        FileError: the file is missing or unreadable, or is not text.
        ParseError: the first line is of no known format.
    """
    file = Path(path)
    if os.path.isdir(file):  # unlike a Path, without an error for a name that is too long
        return "authors"
    suffix = file.suffix.lower()
    if suffix == SUFFIX:
        return "npz"
    if is_store(file):
        return "store"
    if suffix in SUFFIXES:
        return "table" if has_table_columns(ParquetFile(file, RepairLog()).names) else "parquet"
    with open_text(file) as opened:
        try:
            start = opened.read(20_000)
            if "\n" not in start:  # a heading of many features
                start += opened.readline(MAX_HEADING)
        except UnicodeDecodeError as error:
            if b"\0" not in error.object:
                raise locate_bad_byte(file) from None
            start = "\0"
    if "\0" in start:
        raise FileError(
            f"{path}: not text; expected CSV (UTF-8, or UTF-16 with a byte order mark), .npz, .parquet or a"
            " folder of the authors' files"
        )
    for number, text in enumerate(start.splitlines(), start=1):
        if not text.strip():
            continue
        try:
            cells = parse_line(str(path), number, text, detect_delimiter(text))
        except ParseError:
            return "long"  # its reader raises the same error
        if len(cells) == len(ATC_COLUMNS) and is_number(cells[0]):
            return "atc"
        if not all(map(is_number, cells)):
            return "table" if has_table_columns([cell.lower() for cell in cells]) else "long"
        hint = " (the authors' files are read as a folder)" if file.stem.startswith("interpos") else ""
        message = (
            f"{len(cells)} columns of numbers; expected a line that names {', '.join(REQUIRED)}, or the"
            f" {len(ATC_COLUMNS)} columns of ATC data: {', '.join(ATC_COLUMNS)}{hint}"
        )
        raise ParseError(str(path), number, 1, message, text)
    raise ParseError(str(path), 1, 1, f"the file is empty; expected a line that names {', '.join(REQUIRED)}")


def _convert_dataset_units(dataset: Dataset, source: RowSource) -> Dataset:
    """Convert a stored data set to metres and radians, like the tracks of a file."""
    tracks = to_recording(dataset).tracks
    scaled = convert_units(tracks, [1] * len(tracks), source)
    new = [note for note in note_implausible(scaled) if note not in dataset.notes]
    if new:
        dataset = replace(dataset, notes=(*dataset.notes, *new))
    if all(new is old for new, old in zip(scaled, tracks, strict=True)):
        return dataset
    rows = [np.stack([track.columns[name] for name in dataset.channels]) for track in scaled]
    return replace(dataset, trajectories=stack_signals(rows))


def _read_dataset(
    file: Path,
    kind: Format,
    labels: Mapping[str, str] | None,
    repair_log: RepairLog,
    progress: Progress | None,
) -> Dataset:
    if kind == "table":
        return read_table(file, labels, repair_log, progress)
    if kind == "authors":
        return read_authors(file, labels=labels or RAW_LABELS)
    source = RowSource(file, repair_log)
    if kind == "npz":
        dataset = load_dataset(file)
        if dataset.kind == "motion":
            dataset = _convert_dataset_units(dataset, source)
    else:
        dataset = read_store(file).dataset()
    classes = [class_of_label(word, labels) for word in dataset.labels]
    for case, (word, name) in enumerate(zip(dataset.labels, classes, strict=True)):
        if name is None:
            message = f"case {case} (counted from 0): {describe_unknown_label(word, labels)}"
            source.repair_or_raise("labels", 1, message, track=dataset.groups[case])
    known = [case for case, name in enumerate(classes) if name is not None]
    return replace(dataset.take(known), labels=tuple(str(classes[case]) for case in known))
