"""Exact scores of the strategies, by enumeration of people and answers.

These scores are the reference for the simulated trials. The evaluation requires noisy channels as the
classifiers and a feedback model of known probabilities, not a world of the domain's own.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product
from math import prod
from typing import NamedTuple

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.decision import Robot, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError
from lcorpp.protocols import Reasoner as ReasonerProtocol
from lcorpp.reasoning import Program, Reasoner
from lcorpp.scoring import episode_sums
from lcorpp.scoring.decision_graph import DecisionGraph
from lcorpp.scoring.decision_nodes import DecisionNodes, HistoryNodes, RoundedBeliefNodes
from lcorpp.scoring.decision_scores import score_probabilities
from lcorpp.scoring.episode_model import EpisodeModel
from lcorpp.scoring.episode_sums import EpisodeSums
from lcorpp.scoring.gaps import find_gap, take_gap
from lcorpp.scoring.metrics import Scores
from lcorpp.simulation.simulated_classifier import NoisyChannel
from lcorpp.values import Array, Distribution, Label

MAX_DROPPED = 0.001
"""Maximum probability of the episodes that are left out of a sum over too many."""


@check_arguments
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
        progress: called with the percentage of the episodes of some strategies that have ended, and 100.

    Returns:
        The scores. If the decisions of a strategy branch too much, the least likely episodes are left out,
        and the ends of the intervals are bounds for whatever they may be.

    Raises:
        DomainError: the domain has a world of its own, whose probabilities are unknown.
        DecisionError: a strategy draws its actions, learns from people, acts differently after equal
            histories, has too many histories, or branches so much that the bounds are wide.
        NoReportError: a strategy's policy never reports.
    """
    check_enumerable(domain, strategies)
    classified = [channel.of for channel in channels.values()]
    attributes = tuple(dict.fromkeys([*domain.observed, *classified, *domain.reasoning.shared]))
    people = [
        (dict(zip(attributes, values, strict=True)), mass)
        for values, mass in compute_joint_distribution(domain, attributes).items()
    ]
    used = {strategy: _list_used(channels, strategy) for strategy in strategies}
    by_senses = {tuple(own): own for own in used.values()}
    cases_of = {senses: _list_cases(domain, own, people) for senses, own in by_senses.items()}
    cases = {strategy: cases_of[tuple(own)] for strategy, own in used.items()}
    informed = replace(robot, reasoner=_infer_posteriors(domain, robot.reasoner, cases))
    model = EpisodeModel(domain)
    sums: dict[Strategy, EpisodeSums] = {}
    for alike in _group_strategies(used):
        nodes_of = [
            RoundedBeliefNodes(domain, strategy.robot(informed))
            if strategy.change is None
            else HistoryNodes(domain, robot, strategy, used[strategy])
            for strategy in alike
        ]
        found = _sum_strategies(domain, nodes_of, {each: cases[each] for each in alike}, model, progress)
        sums |= zip(alike, found, strict=True)
    return [
        _score_sums(domain, strategy, sums[strategy], _find_gaps(domain, informed, strategy, cases[strategy]))
        for strategy in strategies
    ]


def check_enumerable(domain: Domain, strategies: Sequence[Strategy]) -> None:
    """Check that the probabilities of all actions and answers are known.

    Raises:
        DomainError: the domain has a world of its own.
        DecisionError: a strategy draws its actions, or learns from people.
    """
    if domain.simulation.world is not None:
        raise DomainError(
            f"{domain.folder}: people answer by a world of their own or by reaction() in people.py, so only"
            " simulated trials can score this domain"
        )
    for strategy in strategies:
        if strategy.start is not None:
            raise DecisionError(
                f"{strategy.location} learns from each person, so its scores depend on the people before and"
                " it has no exact scores; expected simulated trials"
            )
        if strategy.draws:
            raise DecisionError(
                f"{strategy.location} draws its actions, so it has no exact scores; expected simulated trials"
            )


def _group_strategies(strategies: Iterable[Strategy]) -> list[list[Strategy]]:
    """Group the strategies whose actions at equal beliefs are equal; an own strategy is alone."""
    groups: dict[Hashable, list[Strategy]] = defaultdict(list)
    for strategy in strategies:
        groups[strategy.plans if strategy.change is None else strategy].append(strategy)
    return list(groups.values())


def compute_joint_distribution(domain: Domain, attributes: Sequence[str]) -> dict[tuple[str, ...], float]:
    """Compute the joint distribution of some attributes of the people: value tuple -> probability."""
    return dict(_compute_joint(domain.simulation.true_program, tuple(attributes)))


@lru_cache(maxsize=16)
def _compute_joint(program: Program, attributes: tuple[str, ...]) -> list[tuple[tuple[str, ...], float]]:
    """Compute a joint distribution, once for the configurations of a sweep that have the same people."""
    return [(values, float(p)) for values, p in Reasoner(program).exact(attributes).items()]


