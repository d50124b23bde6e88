"""Decisions about people who are tracked, on a running robot or in a recording, by Algorithm 2."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.decision import Robot, Strategy
from lcorpp.decision.dt_control import dt_control
from lcorpp.decision.strategies import Session, make_generator
from lcorpp.errors import LcorppError, WorldError
from lcorpp.protocols import Classifier, World
from lcorpp.robot.config import RobotConfig
from lcorpp.values import Array, Episode, Instance, Step


@dataclass(frozen=True, eq=False)
class Decision:
    """The decision about a person.

    person: the tracker's id. facts: observed attribute -> value.
    episode: None if the decision failed. error: why it failed, None if it did not.
    failures: of actions whose failure was an observation.
    n_learnt: number of people that the strategy had learnt from before.
    seed: of what a strategy draws; None without.
    person_id: the same, if the tracker recognises people who come back; else None.
    """

    person: str
    facts: Mapping[str, str]
    episode: Episode | None
    error: LcorppError | None = None
    failures: tuple[WorldError, ...] = ()
    n_learnt: int = 0
    person_id: str | None = None
    seed: tuple[int, ...] | None = None


class TrackedPeople(Protocol):
    """People with their signals and the classifiers of their senses."""

    def signals(self, person: str) -> dict[str, Array]:
        """Return sense -> the signal of a person so far."""

    def classifiers(self, person: str) -> Mapping[str, Classifier]:
        """Return sense -> the classifier of a person."""


class Decider:
    """Decide about tracked people by a strategy, which may learn from one person after another.

    Args:
        config: of the robot. parts: domain, policy and error rates. strategy: by which it decides.
        people: who are tracked. seed: of what the strategy draws, with the number of the decision.

    Attributes:
        session: of the strategy; None if it does not learn from people.
    """

    def __init__(
        self,
        config: RobotConfig,
        parts: RobotParts,
        strategy: Strategy,
        people: TrackedPeople,
        *,
        seed: int = 0,
    ) -> None:
        self._config, self._strategy, self._people = config, strategy, people
        self._seed, self._n_decisions = seed, 0
        self._full = replace(parts.robot, classifiers={})
        self.session: Session | None = None
        if strategy.start is not None:
            self.session = strategy.start(self._full, parts.rates)

    def make_robot(self, person: str) -> Robot:
        """Return the robot that decides about a person."""
        full = replace(self._full, classifiers=dict(self._people.classifiers(person)))
        if self.session is None:
            seed = self._find_seed()
            return self._strategy.robot(full, None if seed is None else make_generator(*seed))
        return self.session.robot(full, self._find_id(person))

    def decide(
        self,
        person: str,
        read_facts: Callable[[], Mapping[str, str]],
        world: World,
        listener: Callable[[Step], None],
    ) -> Decision:
        """Decide about a person; a failure is part of the result.

        Args:
            read_facts: returns the observed facts. world: of the person. listener: takes each step.
        """
        facts: Mapping[str, str] = {}
        seed = self._find_seed()
        n_learnt, own = 0 if self.session is None else self.session.n_people, self._find_id(person)
        try:
            facts = read_facts()
            instance, robot = Instance(self._people.signals(person), facts), self.make_robot(person)
            episode = dt_control(
                robot, instance, world, max_steps=self._config.max_actions, listener=listener
            )
            if self.session is not None:
                self.session.learn(episode.evidence, episode.steps, own)
        except LcorppError as failure:
            return Decision(person, facts, None, failure, (), n_learnt, own, seed)
        finally:
            self._n_decisions += 1
        return Decision(person, facts, episode, None, (), n_learnt, own, seed)

    def _find_seed(self) -> tuple[int, ...] | None:
        return (self._seed, self._n_decisions) if self._strategy.draws else None

    def _find_id(self, person: str) -> str | None:
        return person if self._config.people.permanent_ids else None
