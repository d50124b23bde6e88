"""The robot of the page: the parts of Algorithm 2, set up once and shared by all pages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.domains import Domain
from lcorpp.learning import TrainedClassifier
from lcorpp.reasoning import Program
from lcorpp.web.knowledge import Knowledge


@dataclass(frozen=True, eq=False)
class PlayRobot:
    """A robot that people play with.

    parts: domain, policy and error rates. classifiers: sense -> its classifier of tracks; the page asks for
        the labels of the other senses.
    """

    parts: RobotParts
    classifiers: Mapping[str, TrainedClassifier]

    @property
    def domain(self) -> Domain:
        """The domain."""
        return self.parts.domain

    @property
    def program(self) -> Program:
        """The robot's program with the classifiers' rules."""
        return self.parts.program

    @cached_property
    def knowledge(self) -> Knowledge:
        """The reasoner of the program."""
        return Knowledge(self.domain, self.program)
