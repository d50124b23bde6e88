"""Soft evidence: likelihoods of the values of an attribute instead of one observed value."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError, expected_one_of
from lcorpp.reasoning.answers import format_conditions
from lcorpp.reasoning.estimation import EstimatedDistribution
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import resolve_term
from lcorpp.values import Array, Distribution, Label, Likelihood


class SoftEvidence:
    """Reduces queries with likelihoods to queries with hard evidence, whose answers the reasoner caches.

    With a likelihood L of attribute c, P(a | facts, L) is proportional to the sum over c of
    ``L(c) P(c | facts) P(a | c, facts)``; further likelihoods are handled recursively.

    Args:
        program: the program.
        posterior: computes the marginal of an attribute given hard evidence.

    Source: Pearl, Probabilistic Reasoning in Intelligent Systems, 1988, section 2.2.2.
    """

    def __init__(self, program: Program, posterior: Callable[[str, Mapping[str, str]], Distribution]) -> None:
        if program.has_cr_rules:
            raise ProgramError(f"{program.file}: soft evidence has no meaning for a program with cr-rules")
        self.program, self._posterior = program, posterior
        self._resolved: dict[str, tuple[str, tuple[str, ...]]] = {}

    def posterior(self, attribute: str, evidence: Mapping[str, Label]) -> Distribution:
        """Compute the marginal of an attribute given facts and likelihoods.

        Args:
            attribute: an attribute or a term of one.
            evidence: term -> value, or -> the likelihood of each of its values.

        Raises:
            ProgramError: a name is unknown, the values of a likelihood are not those of its term, or a term
                has two conditions.
            UndefinedError: no possible world has the facts and a value of positive likelihood.
            TooLargeError: the program is too large to be compiled.
        """
        facts: dict[str, str] = {}
        soft: dict[str, Likelihood] = {}
        for name, value in evidence.items():
            term, values = self._resolve(name)
            if term in facts or term in soft:
                raise ProgramError(f"the evidence gives {term} twice; expected a value or a likelihood")
            if not isinstance(value, Likelihood):
                facts[term] = value
            elif set(value.values) == set(values):
                soft[term] = value
            else:
                raise ProgramError(
                    f"a likelihood of {', '.join(value.values)} for {term}; {expected_one_of(values)}"
                )
        term, values = self._resolve(attribute)
        total, marginal = self._compute_weights(term, facts, soft, tuple(soft))
        if not total > 0:
            likelihoods = ", ".join(f"{name}: {likelihood}" for name, likelihood in soft.items())
            raise UndefinedError(
                f"{self.program.file}: no possible world{format_conditions(facts, {})}"
                f" and weight from {likelihoods}"
            )
        return Distribution(values, marginal / marginal.sum())

    def _compute_weights(
        self, queried: str, facts: dict[str, str], soft: Mapping[str, Likelihood], rest: tuple[str, ...]
    ) -> tuple[float, Array]:
        """Return P(likelihoods of `rest` | facts), and the joint weights (n,) of `queried`, with that sum."""
        if not rest:
            return 1.0, self._answer(queried, facts).probabilities
        probability_of = dict(self._answer(rest[0], facts))
        total, marginal = 0.0, np.zeros(len(self._resolve(queried)[1]))
        for value, weight in soft[rest[0]]:
            if weight * probability_of[value] > 0:
                mass, part = self._compute_weights(queried, {**facts, rest[0]: value}, soft, rest[1:])
                total += weight * probability_of[value] * mass
                marginal += weight * probability_of[value] * part
        return total, marginal

    def _answer(self, queried: str, facts: Mapping[str, str]) -> Distribution:
        answer = self._posterior(queried, facts)
        if isinstance(answer, EstimatedDistribution):
            raise TooLargeError(
                f"{self.program.file}: the program is too large to be compiled; soft evidence needs exact"
                " answers"
            )
        return answer

    def _resolve(self, name: str) -> tuple[str, tuple[str, ...]]:
        """Return the canonical term of a name, and its values."""
        if name not in self._resolved:
            term = resolve_term(self.program, name)
            self._resolved[name] = canonical_text(term), self.program.attributes[term.name].values
        return self._resolved[name]
