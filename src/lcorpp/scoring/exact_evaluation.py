"""Exact scores of the strategies, by enumeration of people and answers.

These scores are the reference for the simulated trials. The evaluation requires noisy channels as the
classifiers and a feedback model of known probabilities, not a world of the domain's own.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace

from lcorpp.arguments import check_arguments
from lcorpp.decision import Robot, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError
from lcorpp.scoring.cases import compute_joint_distribution, infer_posteriors, list_attributes, list_cases
from lcorpp.scoring.decision_nodes import HistoryNodes, RoundedBeliefNodes
from lcorpp.scoring.decision_scores import score_sums
from lcorpp.scoring.episode_model import EpisodeModel
from lcorpp.scoring.episode_sums import EpisodeSums, sum_strategies
from lcorpp.scoring.gaps import find_gaps, take_gap
from lcorpp.scoring.metrics import Scores
from lcorpp.simulation.simulated_classifier import NoisyChannel


@check_arguments
def evaluate_exactly(
    domain: Domain,
    robot: Robot,
    channels: Mapping[str, NoisyChannel],
    strategies: tuple[Strategy, ...],
    *,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    on_failure: Callable[[Strategy, DecisionError], None] | None = None,
) -> list[Scores]:
    """Compute the exact scores of some strategies.

    Args:
        robot: the full robot.
        channels: sense -> the noisy channel that replaces its classifier.
        strategies: the strategies, in the order of the result.
        progress: called with the percentage of the episodes of some strategies that have ended, and 100.
        on_failure: called with a strategy whose decisions cannot be summed, and the error; the result has the
            scores of the others. None raises the error.

    Returns:
        The scores. If the decisions of a strategy branch too much, the least likely episodes are left out,
        and the ends of the intervals are bounds for whatever they may be: at most `MAX_STEPS` further actions
        and the best or the worst report.

    Raises:
        DomainError: the domain has a world of its own, whose probabilities are unknown.
        DecisionError: a strategy draws its actions, learns from people, acts differently after equal
            histories, or has too many histories.
        NoReportError: a strategy's policy never reports.

    Examples:
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import strategies
        >>> from lcorpp.scoring import evaluate_exactly
        >>> full = load_robot("intention", cache=False)
        >>> channels = {"motion": full.senses["motion"].classifier}
        >>> scores = evaluate_exactly(full.domain, full.robot, channels, strategies(["L+R", "LCORPP"]))
        >>> [(each.strategy, round(each.accuracy.estimate, 3)) for each in scores]
        [('L+R', 0.771), ('LCORPP', 0.88)]
    """
    check_enumerable(domain, strategies)
    attributes = list_attributes(domain, channels)
    people = [
        (dict(zip(attributes, values, strict=True)), mass)
        for values, mass in compute_joint_distribution(domain, attributes).items()
    ]
    used = {strategy: _list_used(channels, strategy) for strategy in strategies}
    by_senses = {tuple(own): own for own in used.values()}
    cases_of = {senses: list_cases(domain, own, people) for senses, own in by_senses.items()}
    cases = {strategy: cases_of[tuple(own)] for strategy, own in used.items()}
    informed = replace(robot, reasoner=infer_posteriors(domain, robot.reasoner, cases))
    model = EpisodeModel(domain)
    sums: dict[Strategy, EpisodeSums] = {}
    waiting = _group_strategies(used)
    for alike in waiting:  # grows
        nodes_of = [
            RoundedBeliefNodes(domain, strategy.robot(informed))
            if strategy.change is None
            else HistoryNodes(domain, robot, strategy, used[strategy])
            for strategy in alike
        ]
        try:
            found = sum_strategies(domain, nodes_of, {each: cases[each] for each in alike}, model, progress)
        except DecisionError as error:
            if on_failure is None:
                raise
            if len(alike) > 1:
                waiting += [[strategy] for strategy in alike]
            else:
                on_failure(alike[0], error)
            continue
        sums |= zip(alike, found, strict=True)
    scored = [strategy for strategy in strategies if strategy in sums]
    gaps = [take_gap(find_gaps(domain, informed, strategy, cases[strategy])) for strategy in scored]
    return [
        score_sums(domain, strategy, sums[strategy], gap) for strategy, gap in zip(scored, gaps, strict=True)
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


def _list_used(channels: Mapping[str, NoisyChannel], strategy: Strategy) -> dict[str, NoisyChannel]:
    """Return the channels of the senses that a strategy uses."""
    return {sense: channel for sense, channel in channels.items() if strategy.uses(sense)}
