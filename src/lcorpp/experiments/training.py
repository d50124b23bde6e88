"""Making the learner ready: train it, know how good it is, and say whose motion the trials will see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DataError, DomainError
from lcorpp.experiments.people import Appearance, Motion, Recorded, simulated_dataset
from lcorpp.learning import (
    TrainedClassifier,
    Validation,
    leak_note,
    paper_pipeline,
    read_authors,
    split,
    train_and_validate,
)
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


def recorded_training(domain: Domain, folder: Path, seed: int) -> Training:
    """The authors' recorded tracks: 70% to train on, the people in the other 30% for the trials.

    Raises:
        DomainError: the domain does not say how the data writes its classes.
        FileError, ParseError, DataError: the data are missing, malformed or too few.
    """
    if not domain.data_labels:
        raise DomainError(f"{domain.folder}/domain.toml: [learning] data_labels is missing; --data needs it")
    try:
        train, test = split(read_authors(folder, labels=domain.data_labels), seed=seed)
        leak = leak_note(train) if len(domain.values) == 2 else None
    except DataError as error:
        raise DataError(f"{folder}: {error}") from None
    if leak is not None:
        train = replace(train, notes=(*train.notes, leak))
    return Training(train, Recorded(domain.target, test), PAPER_EPOCHS)


def learn(
    dataset: Dataset,
    *,
    epochs: int,
    seed: int,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[TrainedClassifier, Validation]:
    """Lines 1 and 2 of Algorithm 1: train the paper's LSTM and cross-validate it.

    Args:
        epochs: passes over the data in each training.
        jobs: processes for the folds and the final training.
        progress: called with the trainings done and their number.
    """
    estimator = paper_pipeline(epochs=epochs, random_state=seed)
    return train_and_validate(estimator, dataset, folds=FOLDS, seed=seed, jobs=jobs, progress=progress)
