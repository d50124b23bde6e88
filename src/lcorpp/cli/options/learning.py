"""The options of `lcorpp learn` about Algorithm 1."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.options import common as options
from lcorpp.cli.options.robot import RobotGroup
from lcorpp.cli.options.senses import reject_given
from lcorpp.errors import DataError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions
    from lcorpp.domains import Domain
    from lcorpp.runs.senses import ActiveLearningOptions

TRACKS, MIN_TRACKS = 100, 20
"""Simulated training tracks of a sense that learns, without --tracks; and the minimum, if there are any."""


class Labels(StrEnum):
    """How far a report is trusted as the label of a track."""

    hard = "hard"
    soft = "soft"
    corrected = "corrected"


DEVICES = ("cpu", "cuda")
"""The devices of the LSTM; a learner of your own may know others."""


@dataclass(frozen=True)
class LearningGroup:
    """The options of a run of Algorithm 1; each field is an option of its name."""

    batch_size: Annotated[
        int, typer.Option(min=1, max=options.MAX_TRACKS, help="K: decisions between two trainings.")
    ] = 100
    epsilon: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="Stop when no confusion matrix changes by more than this, which is the sum of the absolute"
            " differences of its rates.",
            show_default=".09 for each class",
        ),
    ] = None
    confidence: Annotated[
        float,
        typer.Option(
            min=0,
            help="Probability, below 1, with which the change is at most epsilon; 0 compares the estimates"
            " alone, as the paper does.",
        ),
    ] = 0.95
    max_batches: Annotated[int, typer.Option(min=1, help="Stop after this many batches.")] = 20
    tracks: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=options.MAX_TRACKS,
            help="Simulated training tracks before the first batch, at least 20; or 0: the labels of the"
            " classifier are random until the robot's reports suffice to train it.",
            show_default=str(TRACKS),
        ),
    ] = None
    labels: Annotated[
        Labels,
        typer.Option(
            help="hard: a reported label is taken as certain; soft: a track counts for each class with the"
            " weight of the robot's belief when it reported; corrected: with the probability of the class"
            " that the answers and the classifier's predictions imply; the confusion matrix is corrected too."
        ),
    ] = Labels.hard
    strategy: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="The strategy that decides: a row of the table such as L+P or LCORPP+trust, a baseline, or"
            " your own as FILE.py:NAME; LCORPP by default.",
        ),
    ] = None
    trust: Annotated[
        bool,
        typer.Option(
            "--trust",
            help="Short for --strategy LCORPP+trust: learn from each person's answers how far knowledge,"
            " classifiers and the observation model can be relied on.",
        ),
    ] = False
    ask_budget: options.AskBudgetOption = None
    watch: Annotated[
        bool,
        typer.Option(
            "--watch",
            help="Raise an alarm if knowledge, classifiers or hearing are not as stated, as `lcorpp watch`.",
        ),
    ] = False
    store: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Store every decision in this file (suffix .tracks), of further senses in FILE-SENSE. If it"
            " exists, the run resumes.",
        ),
    ] = None

    def choose_options(self, domain: Domain, given: RobotGroup) -> ActiveLearningOptions:
        """Return the options of the run.

        Raises:
            DomainError, DataError: an option is wrong, has no effect, or does not suit the domain.
        """
        from lcorpp.assembly.strategies.baselines import find_strategies
        from lcorpp.assembly.strategies.trust import TRUST, with_ask_budget
        from lcorpp.decision import LCORPP
        from lcorpp.runs.senses import ActiveLearningOptions

        if self.trust:
            reject_given("--trust is --strategy LCORPP+trust; expected one of them", strategy=self.strategy)
        strategy = TRUST if self.trust else LCORPP
        if self.strategy is not None:
            (strategy,) = find_strategies([self.strategy], [sense.name for sense in domain.senses])
        if self.ask_budget is not None:
            strategy = with_ask_budget(strategy, self.ask_budget)
        sources = _choose_sources(domain, given, self.tracks)
        chosen = ActiveLearningOptions(
            sources,
            given.choose_evidence(domain, sources),
            labels=self.labels.value,
            batch_size=self.batch_size,
            epsilon=self.epsilon,
            confidence=self.confidence,
            max_batches=self.max_batches,
            strategy=strategy,
            watch=self.watch,
            seed=given.seed,
            jobs=console.count_processes(given.jobs),
        )
        _check_options(domain, chosen, self.tracks)
        return chosen


def _choose_sources(domain: Domain, given: RobotGroup, tracks: int | None) -> dict[str, ClassifierOptions]:
    """Return the options of the classifier of each sense; `tracks` is for those that learn."""
    from lcorpp.assembly.options import TrainingOptions
    from lcorpp.runs.senses import find_learning_senses

    sources = given.choose_classifiers(
        domain, domain.senses, tracks, trained=find_learning_senses(domain, {})
    )
    learning = find_learning_senses(domain, sources)
    for name, training in learning.items():
        if training.tracks is None and not (training.data or domain.find_sense(name).data):
            sources[name] = replace(training, tracks=TRACKS)
    others = [sources[name] for name in sources if name not in learning]
    if given.threshold is None and not any(isinstance(source, TrainingOptions) for source in others):
        reject_given("it is for thresholds; expected --threshold, too", prevalence=given.prevalence)
    if tracks == 0:  # the other senses are trained now, on the number of tracks of the domain
        for name, source in sources.items():
            if name not in learning and isinstance(source, TrainingOptions):
                sources[name] = replace(source, tracks=None)
    return sources


def _check_options(domain: Domain, chosen: ActiveLearningOptions, tracks: int | None) -> None:
    """Reject before the work what the training would reject after it.

    Raises:
        DataError: the change that ends the run or its confidence is out of range, there are too few tracks, a
            learner or the device is unknown, or a learner cannot learn from weighted cases.
        DomainError: trust cannot follow the dialogue of the domain.
    """
    from lcorpp.assembly.estimators import make_untrained
    from lcorpp.assembly.options import TrainingOptions
    from lcorpp.assembly.strategies.trust import TRUST, check_dialogue
    from lcorpp.learning.classifiers.learner_table import DEFAULTS
    from lcorpp.learning.classifiers.registry import check_weighted

    if chosen.epsilon is not None and math.isnan(chosen.epsilon):
        raise DataError("--epsilon nan: expected a number from 0")
    if not chosen.confidence < 1:
        raise DataError(f"--confidence {chosen.confidence:g}: expected a number from 0, below 1")
    if tracks is not None and 0 < tracks < MIN_TRACKS:
        raise DataError(f"--tracks {tracks}: expected 0, or at least {MIN_TRACKS}")
    if chosen.learns_from_people or chosen.watch:
        check_dialogue(domain, [TRUST])
    for training in chosen.classifiers.values():
        if isinstance(training, TrainingOptions):
            name = training.learner or DEFAULTS["motion"]
            if ":" not in name and training.device.split(":")[0] not in DEVICES:
                raise DataError(f"--device {training.device}: {expected_one_of(DEVICES)}")
            estimator = make_untrained(training)
            if chosen.labels != Labels.hard:
                check_weighted(name, estimator)
