"""How a command comes by a classifier: the domain's channel, one that is trained now, or one from a file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.cli import console as show, report_table
from lcorpp.domains import Domain
from lcorpp.errors import DataError
from lcorpp.reasoning import Program, Reasoner
from lcorpp.simulation.channel import BatchClassifier, NoisyChannel
from lcorpp.simulation.trajectories import SimulatedTrajectories, TrajectorySource
from lcorpp.values import JEFFREYS, Array, ConfusionMatrix, Dataset

if TYPE_CHECKING:
    from lcorpp.learning import DecisionThreshold, EvaluationReport, TrainedClassifier, Validation

RAREST = 1e-3
"""How common a class is at least when thresholds are chosen."""


@dataclass(frozen=True, eq=False)
class Eyes:
    """A classifier, whom it will see, and the rules that say how far to trust it.

    rates: true value -> value said -> probability, as measured, or as given for a channel.
    tracks: on how many it was trained now, None where it was not.
    report: how good it is found to be, None where it was not trained now.
    notes: what the user has to know about the data.
    """

    reader: BatchClassifier
    appearance: TrajectorySource
    program: Program
    rates: dict[str, dict[str, float]]
    tracks: int | None
    report: EvaluationReport | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Wanted:
    """What is to be learnt, as the user says it.

    learner: a name for `learner`. epochs: passes over the data, None for what suits. device: cpu or cuda.
    threshold: from which probability on the positive class is called: a number, a goal to choose it for, or
        the costs of a missed case and of a false alarm with a colon; None calls the most probable class.
    prevalence: how common the positive class is where the robot works; None asks the domain's knowledge.
    features: the motion features that the classifier uses.
    """

    learner: str = "lstm"
    epochs: int | None = None
    device: str = "cpu"
    threshold: str | None = None
    prevalence: float | None = None
    features: tuple[str, ...] = ("x", "y")


@dataclass(frozen=True)
class Trust:
    """How the reasoner is told what the classifier says.

    soft: by a likelihood of each class, in place of a label.
    smoothing: of the confusion matrix that says how far to trust a label.
    """

    soft: bool = False
    smoothing: Fraction = JEFFREYS


def channel_eyes(domain: Domain) -> Eyes:
    """The classifier as the domain's channel; the rules stay as they are written."""
    channel = NoisyChannel.of(domain)
    rates = _table(domain.values, channel.rates)
    show.console.print("the classifier is a channel")
    for actual, row in rates.items():
        said = ", ".join(f"{value} {rate:.3f}" for value, rate in row.items())
        show.console.print(f"  {actual} people are called: {said}")
    return Eyes(channel, channel, domain.program, rates, None, None, ())


def trained_eyes(
    domain: Domain,
    wanted: Wanted,
    trust: Trust,
    *,
    data: Path | None,
    tracks: int | None,
    seed: int,
    jobs: int,
) -> Eyes:
    """A classifier that is trained now; its confusion matrix becomes the rules.

    Args:
        data: recorded tracks for training and trials, in place of simulated ones.
        tracks: simulated tracks to train on; None takes the domain's number.
    """
    from lcorpp.experiments.training_data import (
        FOLDS,
        make_estimator,
        read_training_data,
        simulate_training_data,
    )
    from lcorpp.learning import build_report, learner, train_and_validate
    from lcorpp.learning.evaluation.thresholds import apply_threshold

    positive = domain.learning.positive or max(domain.values)
    goal = None if wanted.threshold is None else _goal(domain, positive, wanted.threshold)
    learner(wanted.learner, epochs=wanted.epochs, device=wanted.device)  # mistakes are told before the work
    training = (
        read_training_data(domain, data, seed, features=wanted.features)
        if data
        else simulate_training_data(domain, seed, tracks=tracks)
    )
    estimator = make_estimator(
        training,
        wanted.learner,
        epochs=wanted.epochs,
        seed=seed,
        device=wanted.device,
        features=wanted.features,
    )
    with show.progress(f"cross-validating and training: {wanted.learner}") as advance:
        trained, validation = train_and_validate(
            estimator, training.dataset, folds=FOLDS, seed=seed, jobs=jobs, progress=advance
        )
    common = _prevalence(domain, positive, wanted.prevalence)
    if goal is not None:
        threshold = _threshold(validation, positive, common[positive], goal)
        validation = validation.with_predictions(
            apply_threshold(validation.classes, validation.probabilities, threshold)
        )
        trained = replace(trained, confusion=validation.confusion, threshold=threshold)
    report = build_report(
        validation,
        positive=positive,
        prevalence=common,
        costs=goal if isinstance(goal, tuple) else None,
        learner=wanted.learner,
        source=training.dataset.source,
    )
    show.console.print(
        f"{wanted.learner}, five-fold on {training.dataset.source}: {len(training.dataset)} tracks of"
        f" {report.people} people; [dim]95% intervals[/dim]",
    )
    rates = _told(validation.confusion, trust)
    show.console.print(f"  accuracy {report.accuracy}", markup=False)
    show.console.print(report_table.table(report))
    if trained.threshold is not None:
        show.console.print(f"{positive} people are called so from {trained.threshold.probability:.3f} on")
    appearance, notes = training.trajectories, training.dataset.notes
    reader, program = _evidence(domain, trained, validation.confusion, trust)
    return Eyes(reader, appearance, program, rates, len(training.dataset), report, notes)


