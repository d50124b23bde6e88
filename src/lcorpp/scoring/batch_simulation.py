"""Simulated decisions about many people at once: the episodes of `dt_control`, as arrays.

Only decisions that depend on the belief alone can be simulated so, about people who answer by the
simulation's feedback model: the robot decides once at each point that any of the people reaches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lcorpp.decision import Strategy
from lcorpp.decision.dt_control import MAX_STEPS
from lcorpp.errors import DecisionError, LcorppError
from lcorpp.planning import Planner
from lcorpp.scoring.decision_graph import ENDED, DecisionGraph
from lcorpp.scoring.decision_nodes import BeliefNodes
from lcorpp.scoring.experiment import Chunk, Experiment
from lcorpp.scoring.gaps import find_gap
from lcorpp.scoring.limit_costs import LimitCosts
from lcorpp.simulation.table_dynamics import SimulationModel
from lcorpp.values import Array, Indices

FIRST_DRAWS = 16
"""Random numbers drawn at first from each person's generator: enough for seven actions."""


class Outcomes(NamedTuple):
    """The ends of n decisions: index of the reported value, V for no report; cost and return of the world."""

    reported: Indices
    cost: Array
    return_: Array


class PeopleDraws:
    """The random numbers that simulated worlds draw, for n people, each from a generator of its own."""

    def __init__(self, seeds: Sequence[Sequence[int]]) -> None:
        self._generators = [np.random.default_rng(seed) for seed in seeds]
        self._numbers = np.array([generator.random(FIRST_DRAWS) for generator in self._generators])
        self._widths = np.full(len(seeds), FIRST_DRAWS)

    def get(self, people: Indices, number: int) -> Array:
        """Return each of these people's random number of this position, (k,)."""
        while number >= self._numbers.shape[1]:
            self._numbers = np.hstack([self._numbers, np.empty_like(self._numbers)])
        for person in people[self._widths[people] <= number].tolist():
            first, end = self._widths[person], self._numbers.shape[1]
            self._numbers[person, first:end] = self._generators[person].random(end - first)
            self._widths[person] = end
        column: Array = self._numbers[people, number]
        return column


class BatchWorld:
    """The worlds of many people: `SimulatedWorld` with arrays in place of numbers."""

    def __init__(self, model: SimulationModel) -> None:
        self._initial_states = np.array(model.initial_states)
        self._model, self._feedback = model, np.array(model.feedback)
        self._reward, self._reports = np.array(model.reward), model.domain.report_indices
        self._n_values = len(model.domain.values)

    def decide(
        self,
        graph: DecisionGraph,
        roots: Indices,
        values: Indices,
        draws: PeopleDraws,
        limits: LimitCosts | None = None,
    ) -> Outcomes:
        """Simulate a decision about each person.

        Args:
            roots: (n,) nodes before the first action. values: (n,) indices of the true values.
            limits: receives the actions about each person.

        Raises:
            LcorppError: the robot's parts fail, or some decision has no report after `MAX_STEPS` actions.
        """
        n = len(roots)
        people, nodes = np.arange(n), roots
        states = self._draw(self._initial_states[values], draws.get(people, 0))
        reported, cost, return_ = np.full(n, self._n_values), np.zeros(n), np.zeros(n)
        for step in range(MAX_STEPS + 1):
            actions = graph.find_actions(nodes)
            going = actions != ENDED
            people, nodes, states, actions = people[going], nodes[going], states[going], actions[going]
            if limits is not None:
                limits.add(people, actions, step)
            rewards = self._reward[actions, states]
            return_[people] += rewards
            ends = self._reports[actions] < self._n_values
            reported[people[ends]] = self._reports[actions[ends]]
            people, nodes, states, actions = people[~ends], nodes[~ends], states[~ends], actions[~ends]
            if not len(people):
                return Outcomes(reported, cost, return_)
            cost[people] -= rewards[~ends]
            states = self._move(actions, states, draws.get(people, 2 * step + 1))
            answers = self._draw(self._feedback[actions, states], draws.get(people, 2 * step + 2))
            nodes = graph.find_children(nodes, answers)
        raise DecisionError(f"no report after {MAX_STEPS} actions")

    def _move(self, actions: Indices, states: Indices, numbers: Array) -> Indices:
        """Return the next states (n,) after an action in each state."""
        n_states = len(self._model.domain.pomdp.states)
        pairs, places = np.unique(actions * n_states + states, return_inverse=True)
        after = np.empty_like(states)
        for i, pair in enumerate(pairs.tolist()):
            successors, bounds = self._model.find_successors(*divmod(pair, n_states))
            here = places == i
            after[here] = np.array(successors)[np.searchsorted(bounds, numbers[here], side="right")]
        return after

    @staticmethod
    def _draw(bounds: Array, numbers: Array) -> Indices:
        """Return the interval of each row of interval ends (n, k) that contains each number (n,)."""
        index: Indices = (bounds <= numbers[:, None]).sum(axis=1)
        return index


