"""The training data of a sense, and the untrained estimator that suits them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lcorpp.assembly.options import TrainingOptions
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning import learner
from lcorpp.learning.classifiers.learner_table import DEFAULTS
from lcorpp.learning.features.rate import RATE
from lcorpp.simulation.people import SignalSource
from lcorpp.values import Dataset

BALANCES: Mapping[str, str | None] = {"classes": "balanced", "none": None}
"""`TrainingOptions.balance` -> weights of classes, as of `learner`."""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """A training set and the source of the test signals.

    epochs: the number of epochs that suits the data. path: of recorded data.
    tests_training_cases: whether the test signals are the training cases, as the people are few.
    """

    dataset: Dataset
    signals: SignalSource
    epochs: int
    path: Path | None = None
    tests_training_cases: bool = False


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
        rate=options.rate or RATE,
        new_places=new_places,
        class_weight=_find_class_weight(options),
    )


def make_untrained(options: TrainingOptions) -> Any:
    """Return an estimator of the learner before the data are known; raises as `learner`."""
    return learner(
        options.learner or DEFAULTS["motion"],
        epochs=options.epochs,
        device=options.device,
        features=options.features,
        rate=options.rate or RATE,
        class_weight=_find_class_weight(options),
    )


def _find_class_weight(options: TrainingOptions) -> str | None:
    """Return the weights of classes that `balance` names, as of `learner`.

    Raises:
        DataError: the name is unknown.
    """
    if options.balance not in BALANCES:
        raise DataError(f"balance is {options.balance!r}; {expected_one_of(BALANCES)}")
    return BALANCES[options.balance]
