"""Monte-Carlo tree search over histories of actions and observations: POMCP, and POMCPOW by widening.

Sources: Silver and Veness, Monte-Carlo planning in large POMDPs, NIPS 2010, Algorithm 1; Sunberg and
Kochenderfer, Online algorithms for POMDPs with continuous state, action, and observation spaces, ICAPS 2018,
Algorithm 2.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from math import log, sqrt
from numbers import Real
from random import Random
from time import monotonic
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.arguments import check_type
from lcorpp.planning.solvers.pomcp.simulator import Simulator, check_hashable, compute_likelihood
from lcorpp.values import Array

EXPLORATION = 0.2
"""c of UCB1 as a share of the range of mean returns, which differ much less than single rewards."""

BACKUPS = ("mean", "max")
"""What an action is worth: the mean return of its simulations (POMCP), or its mean reward and the values of
the best actions after it (MaxUCT; Keller and Helmert, ICAPS 2013). The latter needs fewer simulations in
dialogues, and overrates actions where simulators overrate leaves."""

MIN_WEIGHT = 1e-3
"""A simulation ends when later rewards are discounted below this factor."""

CLOCK_INTERVAL = 64
"""Simulations between two checks of the clock."""


@dataclass(frozen=True)
class Widening:
    """Limits the observations after an action to factor * n^power, for n simulations of the action.

    Without a limit, continuous observations never occur twice, and the search does not look beyond them.

    Raises:
        ModelError: the factor is not positive and finite, or the power not between 0 and 1.

    Source: Couetoux and others, Continuous upper confidence trees, LION 2011.

    Examples:
        >>> from lcorpp.planning import Widening
        >>> Widening(factor=4, power=0.5).limit(100)
        40.0
    """

    factor: float = 4.0
    power: float = 0.05

    def __post_init__(self) -> None:
        check_type("the factor of widening", self.factor, Real)
        check_type("the power of widening", self.power, Real)
        if not 0 < self.factor < np.inf:
            raise ModelError(f"the factor of widening is {self.factor}; expected a finite positive number")
        if not 0 <= self.power <= 1:
            raise ModelError(f"the power of widening is {self.power}; expected a number from 0 to 1")

    def limit(self, simulations: int) -> float:
        """Return the largest number of observations after an action."""
        return float(self.factor * simulations**self.power)


@dataclass(frozen=True, eq=False, repr=False)
class ActionValues:
    """The result of a search: estimated values of the actions.

    values: (A,) mean return of the simulations that began with each action, -inf without any. Of a search
        with bounds, the lower bounds.
    upper: (A,) upper bounds; None without.
    visits: (A,) number of these simulations, or trials.
    simulations: number of simulations, or of expanded beliefs, of this search. seconds: wall-clock time.
    """

    values: Array
    visits: npt.NDArray[np.intp]
    simulations: int
    seconds: float
    upper: Array | None = None

    def __repr__(self) -> str:
        best, unit = self.action, "simulations" if self.upper is None else "expansions"
        return (
            f"<ActionValues: action {best}, value {self.values[best]:.4g} of {self.visits[best]} visits;"
            f" {self.simulations} {unit} in {self.seconds:.2f} s>"
        )

    @property
    def action(self) -> int:
        """The action with the largest value; among equal ones, the one with the most visits."""
        return int(np.lexsort((-self.visits, -self.values))[0])


class History:
    """A node of the search tree: a sequence of actions and observations.

    visits: number of simulations of each action. values: of each action, see `BACKUPS`. total: sum of the
        visits.
    rewards, later: with the backup "max", sums over the simulations of each action: of the rewards, and of
        what the histories after it are worth. stopped: sum of the returns of simulations that ended here.
        worth: what this history adds to `later`.
    children: next histories by action and observation.
    particles: states of the simulations that reached the history, if they are stored.
    sums: with widening, the cumulative likelihoods of the history's last observation at the particles.
    observed, widths: with widening, the observations after each action, as often as they were simulated, and
        how many different ones.
    """

    __slots__ = (
        "children",
        "later",
        "observed",
        "particles",
        "rewards",
        "stopped",
        "sums",
        "total",
        "values",
        "visits",
        "widths",
        "worth",
    )

    def __init__(self, actions: int) -> None:
        self.visits = [0] * actions
        self.values = [0.0] * actions
        self.rewards = [0.0] * actions
        self.later = [0.0] * actions
        self.stopped = self.worth = 0.0
        self.total = 0
        self.children: dict[tuple[int, Hashable], History] = {}
        self.particles: list[Any] = []
        self.sums: list[float] = []
        self.observed: dict[int, list[Hashable]] = {}
        self.widths: dict[int, int] = {}


class TreeSearch:
    """POMCP from a history.

    A history first tries each action once, then the action with the largest mean + c sqrt(log N / n) (UCB1).
    c is `exploration` times the range of values in the tree so far, so it needs no adjustment to the size of
    the rewards: with the backup "mean" of all actions, with "max" of the best actions of histories, since one
    costly mistake would otherwise hide in what good actions differ. Instead of a rollout from a new history,
    the simulator estimates the value of the state: for problems in tables, the expectation of such rollouts.

    Args:
        keep_particles: whether histories store the states that reach them.
        widening: of the observations; the simulator is then an `ObservedSimulator`. States beyond an
            observation are drawn from those that reached it, by its likelihood.
        backup: "mean" or "max", see `BACKUPS`.
        seed: of the choice of observations and of these states.
    """

    def __init__(
        self,
        simulator: Simulator[Any],
        *,
        exploration: float = EXPLORATION,
        keep_particles: bool = False,
        widening: Widening | None = None,
        backup: str = "mean",
        seed: int = 0,
    ) -> None:
        if backup not in BACKUPS:
            raise ModelError(f"unknown backup {backup!r}; {expected_one_of(BACKUPS)}")
        self.simulator, self.exploration, self.backup = simulator, exploration, backup
        self.keep_particles = keep_particles or widening is not None
        self.widening, self._rng = widening, Random(seed)
        self.depth = max(1, int(log(MIN_WEIGHT) / log(simulator.discount))) if simulator.discount > 0 else 1
        self._lowest, self._highest = np.inf, -np.inf

    def search(
        self, root: History, draw: Callable[[], Any], *, simulations: int, seconds: float = np.inf
    ) -> ActionValues:
        """Simulate from a history.

        Args:
            root: the history; its earlier simulations are used and extended.
            draw: draws a state from the belief.
            simulations: largest number of simulations.
            seconds: of wall-clock time; at least one simulation is made.
        """
        began, done = monotonic(), 0
        while done < simulations:
            self._simulate(root, draw())
            done += 1
            if done % CLOCK_INTERVAL == 0 and monotonic() - began >= seconds:
                break
        visits = np.array(root.visits, dtype=np.intp)
        values = np.where(visits > 0, root.values, -np.inf)
        return ActionValues(values, visits, done, monotonic() - began)

    def _simulate(self, node: History, state: Any) -> None:
        simulator = self.simulator
        path: list[tuple[History, int, float, History]] = []
        return_ = 0.0
        while not simulator.terminal(state):
            action = self._select_action(node)
            before = state
            state, observation, reward = simulator.step(state, action)
            if self.widening is not None:
                observation = self._choose_observation(node, action, observation)
            key = (action, observation)
            child = node.children.get(key)
            is_new = child is None
            if child is None:
                child = node.children[key] = History(simulator.actions)
            path.append((node, action, reward, child))
            if is_new:
                self._keep(child, before, action, state, observation)
                return_ = simulator.value(state)
                break
            self._keep(child, before, action, state, observation)
            if self.widening is not None and child.sums[-1] > 0:
                place = bisect_right(child.sums, self._rng.random() * child.sums[-1])
                state = child.particles[min(place, len(child.particles) - 1)]  # tiny sums round up
            node = child
            if len(path) >= self.depth:
                return_ = simulator.value(state)
                break
        if self.backup == "mean":
            self._back_up_means(path, return_)
        else:
            self._back_up_best(path, return_)

    def _back_up_means(self, path: Sequence[tuple[History, int, float, History]], return_: float) -> None:
        """Add the return of a simulation to the mean of each action on its path."""
        gamma = self.simulator.discount
        for node, action, reward, _ in reversed(path):
            return_ = reward + gamma * return_
            node.total += 1
            n = node.visits[action] = node.visits[action] + 1
            mean = node.values[action] = node.values[action] + (return_ - node.values[action]) / n
            self._widen_range(mean)

    def _back_up_best(self, path: Sequence[tuple[History, int, float, History]], return_: float) -> None:
        """Value each action on the path by its mean reward and the best actions of the histories after it.

        A history is worth its best action in the simulations that went on, and the return of the others.
        """
        gamma, best = self.simulator.discount, -np.inf
        if path:
            path[-1][3].stopped += return_
        for node, action, reward, child in reversed(path):
            worth = child.stopped + (child.total * best if child.total else 0.0)
            node.later[action] += worth - child.worth
            child.worth = worth
            node.rewards[action] += reward
            node.total += 1
            n = node.visits[action] = node.visits[action] + 1
            node.values[action] = (node.rewards[action] + gamma * node.later[action]) / n
            best = max(v for v, visits in zip(node.values, node.visits, strict=True) if visits)
            if node.total >= len(node.visits):
                self._widen_range(best)

    def _widen_range(self, value: float) -> None:
        """Keep the smallest and largest value of an action."""
        if value < self._lowest:
            self._lowest = value
        if value > self._highest:
            self._highest = value

    def _keep(self, child: History, before: Any, action: int, state: Any, observation: Hashable) -> None:
        """Store a state that reached a history, if states are stored."""
        if self.widening is not None:
            weight = compute_likelihood(self.simulator, observation, before, action, state)
            child.sums.append((child.sums[-1] if child.sums else 0.0) + weight)
        if self.keep_particles:
            child.particles.append(state)

    def _choose_observation(self, node: History, action: int, simulated: Hashable) -> Hashable:
        """Return the simulated observation; beyond the limit an earlier one, by their numbers."""
        assert self.widening is not None
        known, width = node.observed.setdefault(action, []), node.widths.get(action, 0)
        check_hashable(simulated)
        is_known = (action, simulated) in node.children
        if is_known or width < max(1.0, self.widening.limit(node.visits[action] + 1)):
            node.widths[action] = width + (not is_known)
            known.append(simulated)
            return simulated
        return known[self._rng.randrange(len(known))]

    def _select_action(self, node: History) -> int:
        """Return the first action without a visit, otherwise the best action by UCB1."""
        visits, values = node.visits, node.values
        if node.total < len(visits):
            return node.total
        bonus = self.exploration * max(self._highest - self._lowest, 0.0) * sqrt(log(node.total))
        best, action = -np.inf, 0
        for a, n in enumerate(visits):
            score = values[a] + bonus / sqrt(n)
            if score > best:
                best, action = score, a
        return action
