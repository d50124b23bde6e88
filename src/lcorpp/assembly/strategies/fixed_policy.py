"""A fixed policy with an estimated observation model, e.g. a policy of a file or of another solver.

If answers are more often wrong than the policy's model states, a less certain start belief makes the policy
ask more, and a more certain one makes it report earlier; the best start follows from exact returns.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.domains.dialogue import MakeModel
from lcorpp.planning import Planner, Pomdp
from lcorpp.planning.evaluation.belief_graph import UNKNOWN, BeliefGraph
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.planner import ModelPlanner, TransferPlanner
from lcorpp.protocols import Planner as PlannerProtocol
from lcorpp.values import Array, Belief, Indices

START_LOG_ODDS = np.arange(-28, 29) / 4
"""Log odds of the first value at the candidate start beliefs."""

PROBABILITY_STEP = 0.02
"""Probabilities of observations are rounded to multiples of this before returns are computed."""

MAX_NODES = 20_000
"""Maximum number of beliefs that the policy reaches from all starts."""

MAX_SWEEPS, SWEEP_TOLERANCE = 500, 1e-3
"""Returns are sums over at most this many actions, or until one more changes them by less (reward units)."""


class FixedPolicy:
    """Returns planners with the stated policy for estimated observation models.

    With two shared values the policy starts at argmax_b sum_y prior(y) G_y(b), where G_y(b) is its expected
    return from start b with a person of value y, who answers by the estimated model; its beliefs follow
    the stated model. With more values, or if the policy reaches too many beliefs, it starts at the prior, and
    beliefs follow the estimated model. Either result depends on the estimated model alone.

    Args:
        planner: the policy with the stated model.
    """

    def __init__(self, planner: Planner, domain: Domain) -> None:
        self._stated, self._domain = planner, domain
        self._tables: Array | None = None  # of the last call; None before
        self._returns_of = dict[bytes, Array]()
        self.planner: PlannerProtocol = planner

    def __call__(self, tables: Array, make_model: MakeModel) -> PlannerProtocol:
        """Return the planner of the next person; the same one if the tables are those of the call before."""
        if self._tables is None or not np.array_equal(tables, self._tables):
            self._tables, model = tables, make_model(tables)
            self.planner = TransferPlanner(self._stated.policy, model)
            if self._graph is not None:
                returns = self._find_returns(self._graph, model)
                self.planner = StartingPlanner(
                    self._stated, self.planner, self._domain, self._starts, returns
                )
        return self.planner

    def state(self) -> dict[str, Any]:
        """Return the state as JSON: the tables of the estimated model."""
        return {"tables": None if self._tables is None else self._tables.tolist()}

    def restore(self, state: Mapping[str, Any], make_model: MakeModel) -> PlannerProtocol:
        """Continue from a state; return the planner of the last call."""
        if state["tables"] is None:
            return self.planner
        return self(np.array(state["tables"]), make_model)

    @cached_property
    def _starts(self) -> Array:
        """(N, S) the beliefs that are compared."""
        first = 1 / (1 + np.exp(-START_LOG_ODDS))
        starts: Array = np.stack([first, 1 - first], axis=1) @ self._domain.planning.initial_states
        return starts

    @cached_property
    def _graph(self) -> BeliefGraph | None:
        """The beliefs that the policy reaches from the starts; None if starts are not compared."""
        if len(self._domain.values) != 2:
            return None
        graph = BeliefGraph(self._stated.pomdp, self._stated.policy)
        frontier = np.unique(graph.add(SparseBeliefs.of(self._starts)))
        while len(frontier):
            if len(graph) > MAX_NODES:
                return None
            n_known = len(graph)
            graph.expand(frontier)
            frontier = n_known + np.flatnonzero(~graph.absorbing[n_known:])
        return graph

    def _find_returns(self, graph: BeliefGraph, model: Pomdp) -> Array:
        """Return (N, V) the policy's return from each start with a person of each value."""
        rounded = PROBABILITY_STEP * np.round(model.observation.dense / PROBABILITY_STEP)
        key = rounded.tobytes()
        if key not in self._returns_of:
            rounded = np.where(model.observation.dense > 0, np.maximum(rounded, PROBABILITY_STEP / 2), 0)
            rounded /= rounded.sum(axis=2, keepdims=True)
            roots = graph.add(SparseBeliefs.of(self._starts))
            returns = sum_rewards(graph, rounded)[roots]
            self._returns_of[key] = returns @ self._domain.planning.initial_states.T
        return self._returns_of[key]


class StartingPlanner(ModelPlanner):
    """A policy that starts at another belief than the prior, for one person: each person gets a copy.

    The beliefs of the decision are those of the estimated model; the policy acts on its own ones.

    Args:
        stated: the policy with its model. estimated: the estimated model.
        starts: (N, S). returns: (N, V) for people of each value.
    """

    def __init__(
        self, stated: Planner, estimated: ModelPlanner, domain: Domain, starts: Array, returns: Array
    ) -> None:
        self.pomdp, self.policy = estimated.pomdp, stated.policy
        self._stated, self._domain = stated, domain
        self._starts, self._returns = starts, returns
        self._own: Belief | None = None  # of the policy, from the first action on

    def action(self, belief: Belief) -> str:
        """Return the policy's action; the first belief (S,) is the prior."""
        if self._own is None:
            self._own = self.find_start(belief)
        return self._stated.action(self._own)

    def find_start(self, prior: Belief) -> Belief:
        """Return the belief (S,) from which the policy starts."""
        start: Belief = self._starts[(self._returns @ self._domain.marginal(prior).probabilities).argmax()]
        return start

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """Return the belief (S,) by the estimated model, and update that of the policy."""
        if self._own is None:
            self._own = self.find_start(belief)
        self._own = self._stated.update(self._own, action, observation)
        return super().update(belief, action, observation)


def sum_rewards(graph: BeliefGraph, observation: Array) -> Array:
    """Compute the expected sum of rewards, without discount, of a policy under another observation model.

    Args:
        graph: all beliefs that the policy reaches. observation: (A, S, O) the true observation model.

    Returns:
        (n, S) for each node as the policy's belief, and each true state.
    """
    model = graph.pomdp
    children = graph.children
    nodes_of_action: list[tuple[int, Indices]] = [
        (action, np.flatnonzero((graph.actions == action) & ~graph.absorbing))
        for action in range(len(model.actions))
    ]
    values = np.zeros((len(graph), len(model.states)))
    for _ in range(MAX_SWEEPS):
        before = values.copy()
        for action, nodes in nodes_of_action:
            after = np.where((children[nodes] != UNKNOWN)[:, :, None], before[children[nodes]], 0)
            expected = np.einsum("so,nos->ns", observation[action], after)
            values[nodes] = model.reward[action] + expected @ model.transition.dense[action].T
        if np.abs(values - before).max() < SWEEP_TOLERANCE:
            break
    return values
