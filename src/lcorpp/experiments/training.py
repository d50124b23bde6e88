"""Making the learner ready: train it, know how good it is, and say whose motion the trials will see."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DataError, DomainError
from lcorpp.learning import (
    TrainedClassifier,
    Validation,
    leakage_note,
    learner,
    read_data,
    split,
    train_and_validate,
)
from lcorpp.simulation.population import Appearance, Motion, Recorded, simulated_dataset
from lcorpp.values import Dataset

FOLDS = 5

PAPER_EPOCHS = 300
"""Passes over the data in the paper; right for a hundred recorded tracks, too many for simulated ones."""


@dataclass(frozen=True, eq=False)
class Training:
    """Data to train on, and how people look in the trials afterwards: never the tracks trained on.

    epochs: passes over the data that suit them.
    """

    dataset: Dataset
    appearance: Appearance
    epochs: int


def simulated_training(domain: Domain, seed: int, *, tracks: int | None = None) -> Training:
    """Simulated tracks to train on; the trials simulate new ones.

    Args:
        tracks: how many; None takes the domain's number.

    Raises:
        DomainError: the domain has no `people.py` that moves people.
    """
    motion = motion_of(domain)
    rng = np.random.default_rng([seed, 0])
    return Training(simulated_dataset(domain, motion, tracks or domain.tracks, rng), motion, domain.epochs)


def motion_of(domain: Domain) -> Motion:
    """How the domain's people move.

    Raises:
        DomainError: the domain has no `people.py` that moves people.
    """
    if domain.simulation.trajectories is None:
        raise DomainError(
            f"{domain.folder}: no people.py with trajectories; give --data or --classifier channel"
        )
    return Motion(domain.simulation.trajectories)


def recorded_training(
    domain: Domain, path: Path, seed: int, *, channels: Sequence[str] = ("x", "y")
) -> Training:
    """Recorded tracks: 70% to train on, the people in the other 30% for the trials.

    Args:
        path: whatever `read_data` reads: a folder of the authors' files, CSV, Parquet or .npz.
        channels: what the classifier sees, see `Motion`. Columns that it does not need are left out, so that
            it can be used where they are not measured.

    Raises:
        DataError: a class is none of the domain's values, the channels are not x and y, or there are too few.
        FileError, ParseError: the data are missing or malformed.
    """
    written = domain.data_labels or {value: value for value in domain.values}
    dataset = _needed(read_data(path, labels=written), channels)
    try:
        train, test = split(dataset, seed=seed)
        leak = leakage_note(train) if len(domain.values) == 2 else None
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    kept = (
        f"of {len(dataset)} tracks {len(train)} are learnt from; the trials meet the {len(set(test.groups))}"
        " other people, and their intervals are about more trials with these people"
    )
    notes = (*train.notes, kept, *([] if leak is None else [leak]))
    return Training(replace(train, notes=notes), Recorded(domain.target, test), PAPER_EPOCHS)


def _needed(dataset: Dataset, channels: Sequence[str]) -> Dataset:
    """A data set with the columns that some channels of `Motion` are made of."""
    wanted = {"x", "y", *channels, *(["facing"] if "attention" in channels else [])}
    kept = [index for index, name in enumerate(dataset.channels) if name in wanted]
    names = tuple(dataset.channels[index] for index in kept)
    return replace(dataset, trajectories=dataset.trajectories[:, kept], channels=names)


def estimator_for(
    training: Training,
    name: str = "lstm",
    *,
    epochs: int | None = None,
    seed: int = 0,
    device: str = "cpu",
    channels: Sequence[str] = ("x", "y"),
) -> Any:
    """The learner of that name for the tracks at hand, not yet trained.

    Args:
        name: see `learner`.
        epochs: passes over the data; None takes what suits the data for "lstm", and the learner's own number
            for others.
        channels: what the classifier sees, see `Motion`.

    Raises:
        DataError: as `learner`.
    """
    suited = training.epochs if name == "lstm" else None
    return learner(
        name,
        interval=training.dataset.interval,
        inputs=training.dataset.channels,
        channels=channels,
        epochs=epochs or suited,
        seed=seed,
        device=device,
    )


def learn(
    dataset: Dataset,
    *,
    estimator: Any,
    seed: int,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[TrainedClassifier, Validation]:
    """Lines 1 and 2 of Algorithm 1: train a classifier and cross-validate it.

    Args:
        estimator: e.g. of `estimator_for`.
        jobs: processes for the folds and the final training.
        progress: called with the trainings done and their number.
    """
    return train_and_validate(estimator, dataset, folds=FOLDS, seed=seed, jobs=jobs, progress=progress)
