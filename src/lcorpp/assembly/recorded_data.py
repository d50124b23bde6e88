"""Recorded training data of a sense, and the other recorded people as the source of the test signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from lcorpp.arguments import check_arguments
from lcorpp.assembly.estimators import TrainingData
from lcorpp.assembly.options import READ_AS_IT_IS, ReadingOptions
from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning import Recording, format_leakage_warning, read_data, split, to_dataset
from lcorpp.learning.data.cleaning import MAX_GAP
from lcorpp.learning.data.windows import INTERVAL, POINTS
from lcorpp.learning.evaluation.folds import (
    assign_training_folds,
    choose_folds,
    count_people,
    has_few_people,
)
from lcorpp.learning.features.motion_features import MOTION_FEATURES
from lcorpp.simulation.people import RecordedSignals
from lcorpp.values import Dataset, count_window
from lcorpp.worlds.ros.people.bag_recording import Progress, find_bags, read_bags

PAPER_EPOCHS = 300
"""Epochs in the paper; right for a hundred recorded tracks, too many for simulated ones."""


@check_arguments
def read_training_data(
    domain: Domain,
    sense: Sense,
    path: Path,
    seed: int,
    *,
    features: Sequence[str] | None = None,
    reading: ReadingOptions = READ_AS_IT_IS,
    seconds: float | None = None,
    leave_one_out: bool = False,
) -> TrainingData:
    """Read recorded data and split them: 70 % for training, the other people's 30 % for the trials.

    With `leave_one_out` data of few people are not split.

    Args:
        path: a path that `read_data` accepts: a folder of the authors' files, CSV, Parquet or .npz; or a bag
            of ROS, or a folder of bags, see `read_bags`.
        seed: of the split.
        features: the classifier's features, see `Motion`; None takes those that need x and y only. Channels
            of motion that no feature needs are dropped, so that the classifier also works where they are not
            measured.
        reading: how to read them. Tracks are resampled to the sense's `rate`.
        seconds: the last seconds of each track that are used; None takes those of the sense.
        leave_one_out: whether data of few people are not split: the caller tests each case by
            leave-one-person-out cross-validation.

    Raises:
        DataError: a class is none of the sense's, or has no case; x or y is missing; there are too few
            cases; or the options are for tracks, and the data are none.
        FileError, ParseError: the data are missing or malformed.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_domain
        >>> from lcorpp.assembly import read_training_data, simulate_training_data
        >>> from lcorpp.learning import save_dataset
        >>> domain = load_domain("intention")
        >>> sense = domain.senses[0]
        >>> save_dataset(simulate_training_data(domain, sense, 0, tracks=40).dataset, "walks.npz")
        >>> len(read_training_data(domain, sense, Path("walks.npz"), seed=0).dataset)  # 70 % of the people
        28
    """
    dataset = _read(sense, path, reading, sense.seconds if seconds is None else seconds, features or ())
    if dataset.kind == "motion":
        dataset = _drop_unused_channels(dataset, features or ())
    unknown = sorted(set(dataset.labels) - set(sense.classes))
    if unknown:
        raise DataError(
            f"{path}: class {unknown[0]!r} is not a value of {sense.of}; {expected_one_of(sense.classes)}"
        )
    counts = {value: dataset.labels.count(value) for value in sense.classes}
    if not all(counts.values()):
        missing = [value for value, count in counts.items() if count == 0]
        found = ", ".join(f"{value} {count}" for value, count in counts.items())
        raise DataError(
            f"{path}: no {dataset.unit} of class {', '.join(missing)}; expected {dataset.unit} of each class"
            f" of {sense.of}, found {found}"
        )
    is_left_out = leave_one_out and has_few_people(dataset)
    try:
        train, test = (dataset, dataset) if is_left_out else split(dataset, seed=seed)
        assign_training_folds(train, choose_folds(train), seed)  # rejects too few people before the work
        leak = format_leakage_warning(train)
    except DataError as error:
        people = f"; the {count_people(dataset.groups)} people are split into training and test data"
        raise DataError(f"{path}: {error}{'' if is_left_out else people}") from None
    unit = dataset.unit
    split_note = (
        f"{len(train)} of {len(dataset)} {unit} are training data; the trials sample {unit} of the"
        f" {count_people(test.groups)} other people, so their intervals do not cover people outside of the"
        " data"
    )
    if is_left_out:
        split_note = (
            f"the {count_people(dataset.groups)} people of {len(dataset)} {unit} are few: the trials sample"
            f" their {unit}, which classifiers that were trained without them classify; the robot's rates are"
            " of the same predictions, and the intervals do not cover other people"
        )
    lost = len(dataset) - len(train) - len(test)
    if lost and not is_left_out:
        split_note += f"; {lost} {unit} of people on both sides are left out"
    notes = (*train.notes, *([] if leak is None else [leak]), split_note)
    signals = RecordedSignals(sense.of, test)
    return TrainingData(
        replace(train, notes=notes), signals, PAPER_EPOCHS, path, tests_training_cases=is_left_out
    )


def _read(
    sense: Sense, path: Path, reading: ReadingOptions, seconds: float | None, features: Sequence[str]
) -> Dataset:
    """Read the data of a sense; of bags the tracks of their people that have what the features need."""
    labels = {**(sense.data_labels or {value: value for value in sense.classes}), **reading.labels}
    interval = None if sense.rate is None else 1 / sense.rate
    if path.exists() and find_bags(path):
        recording = read_bag_recording(path, labels, reading, sense.data_groups)
        needed = _list_needed(features) - {"x", "y"}
        known = tuple(track for track in recording.tracks if needed <= track.columns.keys())
        if 0 < len(known) < len(recording):
            lost = (
                f"{len(recording) - len(known)} of {len(recording)} tracks lack {', '.join(sorted(needed))}"
            )
            recording = replace(recording, tracks=known, notes=(*recording.notes, f"{lost}: left out"))
        interval = interval or INTERVAL
        points = POINTS if seconds is None else count_window(seconds, interval)
        return to_dataset(recording, interval=interval, points=points, step=sense.step)
    return read_data(
        path,
        labels=labels,
        label_file=reading.label_file,
        interval=interval,
        seconds=seconds,
        step=sense.step,
        repair=reading.repair,
        robot=reading.robot,
        gap=MAX_GAP if reading.gap is None else reading.gap,
        columns=reading.columns,
        unit=reading.unit,
        time_unit=reading.time_unit,
        fps=reading.fps,
    )


def read_bag_recording(
    path: Path,
    labels: Mapping[str, str],
    reading: ReadingOptions,
    groups: str | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Read the tracks of the people in a bag or a folder of bags; see `read_bags`.

    Raises:
        DataError: a reading option is for files of tracks.
        FileError, DataError, ParseError: as `read_bags`.
    """
    options = ("repair", "columns", "unit", "time_unit", "fps")
    given = [name for name in options if getattr(reading, name) not in (None, (), {})]
    if given:
        name = given[0].replace("_", "-").replace("columns", "column")
        raise DataError(f"{path}: has bags, whose units and columns are known; expected no --{name}")
    gap = MAX_GAP if reading.gap is None else reading.gap
    recording = read_bags(
        path, labels=labels, label_file=reading.label_file, groups=groups, gap=gap, progress=progress
    )
    return recording if reading.robot is None else recording.in_robot_frame(*reading.robot)


def _list_needed(features: Sequence[str]) -> set[str]:
    """Return the channels that features are computed from: derived from x and y, if that is possible."""
    known = [MOTION_FEATURES[name] for name in features if name in MOTION_FEATURES]
    return set[str]().union(*[feature.needs[-1] for feature in known])


def _drop_unused_channels(dataset: Dataset, features: Sequence[str]) -> Dataset:
    """Return the data set with x, y and the channels that the features are computed from."""
    needed = {"x", "y", *features} | _list_needed(features)
    indices = [index for index, name in enumerate(dataset.channels) if name in needed]
    names = tuple(dataset.channels[index] for index in indices)
    return replace(dataset, trajectories=dataset.trajectories[:, indices], channels=names)
