"""The world of a robot that runs ROS: actions with time-outs and a safe end, feedback of the person."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from time import monotonic
from typing import Protocol

from lcorpp.errors import ActionFailedError, ConnectionLostError, DecisionError, WorldError, expected_one_of
from lcorpp.worlds.ros.connection import RosConnection, Subscription
from lcorpp.worlds.ros.fields import FaultLog
from lcorpp.worlds.ros.sensor_messages import read_text
from lcorpp.worlds.ros.skills import TWIST, Body, CallAction, Navigate, Say, Skill, Speak, make_twist

LOG = logging.getLogger("lcorpp.robot")
"""At INFO one line an action, at WARNING one line a failure that became an observation."""


BRIEFLY = 0.3
"""Seconds to wait for the confirmation of a stop, so that it does not cancel the next goal instead."""
CONFIRMATION = 1.0
"""Seconds to wait until an action server confirms a cancellation, before the orders are repeated."""


class Listener(Protocol):
    """What recognises the person's answers."""

    def clear(self) -> None:
        """Forget what was said before."""

    def listen(self, seconds: float) -> str | None:
        """Return the observation of the first answer; None if there is none within `seconds`.

        Raises:
            ConnectionLostError: the connection is lost.
        """


@dataclass(frozen=True)
class Behaviour:
    """How the robot executes an action of the POMDP.

    skill: what it does; None only listens. timeout: seconds of the skill.
    listen: seconds to wait for an answer afterwards.
    failure: the observation if the skill fails; None ends the decision with the error.
    """

    skill: Skill | None
    timeout: float = 10.0
    listen: float = 3.0
    failure: str | None = None


@dataclass(frozen=True)
class StopOrders:
    """What stops the robot: a Twist of zeros, and the cancellation of the goals of these action servers."""

    cmd_vel: str
    servers: tuple[str, ...] = ()

    @classmethod
    def of(cls, cmd_vel: str, skills: Iterable[Skill | None]) -> StopOrders:
        """Return the orders for what these skills may have started."""
        names = {skill.name for skill in skills if isinstance(skill, Navigate | CallAction)}
        return cls(cmd_vel, tuple(sorted(names)))

    def send(self, connection: RosConnection, *, timeout: float = 0.0) -> bool:
        """Order the robot to stop.

        Returns:
            Whether all action servers have confirmed it, each within `timeout` seconds.

        Raises:
            ConnectionLostError: there is no connection.
        """
        connection.publish(self.cmd_vel, TWIST, make_twist(0.0, 0.0))
        confirmed = []
        for name in self.servers:
            try:
                confirmed.append(connection.cancel_goals(name, timeout=timeout))
            except ActionFailedError:  # the others are still cancelled
                confirmed.append(False)
        return all(confirmed)

    def send_soon(self, connection: RosConnection) -> str:
        """Order the robot to stop, now or (by `RosWorld`) after reconnecting; return a sentence about it."""
        try:
            self.send(connection, timeout=BRIEFLY)
        except ConnectionLostError:
            return (
                "without a connection no order to stop was sent; it is the first once the connection is back"
            )
        return "the robot was ordered to stop"


