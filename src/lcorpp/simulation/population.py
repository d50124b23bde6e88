"""A population: people drawn from a domain's P-log program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lcorpp.domains import Domain
from lcorpp.reasoning import Enumeration, Reasoner

Person = Mapping[str, str]
"""One person: every attribute of the simulation's program and its value."""


class Population:
    """People drawn from a domain's simulation program (section "Experimental Results" of the paper).

    The program's rules order the draw, e.g. identity, then time and location, then intention.
    """

    def __init__(self, domain: Domain) -> None:
        self._program = domain.simulation.true_program
        self._reasoner = Reasoner(self._program)

    def sample(self, count: int, rng: np.random.Generator, given: Mapping[str, str] = {}) -> list[Person]:
        """Draw `count` people from the distribution conditioned on the values in `given`."""
        return [self._reasoner.sample(rng, given) for _ in range(count)]

    def joint_distribution(self, attributes: Sequence[str]) -> dict[tuple[str, ...], float]:
        """Return the exact joint distribution of some attributes: value tuple -> probability."""
        joint: dict[tuple[str, ...], float] = {}
        for world in Enumeration(self._program).worlds:
            values = tuple(world.values[name] for name in attributes)
            joint[values] = joint.get(values, 0.0) + float(world.measure)
        return joint
