"""The options that `lcorpp play` and `lcorpp export` share: the robot of the page."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console
from lcorpp.cli.options import common as options
from lcorpp.cli.options.senses import ClassifiersOption, LearnersOption, choose_classifiers, reject_given
from lcorpp.cli.options.solving import SolverGroup
from lcorpp.cli.options.training import (
    EpochsOption,
    FeaturesOption,
    RateOption,
    TracksOption,
    TrainingGroup,
)
from lcorpp.errors import DomainError

if TYPE_CHECKING:
    from lcorpp.assembly.options import ClassifierOptions
    from lcorpp.decision import Strategy
    from lcorpp.domains import Domain
    from lcorpp.planning import SolverOptions
    from lcorpp.web.robot import PlayRobot


@dataclass(frozen=True)
class PageGroup:
    """The robot of the page; each field is an option of its name."""

    classifier: ClassifiersOption = None
    learner: LearnersOption = None
    tracks: TracksOption = None
    epochs: EpochsOption = None
    features: FeaturesOption = None
    rate: RateOption = None
    strategy: Annotated[
        str, typer.Option(metavar="NAME", help="LCORPP, or LCORPP+limits for the limits of the domain.")
    ] = "LCORPP"
    seed: options.SeedOption = 0
    jobs: options.JobsOption = None
    solving: SolverGroup = field(default_factory=SolverGroup)

    def choose_classifiers(self, domain: Domain) -> dict[str, ClassifierOptions]:
        """Return the options of the classifier of each sense, None for those whose labels the page asks for.

        Raises:
            DomainError: as the function `choose_classifiers`. DataError: an unknown learner, or options that
                it does not take.
        """
        from lcorpp.assembly.estimators import make_untrained
        from lcorpp.assembly.options import READ_AS_IT_IS, TrainingOptions
        from lcorpp.assembly.track_robot import LEARNER, find_track_senses

        training = TrainingGroup(self.epochs, features=self.features, rate=self.rate).choose(self.tracks)
        tracked = {sense.name for sense in find_track_senses(domain)}
        chosen: dict[str, ClassifierOptions] = {sense.name: None for sense in domain.senses}
        if not tracked:
            reason = f"{domain.name} has no sense of tracks that a pointer could give"
            reject_given(reason, classifier=self.classifier, learner=self.learner, **training)
            return chosen
        by_default = not self.classifier and not self.learner
        chosen |= choose_classifiers(
            domain,
            [sense for sense in domain.senses if sense.name in tracked],
            classifiers=self.classifier or [],
            learners=[LEARNER] if by_default else self.learner or [],
            data=[],
            reading=READ_AS_IT_IS,
            training=training,
            by_channel=True,
        )
        for own in chosen.values():
            if isinstance(own, TrainingOptions):
                make_untrained(own)  # rejects a learner and its options before the work
        return chosen

    def set_up(
        self, domain: Domain, chosen: dict[str, ClassifierOptions], solver: SolverOptions
    ) -> PlayRobot:
        """Train or load the chosen classifiers and solve the POMDP, with progress."""
        from lcorpp.web.setup import set_up_robot

        robot = set_up_robot(
            domain,
            chosen,
            solver,
            strategy=self.choose_strategy(domain),
            cache=self.solving.find_cache(),
            progress=console.show_progress,
            seed=self.seed,
            jobs=console.count_processes(self.jobs),
        )
        if robot.strategy.draws:
            with console.show_progress("keeping the limits"):
                _ = robot.plan
        return robot

    def choose_strategy(self, domain: Domain) -> Strategy:
        """Return the strategy of the page.

        Raises:
            DomainError: the page plays no such strategy, or the domain has no limits.
        """
        from lcorpp.assembly.strategies.limits import WITH_LIMITS, require_limits
        from lcorpp.decision import LCORPP

        known = {row.name: row for row in (LCORPP, WITH_LIMITS)}
        if self.strategy not in known:
            raise DomainError(f"--strategy {self.strategy}: the page plays {' and '.join(known)}")
        require_limits(domain, [known[self.strategy]])
        return known[self.strategy]
