"""The robot of the page: the parts of Algorithm 2, set up once and shared by all pages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.assembly.strategies.limits import keeps_limits
from lcorpp.decision import LCORPP, Strategy
from lcorpp.domains import Domain
from lcorpp.learning import TrainedClassifier
from lcorpp.reasoning import Program
from lcorpp.web.knowledge import Knowledge

if TYPE_CHECKING:
    from lcorpp.assembly.strategies.limited_plan import LimitedPlan


@dataclass(frozen=True, eq=False)
class PlayRobot:
    """A robot that people play with.

    parts: domain, policy and error rates. classifiers: sense -> its classifier of tracks; the page asks for
        the labels of the other senses. strategy: LCORPP or LCORPP+limits.
    """

    parts: RobotParts
    classifiers: Mapping[str, TrainedClassifier]
    strategy: Strategy = LCORPP

    @property
    def domain(self) -> Domain:
        """The domain."""
        return self.parts.domain

    @property
    def program(self) -> Program:
        """The robot's program with the classifiers' rules."""
        return self.parts.program

    @cached_property
    def plan(self) -> LimitedPlan | None:
        """The plan of LCORPP+limits, for the rates of the classifiers; None of LCORPP."""
        if not keeps_limits(self.strategy):
            return None
        from lcorpp.assembly.strategies.limited_plan import find_plan  # loads the search

        return find_plan(self.domain, self.program)

    @cached_property
    def knowledge(self) -> Knowledge:
        """The reasoner of the program."""
        return Knowledge(self.domain, self.program)
