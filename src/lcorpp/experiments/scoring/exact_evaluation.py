"""Exact scores of the strategies, by enumeration of people and answers.

These scores are the reference for the simulated trials. The evaluation requires noisy channels as the
classifiers and a feedback model of known probabilities, not a world of the domain's own.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from functools import cache
from itertools import product
from math import ceil, log, prod

import numpy as np

from lcorpp.decision import Robot, Strategy
from lcorpp.decision.dt_control import MAX_STEPS
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError, NoReportError, TooLargeError, check_type
from lcorpp.experiments.scoring.decision_nodes import BeliefNodes, DecisionNodes, HistoryNodes
from lcorpp.experiments.scoring.differences import add_differences
from lcorpp.experiments.scoring.metrics import Scores, score_probabilities
from lcorpp.reasoning import Enumeration, Reasoner
from lcorpp.simulation.simulated_classifier import NoisyChannel

MAX_POINTS = 3_000_000
"""Maximum number of points at which the decisions of a strategy may be: half a minute in small domains."""

FORECAST_POINTS = 20_000
"""Number of points from whose growth the number of all points is forecast: some seconds in large domains."""

FORECAST_ROOTS = 10
"""Number of starts of decisions, evenly chosen, whose points are followed for a forecast."""

FORECAST_LEVELS = 4
"""Number of actions over which growth is averaged."""

FORECAST_MARGIN = 3
"""A forecast above this multiple of the maximum is refused; merged points may stop the growth below it."""

MIN_PROBABILITY = 1e-12
"""Branches of an episode less likely than this are pruned."""

MAX_WORLDS = 1000
"""Maximum number of worlds of a truth program that are summed one by one; larger programs are compiled.

The two agree but for rounding; the sum over worlds keeps the last digits of published results.
"""


def evaluate_exactly(
    domain: Domain,
    robot: Robot,
    channels: Mapping[str, NoisyChannel],
    strategies: tuple[Strategy, ...],
    *,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> list[Scores]:
    """Compute the exact scores of some strategies.

    Args:
        robot: the full robot.
        channels: sense -> the noisy channel that replaces its classifier.
        strategies: the strategies, in the order of the result.
        progress: called with the number of completed starts of decisions of a strategy, and of all.

    Raises:
        DomainError: the domain has a world of its own, whose probabilities are unknown.
        DecisionError: a strategy draws its actions, acts differently after equal histories, has decisions
            that branch too much, or an own strategy has too many histories.
        NoReportError: a strategy's policy never reports.
    """
    check_type(domain, Domain, "the domain", DomainError)
    check_type(robot, Robot, "the robot", DecisionError)
    for channel in channels.values():
        check_type(channel, NoisyChannel, "a channel", DecisionError)
    check_enumerable(domain, strategies)
    classified = [channel.of for channel in channels.values()]
    attributes = tuple(dict.fromkeys([*domain.observed, *classified, *domain.reasoning.shared]))
    people = [
        (dict(zip(attributes, values, strict=True)), mass)
        for values, mass in compute_joint_distribution(domain, attributes).items()
    ]
    scores = [_score_strategy(domain, robot, strategy, channels, people, progress) for strategy in strategies]
    means = [[[getattr(row, name).estimate for row in scores]] for name in ("cost", "return_")]
    return add_differences(scores, np.array(means[0]), np.array(means[1]))


def check_enumerable(domain: Domain, strategies: Sequence[Strategy]) -> None:
    """Check that the probabilities of all actions and answers are known.

    Raises:
        DomainError: the domain has a world of its own.
        DecisionError: a strategy draws its actions.
    """
    if domain.simulation.world is not None:
        raise DomainError(
            f"{domain.folder}: people answer by a world of their own or by reaction() in people.py, so only"
            " simulated trials can score this domain"
        )
    for strategy in strategies:
        if strategy.draws:
            raise DecisionError(
                f"{strategy.location} draws its actions, so it has no exact scores; expected simulated trials"
            )


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
    full: Robot,
    strategy: Strategy,
    channels: Mapping[str, NoisyChannel],
    people: Sequence[tuple[Mapping[str, str], float]],
    progress: Callable[[int, int], None],
) -> Scores:
    """Score a strategy of the full robot; `people`: attribute -> value, and its probability."""
    used = {sense: channel for sense, channel in channels.items() if strategy.uses(sense)}
    nodes: DecisionNodes
    if strategy.change is None:
        nodes = BeliefNodes(domain, strategy.robot(full))
    else:
        nodes = HistoryNodes(domain, full, strategy, used)
    # distribution over (node before the first action, index of the true value)
    roots: dict[tuple[Hashable, int], float] = defaultdict(float)

    @cache
    def find_root(context: tuple[str, ...], labels: tuple[tuple[str, str], ...]) -> Hashable:
        return nodes.root(dict(zip(domain.observed, context, strict=True)), dict(labels))

    for person, mass in people:
        v = domain.values.index(domain.reasoning.join(person))
        context = tuple([person[name] for name in domain.observed])
        for labels, rate in _enumerate_labels(used, person):
            if mass * rate > 0:
                roots[find_root(context, tuple(labels.items())), v] += mass * rate
    tree = _EpisodeTree(domain, nodes, strategy)
    tree.check_size(roots)
    # (V, V + 1) probability of each true value and reported value; the last column is for no report
    joint = np.zeros((len(domain.values), len(domain.values) + 1))
    total_cost = squared_cost = return_ = 0.0
    for done, ((root, v), mass) in enumerate(roots.items(), start=1):
        for probability, reported, cost, reward in tree.enumerate_leaves(root, v):
            p = mass * probability
            joint[v, reported] += p
            total_cost += p * cost
            squared_cost += p * cost**2
            return_ += p * (reward - cost)
        progress(done, len(roots))
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


_Point = tuple[Hashable, int, float]
"""A point of decisions that are merged: the robot's node, the state, and the cost so far."""

