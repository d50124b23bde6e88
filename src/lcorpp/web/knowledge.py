"""What the program infers from evidence, for the page: marginals, the most probable world and its rules."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import NoValueError
from lcorpp.reasoning import Program, Query, Reasoner, find_fired
from lcorpp.values import Distribution, Likelihood
from lcorpp.web.sentences import write_sentence

MAX_CACHED = 4096
"""Inferences that are kept; evidence consists of names only, so a domain has finitely many."""


@dataclass(frozen=True, eq=False)
class Inference:
    """What follows from evidence.

    marginals: attribute -> probabilities of its values; None where it may have no value.
    shared: of the shared variables.
    fired: the rules that fire in the most probable world, as {sentence, about, text, line}.
    world: attribute -> its value in the most probable world. world_probability: of that world.
    """

    marginals: Mapping[str, list[float] | None]
    shared: Distribution
    fired: list[dict[str, Any]]
    world: Mapping[str, str]
    world_probability: float

    @cached_property
    def content(self) -> dict[str, Any]:
        """The inference as JSON."""
        return {
            "marginals": self.marginals,
            "shared": self.shared.probabilities.tolist(),
            "fired": self.fired,
            "world": self.world,
            "world_probability": self.world_probability,
        }


class Knowledge:
    """The reasoner of a domain, for evidence of names.

    attributes: those without arguments, which the page shows.

    Raises:
        DomainError: a reasoner of the domain's own decides.
    """

    def __init__(self, domain: Domain, program: Program) -> None:
        domain.check_program_decides("the page")
        self._domain, self.reasoner = domain, Reasoner(program)
        self.attributes = [name for name, attribute in program.attributes.items() if not attribute.arguments]
        self._inputs = {
            name: Likelihood(values, np.ones(len(values)))
            for name in (*domain.observed, *domain.label_attributes)
            for values in [program.attributes[name].values]
        }
        self._cache: dict[tuple[tuple[str, str], ...], Inference] = {}

    def infer(self, evidence: Mapping[str, str]) -> Inference:
        """Return what follows from evidence.

        Raises:
            UndefinedError: the evidence is impossible.
        """
        key = tuple(sorted(evidence.items()))
        if key not in self._cache:
            if len(self._cache) >= MAX_CACHED:
                self._cache.clear()
            self._cache[key] = self._infer(evidence)
        return self._cache[key]

    def _infer(self, evidence: Mapping[str, str]) -> Inference:
        # what is unknown is a likelihood without information, so that one circuit answers all evidence
        given = {name: evidence.get(name, unknown) for name, unknown in self._inputs.items()}
        shared = self.reasoner.posterior(self._domain.shared, given)
        marginals = dict[str, list[float] | None]()
        for name in self.attributes:
            marginals[name] = None
            with suppress(NoValueError):
                marginals[name] = self.reasoner.posterior(name, given).probabilities.tolist()
        world = self.reasoner.most_probable(evidence)[0]
        fired = [
            {
                "sentence": write_sentence(rule, world.values),
                "about": rule.term.partition("(")[0],
                "text": rule.statement,
                "line": rule.at.line,
            }
            for rule in find_fired(self.reasoner, Query(), world)
            if rule.value
        ]
        own = {name: world.values[name] for name in self.attributes if name in world.values}
        return Inference(marginals, shared, fired, own, float(world.measure))
