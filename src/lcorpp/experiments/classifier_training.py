"""Setup of a trained classifier: trained now, or loaded from a file; its error rates become rules."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lcorpp.domains import Domain
from lcorpp.errors import DataError, DomainError, check_type
from lcorpp.experiments.setup import (
    HARD_LABELS,
    ClassifierSetup,
    EvidenceOptions,
    ProgressDisplay,
    StoredOptions,
    TrainingOptions,
    nest_rates,
    no_progress,
)
from lcorpp.experiments.thresholds import (
    compute_class_prevalence,
    find_positive_class,
    parse_goal,
    select_threshold,
)
from lcorpp.experiments.training_data import FOLDS, make_estimator, make_training_data, read_training_data
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
from lcorpp.simulation.people import SimulatedTrajectories, TrajectorySource
from lcorpp.values import ConfusionMatrix


def train_classifier(
    domain: Domain,
    options: TrainingOptions,
    evidence: EvidenceOptions = HARD_LABELS,
    *,
    seed: int = 0,
    jobs: int = 1,
    progress: ProgressDisplay = no_progress,
) -> ClassifierSetup:
    """Train a classifier, cross-validate it and put its confusion matrix into the rules.

    Raises:
        DataError, FileError: an option or the data are wrong.
        DomainError: the domain cannot simulate trajectories.
    """
    check_type(domain, Domain, "the domain", DomainError)
    goal = None if options.threshold is None else parse_goal(domain, options.threshold)
    learner(options.learner, epochs=options.epochs, device=options.device)  # reject options before the work
    data = make_training_data(domain, options, seed)
    estimator = make_estimator(data, options, seed)
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
    about = {"n_tracks": len(data.dataset), "report": report, "notes": data.dataset.notes}
    return _make_setup(domain, trained, validation.confusion, evidence, data.trajectories, **about)


def load_trained(
    domain: Domain, options: StoredOptions, evidence: EvidenceOptions = HARD_LABELS, *, seed: int = 0
) -> ClassifierSetup:
    """Load a stored classifier and put its confusion matrix into the rules.

    Raises:
        DataError, FileError: the file is no classifier of the domain's classes, or the recorded tracks have
            another interval or other channels than its training data.
    """
    check_type(domain, Domain, "the domain", DomainError)
    trained = load_classifier(options.file)
    confusion = trained.confusion
    if confusion is None or set(confusion.classes) != set(domain.values):
        classes = "unknown classes" if confusion is None else ", ".join(confusion.classes)
        raise DataError(
            f"{options.file}: the classifier's classes are {classes}; {domain.name} needs"
            f" {', '.join(domain.values)}"
        )
    if options.data is None:
        return _make_setup(domain, trained, confusion, evidence, SimulatedTrajectories.of(domain))
    motion = trained.estimator.steps[0][1]
    recorded = read_training_data(domain, options.data, seed, features=getattr(motion, "inputs", ("x", "y")))
    interval, channels = recorded.dataset.interval, recorded.dataset.channels
    if isinstance(motion, Motion) and (motion.interval, tuple(motion.inputs)) != (interval, channels):
        raise DataError(
            f"{options.file}: trained on {', '.join(motion.inputs)} every {motion.interval:g} s;"
            f" the data have {', '.join(channels)} every {interval:g} s"
        )
    notes = recorded.dataset.notes
    return _make_setup(domain, trained, confusion, evidence, recorded.trajectories, notes=notes)


def find_storage_problem(options: TrainingOptions) -> str | None:
    """Return the reason why the classifier cannot be stored after training; None if it can."""
    try:
        check_storable(learner(options.learner, epochs=options.epochs, device=options.device))
    except DataError as error:
        return str(error)
    return None


def _make_setup(
    domain: Domain,
    trained: TrainedClassifier,
    confusion: ConfusionMatrix,
    evidence: EvidenceOptions,
    trajectories: TrajectorySource,
    **about: Any,
) -> ClassifierSetup:
    """Return the setup of a trained classifier: its rates become rules, or likelihoods replace its labels.

    about: fields of `ClassifierSetup` that only some setups have.
    """
    rows = [[float(rate) for rate in row] for row in confusion.rates(evidence.smoothing)]
    return ClassifierSetup(
        trained.soft() if evidence.soft else trained,
        trajectories,
        domain.soft_program if evidence.soft else domain.program_for(confusion, evidence.smoothing),
        nest_rates(confusion.classes, rows),
        estimate_rates(confusion, smoothing=evidence.smoothing),
        trained,
        **about,
    )
