"""Read recordings of any format, detected by content rather than by name."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.files import keep_pipes
from lcorpp.learning.data.authors import read_authors
from lcorpp.learning.data.cleaning import MAX_GAP
from lcorpp.learning.data.csv_reader import Progress
from lcorpp.learning.data.formats.detection import DATASETS, FileFormat, detect_format
from lcorpp.learning.data.formats.json_tracks import read_json
from lcorpp.learning.data.formats.marker_table import read_marker_table
from lcorpp.learning.data.formats.parquet import read_parquet
from lcorpp.learning.data.formats.rows import read_rows
from lcorpp.learning.data.formats.table import read_table
from lcorpp.learning.data.formats.time_series import read_time_series
from lcorpp.learning.data.ingest import ReadOptions
from lcorpp.learning.data.labels import attach_labels, class_of_label, describe_unknown_label, read_labels
from lcorpp.learning.data.measures import Measures, parse_measures
from lcorpp.learning.data.npz import load_dataset, to_recording
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.learning.data.tracks import Recording, Track, note_repairs
from lcorpp.learning.data.units import convert_units, note_implausible
from lcorpp.learning.data.windows import INTERVAL, POINTS, to_dataset
from lcorpp.learning.store import Snapshot, read_store
from lcorpp.notebook import join_some
from lcorpp.values import Dataset, count_window, stack_signals

RAW_LABELS = {"0": "0", "1": "1"}
"""Labels of the authors' files, if the caller does not name their classes."""

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
    step: float | None = None,
    channels: Sequence[str] | None = None,
    repair: str | Collection[str] = (),
    robot: Pose | None = None,
    gap: float = MAX_GAP,
    columns: Mapping[str, str] | None = None,
    unit: str | float | None = None,
    time_unit: str | float | None = None,
    fps: float | None = None,
    progress: Progress | None = None,
) -> Dataset:
    r"""Read labelled tracks of any format, time series, or a table of features, as a data set to learn from.

    The authors' files, .npz and stores stay unchanged unless an argument changes them; other formats of
    tracks are cut to the last ten seconds of each track, at most 304 points .033 s apart, see `to_dataset`.

    Args:
        interval, points, step, channels: as in `to_dataset`. seconds: the duration, instead of points.
        others: as in `read_recording`.

    Raises:
        FileError, ParseError, DataError: as `read_recording`, `read_table` and `to_dataset`; or an argument
            for tracks is given for other data.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.learning import read_data
        >>> rows = "track,time,x,y,label\n7,0,4,1,interested\n7,2,2,1,interested\n"
        >>> _ = Path("people.csv").write_text(rows)
        >>> data = read_data("people.csv", interval=0.5, seconds=1)
        >>> data.labels, data.trajectories.tolist()  # the last second of the track
        (('interested',), [[[3.0, 2.5, 2.0], [1.0, 1.0, 1.0]]])
    """
    measures = parse_measures(unit, time_unit, fps)
    found = detect_format(path, columns, measures)
    if points is not None and seconds is not None:
        raise DataError(f"{points} points and {seconds:g} seconds are given; expected one of them")
    changes = (interval, points, seconds, channels, robot, label_file, step)
    if found.kind in DATASETS:
        repair_log = RepairLog(repair)
        whole = _read_dataset(Path(path), found, labels, repair_log, progress, columns, measures)
        whole = replace(whole, notes=(*whole.notes, *note_repairs(repair_log.repairs)))
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
        path,
        labels=labels,
        label_file=label_file,
        repair=repair,
        robot=robot,
        gap=gap,
        columns=columns,
        unit=unit,
        time_unit=time_unit,
        fps=fps,
        progress=progress,
    )
    try:
        return to_dataset(
            recording,
            interval=interval,
            points=POINTS if points is None else points,
            channels=channels,
            step=step,
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
    columns: Mapping[str, str] | None = None,
    unit: str | float | None = None,
    time_unit: str | float | None = None,
    fps: float | None = None,
    progress: Progress | None = None,
) -> Recording:
    r"""Read tracks: CSV, Parquet, .npz, stores, formats of public data sets (docs/guides/data/formats.md).

    The format is recognised by the content. From a store (see `lcorpp.learning.store`) only the labelled
    tracks are read.

    Args:
        labels: label in the file -> class, e.g. {"1": "interested", "0": "not_interested"}; a class maps to
            itself, too. None takes every label unchanged.
        label_file: a CSV of ids and labels, for a file without labels; only those tracks are read.
        repair: names from `REPAIRS`, or "all"; a fault whose repair is not requested is an error.
        robot: the pose of the robot in the frame of the file (x and y in metres, angle in radians); None if
            the file is in the robot's frame.
        gap: maximum number of seconds between two samples of one person.
        columns: column of the long format -> its name in the file, e.g. {"time": "stamp", "x": "pos_x"}; in a
            file without a heading its number, from 1.
        unit: the unit of length: a name, e.g. "mm", or metres per unit, e.g. of a pixel; also of speeds.
        time_unit: the unit of time: "s", "ms", "us", "ns", or seconds per unit.
        fps: frames per second, instead of `time_unit`, if times are frame numbers.
        progress: callback with (bytes read, bytes in all).

    Raises:
        FileError: a file is missing or cannot be read.
        ParseError: a row or a track has a fault whose repair was not requested.
        DataError: likewise, for files without lines; or an argument is wrong.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.learning import read_recording
        >>> rows = "track,time,x,y,label\n7,0,4,1,1\n7,1,3,1,1\n8,0,5,0,0\n8,2,5,4,0\n"
        >>> _ = Path("people.csv").write_text(rows)
        >>> recording = read_recording("people.csv", labels={"1": "interested", "0": "not_interested"})
        >>> [(track.id, track.label, track.duration) for track in recording.tracks]
        [('7', 'interested', 1.0), ('8', 'not_interested', 2.0)]
    """
    measures = parse_measures(unit, time_unit, fps)
    file, found = Path(path), detect_format(path, columns, measures)
    if not gap > 0:
        raise DataError(f"the longest silence is {gap} s; expected a number above 0")
    repair_log = RepairLog(repair)
    classes = None if label_file is None else read_labels(label_file, labels)
    if found.kind in DATASETS:
        if classes is not None:
            raise DataError(f"{path}: has labels of its own; {label_file} cannot give others")
        data = _read_dataset(file, found, labels, repair_log, progress, columns, measures)
        if data.kind != "motion":
            raise DataError(f"{path}: has no tracks of motion, but {join_some(data.channels)}")
        whole = to_recording(data)
        recording = replace(whole, repairs=tuple(repair_log.repairs))
    else:
        only = None if classes is None else classes.keys()
        options = ReadOptions(repair_log, labels, only, gap, progress, columns or {}, measures)
        if found.rows is not None:
            tracks, notes = read_rows(found.rows, options)
        else:
            reader = {"json": read_json, "markers": read_marker_table, "parquet": read_parquet}[found.kind]
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
    columns: Mapping[str, str] | None = None,
    unit: str | float | None = None,
    time_unit: str | float | None = None,
    fps: float | None = None,
    progress: Progress | None = None,
) -> Dataset | None:
    """Read a table of features, or channels of a domain's own; return None if the file has tracks of motion.

    Args: as of `read_recording`.

    Raises:
        FileError, ParseError, DataError: as `read_data`.
    """
    measures = parse_measures(unit, time_unit, fps)
    found = detect_format(path, columns, measures)
    if found.kind not in ("npz", "table", "store", "series"):
        return None
    if found.kind == "store" and read_store(path).schema.is_motion:
        return None
    whole = _read_dataset(Path(path), found, labels, repair_log, progress, columns, measures)
    return None if whole.kind == "motion" else whole


