"""What `run`, `explain` and `learn` do before the first decision: classifier, rules and policy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lcorpp import planning
from lcorpp.cli import show
from lcorpp.decision import Robot
from lcorpp.domains import Domain
from lcorpp.errors import DataError
from lcorpp.experiments.people import Appearance, Channel, Reader
from lcorpp.reasoning import Enumeration, Program


@dataclass(frozen=True, eq=False)
class Eyes:
    """A classifier, whom it will see, and the rules that say how far to trust it.

    rates: true value -> value said -> probability, as measured, or as given for a channel.
    notes: what the user has to know about the data.
    """

    reader: Reader
    appearance: Appearance
    program: Program
    rates: dict[str, dict[str, float]]
    notes: tuple[str, ...]


def introduce(domain: Domain) -> None:
    """Say which domain this is."""
    preset = f", preset {domain.preset}" if domain.preset else ""
    show.console.print(f"{domain.name}{preset}: {domain.description}", style="bold")


def eyes(
    domain: Domain,
    classifier: str,
    *,
    data: Path | None,
    epochs: int,
    seed: int,
    jobs: int,
    learns: bool = True,
) -> Eyes:
    """The classifier by name: `channel`, `lstm` (trained now), or a file.

    Args:
        learns: whether any strategy will ask the classifier; without one nothing is trained.
    """
    if classifier == "channel" or not learns:
        channel = Channel.of(domain)
        rates = {
            value: dict(zip(domain.values, row, strict=True))
            for value, row in zip(domain.values, channel.rates.tolist(), strict=True)
        }
        _tell(rates, "the classifier is a channel")
        return Eyes(channel, channel, domain.program, rates, ())
    from lcorpp.experiments.training import learn, motion_of, recorded_training, simulated_training
    from lcorpp.learning import load_classifier

    if classifier != "lstm":
        trained = load_classifier(Path(classifier))
        if trained.confusion is None or set(trained.confusion.classes) != set(domain.values):
            raise DataError(
                f"{classifier}: tells {trained.confusion and trained.confusion.classes} apart, not {domain.values}"
            )
        appearance = recorded_training(domain, data, seed).appearance if data else motion_of(domain)
        return _measured(domain, trained, appearance, f"the classifier of {classifier}", ())
    training = recorded_training(domain, data, seed) if data else simulated_training(domain, seed)
    with show.progress("cross-validating the LSTM") as advance:
        trained, validation = learn(training.dataset, epochs=epochs, seed=seed, jobs=jobs, progress=advance)
    area = "" if validation.auc is None else f", AUC {validation.auc:.3f}"
    title = f"the LSTM, cross-validated on {training.dataset.source} ({len(training.dataset)}{area})"
    return _measured(domain, trained, training.appearance, title, training.dataset.notes)


def _measured(
    domain: Domain, trained: Any, appearance: Appearance, title: str, notes: tuple[str, ...]
) -> Eyes:
    confusion = trained.confusion
    rates = {
        actual: dict(zip(confusion.classes, row, strict=True))
        for actual, row in zip(confusion.classes, confusion.probabilities.tolist(), strict=True)
    }
    _tell(rates, title)
    return Eyes(trained, appearance, domain.program_for(confusion), rates, notes)


def _tell(rates: dict[str, dict[str, float]], title: str) -> None:
    show.console.print(title)
    for actual, row in rates.items():
        said = ", ".join(f"{value} {rate:.3f}" for value, rate in row.items())
        show.console.print(f"  {actual} people are called: {said}")


def robot(domain: Domain, looking: Eyes, policy: Path | None = None) -> Robot:
    """The full robot: the classifier, the reasoner with its rules, and the policy, solved or read."""
    return Robot(looking.reader, Enumeration(looking.program), planner(domain, policy), domain)


def planner(domain: Domain, policy: Path | None = None) -> planning.Planner:
    """The policy of a domain's model: read from a file, else solved."""
    pomdp = domain.pomdp
    if policy is not None:
        return planning.Planner(pomdp, planning.read_policy(policy, pomdp))
    starts = domain.starts()
    with show.progress("solving the POMDP"):
        solution = planning.solve(pomdp, starts)
    show.console.print(
        f"SARSOP: {solution.policy.value(pomdp.start):.3f} to {solution.upper_bound.value(pomdp.start):.3f} at the"
        f" model's start, {solution.vectors} vectors for {len(starts)} priors, {solution.seconds:.1f} s"
    )
    return planning.Planner(pomdp, solution.policy)
