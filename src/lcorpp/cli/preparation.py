"""What `run`, `explain` and `learn` do before the first decision: classifier, rules and policy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lcorpp import planning
from lcorpp.cli import models, show
from lcorpp.decision import Robot
from lcorpp.domains import Domain
from lcorpp.errors import DataError
from lcorpp.experiments.people import Appearance, Channel, Reader
from lcorpp.reasoning import Program
from lcorpp.values import Array, ConfusionMatrix

if TYPE_CHECKING:
    from lcorpp.learning import TrainedClassifier


@dataclass(frozen=True, eq=False)
class Eyes:
    """A classifier, whom it will see, and the rules that say how far to trust it.

    rates: true value -> value said -> probability, as measured, or as given for a channel.
    tracks, epochs: on how much and how long it was trained now, None where it was not.
    notes: what the user has to know about the data.
    """

    reader: Reader
    appearance: Appearance
    program: Program
    rates: dict[str, dict[str, float]]
    tracks: int | None
    epochs: int | None
    notes: tuple[str, ...]


def introduce(domain: Domain) -> None:
    """Say which domain this is."""
    preset = f", preset {domain.preset}" if domain.preset else ""
    show.console.print(f"{domain.name}{preset}: {domain.description}", style="bold")


def channel_eyes(domain: Domain) -> Eyes:
    """The classifier as the domain's channel; the rules stay as they are written."""
    channel = Channel.of(domain)
    rates = _table(domain.values, channel.rates)
    show.console.print("the classifier is a channel")
    for actual, row in rates.items():
        said = ", ".join(f"{value} {rate:.3f}" for value, rate in row.items())
        show.console.print(f"  {actual} people are called: {said}")
    return Eyes(channel, channel, domain.program, rates, None, None, ())


def trained_eyes(
    domain: Domain,
    *,
    file: Path | None,
    data: Path | None,
    tracks: int | None,
    epochs: int | None,
    seed: int,
    jobs: int,
) -> Eyes:
    """A trained classifier, from a file or trained now; its confusion matrix becomes the rules.

    Args:
        file: a classifier saved by an earlier run; None trains the LSTM.
        data: recorded tracks for training and trials, in place of simulated ones.
        tracks: simulated tracks to train on; None takes the domain's number.
        epochs: passes over the data; None takes what suits them.
    """
    from lcorpp.experiments.training import learn, motion_of, recorded_training, simulated_training

    recorded = recorded_training(domain, data, seed) if data else None
    notes = recorded.dataset.notes if recorded else ()
    if file is not None:
        trained, confusion = _loaded(domain, file)
        appearance = recorded.appearance if recorded else motion_of(domain)
        program, rates = domain.program_for(confusion), _told(confusion)
        return Eyes(trained, appearance, program, rates, None, None, notes)
    training = recorded or simulated_training(domain, seed, tracks=tracks)
    epochs = epochs or training.epochs
    with show.progress("cross-validating and training the LSTM") as advance:
        trained, validation = learn(training.dataset, epochs=epochs, seed=seed, jobs=jobs, progress=advance)
    area = "" if validation.auc is None else f" AUC {validation.auc:.3f},"
    show.console.print(
        f"the LSTM, five-fold on {training.dataset.source}, {epochs} epochs:{area}"
        f" accuracy {validation.accuracy:.3f}"
    )
    program, rates = domain.program_for(validation.confusion), _told(validation.confusion)
    return Eyes(trained, training.appearance, program, rates, len(training.dataset), epochs, notes)


def _loaded(domain: Domain, file: Path) -> tuple[TrainedClassifier, ConfusionMatrix]:
    """A saved classifier that tells the domain's values apart, and its confusion matrix."""
    from lcorpp.learning import load_classifier

    trained = load_classifier(file)
    if trained.confusion is None or set(trained.confusion.classes) != set(domain.values):
        known = "unknown classes" if trained.confusion is None else ", ".join(trained.confusion.classes)
        raise DataError(f"{file}: tells {known} apart; {domain.name} needs {', '.join(domain.values)}")
    show.console.print(f"the classifier of {file}")
    return trained, trained.confusion


def _told(confusion: ConfusionMatrix) -> dict[str, dict[str, float]]:
    """Print the measured rates with their intervals; returned are the smoothed ones that enter the rules."""
    from lcorpp.learning import rates_intervals

    for row in rates_intervals(confusion):
        said = ", ".join(f"{r.called} {r.value:.3f} [{r.low:.3f}, {r.high:.3f}]" for r in row)
        show.console.print(f"  {row[0].given} people ({row[0].cases}) are called: {said}")
    return _table(confusion.classes, confusion.probabilities)


def _table(values: tuple[str, ...], rates: Array) -> dict[str, dict[str, float]]:
    return {
        value: dict(zip(values, row, strict=True)) for value, row in zip(values, rates.tolist(), strict=True)
    }


def robot(domain: Domain, looking: Eyes, policy: Path | None = None) -> Robot:
    """The full robot: the classifier, the reasoner with its rules, and the policy, solved or read."""
    return Robot(looking.reader, looking.program, planner(domain, policy), domain)


def planner(domain: Domain, policy: Path | None = None) -> planning.Planner:
    """The policy of a domain's model: read from a file, else solved."""
    pomdp = domain.pomdp
    if policy is not None:
        return planning.Planner(pomdp, models.read_policy(policy, pomdp))
    starts = domain.starts()
    with show.progress("solving the POMDP"):
        solution = planning.solve(pomdp, starts)
    lower, gap = solution.policy.value(pomdp.start), solution.gap(pomdp.start)
    show.console.print(
        f"SARSOP: {lower:.3f} to {lower + gap:.3f} at the model's start; {solution.vectors} vectors for"
        f" {len(starts)} priors, {solution.seconds:.1f} s"
    )
    return planning.Planner(pomdp, solution.policy)
