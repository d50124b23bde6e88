"""Composition of a run: the classifiers with their error rates, the reasoner, the planner and the robot.

Classifiers that are trained or loaded come from `classifier_training`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from lcorpp.decision import Robot
from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import NoReportError
from lcorpp.learning.features.resampling import RATE
from lcorpp.planning import Progress, Solution, SolverOptions
from lcorpp.planning.policy_cache import solve_cached
from lcorpp.planning.sarsop.mixtures import MAX_MIXED
from lcorpp.protocols import Planner
from lcorpp.reasoning import Program, Reasoner
from lcorpp.simulation.people import SignalSource
from lcorpp.simulation.simulated_classifier import BatchClassifier, NoisyChannel
from lcorpp.values import JEFFREYS, Array, ConfusionMatrix, EvidenceKind

if TYPE_CHECKING:  # scikit-learn takes seconds to load, and a noisy channel does without
    from lcorpp.learning import EvaluationReport, Rate, TrainedClassifier

Advance = Callable[[int, int], None]
"""A function that takes the completed and the total number of parts of a step."""


class ProgressDisplay(Protocol):
    """A display of one long step at a time, as a context: it yields an `Advance`."""

    def __call__(self, title: str, total: int | None = None, /) -> AbstractContextManager[Advance]: ...


def show_nothing(done: int, total: int) -> None:
    """Display nothing of the completed parts of a step."""


@contextmanager
def no_progress(title: str, total: int | None = None, /) -> Iterator[Advance]:
    """Display nothing."""
    yield show_nothing


@dataclass(frozen=True)
class ReadingOptions:
    """How to read recorded data; see `read_data`.

    labels: label in the file -> class, besides the domain's `data_labels`.
    label_file: a CSV of ids and labels. repair: the kinds of faults to repair.
    robot: the robot's pose in the frame of the file.
    gap: maximum number of seconds between two samples of one person; None for the default.
    columns, unit, time_unit, fps: names of columns, and units.
    """

    labels: Mapping[str, str] = field(default_factory=dict)
    label_file: Path | None = None
    repair: tuple[str, ...] = ()
    robot: tuple[float, float, float] | None = None
    gap: float | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    unit: str | float | None = None
    time_unit: str | float | None = None
    fps: float | None = None


READ_AS_IT_IS = ReadingOptions()
"""Without repairs or other frames."""


@dataclass(frozen=True)
class TrainingOptions:
    """Options for training a classifier.

    learner: a name in `lcorpp.learning.learner`'s table, MODULE:FUNCTION or FILE.py:FUNCTION; None takes the
        one that suits the data.
    epochs: None takes the number that suits the data. device: "cpu" or "cuda".
    features: the classifier's features of the motion; None takes those that suit the learner.
    threshold: the decision threshold of the positive class: a number, the name of a metric to optimise, or
        the costs of a miss and of a false alarm as MISS:ALARM; None predicts the most probable class.
    prevalence: of the positive class, for thresholds; None takes it from the domain's knowledge.
    tracks: number of simulated training tracks; None takes the domain's number.
    data: recorded data for training and trials; None takes the domain's, or simulates them.
    reading: how to read them.
    rate: points of motion per second, see `Motion`.
    seconds: the last seconds of each track that are used; None takes those of the domain, or all.
    """

    learner: str | None = None
    epochs: int | None = None
    device: str = "cpu"
    features: tuple[str, ...] | None = None
    threshold: str | None = None
    prevalence: float | None = None
    tracks: int | None = None
    data: Path | None = None
    reading: ReadingOptions = READ_AS_IT_IS
    rate: float = RATE
    seconds: float | None = None


@dataclass(frozen=True)
class StoredOptions:
    """Options for loading a stored classifier.

    file: the classifier.
    data: recorded data for the trials; None takes the domain's, or simulates them. reading: how to read them.
    seconds: as in `TrainingOptions`.
    """

    file: Path
    data: Path | None = None
    reading: ReadingOptions = READ_AS_IT_IS
    seconds: float | None = None


ClassifierOptions = TrainingOptions | StoredOptions | None
"""How to get a classifier; None is the domain's noisy channel."""


@dataclass(frozen=True)
class EvidenceOptions:
    """The classifier's evidence for the reasoner.

    kinds: sense -> kind of evidence; the others give labels, as noisy channels always do.
    smoothing: added to the counts of the confusion matrix that becomes the rules for labels.
    """

    kinds: Mapping[str, EvidenceKind] = field(default_factory=dict)
    smoothing: Fraction = JEFFREYS

    def kind(self, sense: str) -> EvidenceKind:
        """Return the kind of evidence of a trained sense."""
        return self.kinds.get(sense, LABEL)


LABEL = EvidenceKind()
"""A label as evidence."""

HARD_LABELS = EvidenceOptions()
"""Labels as evidence, with Jeffreys' smoothing."""


@dataclass(frozen=True, eq=False)
class SenseSetup:
    """The classifier of a sense, the source of its test signals, and its error rates.

    rates: true class -> predicted class -> probability, as the rules contain them.
    confusion: the matrix that replaces the rules; None for a noisy channel, whose rules the program has.
    intervals: one row of rates with intervals per true class; () for a noisy channel.
    source: "channel", the learner, or the file of the classifier.
    trained: the trained classifier, without soft evidence; None for a noisy channel.
    evidence: its kind of evidence; if a likelihood, the program does without its rates.
    n_tracks: number of training cases, report: evaluation of the classifier; None if it was not trained now.
    unit: plural noun of the cases. data: the recorded data, None if they are simulated.
    notes: warnings about the data.
    """

    classifier: BatchClassifier
    signals: SignalSource
    rates: dict[str, dict[str, float]]
    confusion: ConfusionMatrix | None = None
    intervals: Sequence[Sequence[Rate]] = ()
    source: str = "channel"
    trained: TrainedClassifier | None = None
    evidence: EvidenceKind = LABEL
    n_tracks: int | None = None
    report: EvaluationReport | None = None
    unit: str = "tracks"
    data: Path | None = None
    notes: tuple[str, ...] = ()

    @property
    def soft(self) -> bool:
        """Whether its evidence is a likelihood."""
        return self.evidence.is_likelihood

    def __repr__(self) -> str:
        kind = "channel" if self.trained is None else "trained"
        rates = ", ".join(f"{value} {row[value]:.3f}" for value, row in self.rates.items())
        return f"<SenseSetup {kind}; recall: {rates}>"


