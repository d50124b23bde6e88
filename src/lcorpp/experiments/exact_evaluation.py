"""Exact scores of the strategies, by enumeration of people and answers.

These scores are the reference for the simulated trials. The evaluation requires noisy channels as the
classifiers and a feedback model of known probabilities, not a `people.py` that draws reactions.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import product
from math import prod

import numpy as np

from lcorpp.decision import Robot, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError, TooLargeError, check_type
from lcorpp.experiments.differences import add_differences
from lcorpp.experiments.metrics import Scores, score_probabilities
from lcorpp.reasoning import Enumeration, Reasoner
from lcorpp.simulation.simulated_classifier import NoisyChannel
from lcorpp.values import Belief

MIN_PROBABILITY = 1e-12
"""Branches of an episode less likely than this are pruned."""

MAX_WORLDS = 1000
"""Maximum number of worlds of a truth program that are summed one by one; larger programs are compiled.

The two agree but for rounding; the sum over worlds keeps the last digits of published results.
"""


def evaluate_exactly(
    domain: Domain, robot: Robot, channels: Mapping[str, NoisyChannel], strategies: tuple[Strategy, ...]
) -> list[Scores]:
    """Compute the exact scores of some strategies.

    Args:
        robot: the full robot.
        channels: sense -> the noisy channel that replaces its classifier.
        strategies: the strategies, in the order of the result.

    Raises:
        DomainError: the domain's `people.py` draws reactions, whose probabilities are unknown.
    """
    check_type(domain, Domain, "the domain", DomainError)
    check_type(robot, Robot, "the robot", DecisionError)
    for channel in channels.values():
        check_type(channel, NoisyChannel, "a channel", DecisionError)
    if domain.simulation.reaction is not None:
        raise DomainError(
            f"{domain.folder}: people.py draws reactions, so only simulated trials can score this domain"
        )
    classified = [channel.of for channel in channels.values()]
    attributes = tuple(dict.fromkeys([*domain.observed, *classified, *domain.reasoning.shared]))
    people = [
        (dict(zip(attributes, values, strict=True)), mass)
        for values, mass in compute_joint_distribution(domain, attributes).items()
    ]
    scores = [
        _score_strategy(domain, strategy.robot(robot), strategy, channels, people) for strategy in strategies
    ]
    means = [[[getattr(row, name).estimate for row in scores]] for name in ("cost", "return_")]
    return add_differences(scores, np.array(means[0]), np.array(means[1]))


def compute_joint_distribution(domain: Domain, attributes: Sequence[str]) -> dict[tuple[str, ...], float]:
    """Compute the joint distribution of some attributes of the people: value tuple -> probability."""
    program = domain.simulation.true_program
    try:
        worlds = Enumeration(program, limit=MAX_WORLDS).worlds
    except TooLargeError:
        return {values: float(p) for values, p in Reasoner(program).exact(list(attributes)).items()}
    joint: dict[tuple[str, ...], float] = {}
    for world in worlds:
        values = tuple(world.values[name] for name in attributes)
        joint[values] = joint.get(values, 0.0) + float(world.measure)
    return joint


def _score_strategy(
    domain: Domain,
    robot: Robot,
    strategy: Strategy,
    channels: Mapping[str, NoisyChannel],
    people: Sequence[tuple[Mapping[str, str], float]],
) -> Scores:
    """Score the robot of a strategy; `people`: attribute -> value, and its probability."""
    used = {sense: channel for sense, channel in channels.items() if strategy.uses(sense)}
    # distribution over (prior belief (S,) as bytes, index of the true value)
    priors: dict[tuple[bytes, int], float] = defaultdict(float)

    @cache
    def find_prior(context: tuple[str, ...], labels: tuple[tuple[str, str], ...]) -> bytes:
        facts = dict(zip(domain.observed, context, strict=True))
        marginal = robot.reasoner.posterior(domain.shared, domain.evidence(facts, dict(labels)))
        return (robot.planner.start if marginal is None else domain.prior(marginal)).tobytes()

    for person, mass in people:
        v = domain.values.index(domain.reasoning.join(person))
        context = tuple([person[name] for name in domain.observed])
        for labels, rate in _enumerate_labels(used, person):
            if mass * rate > 0:
                priors[find_prior(context, tuple(labels.items())), v] += mass * rate
    tree = _EpisodeTree(domain, robot)
    # (V, V + 1) probability of each true value and reported value; the last column is for no report
    joint = np.zeros((len(domain.values), len(domain.values) + 1))
    total_cost = squared_cost = return_ = 0.0
    for (key, v), mass in priors.items():
        for probability, reported, cost, reward in tree.enumerate_leaves(np.frombuffer(key), v):
            p = mass * probability
            joint[v, reported] += p
            total_cost += p * cost
            squared_cost += p * cost**2
            return_ += p * (reward - cost)
    sd = float(np.sqrt(max(squared_cost - total_cost**2, 0.0)))
    return score_probabilities(
        strategy.name,
        joint,
        total_cost,
        return_,
        sd,
        values=domain.values,
        positive=domain.positive,
        variables=domain.reasoning.shared,
    )


def _enumerate_labels(
    channels: Mapping[str, NoisyChannel], person: Mapping[str, str]
) -> Iterator[tuple[dict[str, str], float]]:
    """Yield the labels that the senses may give a person, sense -> class, and their probability."""
    rows = [channel.rates[channel.classes.index(person[channel.of])] for channel in channels.values()]
    choices = [
        zip(c.classes, row.tolist(), strict=True) for c, row in zip(channels.values(), rows, strict=True)
    ]
    for combination in product(*choices):
        labels = {sense: label for sense, (label, _) in zip(channels, combination, strict=True)}
        yield labels, prod([rate for _, rate in combination])


class _EpisodeTree:
    """All episodes from a belief; actions, transitions and belief updates are cached.

    Beliefs are passed as bytes, because arrays cannot be keys of a cache.
    """

    def __init__(self, domain: Domain, robot: Robot) -> None:
        pomdp, planner, feedback = domain.pomdp, robot.planner, domain.simulation.feedback_model
        self._domain = domain

        @cache
        def select_action(belief: bytes) -> str:
            return planner.action(np.frombuffer(belief))

        @cache
        def find_transitions(action: int, state: int) -> list[tuple[int, str, float]]:
            states, probabilities = pomdp.transition.row(action, state)
            return [
                (s, pomdp.observations[o], p * float(feedback[action, s, o]))
                for s, p in zip(states.tolist(), probabilities.tolist(), strict=True)
                for o in np.flatnonzero(feedback[action, s])
            ]

        @cache
        def update(belief: bytes, action: str, observation: str) -> bytes:
            after = planner.update(np.frombuffer(belief), action, observation)
            return np.round(after, 12).tobytes()  # rounding merges beliefs that different paths reach

        self._select_action, self._find_transitions, self._update = select_action, find_transitions, update

    def enumerate_leaves(self, prior: Belief, v: int) -> Iterator[tuple[float, int, float, float]]:
        """Yield the ends of all episodes from a prior belief (S,) with a person of true value v.

        Each is the end of all episodes with the same last action and cost: their probability; the index of
        the reported value, V for no report; the cost of the actions before the report, positive; the reward
        of the report in the true state, 0 without a report.
        """
        domain, pomdp = self._domain, self._domain.pomdp
        # the episodes after the same number of actions: (belief as bytes, state, cost) -> probability
        frontier: dict[tuple[bytes, int, float], float] = {}
        for first in np.flatnonzero(domain.planning.initial_states[v]):
            frontier[prior.tobytes(), int(first), 0.0] = float(domain.planning.initial_states[v, first])
        while frontier:
            successors: dict[tuple[bytes, int, float], float] = defaultdict(float)
            for (belief, s, cost), mass in frontier.items():
                if domain.is_terminal(np.frombuffer(belief)):
                    yield mass, len(domain.values), cost, 0.0
                    continue
                action = self._select_action(belief)
                a = pomdp.actions.index(action)
                reward = float(pomdp.reward[a, s])
                value = domain.reported_value(action)
                if value is not None:
                    yield mass, domain.values.index(value), cost, reward
                    continue
                next_cost = round(cost - reward, 9)  # rounding merges equal costs
                for s_next, observation, probability in self._find_transitions(a, s):
                    p = mass * probability
                    if p >= MIN_PROBABILITY:
                        successors[self._update(belief, action, observation), s_next, next_cost] += p
            frontier = successors
