"""Soft evidence: a likelihood weighs the values of an attribute, in place of a value that is seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError, expected_one_of
from lcorpp.reasoning.distributions import EstimatedDistribution
from lcorpp.reasoning.errors import format_conditions
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import resolve_term
from lcorpp.values import Array, Distribution, Label, Likelihood


class SoftEvidence:
    """Answers questions whose evidence holds likelihoods, through ordinary questions.

    With a likelihood L of attribute c, P(a | facts) is in proportion to the sum over c of
    ``L(c) P(c | facts) P(a | c, facts)``, and so on for more of them: every term is an ordinary question,
    which the reasoner remembers.

    Args:
        program: the program.
        posterior: the marginal of an attribute given ordinary evidence.

    Source: Pearl, Probabilistic Reasoning in Intelligent Systems, 1988, section 2.2.2.
    """

    def __init__(self, program: Program, posterior: Callable[[str, Mapping[str, str]], Distribution]) -> None:
        if program.has_cr_rules:
            raise ProgramError(f"{program.file}: soft evidence has no meaning for a program with cr-rules")
        self.program, self._posterior = program, posterior
        self._named: dict[str, tuple[str, tuple[str, ...]]] = {}

    def posterior(self, attribute: str, evidence: Mapping[str, Label]) -> Distribution:
        """The marginal of `attribute` given facts and likelihoods, exact.

        Args:
            attribute: an attribute or a term of one.
            evidence: term -> value, or -> the likelihood of each of its values.

        Raises:
            ProgramError: the program does not know a name, or a likelihood is not about the values of its
                term or about a term that has a value already.
            UndefinedError: no possible world has the facts and a value of weight above 0.
            TooLargeError: the program has too many states for exact answers.
        """
        facts: dict[str, str] = {}
        soft: dict[str, Likelihood] = {}
        for name, value in evidence.items():
            term, values = self._range(name)
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
        term, values = self._range(attribute)
        total, marginal = self._weights(term, facts, soft, tuple(soft))
        if not total > 0:
            told = ", ".join(f"{name}: {likelihood}" for name, likelihood in soft.items())
            raise UndefinedError(
                f"{self.program.file}: no possible world{format_conditions(facts, {})} and weight from {told}"
            )
        return Distribution(values, marginal / marginal.sum())

    def _weights(
        self, asked: str, facts: dict[str, str], soft: Mapping[str, Likelihood], rest: tuple[str, ...]
    ) -> tuple[float, Array]:
        """P(the likelihoods of `rest` | facts), and the marginal (n,) of `asked`, summing to that."""
        if not rest:
            return 1.0, self._answer(asked, facts).probabilities
        share_of = dict(self._answer(rest[0], facts))
        total, marginal = 0.0, np.zeros(len(self._range(asked)[1]))
        for value, weight in soft[rest[0]]:
            if weight * share_of[value] > 0:
                mass, part = self._weights(asked, {**facts, rest[0]: value}, soft, rest[1:])
                total += weight * share_of[value] * mass
                marginal += weight * share_of[value] * part
        return total, marginal

    def _answer(self, asked: str, facts: Mapping[str, str]) -> Distribution:
        answer = self._posterior(asked, facts)
        if isinstance(answer, EstimatedDistribution):
            raise TooLargeError(f"{self.program.file}: too many states to weigh soft evidence exactly")
        return answer

    def _range(self, name: str) -> tuple[str, tuple[str, ...]]:
        """The term that a name stands for, and its values."""
        if name not in self._named:
            term = resolve_term(self.program, name)
            self._named[name] = canonical_text(term), self.program.attributes[term.name].values
        return self._named[name]
