"""Exact scores of the strategies, by enumeration of people and answers.

These scores are the reference for the simulated trials. They need a noisy channel as the classifier and a
feedback model in probabilities.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.decision import Robot, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.experiments.metrics import Scores, score_probabilities
from lcorpp.reasoning import Enumeration
from lcorpp.simulation.channel import NoisyChannel
from lcorpp.values import Belief

MIN_PROBABILITY = 1e-12
"""Branches of an episode less likely than this are pruned."""


def evaluate_exactly(
    domain: Domain, robot: Robot, channel: NoisyChannel, strategies: tuple[Strategy, ...]
) -> list[Scores]:
    """Compute the exact scores of some strategies.

    Args:
        robot: the full robot; `channel` replaces its classifier.
        strategies: the strategies, in the order of the result.

    Raises:
        DomainError: the domain's `people.py` draws reactions, whose probabilities are unknown.
    """
    if domain.simulation.reaction is not None:
        raise DomainError(f"{domain.folder}: people.py draws its reactions, so only simulation can score it")
    people = joint_distribution(domain, (*domain.observed, domain.target))
    return [
        _score_strategy(domain, strategy.robot(robot), strategy, channel, people) for strategy in strategies
    ]


def joint_distribution(domain: Domain, attributes: Sequence[str]) -> dict[tuple[str, ...], float]:
    """Return the joint distribution of some attributes of the people: value tuple -> probability."""
    joint: dict[tuple[str, ...], float] = {}
    for world in Enumeration(domain.simulation.true_program).worlds:
        values = tuple(world.values[name] for name in attributes)
        joint[values] = joint.get(values, 0.0) + float(world.measure)
    return joint


def _score_strategy(
    domain: Domain,
    robot: Robot,
    strategy: Strategy,
    channel: NoisyChannel,
    people: Mapping[tuple[str, ...], float],
) -> Scores:
    priors = _prior_probabilities(domain, robot, strategy, channel, people)
    tree = _EpisodeTree(domain, robot)
    joint = np.zeros((len(domain.values), len(domain.values) + 1))
    cost = squared_cost = return_ = 0.0
    for (key, v), mass in priors.items():
        for leaf in tree.leaves(np.frombuffer(key), v):
            p = mass * leaf.probability
            joint[v, leaf.reported] += p
            cost += p * leaf.cost
            squared_cost += p * leaf.cost**2
            return_ += p * (leaf.reward - leaf.cost)
    sd = float(np.sqrt(max(squared_cost - cost**2, 0.0)))
    return score_probabilities(
        strategy.name, joint, cost, return_, sd, values=domain.values, positive=domain.learning.positive
    )


def _prior_probabilities(
    domain: Domain,
    robot: Robot,
    strategy: Strategy,
    channel: NoisyChannel,
    people: Mapping[tuple[str, ...], float],
) -> dict[tuple[bytes, int], float]:
    """Return the probability of each pair of a prior belief (as bytes) and a true value's index."""
    priors: dict[tuple[bytes, int], float] = defaultdict(float)
    for (*context, value), mass in people.items():
        v = domain.values.index(value)
        labels = (
            dict(zip(channel.classes, channel.rates[v].tolist(), strict=True))
            if strategy.learns
            else {None: 1.0}
        )
        for label, rate in labels.items():
            if mass * rate == 0:
                continue
            evidence = domain.evidence(dict(zip(domain.observed, context, strict=True)), label)
            marginal = robot.reasoner.posterior(domain.target, evidence)
            prior = robot.planner.start if marginal is None else domain.prior(marginal)
            priors[prior.tobytes(), v] += mass * rate
    return priors


@dataclass(frozen=True)
class _Leaf:
    """The end of an episode. reported: index of the reported value, V for no report."""

    probability: float
    reported: int
    cost: float
    reward: float


class _EpisodeTree:
    """All episodes from a belief; actions, transitions and belief updates are cached."""

    def __init__(self, domain: Domain, robot: Robot) -> None:
        self._domain, self._robot = domain, robot
        self._actions: dict[bytes, str] = {}
        self._transitions: dict[tuple[int, int], list[tuple[int, str, float]]] = {}
        self._updates: dict[tuple[bytes, str, str], Belief] = {}

    def leaves(self, prior: Belief, v: int) -> list[_Leaf]:
        """Return the leaves of all episodes from a prior belief (S,) with a person of true value v."""
        domain, pomdp = self._domain, self._domain.pomdp
        leaves: list[_Leaf] = []
        frontier: dict[tuple[bytes, int, float], float] = {}
        beliefs = {prior.tobytes(): prior}
        for first in np.flatnonzero(domain.planning.initial_states[v]):
            frontier[prior.tobytes(), int(first), 0.0] = float(domain.planning.initial_states[v, first])
        while frontier:
            successors: dict[tuple[bytes, int, float], float] = defaultdict(float)
            for (key, s, cost), mass in frontier.items():
                belief = beliefs[key]
                if domain.is_terminal(belief):
                    leaves.append(_Leaf(mass, len(domain.values), cost, 0.0))
                    continue
                action = self._select_action(key, belief)
                a = pomdp.actions.index(action)
                reward = float(pomdp.reward[a, s])
                value = domain.reported_value(action)
                if value is not None:
                    leaves.append(_Leaf(mass, domain.values.index(value), cost, reward))
                    continue
                next_cost = round(cost - reward, 9)
                for s_next, observation, probability in self._step(a, s):
                    p = mass * probability
                    if p < MIN_PROBABILITY:
                        continue
                    belief_next = self._update(key, belief, action, observation)
                    key_next = belief_next.tobytes()
                    beliefs[key_next] = belief_next
                    successors[key_next, s_next, next_cost] += p
            frontier = successors
        return leaves

    def _step(self, action: int, state: int) -> list[tuple[int, str, float]]:
        """Return the possible (next state, observation, probability) of an action in a state."""
        if (action, state) not in self._transitions:
            pomdp, feedback = self._domain.pomdp, self._domain.simulation.feedback_model
            states, probabilities = pomdp.transition.row(action, state)
            self._transitions[action, state] = [
                (s, pomdp.observations[o], p * float(feedback[action, s, o]))
                for s, p in zip(states.tolist(), probabilities.tolist(), strict=True)
                for o in np.flatnonzero(feedback[action, s])
            ]
        return self._transitions[action, state]

    def _select_action(self, key: bytes, belief: Belief) -> str:
        if key not in self._actions:
            self._actions[key] = self._robot.planner.action(belief)
        return self._actions[key]

    def _update(self, key: bytes, belief: Belief, action: str, observation: str) -> Belief:
        step = (key, action, observation)
        if step not in self._updates:
            # rounding merges beliefs that different paths reach
            self._updates[step] = np.round(self._robot.planner.update(belief, action, observation), 12)
        return self._updates[step]
