"""All episodes of a strategy at once: probabilities, costs and returns, summed step by step.

After the same number of actions, the episodes that are at the same point of the decision, with the same true
value and the same hidden state, are one entry: their probability and the first two moments of their cost.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lcorpp.decision import Strategy
from lcorpp.decision.dt_control import MAX_STEPS
from lcorpp.domains import Domain
from lcorpp.errors import NoReportError
from lcorpp.scoring.cases import Case
from lcorpp.scoring.decision_graph import ENDED, DecisionGraph
from lcorpp.scoring.decision_nodes import DecisionNodes
from lcorpp.scoring.episode_model import EpisodeModel
from lcorpp.scoring.episode_totals import EpisodeTotals
from lcorpp.values import Array, Indices, Interval
from lcorpp.values.probabilities import MIN_BRANCH

MAX_POINTS, MAX_TOGETHER = 200_000, 500_000
"""Maximum numbers of points at which the episodes of a strategy, and of those that act alike, continue."""

MAX_NUMBERS = 40_000_000_000
"""Maximum product of these points and the numbers in the policy's alpha vectors: half a minute in all."""

MIN_BATCH = 5_000
"""Up to this many points are continued at once; of more, the likeliest."""

MAX_LEFT = 1e-9
"""Probability of the episodes of a strategy that are left out if they are at more than `MIN_BATCH` points."""

MAX_ENTRIES = 4_000_000
"""Maximum number of entries after the actions of a round, times three numbers of 8 bytes."""


@dataclass(frozen=True, eq=False)
class EpisodeSums:
    """The sums over all episodes.

    joint: (V, V + 1) probability of true value i and reported value j; the last column is for no report.
    cost, squared_cost: the expectation of the cost of the actions before the report, and of its square.
    return_: the expectation of the undiscounted return.
    dropped: (V,) probability of the episodes of each true value that are not in these sums.
    cost_range, return_range: bounds of what the dropped episodes add to the expectations.
    """

    joint: Array
    cost: float
    squared_cost: float
    return_: float
    dropped: Array
    cost_range: tuple[float, float]
    return_range: tuple[float, float]

    @property
    def cost_bounds(self) -> Interval:
        """Bounds of the expectation of the cost, whatever the dropped episodes are."""
        return self._bound(self.cost, self.cost_range)

    @property
    def return_bounds(self) -> Interval:
        """Bounds of the expectation of the return, whatever the dropped episodes are."""
        return self._bound(self.return_, self.return_range)

    def _bound(self, known: float, rest: tuple[float, float]) -> Interval:
        """Return bounds of an expectation, from its sum over the known episodes and the range of the rest.

        The estimate is the mean of the known episodes.
        """
        share = float(self.dropped.sum())
        if not share:
            return Interval.exact(known)
        low, high = known + rest[0], known + rest[1]
        return Interval(min(max(known / (1 - share), low), high), low, high, confidence=1.0)


