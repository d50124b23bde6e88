"""Training data, simulated or recorded, with the source of the test trajectories and an estimator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.assembly.options import READ_AS_IT_IS, ReadingOptions, TrainingOptions
from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DataError, DomainError, check_type, expected_one_of
from lcorpp.learning import format_leakage_warning, learner, read_data, split
from lcorpp.learning.classifiers.table import DEFAULTS
from lcorpp.learning.data.cleaning import MAX_GAP
from lcorpp.learning.features.motion_features import MOTION_FEATURES
from lcorpp.simulation.people import (
    CutSignals,
    RecordedSignals,
    SignalSource,
    SimulatedSignals,
    simulate_dataset,
)
from lcorpp.values import Dataset, count_window

FOLDS = 5
"""Folds of every cross-validation."""

PAPER_EPOCHS = 300
"""Epochs in the paper; right for a hundred recorded tracks, too many for simulated ones."""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """A training set and the source of the test signals, which never contains a training case.

    epochs: the number of epochs that suits the data. path: of recorded data.
    """

    dataset: Dataset
    signals: SignalSource
    epochs: int
    path: Path | None = None


def make_training_data(domain: Domain, sense: Sense, options: TrainingOptions, seed: int) -> TrainingData:
    """Return the training data that the options or the domain describe, recorded or simulated.

    Raises:
        DataError: a number of simulated tracks is given, and the data are recorded; and as
            `read_training_data`.
        DomainError: as `simulate_training_data`.
    """
    path = options.data or sense.data
    if path is not None:
        if options.tracks is not None:
            raise DataError(
                f"--tracks {options.tracks}: nothing is simulated, as {path} has the recorded data"
            )
        return read_training_data(
            domain,
            sense,
            path,
            seed,
            features=options.features,
            reading=options.reading,
            seconds=options.seconds,
        )
    return simulate_training_data(domain, sense, seed, tracks=options.tracks, seconds=options.seconds)


def choose_learner(options: TrainingOptions, dataset: Dataset) -> TrainingOptions:
    """Return the options with the learner that suits the data, if they name none."""
    return replace(options, learner=options.learner or DEFAULTS[dataset.kind])


def make_estimator(
    data: TrainingData, options: TrainingOptions, seed: int, *, new_places: bool = True
) -> Any:
    """Return an unfitted estimator of a learner, for the interval and the channels of the training data.

    Without a number of epochs, the learner "lstm" gets `data.epochs`, and any other its own default.

    Args:
        new_places: as of `learner`.

    Raises:
        DataError: as `learner`.
    """
    chosen = choose_learner(options, data.dataset).learner or ""
    default_epochs = data.epochs if chosen == "lstm" else None
    return learner(
        chosen,
        interval=data.dataset.interval,
        inputs=data.dataset.channels,
        features=options.features,
        epochs=options.epochs or default_epochs,
        seed=seed,
        device=options.device,
        kind=data.dataset.kind,
        rate=options.rate,
        new_places=new_places,
    )


def simulate_training_data(
    domain: Domain, sense: Sense, seed: int, *, tracks: int | None = None, seconds: float | None = None
) -> TrainingData:
    """Simulate a training set; the trials simulate new trajectories.

    Args:
        tracks: the number of tracks; None takes the sense's number.
        seconds: the last seconds of each track that are used; None takes all.

    Raises:
        DomainError: the domain has no `people.py` with a function for the sense.
        DataError: seconds are given, and the signals are features.
    """
    check_type(domain, Domain, "the domain", DomainError)
    source = make_signal_source(domain, sense, seconds)
    rng = np.random.default_rng([seed, 0])
    dataset = simulate_dataset(domain, sense, source, sense.tracks if tracks is None else tracks, rng)
    return TrainingData(dataset, source, sense.epochs)


def make_signal_source(domain: Domain, sense: Sense, seconds: float | None) -> SignalSource:
    """Return the simulated signals of a sense, or their last seconds; raises as `simulate_training_data`."""
    source = SimulatedSignals.from_domain(domain, sense)
    if seconds is None:
        return source
    return CutSignals(source, slice(-count_window(seconds, sense.interval), None))


def read_training_data(
    domain: Domain,
    sense: Sense,
    path: Path,
    seed: int,
    *,
    features: Sequence[str] | None = None,
    reading: ReadingOptions = READ_AS_IT_IS,
    seconds: float | None = None,
) -> TrainingData:
    """Read recorded data and split them: 70 % for training, the other people's 30 % for the trials.

    Args:
        path: a path that `read_data` accepts: a folder of the authors' files, CSV, Parquet or .npz.
        features: the classifier's features, see `Motion`; None takes those that need x and y only. Channels
            of motion that no feature needs are dropped, so that the classifier also works where they are not
            measured.
        reading: how to read them. Tracks are resampled to the sense's `rate`.
        seconds: the last seconds of each track that are used; None takes those of the sense.

    Raises:
        DataError: a class is none of the sense's, or has no case; x or y is missing; there are too few
            cases; or the options are for tracks, and the data are none.
        FileError, ParseError: the data are missing or malformed.
    """
    check_type(domain, Domain, "the domain", DomainError)
    labels = sense.data_labels or {value: value for value in sense.classes}
    dataset = read_data(
        path,
        labels={**labels, **reading.labels},
        label_file=reading.label_file,
        interval=None if sense.rate is None else 1 / sense.rate,
        seconds=sense.seconds if seconds is None else seconds,
        repair=reading.repair,
        robot=reading.robot,
        gap=MAX_GAP if reading.gap is None else reading.gap,
        columns=reading.columns,
        unit=reading.unit,
        time_unit=reading.time_unit,
        fps=reading.fps,
    )
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
    try:
        train, test = split(dataset, seed=seed)
        leak = format_leakage_warning(train)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    unit = dataset.unit
    split_note = (
        f"{len(train)} of {len(dataset)} {unit} are training data; the trials sample {unit} of the"
        f" {len(set(test.groups))} other people, so their intervals do not cover people outside of the data"
    )
    notes = (*train.notes, split_note, *([] if leak is None else [leak]))
    return TrainingData(replace(train, notes=notes), RecordedSignals(sense.of, test), PAPER_EPOCHS, path)


def _drop_unused_channels(dataset: Dataset, features: Sequence[str]) -> Dataset:
    """Return the data set with x, y and the channels that the features are computed from."""
    known = [MOTION_FEATURES[name] for name in features if name in MOTION_FEATURES]
    derived = [feature.needs[-1] for feature in known]  # from x and y, if that is possible
    needed = {"x", "y", *features}.union(*derived)
    indices = [index for index, name in enumerate(dataset.channels) if name in needed]
    names = tuple(dataset.channels[index] for index in indices)
    return replace(dataset, trajectories=dataset.trajectories[:, indices], channels=names)
