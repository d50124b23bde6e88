"""The loop of a robot: track people, attend to one, decide by Algorithm 2, and go on with the next."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from time import monotonic, sleep

from lcorpp.assembly.robot_parts import RobotParts
from lcorpp.decision import Strategy
from lcorpp.decision.dt_control import infer_prior
from lcorpp.decision.strategies import Session
from lcorpp.errors import ConnectionLostError, LcorppError, PersonLeftError, WorldError
from lcorpp.learning import TrainedClassifier
from lcorpp.robot.attending import Attention
from lcorpp.robot.config import AFTER, PeopleConfig, RobotConfig
from lcorpp.robot.deciding import Decider, Decision
from lcorpp.robot.hearing import make_listener
from lcorpp.robot.tracking import PeopleTracks, SensedPeople, TrackingThread, find_windows
from lcorpp.values import Distribution, Episode, Instance, Step
from lcorpp.worlds.ros.connection import RosConnection
from lcorpp.worlds.ros.fields import FaultLog
from lcorpp.worlds.ros.perception import Perception
from lcorpp.worlds.ros.ros_world import RosWorld
from lcorpp.worlds.ros.skills import Body
from lcorpp.worlds.ros.stop_report import StopReport
from lcorpp.worlds.ros.stopping import StopOrders

LOG = logging.getLogger("lcorpp.robot")

PERIOD = 0.1
"""Seconds between two looks at the people while nobody can be attended to."""
SILENCE = 10.0
"""Seconds without any message of the people tracker after which the robot warns."""
MAX_FAILURES = 5
"""Decisions in a row with a failed action after which the robot gives up: something is wrong with it."""


class RobotLoop:
    """A robot among people.

    Args:
        config: of the robot. parts: domain, policy and error rates. classifiers: sense -> its classifier.
        strategy: by which it decides. connection: to the robot.
        show_step: takes the person and each step of a decision. seed: as of `Decider`.

    Raises:
        WorldError: no pose of the robot comes. ConnectionLostError: there is no connection.
    """

    def __init__(
        self,
        config: RobotConfig,
        parts: RobotParts,
        classifiers: Mapping[str, TrainedClassifier],
        strategy: Strategy,
        connection: RosConnection,
        *,
        show_step: Callable[[str, Step], None] = lambda person, step: None,
        seed: int = 0,
    ) -> None:
        self._config, self._parts, self._strategy, self._connection = config, parts, strategy, connection
        self._show_step, self._attention = show_step, Attention(parts.domain, config.value)
        self._perceptions = make_perceptions(connection, config)
        self._perception = self._perceptions[0]
        windows = find_windows(parts.domain)
        self._tracks = [
            PeopleTracks(own, max_silence=config.people.max_silence, windows=windows)
            for own in _divide(classifiers, config.people)
        ]
        self._people = SensedPeople(self._tracks)
        self._decider = Decider(config, parts, strategy, self._people, seed=seed)
        for fact in config.facts.values():
            fact.start(connection, lambda: self._perception.pose)
        self._orders = StopOrders.of(config.cmd_vel, [b.skill for b in config.behaviours.values()])
        self._listener = make_listener(config.answers, parts.domain, connection)
        self._decided = set[str]()
        self._faults = [FaultLog(tracker.topic[0]) for tracker in config.people.trackers.values()]

    @property
    def session(self) -> Session | None:
        """What the strategy has learnt from people; None if it does not learn."""
        return self._decider.session

    def run(self, max_decisions: int | None = None) -> Iterator[Decision]:
        """Decide about one person after another; yield each decision.

        Args:
            max_decisions: ends after so many; None never does.

        Raises:
            ConnectionLostError: the connection is lost, and does not come back in time.
            WorldError: the decisions fail again and again, or people are in another frame. The robot was
                ordered to stop; the message states what is known about that.
        """
        pairs = zip(self._perceptions, self._tracks, strict=True)
        threads = [TrackingThread(perception, tracks) for perception, tracks in pairs]
        count, failures, began = 0, 0, monotonic()
        error: LcorppError | None = None
        try:
            while max_decisions is None or count < max_decisions:
                for thread in threads:
                    thread.check()
                self._await_connection()
                self._warn_of_silence(monotonic() - began)
                person = self._find_person()
                if person is None:
                    sleep(PERIOD)
                    continue
                self._attention.attend(person)
                self._decided.add(person)
                decision = self._decide(person)
                count += 1
                yield decision  # before what follows it, so that an interrupt does not lose it
                error = self._finish(person) or decision.error
                if not isinstance(error, PersonLeftError):
                    failures = failures + 1 if isinstance(error, WorldError) else 0
                if failures == MAX_FAILURES:
                    raise WorldError(f"{failures} decisions in a row have failed; the last one: {error}")
            if isinstance(error, ConnectionLostError):
                self._await_connection()  # after which the robot was ordered to stop
        except LcorppError as fault:
            kind = type(fault) if isinstance(fault, WorldError) else WorldError
            raise kind(f"{fault}; at the end: {self.stop()}") from fault
        except Exception:
            self.stop()
            raise
        finally:
            for thread in threads:
                thread.end()

    def stop(self) -> StopReport:
        """Order the robot to stop for the last time; return what is known about it."""
        return self._make_world("").stop(is_final=True)

    def _warn_of_silence(self, seconds: float) -> None:
        """Warn if a tracker sends no messages: once before the first one, and once after it."""
        trackers = self._config.people.trackers.values()
        for perception, tracker, faults in zip(self._perceptions, trackers, self._faults, strict=True):
            last, kind = perception.last_message, tracker.topic[1]
            if last is None and seconds > SILENCE:
                faults.warn(f"no {kind} for {SILENCE:g} s; is this the topic of the people tracker?")
            elif last is not None and monotonic() - last > SILENCE:
                faults.warn(f"no {kind} for {SILENCE:g} s any more; has the people tracker stopped?")

    def _await_connection(self) -> None:
        """Wait until a lost connection is back.

        Raises:
            ConnectionLostError: it does not come back in time.
        """
        end = monotonic() + self._config.connection.max_outage
        while True:
            try:
                self._connection.check()
                return
            except ConnectionLostError as error:
                if monotonic() > end:
                    outage = self._config.connection.max_outage
                    raise ConnectionLostError(f"{error}; it could not be used within {outage:g} s") from None
            sleep(PERIOD)

    def _find_person(self) -> str | None:
        """Return the person to attend to; None if there is nobody."""
        present, facts = self._people.list_people(), self._read_facts()
        self._decided &= present.keys()
        self._attention.note_presence(len(present), monotonic())
        self._attention.note_absence(present)
        waited_from = self._config.people.decide_after
        beliefs = dict[str, Distribution]()
        for person, seconds in present.items():
            if seconds < waited_from or person in self._decided:
                continue
            robot = self._decider.make_robot(person)
            labels = robot.classify(Instance(self._people.signals(person), {}))
            try:
                _, _, prior = infer_prior(robot, facts, labels)
                self._attention.update(person, robot, prior, seconds - waited_from)
            except LcorppError as error:  # e.g. impossible evidence, or a policy that never reports
                LOG.warning("%s: %s", person, error)
                self._decided.add(person)
                self._attention.forget(person)
                continue
            beliefs[person] = self._parts.domain.marginal(prior)
        chosen = self._attention.choose()
        with suppress(ConnectionLostError):  # the loop waits for it
            for person in sorted(beliefs, key=lambda person: person == chosen):  # the chosen one last
                self._publish_belief(person, beliefs[person])
        return chosen

    def _read_facts(self) -> dict[str, str]:
        facts = {name: fact.read() for name, fact in self._config.facts.items()}
        return {name: value for name, value in facts.items() if value is not None}

    def _decide(self, person: str) -> Decision:
        """Decide about a person; a failure is part of the result."""
        domain, world = self._parts.domain, self._make_world(person)

        def take(step: Step) -> None:
            self._publish_belief(person, domain.marginal(step.belief), step.action)
            self._attention.note_presence(len(self._people.list_people()), monotonic())
            self._show_step(person, step)

        try:
            decision = self._decider.decide(person, self._read_facts, world, take)
        except BaseException:
            world.stop()
            raise
        error = decision.error
        if decision.episode is None:
            world.stop()
        else:
            error = self._publish_intent(person, decision.episode)
        return replace(decision, error=error, failures=tuple(world.failures))

    def _publish_intent(self, person: str, episode: Episode) -> WorldError | None:
        """Publish that the person wants to engage, if so reported; return why it failed, if it did."""
        beliefs = self._config.beliefs
        if beliefs is None or episode.report != self._config.value:
            return None
        marginal, answered = self._parts.domain.marginal(episode.steps[-1].belief), bool(episode.answers)
        try:
            beliefs.publish_intent(self._connection, person, marginal, has_answered=answered)
        except WorldError as error:
            return error
        return None

    def _finish(self, person: str) -> WorldError | None:
        """Do what follows a decision; return why it failed, None if it did not."""
        try:
            self._make_world(person).report(AFTER)
        except WorldError as error:
            LOG.warning("%s", error)
            return error
        return None

    def _make_world(self, person: str) -> RosWorld:
        config = self._config
        body = Body(self._connection, self._perception, person, config.cmd_vel, self._people)
        silence = config.answers.silence
        return RosWorld(body, config.behaviours, self._listener, silence=silence, orders=self._orders)

    def _publish_belief(self, person: str, marginal: Distribution, action: str | None = None) -> None:
        if self._config.beliefs is not None:
            self._config.beliefs.publish(self._connection, person, marginal, action)


def make_perceptions(connection: RosConnection, config: RobotConfig) -> list[Perception]:
    """Return the perception by the robot's tracker, and by that of each sense that has its own.

    Raises:
        WorldError: no pose of the robot comes. ConnectionLostError: there is no connection.
    """
    perceptions = list[Perception]()
    for name, tracker in config.people.trackers.items():
        first = perceptions[0] if perceptions else None
        perceptions.append(
            Perception(
                connection,
                tracker.topic,
                config.pose,
                config.frames,
                timeout=config.connection.timeout,
                classes=tracker.classes,
                mounting=tracker.mounting,
                positions=None if first is None else first.positions,
                tracker=name,
                home=None if first is None else first.home,
                initial=config.initial_pose if first is None else None,
                head_frame=tracker.head_frame,
            )
        )
    return perceptions


def _divide(
    classifiers: Mapping[str, TrainedClassifier], people: PeopleConfig
) -> list[dict[str, TrainedClassifier]]:
    """Return the classifiers of the robot's tracker, and of each sense's own, in their order."""
    own = [{name: classifiers[name]} if name in classifiers else {} for name in people.senses]
    return [{name: one for name, one in classifiers.items() if name not in people.senses}, *own]