def sum_strategies(
    domain: Domain,
    nodes_of: Sequence[DecisionNodes],
    cases: Mapping[Strategy, Sequence[Case]],
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
    shared = min(MAX_TOGETHER, MAX_NUMBERS // max(1, nodes_of[0].n_numbers))
    max_points = min(MAX_POINTS, shared // len(names))
    return sum_episodes(model, graph, roots, names, progress, max_points)


class _Episodes(NamedTuple):
    """Episodes that continue, as n entries.

    nodes, owners: (n,) the point of the decision, and the strategy. moments: (n, 3, J) their probability with
    each pair of true value and hidden state, and the first two moments of their cost. steps: (n,) the fewest
    actions before.
    """

    nodes: Indices
    owners: Indices
    moments: Array
    steps: Indices

    def take(self, rows: Indices) -> _Episodes:
        """Return some of the entries."""
        return _Episodes(self.nodes[rows], self.owners[rows], self.moments[rows], self.steps[rows])


class _Sums:
    """The `EpisodeSums` of K strategies while they grow."""

    def __init__(self, model: EpisodeModel, count: int) -> None:
        v = model.n_values
        self._model, self._joint, self._dropped = model, np.zeros((count, v, v + 1)), np.zeros((count, v))
        self._known = np.zeros((count, 3))  # cost, squared cost, return
        self._ranges = np.zeros((count, 2, 2))  # of cost and return

    def end(self, owners: Indices, moments: Array, actions: Indices) -> None:
        """Add episodes that end with an action: (n,) strategies, (n, 3, J) moments, (n,) actions."""
        model, probability = self._model, moments[:, 0]
        cells = owners[:, None], model.values, model.reports[actions][:, None]
        np.add.at(self._joint, cells, probability)
        reward = (probability * model.reward[actions]).sum(axis=1)
        cost, squared_cost = moments[:, 1:].sum(axis=2).T
        np.add.at(self._known, owners, np.stack([cost, squared_cost, reward - cost], axis=1))

    def drop(self, episodes: _Episodes, steps_left: int) -> None:
        """Add episodes that are dropped before their end, with at most `steps_left` further actions."""
        model, ends, owners = self._model, np.array(self._model.end_range), episodes.owners
        np.add.at(self._dropped, (owners[:, None], model.values), episodes.moments[:, 0])
        mass, cost = episodes.moments[:, :2].sum(axis=2).T[:, :, None]
        steps = steps_left * np.array(model.step_range)
        costs, returns = cost - mass * steps[::-1], mass * (steps + ends) - cost
        np.add.at(self._ranges, owners, np.stack([costs, returns], axis=1))

    def list_sums(self) -> list[EpisodeSums]:
        """Return the sums of each strategy."""
        rows = zip(self._joint, self._known.tolist(), self._dropped, self._ranges.tolist(), strict=True)
        return [
            EpisodeSums(joint, cost, squared_cost, return_, dropped, (a, b), (c, d))
            for joint, (cost, squared_cost, return_), dropped, ((a, b), (c, d)) in rows
        ]


def sum_episodes(
    model: EpisodeModel,
    graph: DecisionGraph,
    roots: Mapping[tuple[int, int], Array],
    names: Sequence[str],
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    max_points: int | None = None,
) -> list[EpisodeSums]:
    """Sum over all episodes of K strategies that act alike at the same points.

    Args:
        graph: the strategies' decisions.
        roots: (node before the first action, index of the strategy) -> (V,) probability of each true value.
        names: of the strategies, for messages.
        progress: called with the percentage of the episodes that have ended, and 100.
        max_points: points at which episodes of a strategy continue, by default `MAX_POINTS`; the less likely
            ones are dropped.

    Raises:
        NoReportError: there is no report after `MAX_STEPS` actions.
    """
    sums, count = _Sums(model, len(names)), len(names)
    nodes, owners = np.array(list(roots), np.intp).T
    moments = np.zeros((len(nodes), 3, len(model.values)))
    moments[:, 0] = np.array(list(roots.values())) @ model.starts
    waiting = _Episodes(nodes, owners, moments, np.zeros(len(nodes), np.intp))
    max_points = count * (MAX_POINTS if max_points is None else max_points)
    branching = max([len(possible) for possible, _ in model.feedback.values()], default=1)
    max_width = MAX_ENTRIES // (len(model.values) * branching)
    points = 0
    totals: EpisodeTotals | None = None  # of the graph when no new point was reached
    while True:
        waiting = _end(sums, model, graph, waiting)
        mass = waiting.moments[:, 0].sum(axis=1)
        progress(100 - round(100 * float(mass.sum()) / count), 100)
        if points >= max_points or (len(mass) > MIN_BATCH and mass.sum() <= count * MAX_LEFT):
            sums.drop(waiting, MAX_STEPS)
            return sums.list_sums()
        if not len(mass):
            return sums.list_sums()
        here, rest = _split(mass, 1 + min(max_width, (max_points - points) // branching))
        batch = waiting.take(here)
        if batch.steps.max() >= MAX_STEPS:
            late = int(batch.steps.argmax())
            node, owner = int(batch.nodes[late]), int(batch.owners[late])
            root = graph.describe_root([first for first, k in roots if k == owner], node)
            raise NoReportError(
                f"{names[owner]}: no report after {MAX_STEPS} actions; the policy does not report from {root}"
            )
        n_known = len(graph)
        continued = _continue(model, graph, batch)
        points += len(continued.nodes)
        waiting = _merge(waiting.take(rest), continued, count)
        if len(graph) == n_known and not len(rest):
            if totals is None or totals.n_arcs != graph.n_arcs:
                totals = EpisodeTotals(model, graph)
            total = totals.find(waiting.nodes, waiting.owners, waiting.moments, count)
            if total is not None:
                nodes, owners = np.divmod(np.arange(len(graph) * count), count)
                moments = total.reshape(-1, *total.shape[2:])
                _end(sums, model, graph, _Episodes(nodes, owners, moments, np.zeros_like(nodes)))
                return sums.list_sums()


def _split(mass: Array, width: int) -> tuple[Indices, Indices]:
    """Return the indices of the episodes to continue next, and of the others, from their probabilities.

    All, if they are few; else the likeliest, which have half of the probability: so a limited number of
    points covers as much of it as possible.
    """
    if len(mass) <= min(MIN_BATCH, width):
        return np.arange(len(mass)), np.arange(0)
    order = np.argsort(-mass, kind="stable")
    half = 1 + int(np.searchsorted(np.cumsum(mass[order]), mass.sum() / 2))
    n = min(max(half, MIN_BATCH), width)
    return np.sort(order[:n]), np.sort(order[n:])


def _end(sums: _Sums, model: EpisodeModel, graph: DecisionGraph, episodes: _Episodes) -> _Episodes:
    """Add the episodes that end to the sums, and return the others."""
    actions = graph.find_actions(episodes.nodes)
    ends = (model.reports[actions] < model.n_values) | (actions == ENDED)
    if not ends.any():
        return episodes
    ended = episodes.take(np.flatnonzero(ends))
    sums.end(ended.owners, ended.moments, actions[ends])
    return episodes.take(np.flatnonzero(~ends))


def _continue(model: EpisodeModel, graph: DecisionGraph, episodes: _Episodes) -> _Episodes:
    """Continue episodes by one action; return them after each possible observation."""
    nodes, owners, moments, steps = episodes
    actions = graph.find_actions(nodes)
    sources, observations, parts = [nodes[:0]], [nodes[:0]], [moments[:0]]
    moments = _add_cost(moments, -model.reward[actions])
    for a in sorted(set(actions.tolist())):
        rows = np.flatnonzero(actions == a)
        part = moments[rows]  # (n, 3, J); a sparse matrix takes two dimensions
        after = (part.reshape(-1, part.shape[2]) @ model.transition[a]).reshape(part.shape)
        possible, probabilities = model.feedback[a]
        n, o = np.nonzero(after[:, 0] @ probabilities.T >= MIN_BRANCH)
        sources.append(rows[n])
        observations.append(possible[o])
        parts.append(after[n] * probabilities[o, None])
    source, observation = np.concatenate(sources), np.concatenate(observations)
    children = graph.find_children(nodes[source], observation)
    return _Episodes(children, owners[source], np.concatenate(parts), steps[source] + 1)


def _add_cost(moments: Array, cost: Array) -> Array:
    """Add a further cost (n, J) to the moments (n, 3, J) of episodes, in place."""
    probability, first, second = moments[:, 0], moments[:, 1], moments[:, 2]
    second += cost * (2 * first + cost * probability)
    first += cost * probability
    return moments


def _merge(some: _Episodes, others: _Episodes, count: int) -> _Episodes:
    """Return the episodes of both, those of a strategy at the same node as one; `count`: of strategies."""
    if not len(some.nodes) + len(others.nodes):
        return others
    keys = np.append(some.nodes, others.nodes) * count + np.append(some.owners, others.owners)
    moments, steps = np.concatenate([some.moments, others.moments]), np.append(some.steps, others.steps)
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    first = np.flatnonzero(np.diff(ordered, prepend=-1))
    nodes, owners = np.divmod(ordered[first], count)
    sums = np.add.reduceat(moments[order], first, axis=0)
    return _Episodes(nodes, owners, sums, np.minimum.reduceat(steps[order], first))