_Leaf = tuple[float, int, float, float]
"""The end of all episodes with the same last point: their probability; the index of the reported value, V for
no report; the cost of the actions before the report, positive; the reward of the report in the true state, 0
without a report."""


class _EpisodeTree:
    """All episodes from a node; transitions are cached."""

    def __init__(self, domain: Domain, nodes: DecisionNodes, strategy: Strategy) -> None:
        pomdp, feedback = domain.pomdp, domain.simulation.feedback_model
        self._domain, self._nodes, self._strategy = domain, nodes, strategy
        self._count = 0

        @cache
        def find_transitions(action: int, state: int) -> list[tuple[int, str, float]]:
            states, probabilities = pomdp.transition.row(action, state)
            return [
                (s, pomdp.observations[o], p * float(feedback[action, s, o]))
                for s, p in zip(states.tolist(), probabilities.tolist(), strict=True)
                for o in np.flatnonzero(feedback[action, s])
            ]

        self._find_transitions = find_transitions

    def check_size(self, roots: Collection[tuple[Hashable, int]]) -> None:
        """Refuse episodes that, by their growth after the first actions, pass far too many points.

        The number of points of some roots is extrapolated as a power of the number of actions, which is low
        if they branch without end, and their probability geometrically, until the branches are pruned.

        Raises:
            DecisionError: the forecast is above `FORECAST_MARGIN` times `MAX_POINTS`.
        """
        some = list(roots)[:: ceil(len(roots) / FORECAST_ROOTS)]
        walks = [self._walk(root, v) for root, v in some]
        sizes, masses = list[float](), list[float]()
        while walks and sum(sizes) < FORECAST_POINTS:
            followed = [(walk, step[1]) for walk in walks if (step := next(walk, None)) is not None]
            walks = [walk for walk, _ in followed]
            sizes.append(sum(len(points) for _, points in followed))
            masses.append(sum(sum(points.values()) for _, points in followed))
        last = len(sizes)
        k = min(FORECAST_LEVELS, last - 1)
        if not walks or k < 1:
            return
        power = log(sizes[-1] / sizes[-1 - k]) / log(last / (last - k))
        decay = (masses[-1] / masses[-1 - k]) ** (1 / k)
        count = sum(sizes)
        for level in range(last + 1, MAX_STEPS + 1):
            size = sizes[-1] * (level / last) ** power
            if masses[-1] * decay ** (level - last) < size * MIN_PROBABILITY:
                return
            count += size
            if count * len(roots) / len(some) > FORECAST_MARGIN * MAX_POINTS:
                raise self._make_size_error(" by far, as their growth shows")

    def _make_size_error(self, how: str = "") -> DecisionError:
        return DecisionError(
            f"the decisions of {self._strategy.location} pass more than {MAX_POINTS} points{how}; its scores"
            " need simulated trials, or a smaller model"
        )

    def enumerate_leaves(self, root: Hashable, v: int) -> Iterator[_Leaf]:
        """Yield the ends of all episodes from a root with a person of true value v."""
        for leaves, points in self._walk(root, v):
            yield from leaves
            self._count += len(points)
            if self._count > MAX_POINTS:
                raise self._make_size_error()

    def _walk(self, root: Hashable, v: int) -> Iterator[tuple[list[_Leaf], dict[_Point, float]]]:
        """Yield after each number of actions the episodes that end there, and the points of the others.

        Raises:
            NoReportError: some episodes have no report after `MAX_STEPS` actions.
        """
        domain, pomdp, nodes = self._domain, self._domain.pomdp, self._nodes
        # the episodes after the same number of actions: (node, state, cost) -> probability
        frontier: dict[_Point, float] = {}
        for first in np.flatnonzero(domain.planning.initial_states[v]):
            frontier[root, int(first), 0.0] = float(domain.planning.initial_states[v, first])
        for _ in range(MAX_STEPS + 1):
            leaves, successors = list[_Leaf](), defaultdict[_Point, float](float)
            for (node, s, cost), mass in frontier.items():
                action = nodes.find_action(node)
                if action is None:
                    leaves.append((mass, len(domain.values), cost, 0.0))
                    continue
                a = pomdp.actions.index(action)
                reward = float(pomdp.reward[a, s])
                value = domain.reported_value(action)
                if value is not None:
                    leaves.append((mass, domain.values.index(value), cost, reward))
                    continue
                next_cost = round(cost - reward, 9)  # rounding merges equal costs
                for s_next, observation, probability in self._find_transitions(a, s):
                    p = mass * probability
                    if p >= MIN_PROBABILITY:
                        successors[nodes.extend(node, action, observation), s_next, next_cost] += p
            yield leaves, successors
            if not successors:
                return
            frontier = successors
        raise NoReportError(
            f"{self._strategy.location}: no report after {MAX_STEPS} actions; the policy does not report from"
            f" {nodes.describe(root)}"
        )
