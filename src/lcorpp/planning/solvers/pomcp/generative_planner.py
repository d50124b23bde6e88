"""The planner of a domain whose model is generative: a particle belief, and a search at each step.

Sources: Silver and Veness, NIPS 2010; Sunberg and Kochenderfer, ICAPS 2018; Keller and Helmert, ICAPS 2013.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from random import Random
from typing import Any

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.arguments import check_count
from lcorpp.planning.generative_model import GenerativeModel, GenerativeSimulator
from lcorpp.planning.solvers.pomcp.batches import Batch, Loop, States, as_objects
from lcorpp.planning.solvers.pomcp.bounded import BoundedParticleSearch
from lcorpp.planning.solvers.pomcp.particles import Particles, filter_particles, share_out
from lcorpp.planning.solvers.pomcp.search import ActionValues, History, TreeSearch, Widening
from lcorpp.planning.vectorised import VectorBatch
from lcorpp.values import Array, Belief

EXPLORATION = 1.0
"""c of UCB1 as a share of the range of values, which are those of the best actions of histories."""

MAX_KNOWN = 10_000
"""Maximum number of beliefs whose search results are kept."""


@dataclass(frozen=True)
class SearchOptions:
    """The work of a search at each step.

    simulations: of a search, at least 1. particles: about how many represent a belief, at least 1.
    widening: of the observations; None for few observations.
    expansions: of a search with bounds, in place of simulations: how many beliefs it expands, at least 1.
    samples: number of particles of each of these, at least 1.

    Raises:
        ModelError: a number is out of range.

    Examples:
        >>> from lcorpp.planning import SearchOptions
        >>> SearchOptions(simulations=500).particles
        1000
    """

    simulations: int = 5000
    particles: int = 1000
    widening: Widening | None = None
    expansions: int = 300
    samples: int = 100

    @classmethod
    def for_model(cls, model: GenerativeModel) -> SearchOptions:
        """Return the options by default: observations that are numbers are widened."""
        return cls(widening=None if model.observations or model.has_bounds else Widening())

    def __post_init__(self) -> None:
        for name in ("simulations", "particles", "expansions", "samples"):
            check_count(name, getattr(self, name), 1)

    def describe(self, model: GenerativeModel) -> str:
        """Return the work of a search at each step with a model."""
        if model.has_bounds:
            return f"{self.expansions} expansions of {self.samples} particles, {self.particles} particles"
        observed = "" if self.widening is None else ", observations are widened (POMCPOW)"
        return f"{self.simulations} simulations, {self.particles} particles{observed}"


class ParticleBelief(np.ndarray[Any, np.dtype[np.float64]]):
    """A belief (S,) over the named states of a generative model, and the particles behind it.

    key: identifies the prior, actions and observations that led to it.
    """

    particles: Particles | None
    key: bytes

    @classmethod
    def of(cls, model: GenerativeModel, particles: Particles, key: bytes) -> ParticleBelief:
        """Return the belief of some particles."""
        values = make_batch(model, np.random.default_rng(0)).group(particles.states)
        values[values < 0] = len(model.values)
        belief = np.bincount(values, particles.weights, len(model.states)).view(cls)
        belief.particles, belief.key = particles, key
        belief.flags.writeable = False
        return belief

    def __array_finalize__(self, other: Any) -> None:
        self.particles, self.key = None, b""  # results of operations are no beliefs


def make_batch(model: GenerativeModel, rng: np.random.Generator) -> Batch:
    """Return the simulation of many states at once."""
    if model.vectorised is not None:
        return VectorBatch(model.vectorised, rng)
    return Loop(GenerativeSimulator(model, rng), model.find_value)


class GenerativePlanner:
    """A search at each step with a generative model: `lcorpp.protocols.Planner`.

    Beliefs are particles, at first drawn for each shared value, later resampled by the likelihood of the
    observations. The search is POMCP, and with widening POMCPOW; other than published, an action is worth its
    mean reward and the best actions after it, not the mean return. If the model has bounds, it is
    `BoundedParticleSearch`. Results depend on the prior, the actions and the observations alone. Values are
    estimates, and particles may miss states of small probability.

    Args:
        model: the model.
        options: of the search; None for `SearchOptions.for_model`.

    Examples:
        >>> from lcorpp.planning import GenerativeModel, GenerativePlanner
        >>> class Coin:
        ...     actions, discount, observations = ("look", "say_heads", "say_tails"), 0.9, ("h", "t")
        ...     def start(self, value, rng): return value
        ...     def step(self, state, action, rng):
        ...         if action == "look": return state, state[0], -1.0
        ...         return "end", "h", 5.0 if action == "say_" + state else -5.0
        ...     def likelihood(self, observation, state, action, next_state):
        ...         return float(observation == next_state[0]) if action == "look" else 1.0
        ...     def shared(self, state): return None if state == "end" else state
        >>> planner = GenerativePlanner(GenerativeModel(Coin(), ("heads", "tails")))
        >>> planner.action(planner.start)
        'look'
        >>> planner.update(planner.start, "look", "t").round(3).tolist()  # heads, tails, over
        [0.0, 1.0, 0.0]
    """

    def __init__(self, model: GenerativeModel, options: SearchOptions | None = None) -> None:
        self.model = model
        self.options = SearchOptions.for_model(model) if options is None else options
        self._known = dict[bytes, ActionValues]()

    def __repr__(self) -> str:
        return f"<GenerativePlanner: {self.options.describe(self.model)}>"

    @property
    def start(self) -> Belief:
        """(S,) a belief without knowledge: all shared values are equally probable."""
        return self.model.start

    def action(self, belief: Belief) -> str:
        """Search, and return the name of the action to take at a belief (S,)."""
        return self.model.actions[self.search(belief).action]

    def search(self, belief: Belief) -> ActionValues:
        """Search from a belief (S,) of `update`, or from a prior.

        Raises:
            ModelError: the belief is none, or a method of the model fails or returns something else than
                expected. Of a model in a file, `DomainError` with the line.
        """
        with self.model.locate("the search"):
            known = self._find_particles(belief)
            if known.key not in self._known:
                if len(self._known) >= MAX_KNOWN:
                    self._known.clear()
                self._known[known.key] = self._search(known)
            return self._known[known.key]

    def describe_search(self, belief: Belief) -> str:
        """Return the estimated value, or its bounds, at a belief (S,)."""
        found = self.search(belief)
        value = float(found.values[found.action])
        if found.upper is None:
            return f"value about {value:.3f}, by {found.simulations} simulations"
        return f"value about {value:.3f} to {found.upper.max():.3f}, by {found.simulations} expansions"

    def _search(self, belief: ParticleBelief) -> ActionValues:
        assert belief.particles is not None
        seed, options = _make_seed(belief.key, b"search"), self.options
        if self.model.has_bounds:
            batch, rng = make_batch(self.model, np.random.default_rng(seed)), np.random.default_rng(seed + 1)
            return BoundedParticleSearch(batch, options.samples, rng).search(
                belief.particles, options.expansions
            )
        simulator = GenerativeSimulator(self.model, np.random.default_rng(seed))
        tree = TreeSearch(
            simulator, exploration=EXPLORATION, widening=options.widening, backup="max", seed=seed
        )
        draw = belief.particles.sampler(Random(seed))
        result = tree.search(History(simulator.actions), draw, simulations=options.simulations)
        if not np.isfinite(result.values[result.visits > 0]).all():
            raise self.model.make_error("a reward or value in the search is not finite")
        return result

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """Return the belief (S,) after an action and an observation, as text of the model.

        Raises:
            ModelError: as of `search`, or the action is unknown.
            ObservationError: the observation is unknown, or impossible in all particles.
        """
        a, observed = self.model.action_index(action), self.model.read_observation(observation)
        with self.model.locate("the update of the belief"):
            known = self._find_particles(belief)
            assert known.particles is not None
            key = sha256(known.key + repr((action, observation)).encode()).digest()
            rng = np.random.default_rng(_make_seed(key, b"update"))
            particles = filter_particles(
                make_batch(self.model, rng),
                known.particles,
                a,
                observed,
                count=self.options.particles,
                rng=rng,
            )
            return ParticleBelief.of(self.model, particles, key)

    def _find_particles(self, belief: Belief) -> ParticleBelief:
        """Return a belief with its particles; those of a prior are drawn for each shared value."""
        if isinstance(belief, ParticleBelief) and belief.particles is not None:
            return belief
        model, probabilities = self.model, _check_prior(self.model, belief)
        possible = np.flatnonzero(probabilities)
        counts = share_out(probabilities[possible], self.options.particles)
        rng = np.random.default_rng(_make_seed(probabilities.tobytes(), b"start"))
        states = [_draw_states(model, v, n, rng) for v, n in zip(possible.tolist(), counts, strict=True)]
        particles = Particles(np.concatenate(states), np.repeat(probabilities[possible] / counts, counts))
        return ParticleBelief.of(model, particles, probabilities.tobytes())


def _draw_states(model: GenerativeModel, value: int, count: int, rng: np.random.Generator) -> States:
    """Draw states (count) at the start of a decision about a person of a shared value, by its index."""
    if model.vectorised is not None:
        return VectorBatch(model.vectorised, rng).start(value, count)
    return as_objects([model.interaction.start(model.values[value], rng) for _ in range(count)])


def _check_prior(model: GenerativeModel, belief: Belief) -> Array:
    """Return (V,) the probabilities of the shared values in a prior (S,)."""
    found = np.array(belief, dtype=np.float64)
    is_valid = found.shape == (len(model.states),) and found.min() >= 0 and abs(found.sum() - 1) < 1e-6
    if not is_valid or found[-1] > 0:
        raise ModelError(
            f"{belief!r} is no prior; expected the probabilities of {', '.join(model.states[:-1])}, then 0"
            f" for {model.states[-1]!r}"
        )
    return np.asarray(found[:-1] / found.sum())


def _make_seed(key: bytes, purpose: bytes) -> int:
    """Return a seed that depends on a belief and the purpose of the random numbers."""
    return int.from_bytes(sha256(key + purpose).digest()[:8], "little")