def stored_eyes(domain: Domain, file: Path, trust: Trust, *, data: Path | None, seed: int) -> Eyes:
    """A classifier that an earlier run saved; its confusion matrix becomes the rules.

    Args:
        data: recorded tracks for the trials, in place of simulated ones.
    """
    from lcorpp.experiments.training_data import read_training_data

    trained, confusion = _loaded(domain, file)
    inputs = getattr(trained.estimator.steps[0][1], "inputs", ("x", "y"))
    recorded = read_training_data(domain, data, seed, features=inputs) if data else None
    if recorded is not None:
        _check_motion(file, trained, recorded.dataset)
    rates = _told(confusion, trust)
    reader, program = _evidence(domain, trained, confusion, trust)
    appearance = recorded.trajectories if recorded else SimulatedTrajectories.of(domain)
    return Eyes(reader, appearance, program, rates, None, None, recorded.dataset.notes if recorded else ())


def _evidence(
    domain: Domain, trained: TrainedClassifier, confusion: ConfusionMatrix, trust: Trust
) -> tuple[BatchClassifier, Program]:
    """Who reads the tracks, and the rules that say how far to trust that."""
    if trust.soft:
        show.console.print("the reasoner is told likelihoods in place of labels")
        return trained.soft(), domain.soft_program
    return trained, domain.program_for(confusion, trust.smoothing)


def _prevalence(domain: Domain, positive: str, given: float | None) -> dict[str, float]:
    """How common each class is: as the domain's knowledge says, or the positive one as given.

    A class that the knowledge rules out counts as one in a thousand, so that thresholds exist.
    """
    told = dict(Reasoner(domain.program).posterior(domain.target, {}))
    raised = {value: max(share, RAREST) for value, share in told.items()}
    common = {value: share / sum(raised.values()) for value, share in raised.items()}
    if given is not None:
        others = 1 - common[positive]
        common = {v: given if v == positive else p * (1 - given) / others for v, p in common.items()}
    return common


def _goal(domain: Domain, positive: str, threshold: str) -> str | tuple[float, float] | float:
    """What --threshold asks for: a goal by name, two costs, or a number itself."""
    from lcorpp.learning import DecisionThreshold
    from lcorpp.learning.evaluation.thresholds import resolve_goal

    if len(domain.values) != 2:
        raise DataError(f"--threshold is for two classes, and there are {len(domain.values)}")
    parts = threshold.split(":")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) == 1:
        return DecisionThreshold(positive, numbers[0]).probability
    goal = (numbers[0], numbers[1]) if len(numbers) == 2 else threshold
    resolve_goal(goal)
    return goal


def _threshold(
    validation: Validation, positive: str, prevalence: float, goal: str | tuple[float, float] | float
) -> DecisionThreshold:
    """The threshold itself, or the one that is best for a goal."""
    from lcorpp.learning import DecisionThreshold, choose_threshold

    if isinstance(goal, float):
        return DecisionThreshold(positive, goal)
    scores = validation.probabilities[:, validation.classes.index(positive)]
    truth = np.array(validation.labels) == positive
    chosen = choose_threshold(scores, truth, validation.folds, prevalence=prevalence, goal=goal)
    return DecisionThreshold(positive, chosen.probability)


def _loaded(domain: Domain, file: Path) -> tuple[TrainedClassifier, ConfusionMatrix]:
    """A saved classifier that tells the domain's values apart, and its confusion matrix."""
    from lcorpp.learning import load_classifier

    trained = load_classifier(file)
    if trained.confusion is None or set(trained.confusion.classes) != set(domain.values):
        known = "unknown classes" if trained.confusion is None else ", ".join(trained.confusion.classes)
        raise DataError(f"{file}: tells {known} apart; {domain.name} needs {', '.join(domain.values)}")
    show.console.print(f"the classifier of {file}")
    return trained, trained.confusion


def _check_motion(file: Path, trained: TrainedClassifier, dataset: Dataset) -> None:
    """Refuse tracks of another kind than those the classifier was trained on."""
    from lcorpp.learning import Motion

    first = trained.estimator.steps[0][1]
    if isinstance(first, Motion) and (first.interval, tuple(first.inputs)) != (
        dataset.interval,
        dataset.channels,
    ):
        raise DataError(
            f"{file}: trained on {', '.join(first.inputs)} every {first.interval:g} s; the data have"
            f" {', '.join(dataset.channels)} every {dataset.interval:g} s"
        )


def _told(confusion: ConfusionMatrix, trust: Trust) -> dict[str, dict[str, float]]:
    """Print the measured rates with their intervals; returned are the smoothed ones that enter the rules."""
    from lcorpp.learning import estimate_rates

    for row in estimate_rates(confusion, smoothing=trust.smoothing):
        said = ", ".join(f"{r.predicted} {r.interval}" for r in row)
        show.console.print(f"  {row[0].true} people ({row[0].cases}) are called: {said}")
    smoothed = [[float(rate) for rate in row] for row in confusion.rates(trust.smoothing)]
    return _table(confusion.classes, np.array(smoothed))


def _table(values: tuple[str, ...], rates: Array) -> dict[str, dict[str, float]]:
    return {
        value: dict(zip(values, row, strict=True)) for value, row in zip(values, rates.tolist(), strict=True)
    }
