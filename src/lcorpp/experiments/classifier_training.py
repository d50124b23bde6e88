"""Setup of a trained classifier: trained now, or loaded from a file; its error rates become rules."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DataError
from lcorpp.experiments.estimators import FOLDS, make_estimator
from lcorpp.experiments.progress import Progress, no_progress
from lcorpp.experiments.setup import (
    HARD_LABELS,
    ClassifierSetup,
    EvidenceOptions,
    StoredOptions,
    TrainingOptions,
    nest_rates,
)
from lcorpp.experiments.thresholds import (
    compute_class_prevalence,
    find_positive_class,
    parse_goal,
    select_threshold,
)
from lcorpp.experiments.training_data import read_training_data, simulate_training_data
from lcorpp.learning import (
    Motion,
    TrainedClassifier,
    apply_threshold,
    build_report,
    estimate_rates,
    learner,
    load_classifier,
    train_and_validate,
)
from lcorpp.learning.classifiers.storage import check_storable
from lcorpp.simulation.trajectories import SimulatedTrajectories, TrajectorySource
from lcorpp.values import ConfusionMatrix, Dataset


def train_classifier(
    domain: Domain,
    options: TrainingOptions,
    evidence: EvidenceOptions = HARD_LABELS,
    *,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress = no_progress,
) -> ClassifierSetup:
    """Train a classifier, cross-validate it and put its confusion matrix into the rules.

    Raises:
        DataError, FileError: an option or the data are wrong.
        DomainError: the domain cannot simulate trajectories.
    """
    goal = None if options.threshold is None else parse_goal(domain, options.threshold)
    learner(options.learner, epochs=options.epochs, device=options.device)  # reject options before the work
    data = (
        read_training_data(domain, options.data, seed, features=options.features)
        if options.data
        else simulate_training_data(domain, seed, tracks=options.tracks)
    )
    estimator = make_estimator(
        data,
        options.learner,
        epochs=options.epochs,
        seed=seed,
        device=options.device,
        features=options.features,
    )
    with progress(f"training and cross-validating {options.learner}", FOLDS + 1) as advance:
        trained, validation = train_and_validate(
            estimator, data.dataset, folds=FOLDS, seed=seed, jobs=jobs, progress=advance
        )
    positive, prevalence = find_positive_class(domain), compute_class_prevalence(domain, options.prevalence)
    if goal is not None:
        threshold = select_threshold(validation, positive, prevalence[positive], goal)
        validation = validation.with_predictions(
            apply_threshold(validation.classes, validation.probabilities, threshold)
        )
        trained = replace(trained, confusion=validation.confusion, threshold=threshold)
    report = build_report(
        validation,
        positive=positive,
        prevalence=prevalence,
        costs=goal if isinstance(goal, tuple) else None,
        learner=options.learner,
        source=data.dataset.source,
    )
    setup = _with_rates(domain, trained, validation.confusion, evidence, data.trajectories)
    return replace(setup, n_tracks=len(data.dataset), report=report, notes=data.dataset.notes)


def load_trained(
    domain: Domain, options: StoredOptions, evidence: EvidenceOptions = HARD_LABELS, *, seed: int = 0
) -> ClassifierSetup:
    """Load a stored classifier and put its confusion matrix into the rules.

    Raises:
        DataError, FileError: the file is no classifier of the domain's classes, or the recorded tracks have
            another interval or other channels than its training data.
    """
    file = options.file
    trained = load_classifier(file)
    if trained.confusion is None or set(trained.confusion.classes) != set(domain.values):
        classes = "unknown classes" if trained.confusion is None else ", ".join(trained.confusion.classes)
        raise DataError(
            f"{file}: the classifier's classes are {classes}; {domain.name} needs {', '.join(domain.values)}"
        )
    if options.data is None:
        return _with_rates(domain, trained, trained.confusion, evidence, SimulatedTrajectories.of(domain))
    channels = getattr(trained.estimator.steps[0][1], "inputs", ("x", "y"))
    recorded = read_training_data(domain, options.data, seed, features=channels)
    _check_channels(file, trained, recorded.dataset)
    setup = _with_rates(domain, trained, trained.confusion, evidence, recorded.trajectories)
    return replace(setup, notes=recorded.dataset.notes)


def find_storage_problem(options: TrainingOptions) -> str | None:
    """Return the reason why the classifier cannot be stored after training; None if it can."""
    try:
        check_storable(learner(options.learner, epochs=options.epochs, device=options.device))
    except DataError as error:
        return str(error)
    return None


def _with_rates(
    domain: Domain,
    trained: TrainedClassifier,
    confusion: ConfusionMatrix,
    evidence: EvidenceOptions,
    trajectories: TrajectorySource,
) -> ClassifierSetup:
    """Return the setup of a trained classifier: its rates become rules, or likelihoods replace its labels."""
    smoothed = [[float(rate) for rate in row] for row in confusion.rates(evidence.smoothing)]
    return ClassifierSetup(
        trained.soft() if evidence.soft else trained,
        trajectories,
        domain.soft_program if evidence.soft else domain.program_for(confusion, evidence.smoothing),
        nest_rates(confusion.classes, np.array(smoothed)),
        estimate_rates(confusion, smoothing=evidence.smoothing),
        trained,
    )


def _check_channels(file: Path, trained: TrainedClassifier, dataset: Dataset) -> None:
    """Reject tracks whose interval or channels differ from those of the training data."""
    first = trained.estimator.steps[0][1]
    if isinstance(first, Motion) and (first.interval, tuple(first.inputs)) != (
        dataset.interval,
        dataset.channels,
    ):
        raise DataError(
            f"{file}: trained on {', '.join(first.inputs)} every {first.interval:g} s; the data have"
            f" {', '.join(dataset.channels)} every {dataset.interval:g} s"
        )
