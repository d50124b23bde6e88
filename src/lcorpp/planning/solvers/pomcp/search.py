"""POMCP: Monte-Carlo tree search in the histories of actions and observations.

Source: Silver and Veness, Monte-Carlo planning in large POMDPs, NIPS 2010, Algorithm 1.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from math import log, sqrt
from time import monotonic
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.planning.solvers.pomcp.simulator import Simulator
from lcorpp.values import Array

EXPLORATION = 0.2
"""c of UCB1 as a share of the range of values met: mean values differ by much less than single rewards."""

NEGLIGIBLE = 1e-3
"""A simulation ends where what is earned later weighs less than this."""

LOOKED = 64
"""Simulations between two looks at the clock."""


@dataclass(frozen=True, eq=False)
class Looked:
    """What a search has found out about the actions.

    values: (A,) the mean reward of the simulations that began with each, -inf where none did.
    visits: (A,) how many did. simulations: of this search. seconds: wall-clock time used.
    """

    values: Array
    visits: npt.NDArray[np.intp]
    simulations: int
    seconds: float

    @property
    def action(self) -> int:
        """The action with the best mean, the one tried more often among equals."""
        return int(np.lexsort((-self.visits, -self.values))[0])


class History:
    """A node of the tree: what is known after some actions and observations.

    visits: of each action. values: the mean reward after each. following: nodes by action and observation.
    particles: the states in which simulations came by, where they are kept.
    """

    __slots__ = ("following", "particles", "total", "values", "visits")

    def __init__(self, actions: int) -> None:
        self.visits = [0] * actions
        self.values = [0.0] * actions
        self.total = 0
        self.following: dict[tuple[int, Hashable], History] = {}
        self.particles: list[Any] = []


class TreeSearch:
    """POMCP from one history on.

    Of the actions that were tried in a history the one with the most mean + c sqrt(log N / n) is tried again
    (UCB1). c is `exploration` times the range of all means in the tree so far, so that it needs no tuning to
    the size of rewards. Where the paper rolls out a policy from the first new history, the simulator's guess
    at the value of the state is taken: for problems in tables that is the expectation of such rollouts.

    Args:
        keep_particles: whether nodes keep the states that come by.
    """

    def __init__(
        self, simulator: Simulator[Any], *, exploration: float = EXPLORATION, keep_particles: bool = False
    ) -> None:
        self.simulator, self.exploration, self.keep_particles = simulator, exploration, keep_particles
        self.depth = max(1, int(log(NEGLIGIBLE) / log(simulator.discount)))
        self._low, self._high = np.inf, -np.inf

    def search(
        self, root: History, draw: Callable[[], Any], *, simulations: int, seconds: float = np.inf
    ) -> Looked:
        """Simulate from a history.

        Args:
            root: what is known of it already is used and added to. draw: draws a state from the belief.
            simulations: how many at most. seconds: of wall-clock time at most; one simulation is made at
            least.
        """
        began, done = monotonic(), 0
        while done < simulations:
            self._simulate(root, draw())
            done += 1
            if done % LOOKED == 0 and monotonic() - began >= seconds:
                break
        visits = np.array(root.visits, dtype=np.intp)
        values = np.where(visits > 0, root.values, -np.inf)
        return Looked(values, visits, done, monotonic() - began)

    def _simulate(self, node: History, state: Any) -> None:
        simulator, gamma = self.simulator, self.simulator.discount
        path: list[tuple[History, int, float]] = []
        earned = 0.0
        while not simulator.over(state):
            action = self._choice(node)
            state, observation, reward = simulator.step(state, action)
            path.append((node, action, reward))
            key = (action, observation)
            after = node.following.get(key)
            if after is None:
                after = node.following[key] = History(simulator.actions)
                if self.keep_particles:
                    after.particles.append(state)
                earned = simulator.value(state)
                break
            if self.keep_particles:
                after.particles.append(state)
            node = after
            if len(path) >= self.depth:
                earned = simulator.value(state)
                break
        for node, action, reward in reversed(path):
            earned = reward + gamma * earned
            node.total += 1
            n = node.visits[action] = node.visits[action] + 1
            mean = node.values[action] = node.values[action] + (earned - node.values[action]) / n
            if mean < self._low:
                self._low = mean
            if mean > self._high:
                self._high = mean

    def _choice(self, node: History) -> int:
        """An action that was never tried, the first one; otherwise by UCB1."""
        visits, values = node.visits, node.values
        if node.total < len(visits):
            return node.total
        bonus = self.exploration * max(self._high - self._low, 0.0) * sqrt(log(node.total))
        best, action = -np.inf, 0
        for a, n in enumerate(visits):
            score = values[a] + bonus / sqrt(n)
            if score > best:
                best, action = score, a
        return action