Senses = Mapping[str, SenseSetup]
"""Name of a sense -> its setup, for the senses that some strategy uses."""


def from_channel(domain: Domain, sense: Sense) -> SenseSetup:
    """Return the noisy channel of a sense; the program keeps its own rules.

    Raises:
        DomainError: the domain has no noisy channel.
    """
    channel = NoisyChannel.from_domain(domain, sense)
    return SenseSetup(channel, channel, nest_rates(sense.classes, channel.rates.tolist()))


class RatesSource(Protocol):
    """A classifier as the program knows it: the matrix that replaces its rules, and whether it is soft."""

    @property
    def confusion(self) -> ConfusionMatrix | None: ...
    @property
    def soft(self) -> bool: ...


def have_own_rates(classifiers: Mapping[str, RatesSource]) -> bool:
    """Whether a classifier has other rates than the domain's program states, or returns likelihoods."""
    return any(part.confusion is not None or part.soft for part in classifiers.values())


def make_program(domain: Domain, senses: Senses, smoothing: Fraction = JEFFREYS) -> Program:
    """Return the domain's program with the error rates of trained classifiers as rules."""
    confusions = {name: setup.confusion for name, setup in senses.items() if setup.confusion is not None}
    soft = [name for name, setup in senses.items() if setup.soft]
    return domain.program_for(confusions, smoothing, soft=soft)


def solve_domain(
    domain: Domain,
    solver: SolverOptions | None = None,
    *,
    any_prior: bool = False,
    cache: Path | None = None,
    advance: Advance = show_nothing,
) -> Solution:
    """Solve the domain's POMDP for all its start beliefs, or for all priors.

    At the time limit or after Ctrl-C, the result is the best policy so far.

    Args:
        solver: None takes that of the domain.
        any_prior: whether the robot's priors are others than those of the domain's own rates and labels as
            evidence: a classifier was trained or gives likelihoods. With `sarsop` and at most `MAX_MIXED`
            shared values the precision is then reached at every prior, within the solver's limit; also if the
            domain's own priors are too many to be listed.
        cache: a folder that keeps solutions; None solves.
        advance: receives the seconds and the time limit.

    Raises:
        ModelError: an own solver fails, or returns no policy for this model.
    """
    options = solver or domain.planning.solver
    limit = options.time_limit

    def show(now: Progress) -> None:
        advance(round(now.seconds), round(limit))

    callback = show if isfinite(limit) and advance is not show_nothing else None
    starts = domain.list_starts()
    beliefs = np.vstack([starts.beliefs, starts.labels_alone])
    is_mixed = options.name == "sarsop" and (any_prior or not starts.are_complete)
    mixed = find_mixed(domain) if is_mixed else None
    return solve_cached(domain.pomdp, beliefs, options, mixed=mixed, folder=cache, callback=callback)


def find_mixed(domain: Domain) -> Array | None:
    """Return the beliefs (V, S) whose mixtures are the priors; None if they are too many."""
    corners = domain.planning.initial_states
    return corners if 2 <= len(corners) <= MAX_MIXED else None


FLAWS = {
    "qmdp": "it assumes that one action reveals the state, so it cannot value information; choose another"
    " one, e.g. --solver sarsop",
    "fib": "it overrates what answers are worth; choose another one, e.g. --solver sarsop",
}
"""Solver -> why its policy may never report, and what to do."""


@contextmanager
def explain_missing_reports(solution: Solution | None) -> Iterator[None]:
    """Add to the error of a policy that never reports which solver made it, and what to do.

    Args:
        solution: None if the policy was given.

    Raises:
        NoReportError: with the explanation.
    """
    try:
        yield
    except NoReportError as error:
        raise NoReportError(f"{error}; {_describe_solver(solution)}") from error


def _describe_solver(solution: Solution | None) -> str:
    if solution is None:
        return "expected a policy that reports, with --policy or by solving"
    solver, gap = solution.solver or "sarsop", solution.upper - solution.lower
    if solver in FLAWS:
        advice = FLAWS[solver]
    elif solution.converged and gap <= SolverOptions().precision:
        advice = "the policy is nearly optimal, so no report is worth it; check the costs and rewards"
    else:
        advice = "a better policy may exist: give more time (--time-limit), a smaller --precision or another"
        advice += " --solver"
    return f"the solver {solver} ended ({solution.reason}) with a gap of {gap:.4g}; {advice}"


def make_robot(domain: Domain, senses: Senses, program: Program, planner: Planner) -> Robot:
    """Return the full robot: classifiers, reasoner with the classifiers' rules, planner and domain."""
    classifiers = {name: setup.classifier for name, setup in senses.items()}
    return Robot(classifiers, Reasoner(program), planner, domain)


def nest_rates(classes: Sequence[str], rows: Iterable[Iterable[float]]) -> dict[str, dict[str, float]]:
    """Return rates (V, V) as true class -> predicted class -> probability."""
    return {actual: dict(zip(classes, row, strict=True)) for actual, row in zip(classes, rows, strict=True)}
