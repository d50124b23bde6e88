"""Setup of a trained classifier: trained now, or loaded from a file; its error rates become rules."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from lcorpp.arguments import check_arguments
from lcorpp.assembly.estimators import (
    TrainingData,
    choose_learner,
    make_estimator,
    make_untrained,
)
from lcorpp.assembly.options import HARD_LABELS, EvidenceOptions, StoredOptions, TrainingOptions
from lcorpp.assembly.progress import ProgressDisplay, no_progress
from lcorpp.assembly.senses import SenseSetup, nest_rates
from lcorpp.assembly.thresholds import (
    compute_class_prevalence,
    find_positive_class,
    parse_goal,
    set_threshold,
)
from lcorpp.assembly.training_data import make_training_data
from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DataError
from lcorpp.learning import (
    Motion,
    TrainedClassifier,
    build_report,
    estimate_rates,
    load_classifier,
    train_and_validate,
)
from lcorpp.learning.classifiers.storage import check_storable
from lcorpp.learning.evaluation.folds import choose_folds
from lcorpp.learning.evaluation.held_out import HeldOutPredictor
from lcorpp.notebook import join_some
from lcorpp.simulation.people import SelectedSignals, SignalSource, make_signal_source
from lcorpp.values import COVERAGE, ConfusionMatrix


@check_arguments
def train_classifier(
    domain: Domain,
    sense: Sense,
    options: TrainingOptions,
    evidence: EvidenceOptions = HARD_LABELS,
    *,
    seed: int = 0,
    jobs: int = 1,
    progress: ProgressDisplay = no_progress,
) -> SenseSetup:
    """Train and cross-validate the classifier of a sense; its confusion matrix becomes the rules.

    Args:
        options: how to train it. evidence: what it gives to the reasoner.
        seed: of the simulated data, the folds and the training.
        jobs: number of processes; it does not affect the result.
        progress: shows the completed folds.

    Raises:
        DataError, FileError: an option or the data are wrong.
        DomainError: the domain cannot simulate signals.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.assembly import TrainingOptions, train_classifier
        >>> domain = load_domain("intention")
        >>> setup = train_classifier(domain, domain.senses[0], TrainingOptions("summaries", tracks=40))
        >>> setup.source, setup.n_tracks, int(setup.confusion.counts.sum())
        ('summaries', 40, 40)
    """
    goal = None if options.threshold is None else parse_goal(sense, options.threshold)
    options = options.complete(sense)
    make_untrained(options)  # reject options before the work
    coverage = evidence.kind(sense.name).coverage or COVERAGE
    data = make_training_data(domain, sense, options, seed, leave_one_out=True)
    options = choose_learner(options, data.dataset)
    estimator = make_estimator(data, options, seed)
    folds = choose_folds(data.dataset)
    with progress(f"training and cross-validating {options.learner}", folds + 1) as advance:
        trained, validation = train_and_validate(
            estimator, data.dataset, folds=folds, seed=seed, jobs=jobs, progress=advance, coverage=coverage
        )
    positive = find_positive_class(sense)
    prevalence = compute_class_prevalence(domain, sense, options.prevalence)
    trained, validation = set_threshold(domain, sense, options, trained, validation)
    tested = trained
    if data.tests_training_cases:
        predictor = HeldOutPredictor(trained.estimator, data.dataset.trajectories, validation.probabilities)
        tested = replace(trained, estimator=predictor)
    report = build_report(
        validation,
        positive=positive,
        prevalence=prevalence,
        costs=goal if isinstance(goal, tuple) else None,
        learner=options.learner or "",
        source=data.dataset.source,
        coverage=coverage,
    )
    return replace(
        _make_setup(sense, trained, validation.confusion, evidence, data.signals, options.learner or ""),
        n_tracks=len(data.dataset),
        report=report,
        unit=data.dataset.unit,
        data=data.path,
        notes=data.dataset.notes,
        classifier=tested.as_evidence(evidence.kind(sense.name)),
    )


@check_arguments
def load_trained(
    domain: Domain,
    sense: Sense,
    options: StoredOptions,
    evidence: EvidenceOptions = HARD_LABELS,
    *,
    seed: int = 0,
) -> SenseSetup:
    """Load a stored classifier of a sense; its confusion matrix becomes the rules.

    Args:
        options: its file, and the data for the trials. evidence: what it gives to the reasoner.
        seed: of the split of recorded data; that of the training makes the people of the trials new.

    Raises:
        DataError, FileError: the file is not a classifier of the sense's classes, or the recorded data have
            another interval, other channels or other features than its training data.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_domain
        >>> from lcorpp.assembly import StoredOptions, TrainingOptions, load_trained, train_classifier
        >>> from lcorpp.learning import save_classifier
        >>> domain = load_domain("intention")
        >>> setup = train_classifier(domain, domain.senses[0], TrainingOptions("summaries", tracks=40))
        >>> save_classifier(setup.trained, "motion.npz")
        >>> load_trained(domain, domain.senses[0], StoredOptions(Path("motion.npz"))).source
        'motion.npz'
    """
    trained = load_classifier(options.file)
    confusion = trained.confusion
    if confusion is None or set(confusion.classes) != set(sense.classes):
        classes = "unknown classes" if confusion is None else ", ".join(confusion.classes)
        raise DataError(
            f"{options.file}: the classifier's classes are {classes}; {domain.name} needs"
            f" {', '.join(sense.classes)}"
        )
    path: Path | None = options.data or sense.data
    notes: tuple[str, ...] = ()
    signals: SignalSource
    if path is not None:
        recorded = _read_test_data(domain, sense, options, path, trained, seed)
        signals, notes = recorded.signals, recorded.dataset.notes
        if recorded.tests_training_cases:
            warning = f"if {options.file} was trained on the people of {path}, the trials are too good"
            notes = (*notes[:-1], warning)  # in place of that about held-out people, which is the last one
    else:
        signals = make_signal_source(domain, sense, options.seconds)
        if trained.inputs and set(trained.inputs) < set(sense.channels):  # trained on recorded data
            signals = SelectedSignals(signals, [sense.channels.index(name) for name in trained.inputs])
    setup = _make_setup(sense, trained, confusion, evidence, signals, str(options.file))
    return replace(setup, data=path, notes=notes)


def _read_test_data(
    domain: Domain, sense: Sense, options: StoredOptions, path: Path, trained: TrainedClassifier, seed: int
) -> TrainingData:
    """Read the recorded data of a stored classifier; errors as of `load_trained`."""
    from lcorpp.assembly.recorded_data import read_training_data  # loads the readers of all formats

    motion = trained.estimator.steps[0][1]
    inputs = trained.inputs or getattr(motion, "inputs", ("x", "y"))
    recorded = read_training_data(
        domain, sense, path, seed, features=inputs, reading=options.reading, seconds=options.seconds
    )
    interval, channels = recorded.dataset.interval, recorded.dataset.channels
    if isinstance(motion, Motion) and (motion.interval, tuple(motion.inputs)) != (interval, channels):
        raise DataError(
            f"{options.file}: trained on {', '.join(motion.inputs)} every {motion.interval:g} s;"
            f" the data have {', '.join(channels)} every {interval:g} s"
        )
    if trained.inputs and trained.inputs != channels:
        raise DataError(
            f"{options.file}: trained on {join_some(trained.inputs)}; the data have {join_some(channels)}"
        )
    return recorded


def find_storage_problem(options: TrainingOptions) -> str | None:
    """Return the reason why the classifier cannot be stored after training; None if it can."""
    try:
        check_storable(make_untrained(options))
    except DataError as error:
        return str(error)
    return None


def _make_setup(
    sense: Sense,
    trained: TrainedClassifier,
    confusion: ConfusionMatrix,
    evidence: EvidenceOptions,
    signals: SignalSource,
    source: str,
) -> SenseSetup:
    """Return the setup of a trained classifier: its rates become rules, or likelihoods replace its labels.

    Args:
        source: the learner, or the file of the classifier.
    """
    kind = evidence.kind(sense.name)
    rows = [[float(rate) for rate in row] for row in confusion.rates(evidence.smoothing)]
    return SenseSetup(
        trained.as_evidence(kind),
        signals,
        nest_rates(confusion.classes, rows),
        confusion,
        estimate_rates(confusion, smoothing=evidence.smoothing),
        source=source,
        trained=trained,
        evidence=kind,
    )
