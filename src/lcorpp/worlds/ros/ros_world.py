"""The world of a robot that runs ROS: actions with time-outs and a safe end, feedback of the person."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from time import monotonic
from typing import Protocol

from lcorpp.errors import ActionFailedError, DecisionError, WorldError, expected_one_of
from lcorpp.worlds.ros.connection import Subscription
from lcorpp.worlds.ros.fields import FaultLog
from lcorpp.worlds.ros.sensor_messages import read_text
from lcorpp.worlds.ros.skills import Body, Say, Skill, Speak
from lcorpp.worlds.ros.stop_report import StopReport
from lcorpp.worlds.ros.stopping import StopAfterFailure, StopOrders

LOG = logging.getLogger("lcorpp.robot")
"""At INFO one line an action, at WARNING one line a failure that became an observation."""


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
        orders: what stops the robot; None makes them from the behaviours.
    """

    source = "robot.toml"

    def __init__(
        self,
        body: Body,
        behaviours: Mapping[str, Behaviour],
        listener: Listener | None = None,
        *,
        silence: str = "none",
        orders: StopOrders | None = None,
    ) -> None:
        self._body, self._behaviours = body, behaviours
        self._listener, self._silence = listener, silence
        self._orders = orders or StopOrders.of(body.cmd_vel, [b.skill for b in behaviours.values()])
        self.failures = list[WorldError]()
        body.connection.call_after_reconnect(
            lambda: self._orders.send(body.connection, timeout=CONFIRMATION).is_settled
        )

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
        observed = self._execute(action, behaviour)
        if observed is not None:
            return observed
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

    def stop(self, *, is_final: bool = False) -> StopReport:
        """Order the robot to stop, now or as soon as the connection is back; return what is known about it.

        Args:
            is_final: whether the connection ends now.
        """
        return self._orders.stop(self._body, is_final=is_final)

    def _find_behaviour(self, action: str) -> Behaviour:
        found = self._behaviours.get(action)
        if found is None:
            raise DecisionError(f"the robot has no action {action!r}; {expected_one_of(self._behaviours)}")
        return found

    def _execute(self, action: str, behaviour: Behaviour) -> str | None:
        """Run the skill of an action; return its observation or that of its failure, None without either."""
        skill, began = behaviour.skill, monotonic()
        if self._listener is not None:
            self._listener.clear()
        if skill is None:
            return None
        try:
            with self._stop_after_failure(action):
                observed = skill.run(self._body, behaviour.timeout)
        except ActionFailedError as error:
            if behaviour.failure is None:
                raise
            self.failures.append(error)
            LOG.warning("%s; observation %s", error, behaviour.failure)
            return behaviour.failure
        LOG.info("%s: done after %.1f s", action, monotonic() - began)
        if isinstance(skill, Say | Speak) and self._listener is not None:
            self._listener.clear()  # the robot's own voice is not an answer
        return observed

    def _stop_after_failure(self, action: str) -> StopAfterFailure:
        return StopAfterFailure(action, self._orders, self._body)


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
        """As `Listener.listen`; texts that are none of the sentences are not answers."""
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