@check_arguments
def convert_snapshot(snapshot: Snapshot) -> Recording:
    """Convert all tracks of a store, of any length, with their labels, e.g. for `write_recording`.

    Raises:
        DataError: the tracks have no x or y. FileError: the file of the store was changed or damaged.

    Examples:
        >>> from lcorpp.learning import NewTrack, Store, TrackSchema, convert_snapshot
        >>> with Store("converted.tracks", TrackSchema(["x", "y"], 0.5, ["interested"])) as store:
        ...     _ = store.append(NewTrack([[0.0, 1.0, 2.0], [0.0, 0.0, 0.0]], "interested", id="7"))
        ...     recording = convert_snapshot(store.snapshot())
        >>> recording.tracks[0].label, recording.tracks[0].duration
        ('interested', 1.0)
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
    found: FileFormat,
    labels: Mapping[str, str] | None,
    repair_log: RepairLog,
    progress: Progress | None,
    columns: Mapping[str, str] | None,
    measures: Measures,
) -> Dataset:
    kind = found.kind
    if columns:
        raise DataError(f"{file}: has no columns of tracks to name; expected no --column")
    if measures and kind != "series":
        raise DataError(f"{file}: its units are known; expected no --unit, --time-unit or --fps")
    if kind == "table":
        return read_table(file, labels, repair_log, progress)
    if kind == "authors":
        return read_authors(file, labels=labels or RAW_LABELS)
    source = RowSource(file, repair_log)
    if kind == "npz":
        dataset = load_dataset(file)
        if dataset.kind == "motion":
            dataset = _convert_dataset_units(dataset, source)
    elif kind == "series":
        dataset = read_time_series(file, measures)
    elif kind == "store":
        dataset = read_store(file).dataset()
    else:
        raise AssertionError(f"no reader of {kind}, a kind of `DATASETS`")
    classes = [class_of_label(word, labels) for word in dataset.labels]
    for case, (word, name) in enumerate(zip(dataset.labels, classes, strict=True)):
        if name is None:
            message = f"case {case} (counted from 0): {describe_unknown_label(word, labels)}"
            source.repair_or_raise("labels", 1, message, track=dataset.groups[case])
    known = [case for case, name in enumerate(classes) if name is not None]
    return replace(dataset.take(known), labels=tuple(str(classes[case]) for case in known))
