"""Whom the robot attends to: forecasts of decisions about people, and what it learns of their patience."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lcorpp.decision import Robot
from lcorpp.decision.attention import Candidate, ServedShare, choose_candidate, find_delay
from lcorpp.decision.patience import Patience
from lcorpp.domains import Domain
from lcorpp.planning import Planner, Pomdp
from lcorpp.scoring.decision_graph import DecisionGraph
from lcorpp.scoring.decision_nodes import RoundedBeliefNodes
from lcorpp.scoring.episode_model import EpisodeModel
from lcorpp.scoring.episode_sums import sum_episodes
from lcorpp.values import Belief, SharedValue

MAX_POINTS = 5_000
"""Points of decisions that a forecast visits: a fraction of a second."""
DIGITS = 2
"""Digits of the beliefs that share a forecast."""
KIND = ""
"""The kind of all people: a tracker does not see who is in a hurry."""


@dataclass(frozen=True)
class Forecast:
    """What a decision is expected to yield. value: P(engaged, and reported so). seconds: its duration."""

    value: float
    seconds: float


def forecast_decision(
    domain: Domain, robot: Robot, model: Pomdp, prior: Belief, engaged: SharedValue
) -> Forecast:
    """Sum over the histories of answers, as the planner's model has them; costs are seconds.

    The less likely histories are left out where they branch more than `MAX_POINTS` allows.

    Args:
        robot: its planner has a policy. model: of the planner.
        prior: (S,) belief before the first action. engaged: the shared value that means engagement.

    Raises:
        NoReportError: a history has no report after `lcorpp.decision.dt_control.MAX_STEPS` actions.
    """
    graph = DecisionGraph(domain, RoundedBeliefNodes(domain, robot))
    (root,) = graph.find_numbers([prior.tobytes()])
    people = EpisodeModel(domain, model.observation)
    marginal, index = domain.marginal(prior).probabilities, domain.values.index(engaged)
    (sums,) = sum_episodes(people, graph, {(root, 0): marginal}, ["the policy"], max_points=MAX_POINTS)
    return Forecast(float(sums.joint[index, index]), max(0.0, sums.cost))


@dataclass
class WaitingPerson:
    """A person to whom the robot may attend. forecast: of the decision. waited: seconds so far."""

    probability: float
    forecast: Forecast
    waited: float


class Attention:
    """Chooses the person to attend to by an index, and learns how long people stay.

    Args:
        domain: of the decisions. engaged: the shared value that means engagement.

    Attributes:
        served: estimate of the share of people to whom the robot attends.

    Source: `lcorpp.decision.attention` has the index.
    """

    def __init__(self, domain: Domain, engaged: SharedValue) -> None:
        self._domain, self._engaged = domain, engaged
        self._patience, self.served = Patience(), ServedShare()
        self._waiting = dict[str, WaitingPerson]()
        self._forecasts = dict[bytes, Forecast]()
        self._planner: object = None
        self._presence: tuple[int, float] | None = None

    def note_presence(self, count: int, now: float) -> None:
        """Learn how full the place is.

        Args:
            count: number of people present, of any kind. now: time in seconds.
        """
        if self._presence is not None:
            before, since = self._presence
            self.served.record_presence(before, now - since)
        self._presence = count, now

    def update(self, person: str, robot: Robot, prior: Belief, waited: float) -> None:
        """Take the belief about a person who waits.

        Args:
            robot: for this person. prior: (S,) belief. waited: seconds so far.
        """
        probability = float(self._domain.marginal(prior)[self._engaged])
        self._waiting[person] = WaitingPerson(probability, self._forecast(robot, prior, probability), waited)

    def note_absence(self, present: Mapping[str, float]) -> None:
        """Learn from the people who waited, and are no longer present."""
        for person in [name for name in self._waiting if name not in present]:
            self._end(person, left=True)

    def forget(self, person: str) -> None:
        """Leave out a person about whom the robot cannot decide."""
        self._waiting.pop(person, None)

    def choose(self) -> str | None:
        """Return the person to attend to; None if nobody waits, or nobody is worth it.

        People about whom the policy reports at once come first: that takes no time.
        """
        for person, waiting in self._waiting.items():
            if waiting.forecast.seconds == 0:
                return person
        if not self._waiting:
            return None
        ahead = find_delay([waiting.forecast.seconds for waiting in self._waiting.values()])
        candidates = [
            Candidate(
                person,
                waiting.probability,
                waiting.forecast.value,
                waiting.forecast.seconds,
                self._patience.hazard(KIND, waiting.waited, ahead),
            )
            for person, waiting in self._waiting.items()
        ]
        chosen = choose_candidate(candidates, share=self.served.share)
        return None if chosen is None else str(chosen)

    def attend(self, person: str) -> None:
        """Note that the robot attends to a person now."""
        self._end(person, left=False)

    def _end(self, person: str, *, left: bool) -> None:
        waiting = self._waiting.pop(person)
        self._patience.observe(KIND, waiting.waited, left=left, weight=waiting.probability)
        self.served.record(waiting.forecast.value, attended=not left)

    def _forecast(self, robot: Robot, prior: Belief, probability: float) -> Forecast:
        planner = robot.planner
        if not isinstance(planner, Planner):  # an own one may have state
            return Forecast(probability, 1.0)
        if planner is not self._planner:
            self._planner, self._forecasts = planner, {}
        key = np.round(prior, DIGITS).tobytes()
        if key not in self._forecasts:
            self._forecasts[key] = forecast_decision(self._domain, robot, planner.pomdp, prior, self._engaged)
        return self._forecasts[key]