class _Case(NamedTuple):
    """Facts and labels that a robot may perceive; (V,) their probability with each true value."""

    context: Mapping[str, str]
    labels: Mapping[str, str]
    masses: Array


def _list_cases(
    domain: Domain,
    channels: Mapping[str, NoisyChannel],
    people: Sequence[tuple[Mapping[str, str], float]],
) -> list[_Case]:
    """List what a robot with these senses may perceive; `people`: attribute -> value, and probability."""
    cases: dict[tuple[str, ...], _Case] = {}
    for person, mass in people:
        v = domain.values.index(domain.reasoning.join(person))
        context = {name: person[name] for name in domain.observed}
        for labels, rate in _enumerate_labels(channels, person):
            if mass * rate > 0:
                key = (*context.values(), *labels.values())
                case = cases.setdefault(key, _Case(context, labels, np.zeros(len(domain.values))))
                case.masses[v] += mass * rate
    return list(cases.values())


class _KnownPosteriors(NamedTuple):
    """A reasoner that has inferred the posterior of all evidence of an evaluation at once."""

    answers: Mapping[tuple[tuple[str, Label], ...], Distribution]

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution:
        return self.answers[tuple(evidence.items())]


def _infer_posteriors(
    domain: Domain, reasoner: ReasonerProtocol, cases: Mapping[Strategy, Sequence[_Case]]
) -> ReasonerProtocol:
    """Return the reasoner for the cases of the table's strategies; another engine answers one by one."""
    evidence: dict[tuple[tuple[str, Label], ...], Mapping[str, Label]] = {}
    for strategy, own in cases.items():
        if strategy.change is not None or not (strategy.reasons or strategy.plans):
            continue
        for case in own:
            each = domain.evidence(case.context if strategy.reasons else {}, case.labels)
            evidence[tuple(each.items())] = each
        if not strategy.reasons:
            evidence[()] = {}  # see `LabelRatesReasoner`
    if not isinstance(reasoner, Reasoner):
        return reasoner
    answers = reasoner.posteriors(domain.shared, list(evidence.values()))
    return _KnownPosteriors(dict(zip(evidence, answers, strict=True)))


def _sum_strategies(
    domain: Domain,
    nodes_of: Sequence[DecisionNodes],
    cases: Mapping[Strategy, Sequence[_Case]],
    model: EpisodeModel,
    progress: Callable[[int, int], None],
) -> list[EpisodeSums]:
    """Sum over the episodes of strategies that act alike, given the nodes and the cases of each."""
    graph = DecisionGraph(domain, nodes_of[0])
    # (node before the first action, index of the strategy) -> (V,) probability of each true value
    roots: dict[tuple[int, int], Array] = defaultdict(lambda: np.zeros(len(domain.values)))
    for k, (own, nodes) in enumerate(zip(cases.values(), nodes_of, strict=True)):
        numbers = graph.find_numbers([nodes.root(case.context, case.labels) for case in own])
        for number, case in zip(numbers, own, strict=True):
            roots[number, k] += case.masses
    names = [strategy.location for strategy in cases]
    return episode_sums.sum_episodes(model, graph, roots, names, progress)


def _list_used(channels: Mapping[str, NoisyChannel], strategy: Strategy) -> dict[str, NoisyChannel]:
    """Return the channels of the senses that a strategy uses."""
    return {sense: channel for sense, channel in channels.items() if strategy.uses(sense)}


def _find_gaps(domain: Domain, robot: Robot, strategy: Strategy, cases: Sequence[_Case]) -> list[float]:
    """Return the gap at the prior of each case, see `find_gap`."""
    if not strategy.plans or strategy.change is not None:
        return []
    nodes = RoundedBeliefNodes(domain, strategy.robot(robot))
    priors = dict.fromkeys(nodes.root(case.context, case.labels) for case in cases)
    return [find_gap(robot, strategy, np.frombuffer(prior)) for prior in priors]


def _score_sums(domain: Domain, strategy: Strategy, sums: EpisodeSums, gaps: Sequence[float]) -> Scores:
    """Return the scores of a strategy from the sums over its episodes; gaps: at its priors."""
    share = float(sums.dropped.sum())
    if share > MAX_DROPPED:
        raise DecisionError(
            f"the decisions of {strategy.location} pass more than {episode_sums.MAX_POINTS} points; the"
            f" likeliest cover {1 - share:.2%} of them, less than {1 - MAX_DROPPED:.1%}; its scores need"
            " simulated trials"
        )
    return score_probabilities(
        strategy.name,
        sums.joint,
        sums.bound(sums.cost, sums.cost_range),
        sums.bound(sums.return_, sums.return_range),
        float(np.sqrt(max(sums.squared_cost - sums.cost**2, 0.0))),
        values=domain.values,
        positive=domain.positive,
        variables=domain.reasoning.shared,
        dropped=sums.dropped,
        gap=take_gap(gaps),
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
