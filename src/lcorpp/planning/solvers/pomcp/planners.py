"""Planners by Monte-Carlo tree search: exact beliefs for problems in tables, particles for any simulator.

Sources: Silver and Veness, Monte-Carlo planning in large POMDPs, NIPS 2010; Sunberg and Kochenderfer, Online
algorithms for POMDPs with continuous state, action, and observation spaces, ICAPS 2018.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from random import Random
from typing import Any

import numpy as np

from lcorpp.errors import ModelError, ObservationError
from lcorpp.planning.arguments import check_count, check_type
from lcorpp.planning.belief import check_belief
from lcorpp.planning.planner import ModelPlanner
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solvers.pomcp.batches import Loop, as_objects
from lcorpp.planning.solvers.pomcp.particles import Particles, filter_particles
from lcorpp.planning.solvers.pomcp.search import (
    EXPLORATION,
    ActionValues,
    History,
    TreeSearch,
    Widening,
)
from lcorpp.planning.solvers.pomcp.simulator import Simulator, TableSimulator, check_hashable
from lcorpp.values import Belief

MAX_TRIES = 100
"""Largest number of simulations per missing particle."""


class PomcpPlanner(ModelPlanner):
    """POMCP with exact beliefs: `lcorpp.protocols.Planner`.

    It needs no policy, and the time of a simulation does not depend on the number of states: one core runs 10
        to 40 thousand per second. Its results have no bounds; `OnlinePlanner` has better ones unless there
        are very many states. If `update` leads to the belief of the next `action`, the search continues in
        that part of the tree.

    Args:
        pomdp: the problem.
        simulations: largest number of simulations from a belief, at least 1.
        seconds: largest wall-clock time of one call of `action`; unlimited when None.
        exploration: c of UCB1 as a share of the range of mean returns.
        leaf_values: estimate of the value of the last state of a simulation, see `simulator.LEAF_VALUES`.
        seed: of the random numbers, an integer of at least 0. Without `seconds`, equal calls have equal
            results.

    Raises:
        ModelError: a number is out of range, or the estimate is unknown.

    Source: Silver and Veness, NIPS 2010.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import PomcpPlanner
        >>> planner = PomcpPlanner(load_domain("intention").pomdp, simulations=200)
        >>> planner.action([1, 0, 0, 0, 0])  # the person is certainly interested
        'report_interested'
    """

    def __init__(
        self,
        pomdp: Pomdp,
        *,
        simulations: int = 10_000,
        seconds: float | None = None,
        exploration: float = EXPLORATION,
        leaf_values: str = "mdp",
        seed: int = 0,
    ) -> None:
        _check_options(simulations, seconds, exploration, seed)
        self._simulator = TableSimulator(pomdp, leaf_values=leaf_values, seed=seed)
        self.pomdp, self.simulations = pomdp, simulations
        self.seconds = np.inf if seconds is None else seconds
        self._tree_search = TreeSearch(self._simulator, exploration=exploration)
        self._root, self._belief = History(self._simulator.actions), b""

    def __repr__(self) -> str:
        return f"<PomcpPlanner: {len(self.pomdp.states)} states, {self.simulations} simulations per step>"

    def action(self, belief: Belief) -> str:
        """Search, and return the name of the best action at a belief (S,).

        Raises:
            ModelError: `belief` is not a distribution over the states.
        """
        return self.pomdp.actions[self.search(belief).action]

    def search(self, belief: Belief) -> ActionValues:
        """Search from a belief (S,), continuing the last search if it was from the same belief.

        Raises:
            ModelError: `belief` is not a distribution over the states.
        """
        belief = check_belief(self.pomdp, belief)
        if belief.tobytes() != self._belief:
            self._root, self._belief = History(self._simulator.actions), belief.tobytes()
        draw, left = self._simulator.state_sampler(belief), self.simulations - self._root.total
        return self._tree_search.search(self._root, draw, simulations=left, seconds=self.seconds)

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """Return the belief (S,) after a named action and observation; keep its part of the tree.

        Errors are those of `ModelPlanner.update`.
        """
        after = super().update(belief, action, observation)
        if belief.tobytes() == self._belief:
            a, o = self.pomdp.action_index(action), self.pomdp.observation_index(observation)
            self._root = self._root.children.get((a, o)) or History(self._simulator.actions)
            self._belief = after.tobytes()
        return after


class ParticlePlanner:
    """POMCP and POMCPOW for any simulator: the belief is a set of particles, states of the problem.

    With `widening` the simulator is an `ObservedSimulator`. Observations may then be continuous: the search
    widens over them, and particles are resampled by their likelihood. Otherwise the particles are the
    simulated states whose simulated observation is the one that was made. Neither has bounds: the values are
    estimates, and particles may miss states of small probability. Other than published, rewards are those of
    the simulated step, `value` of the simulator replaces rollouts, and actions are not widened over.

    Args:
        simulator: the problem.
        start: draws a start state.
        simulations: largest number of simulations per step, at least 1.
        seconds: largest wall-clock time of one call of `action`; unlimited when None.
        particles: the wanted number of particles, at least 1.
        exploration: c of UCB1 as a share of the range of mean returns.
        widening: of the observations; None for few observations.
        backup: of the values, "mean" or "max", see `search.BACKUPS`.
        seed: of the choice among particles, an integer of at least 0; the simulator has its own random
            numbers.

    Raises:
        ModelError: a number is out of range, the backup is unknown, or a simulator with widening has no
            likelihood.

    Sources: Silver and Veness, NIPS 2010; Sunberg and Kochenderfer, ICAPS 2018; for the particles Gordon,
    Salmond and Smith, 1993.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import ParticlePlanner, TableSimulator
        >>> pomdp = load_domain("intention").pomdp
        >>> planner = ParticlePlanner(TableSimulator(pomdp), lambda: 0, simulations=200, particles=10)
        >>> pomdp.actions[planner.action()]  # all particles are state 0, interested
        'report_interested'
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
        widening: Widening | None = None,
        backup: str = "mean",
        seed: int = 0,
    ) -> None:
        _check_options(simulations, seconds, exploration, seed)
        check_type("widening", widening, Widening, type(None))
        if widening is not None and not callable(getattr(simulator, "likelihood", None)):
            raise ModelError(
                "widening needs a simulator with likelihood(observation, state, action, next_state)"
            )
        self.simulator, self.simulations, self.widening = simulator, simulations, widening
        self.seconds = np.inf if seconds is None else seconds
        self.particle_count = check_count("particles", particles, 1)
        self._tree_search = TreeSearch(
            simulator,
            exploration=exploration,
            keep_particles=True,
            widening=widening,
            backup=backup,
            seed=seed,
        )
        self._root = History(simulator.actions)
        self._rng, self._random = np.random.default_rng(seed), Random(seed)
        self._set_particles(Particles.of(as_objects([start() for _ in range(particles)])))

    def __repr__(self) -> str:
        particles = len(self.particles.states)
        return f"<ParticlePlanner: {particles} particles, {self.simulations} simulations per step>"

    def action(self) -> int:
        """Search, and return the best action."""
        return self.search().action

    def search(self) -> ActionValues:
        """Search from the current particles, continuing the last search if there was no update since."""
        left = self.simulations - self._root.total
        return self._tree_search.search(self._root, self._draw, simulations=left, seconds=self.seconds)

    def update(self, action: int, observation: Hashable) -> None:
        """Update the particles after an action and an observation.

        With widening, as many steps are simulated as there are particles, and the next particles are drawn by
        the likelihood of the observation, see `filter_particles`. Otherwise they are the states of all
        simulations with this action and observation. If there are fewer than `particle_count`, further
        simulations of the step add those with the observation.

        Raises:
            ModelError: the action is unknown.
            ObservationError: no simulation produced the observation: it is impossible, or there are too few
                particles.
        """
        if not 0 <= action < self.simulator.actions:
            raise ModelError(f"the action must be 0 to {self.simulator.actions - 1}, not {action}")
        check_hashable(observation)
        child = self._root.children.get((action, observation)) or History(self.simulator.actions)
        if self.widening is not None:
            resampled = filter_particles(
                Loop(self.simulator),
                self.particles,
                action,
                observation,
                count=self.particle_count,
                rng=self._rng,
            )
            self._set_particles(resampled)
            self._root = child
            return
        particles, tries = list(child.particles), 0
        while len(particles) < self.particle_count and tries < MAX_TRIES * self.particle_count:
            state, simulated, _ = self.simulator.step(self._draw(), action)
            tries += 1
            if simulated == observation:
                particles.append(state)
        if not particles:
            raise ObservationError(
                f"none of {tries} simulations of action {action} from {len(self.particles.states)} particles"
                f" produced observation {observation!r}"
            )
        self._set_particles(Particles.of(as_objects(particles)))
        self._root = child

    def _set_particles(self, particles: Particles) -> None:
        self.particles = particles
        self._draw = particles.sampler(self._random)


def _check_options(simulations: int, seconds: float | None, exploration: float, seed: int) -> None:
    check_count("simulations", simulations, 1)
    check_count("seed", seed, 0)
    if seconds is not None and not seconds > 0:
        raise ModelError(f"seconds must be positive, not {seconds}")
    if not 0 <= exploration < np.inf:
        raise ModelError(f"exploration must be a finite number of at least 0, not {exploration}")
