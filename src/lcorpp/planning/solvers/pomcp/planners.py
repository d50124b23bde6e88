"""POMCP as a planner: with exact beliefs for problems in tables, with particles for anything that simulates.

Source: Silver and Veness, Monte-Carlo planning in large POMDPs, NIPS 2010.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any

import numpy as np

from lcorpp.errors import ModelError, ObservationError
from lcorpp.planning.belief import check_belief, update
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solvers.arguments import checked_count
from lcorpp.planning.solvers.pomcp.search import EXPLORATION, History, Looked, TreeSearch
from lcorpp.planning.solvers.pomcp.simulator import Simulator, TableSimulator
from lcorpp.values import Belief

TRIES = 100
"""Simulations for each particle wanted before it is held that no more can be found."""


class PomcpPlanner:
    """POMCP with exact beliefs: `lcorpp.protocols.Planner`.

    It needs no solving, and a simulation takes as long however many states there are: one core makes 10 to 40
    thousand in a second. But its answers come with no bounds; `OnlinePlanner` gives better ones unless there
    are very many states. What is found out
    about the actions after the one that is taken is kept: when `update` leads to the belief of the next
    `action`, the search goes on from there.

    Args:
        pomdp: the problem.
        simulations: how many a belief is looked at with, at most; from 1.
        seconds: of wall-clock time that `action` may take at most; the simulations alone count when None.
        exploration: how much actions that look worse are tried: times the range of values met (UCB1).
        leaves: the guess at the value of a state that a simulation ends in, see `simulator.LEAVES`.
        seed: of its chance, a whole number from 0. Without `seconds` the same calls get the same answers.

    Raises:
        ModelError: a number is out of range, or there is no guess of that name.

    Source: Silver and Veness, NIPS 2010.
    """

    def __init__(
        self,
        pomdp: Pomdp,
        *,
        simulations: int = 10_000,
        seconds: float | None = None,
        exploration: float = EXPLORATION,
        leaves: str = "mdp",
        seed: int = 0,
    ) -> None:
        _check(simulations, seconds, exploration, seed)
        self.pomdp, self.simulations = pomdp, simulations
        self.seconds = np.inf if seconds is None else seconds
        self._simulator = TableSimulator(pomdp, leaves=leaves, seed=seed)
        self._search = TreeSearch(self._simulator, exploration=exploration)
        self._root, self._belief = History(self._simulator.actions), b""

    @property
    def start(self) -> Belief:
        """(S,) the model's own start belief."""
        return self.pomdp.start

    def action(self, belief: Belief) -> str:
        """The name of the action that looks best at a belief (S,).

        Raises:
            ModelError: it is not a distribution over the states.
        """
        return self.pomdp.actions[self.look(belief).action]

    def look(self, belief: Belief) -> Looked:
        """What is known of the actions at a belief (S,) after searching; a belief just looked at is known.

        Raises:
            ModelError: it is not a distribution over the states.
        """
        belief = check_belief(self.pomdp, belief)
        self._go_to(belief)
        draw, left = self._simulator.drawing(belief), self.simulations - self._root.total
        return self._search.search(self._root, draw, simulations=left, seconds=self.seconds)

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """(S,) the belief after a named action and observation.

        Raises:
            ModelError: a name is unknown.
            ObservationError: the observation is impossible.
        """
        a, o = self.pomdp.action_index(action), self.pomdp.observation_index(observation)
        after = update(self.pomdp, belief, a, o)
        if belief.tobytes() == self._belief:
            self._root = self._root.following.get((a, o)) or History(self._simulator.actions)
            self._belief = after.tobytes()
        return after

    def _go_to(self, belief: Belief) -> None:
        """Begin a new tree unless the root stands for this belief."""
        if belief.tobytes() != self._belief:
            self._root, self._belief = History(self._simulator.actions), belief.tobytes()


class ParticlePlanner:
    """POMCP as it is published, for any simulator: the belief is a set of states that fit what was observed.

    Args:
        simulator: the problem.
        start: draws a state to start from.
        simulations: how many each step is looked at with, at most; from 1.
        seconds: of wall-clock time that `action` may take at most; the simulations alone count when None.
        particles: states that stand for the belief, at least where so many can be found; from 1.
        exploration: how much actions that look worse are tried: times the range of values met (UCB1).
        seed: of the choice among particles, a whole number from 0; the simulator has its own chance.

    Raises:
        ModelError: a number is out of range.

    Source: Silver and Veness, NIPS 2010.
    """

    def __init__(
        self,
        simulator: Simulator[Any],
        start: Callable[[], Any],
        *,
        simulations: int = 10_000,
        seconds: float | None = None,
        particles: int = 1_000,
        exploration: float = EXPLORATION,
        seed: int = 0,
    ) -> None:
        _check(simulations, seconds, exploration, seed)
        self.simulator, self.simulations = simulator, simulations
        self.seconds = np.inf if seconds is None else seconds
        self.wanted = checked_count("particles", particles, 1)
        self._search = TreeSearch(simulator, exploration=exploration, keep_particles=True)
        self._root, self._rng = History(simulator.actions), np.random.default_rng(seed)
        self.particles: Sequence[Any] = [start() for _ in range(particles)]

    def action(self) -> int:
        """The action that looks best now."""
        return self.look().action

    def look(self) -> Looked:
        """What is known of the actions now, after searching; what was just looked at is known."""
        left = self.simulations - self._root.total
        return self._search.search(self._root, self._draw, simulations=left, seconds=self.seconds)

    def update(self, action: int, observation: Hashable) -> None:
        """Take note of an action and what was observed then.

        The states that simulations came by with, in this history, are the particles; too few are filled up by
        simulating the step until enough have shown the observation.

        Raises:
            ModelError: there is no such action.
            ObservationError: no simulation has shown the observation: it is impossible, or there are too few
                particles.
        """
        if not 0 <= action < self.simulator.actions:
            raise ModelError(f"actions are 0 to {self.simulator.actions - 1}, not {action}")
        after = self._root.following.get((action, observation)) or History(self.simulator.actions)
        found, tries = list(after.particles), 0
        while len(found) < self.wanted and tries < TRIES * self.wanted:
            state, shown, _ = self.simulator.step(self._draw(), action)
            tries += 1
            if shown == observation:
                found.append(state)
        if not found:
            raise ObservationError(
                f"observation {observation!r} was shown by none of {tries} simulations of action {action}"
                f" from {len(self.particles)} particles"
            )
        self._root, self.particles = after, found

    def _draw(self) -> Any:
        return self.particles[int(self._rng.integers(len(self.particles)))]


def _check(simulations: int, seconds: float | None, exploration: float, seed: int) -> None:
    checked_count("simulations", simulations, 1)
    checked_count("seed", seed, 0)
    if seconds is not None and not seconds > 0:
        raise ModelError(f"seconds {seconds} must be positive")
    if not 0 <= exploration < np.inf:
        raise ModelError(f"exploration {exploration} must be a number from 0")
