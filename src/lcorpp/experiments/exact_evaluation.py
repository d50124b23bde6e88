"""Exact scores of the strategies, by enumeration of people and answers.

These scores are the reference for the simulated trials. The evaluation requires a noisy channel as the
classifier and a feedback model of known probabilities, not a `people.py` that draws reactions.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.decision import Robot, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError, check_type
from lcorpp.experiments.metrics import Scores, score_probabilities
from lcorpp.reasoning import Enumeration
from lcorpp.simulation.simulated_classifier import NoisyChannel
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
    check_type(domain, Domain, "the domain", DomainError)
    check_type(robot, Robot, "the robot", DecisionError)
    check_type(channel, NoisyChannel, "the channel", DecisionError)
    if domain.simulation.reaction is not None:
        raise DomainError(
            f"{domain.folder}: people.py draws reactions, so only simulated trials can score this domain"
        )
    people = compute_joint_distribution(domain, (*domain.observed, domain.target))
    return [
        _score_strategy(domain, strategy.robot(robot), strategy, channel, people) for strategy in strategies
    ]


def compute_joint_distribution(domain: Domain, attributes: Sequence[str]) -> dict[tuple[str, ...], float]:
    """Compute the joint distribution of some attributes of the people: value tuple -> probability."""
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
    priors = _compute_prior_probabilities(domain, robot, strategy, channel, people)
    tree = _EpisodeTree(domain, robot)
    # (V, V + 1) probability of each true value and reported value; the last column is for no report
    joint = np.zeros((len(domain.values), len(domain.values) + 1))
    cost = squared_cost = return_ = 0.0
    for (key, v), mass in priors.items():
        for leaf in tree.enumerate_leaves(np.frombuffer(key), v):
            p = mass * leaf.probability
            joint[v, leaf.reported] += p
            cost += p * leaf.cost
            squared_cost += p * leaf.cost**2
            return_ += p * (leaf.reward - leaf.cost)
    sd = float(np.sqrt(max(squared_cost - cost**2, 0.0)))
    return score_probabilities(
        strategy.name, joint, cost, return_, sd, values=domain.values, positive=domain.learning.positive
    )


def _compute_prior_probabilities(
    domain: Domain,
    robot: Robot,
    strategy: Strategy,
    channel: NoisyChannel,
    people: Mapping[tuple[str, ...], float],
) -> dict[tuple[bytes, int], float]:
    """Compute the distribution over prior beliefs and true values.

    Args:
        people: the observed values and, last, the true value -> probability.

    Returns:
        (prior belief (S,) as bytes, index of the true value) -> probability.
    """
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
    """The end of all episodes with the same last action and cost.

    probability: of these episodes, given the prior belief and the true value.
    reported: index of the reported value, V for no report.
    cost: the sum of the costs of the actions before the report, positive.
    reward: the reward of the report in the true state; 0 without a report.
    """

    probability: float
    reported: int
    cost: float
    reward: float


class _EpisodeTree:
    """All episodes from a belief; actions, transitions and belief updates are cached.

    _actions: belief as bytes -> action.
    _transitions: (action, state) -> possible (next state, observation, probability).
    _updates: (belief as bytes, action, observation) -> belief (S,).
    """

    def __init__(self, domain: Domain, robot: Robot) -> None:
        self._domain, self._robot = domain, robot
        self._actions: dict[bytes, str] = {}
        self._transitions: dict[tuple[int, int], list[tuple[int, str, float]]] = {}
        self._updates: dict[tuple[bytes, str, str], Belief] = {}

    def enumerate_leaves(self, prior: Belief, v: int) -> list[_Leaf]:
        """Return the leaves of all episodes from a prior belief (S,) with a person of true value v."""
        domain, pomdp = self._domain, self._domain.pomdp
        leaves: list[_Leaf] = []
        # the episodes after the same number of actions: (belief as bytes, state, cost) -> probability
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
                next_cost = round(cost - reward, 9)  # rounding merges equal costs
                for s_next, observation, probability in self._find_transitions(a, s):
                    p = mass * probability
                    if p < MIN_PROBABILITY:
                        continue
                    belief_next = self._update(key, belief, action, observation)
                    key_next = belief_next.tobytes()
                    beliefs[key_next] = belief_next
                    successors[key_next, s_next, next_cost] += p
            frontier = successors
        return leaves

    def _find_transitions(self, action: int, state: int) -> list[tuple[int, str, float]]:
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
        cache_key = (key, action, observation)
        if cache_key not in self._updates:
            # rounding merges beliefs that different paths reach
            self._updates[cache_key] = np.round(self._robot.planner.update(belief, action, observation), 12)
        return self._updates[cache_key]