def simulates_at_once(experiment: Experiment, strategy: Strategy) -> bool:
    """Whether a strategy's decisions are simulated for many people at once.

    They are if its actions depend on the belief alone and people answer by the feedback model of the domain.
    """
    planner = experiment.robot.planner
    alone = strategy.change is None and strategy.start is None and experiment.people is None
    return alone and isinstance(planner, Planner) and experiment.domain.simulation.world is None


def simulate_at_once(experiment: Experiment, chunks: Sequence[Chunk]) -> dict[int, dict[str, Array]]:
    """Simulate the n people of some chunks at once.

    Returns:
        Index of a strategy -> field of a trial -> (n,) numbers. A strategy whose decisions fail is left out:
        one by one the decision is found that fails.
    """
    selected = [k for k, row in enumerate(experiment.strategies) if simulates_at_once(experiment, row)]
    if not selected:
        return {}
    model = chunks[0].model
    assert isinstance(model, SimulationModel)
    world = BatchWorld(model)
    draws = PeopleDraws([seed for chunk in chunks for seed in chunk.seeds])
    values = np.concatenate([chunk.index_values() for chunk in chunks])
    people = [person for chunk in chunks for person in chunk.people]
    done: dict[int, dict[str, Array]] = {}
    for k in selected:
        strategy = experiment.strategies[k]
        try:
            nodes, roots, gaps = _find_roots(experiment, strategy, chunks)
            graph = DecisionGraph(experiment.domain, nodes)
            costs = LimitCosts(experiment.domain, people) if experiment.domain.planning.limits else None
            outcomes = world.decide(graph, np.array(graph.find_numbers(roots)), values, draws, costs)
        except LcorppError:
            continue
        done[k] = {**outcomes._asdict(), "gap": gaps}
        if costs is not None:
            done[k]["limits"] = costs.finish()
    return done


def _find_roots(
    experiment: Experiment, strategy: Strategy, chunks: Sequence[Chunk]
) -> tuple[BeliefNodes, list[bytes], Array]:
    """Return a strategy's nodes, that before the first action about each person, and `find_gap` there."""
    nodes = BeliefNodes(experiment.domain, strategy.robot(experiment.robot))
    roots, gaps = list[bytes](), list[float]()
    known: dict[tuple[object, ...], tuple[bytes, float]] = {}
    for chunk in chunks:
        observed = chunk.model.domain.observed
        senses = [sense for sense in chunk.labels if strategy.uses(sense)]
        for i, person in enumerate(chunk.people):
            facts = [person[name] for name in observed]
            outputs = [chunk.labels[sense][i] for sense in senses]
            key = (*facts, *outputs)
            if key not in known:
                labels = {s: label for s, label in zip(senses, outputs, strict=True) if label is not None}
                root = nodes.root(dict(zip(observed, facts, strict=True)), labels)
                known[key] = root, find_gap(experiment.robot, strategy, np.frombuffer(root))
            root, gap = known[key]
            roots.append(root)
            gaps.append(gap)
    return nodes, roots, np.array(gaps)
