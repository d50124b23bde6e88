"""A population: people drawn from a domain's P-log program."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lcorpp.domains import Domain
from lcorpp.reasoning import Reasoner

Person = Mapping[str, str]
"""One person: every attribute of the simulation's program and its value."""


class Population:
    """People drawn from a domain's simulation program (section "Experimental Results" of the paper).

    The program's rules order the draw, e.g. identity, then time and location, then intention.
    """

    def __init__(self, domain: Domain) -> None:
        self._reasoner = Reasoner(domain.simulation.true_program)

    def sample(self, count: int, rng: np.random.Generator, given: Mapping[str, str] = {}) -> list[Person]:
        """Draw `count` people from the distribution conditioned on the values in `given`."""
        return [self._reasoner.sample(rng, given) for _ in range(count)]
