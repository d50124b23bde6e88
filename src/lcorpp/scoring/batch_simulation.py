"""Simulated decisions about many people at once: the episodes of `dt_control`, as arrays.

Only decisions that depend on the belief alone can be simulated so, about people who answer by the
simulation's feedback model: the robot decides once at each point that any of the people reaches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lcorpp.decision.dt_control import MAX_STEPS
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError
from lcorpp.scoring.decision_graph import ENDED, DecisionGraph, index_reports
from lcorpp.simulation.world import SimulationModel
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
        self._reward, self._reports = np.array(model.reward), index_reports(model.domain)
        self._n_values = len(model.domain.values)

    @staticmethod
    def supports(domain: Domain) -> bool:
        """Whether people answer by the feedback model, not in a world of the domain's own."""
        return domain.simulation.world is None

    def decide(self, graph: DecisionGraph, roots: Indices, values: Indices, draws: PeopleDraws) -> Outcomes:
        """Simulate a decision about each person.

        Args:
            roots: (n,) nodes before the first action. values: (n,) indices of the true values.

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