class RosWorld:
    """A person and a robot that runs ROS, as the world of one decision (`lcorpp.protocols.World`).

    An action ends after at most its time-out and the time to listen. Silence gives the observation `silence`.
    A skill that fails gives the observation of its behaviour, or an error. After each failure, and if it is
    interrupted, the robot is ordered to stop.

    failures: the failures that became observations.

    Args:
        body: the robot's parts and the person.
        behaviours: action -> how to execute it; actions without one are errors.
        listener: recognises answers; None if the robot cannot hear.
        silence: the observation without an answer.
    """

    source = "robot.toml"

    def __init__(
        self,
        body: Body,
        behaviours: Mapping[str, Behaviour],
        listener: Listener | None = None,
        *,
        silence: str = "none",
    ) -> None:
        self._body, self._behaviours = body, behaviours
        self._listener, self._silence = listener, silence
        self._orders = StopOrders.of(body.cmd_vel, [b.skill for b in behaviours.values()])
        self.failures = list[WorldError]()
        body.connection.call_after_reconnect(lambda: self._orders.send(body.connection, timeout=CONFIRMATION))

    def __repr__(self) -> str:
        return f"RosWorld({self._body.person!r}; actions: {', '.join(self._behaviours)})"

    def act(self, action: str) -> str:
        """Execute an action and return the observation.

        Raises:
            DecisionError: the action is unknown.
            ActionFailedError: it failed, and its behaviour has no observation for that.
            PersonLeftError: the person is no longer detected, so nothing is done.
            ConnectionLostError: the connection is lost.
        """
        behaviour = self._find_behaviour(action)
        self._body.locate_person()
        failed = self._execute(action, behaviour)
        if failed is not None:
            return failed
        if self._listener is None:
            return self._silence
        with self._stop_after_failure(action):
            return self._listener.listen(behaviour.listen) or self._silence

    def report(self, action: str) -> None:
        """Execute a report; without a behaviour the robot does nothing.

        Raises:
            ActionFailedError, ConnectionLostError: as `act`.
        """
        if action in self._behaviours:
            self._execute(action, self._behaviours[action])

    def stop(self) -> str:
        """Order the robot to stop, now or as soon as the connection is back; return a sentence about it."""
        return self._orders.send_soon(self._body.connection)

    def _find_behaviour(self, action: str) -> Behaviour:
        found = self._behaviours.get(action)
        if found is None:
            raise DecisionError(f"the robot has no action {action!r}; {expected_one_of(self._behaviours)}")
        return found

    def _execute(self, action: str, behaviour: Behaviour) -> str | None:
        """Run the skill of an action; return the observation of its failure, None if it did not fail."""
        skill, began = behaviour.skill, monotonic()
        if self._listener is not None:
            self._listener.clear()
        if skill is None:
            return None
        try:
            with self._stop_after_failure(action):
                skill.run(self._body, behaviour.timeout)
        except ActionFailedError as error:
            if behaviour.failure is None:
                raise
            self.failures.append(error)
            LOG.warning("%s; observation %s", error, behaviour.failure)
            return behaviour.failure
        LOG.info("%s: done after %.1f s", action, monotonic() - began)
        if isinstance(skill, Say | Speak) and self._listener is not None:
            self._listener.clear()  # the robot's own voice is no answer
        return None

    def _stop_after_failure(self, action: str) -> StopAfterFailure:
        return StopAfterFailure(action, self._orders, self._body.connection)


class StopAfterFailure:
    """A context that orders the robot to stop if an action fails or is interrupted."""

    def __init__(self, action: str, orders: StopOrders, connection: RosConnection) -> None:
        self._action, self._orders, self._connection = action, orders, connection

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, _: object) -> None:
        if error is None:
            return
        ordered = self._orders.send_soon(self._connection)
        if isinstance(error, WorldError):
            raise type(error)(f"{self._action}: {error}; {ordered}") from error


@dataclass(frozen=True, eq=False)
class TopicListener:
    """Answers that a speech recogniser publishes.

    subscription: of its topic. kind: the type of the messages, see `TEXTS`.
    utterances: observation -> its sentences; a text that is the name of an observation stands for itself.
    observations: the possible observations. faults: warns of messages that cannot be read.
    """

    subscription: Subscription
    kind: str
    observations: Sequence[str]
    utterances: Mapping[str, Sequence[str]] = field(default_factory=dict)
    faults: FaultLog = field(default_factory=lambda: FaultLog("speech"))

    def clear(self) -> None:
        """As `Listener.clear`."""
        self.subscription.take()

    def listen(self, seconds: float) -> str | None:
        """As `Listener.listen`; texts that are none of the sentences are no answers."""
        end = monotonic() + seconds
        while (message := self.subscription.wait(max(0.0, end - monotonic()))) is not None:
            try:
                found = self._find_observation(read_text(self.kind, message))
            except WorldError as fault:
                self.faults.warn(f"{fault}; it is left out")
                continue
            if found is not None:
                return found
        return None

    def _find_observation(self, text: str) -> str | None:
        if text in self.observations:
            return text
        words = normalise_text(text)
        for observation, sentences in self.utterances.items():
            if any(words == normalise_text(sentence) for sentence in sentences):
                return observation
        return None


def normalise_text(text: str) -> str:
    """Return a sentence in lower case without punctuation."""
    return " ".join(re.findall(r"[\w']+", text.lower().replace("\u2019", "'")))
