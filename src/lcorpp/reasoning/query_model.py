"""A program grounded for one query: its worlds, its answer, or an estimate if it is too large."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.answers import (
    QueryAnswer,
    make_no_world_error,
    normalise_marginal,
)
from lcorpp.reasoning.circuit.decision_diagram import build_decision_diagram
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.resolve import name_question
from lcorpp.reasoning.transitions.transition_system import build_transition_system

if TYPE_CHECKING:
    from lcorpp.reasoning.enumeration.reasoner import Enumeration  # imports numpy and clingo


class QueryModel:
    """The worlds of a program that satisfy the conditions of a query.

    Observations and interventions are part of the ground program, as a literal may be `a!=v`. The literals of
    the query define the term `QUERY_TERM`.

    Args:
        program: a program without cr-rules.
        query: a query resolved by `resolve_query`.
        samples, seed: as in `Reasoner`.

    Raises:
        ProgramError: arithmetic is undefined.
    """

    def __init__(self, program: Program, query: Query, *, samples: int, seed: int) -> None:
        self.program, self.query, self.samples, self.seed = program, query, samples, seed
        do = {canonical_text(item.term): canonical_text(item.value) for item in query.interventions}
        observed = [observation.literal for observation in query.observations]
        self.term = name_question(query)
        self.ground = ground_program(program, do, observed, query.literals, (self.term,))
        self.system = build_transition_system(self.ground, (self.term,))
        parts = [str(part)[:-1] for part in (*query.observations, *query.interventions)]
        self.conditions = f" has {', '.join(parts)}" if parts else ""

    @cached_property
    def worlds(self) -> WorldQueries:
        """The worlds.

        Raises:
            TooLargeError: the program is too large to be compiled.
            ProgramError: a world violates a condition of the language.
        """
        return WorldQueries(build_decision_diagram(self.system))

    def answer(self, *, exact: bool) -> QueryAnswer:
        """Compute the answer, in fractions if `exact`; estimate it if the program is too large to compile.

        Raises:
            TooLargeError: the program is too large to be compiled, and `exact`, or its evidence is too
                improbable for sampling.
            ProgramError: as `worlds`; or the subject may have no value.
            UndefinedError: no possible world satisfies the conditions.
        """
        try:
            return self._compute(exact=exact)
        except TooLargeError as error:
            if exact:
                raise
            return self._estimate(error)

    def _compute(self, *, exact: bool) -> QueryAnswer:
        worlds = self.worlds
        weights: Mapping[str, Fraction | float]
        weights = (worlds.compute_exact_weights if exact else worlds.compute_float_weights)(self.term, {})
        if self.query.subjects:
            return normalise_marginal(self.program, self.term, weights, self.conditions)  # type: ignore[type-var, return-value]
        total = sum(weights.values())
        if not total:
            raise make_no_world_error(self.program, self.conditions)
        return weights.get("true", 0 * total) / total

    def _estimate(self, reason: TooLargeError) -> QueryAnswer:
        """Estimate the answer from sampled worlds; the numbers are `Estimate`s."""
        from lcorpp.reasoning.estimation import drop_no_value, estimate_probabilities  # imports numpy
        from lcorpp.reasoning.transitions.rejection_sampling import sample_worlds

        found = sample_worlds(self.ground, self.system, self.term, self.samples, self.seed)
        estimates = estimate_probabilities(self.ground, found, reason, self.conditions, stacklevel=6)
        if not self.query.subjects:
            return estimates["true"]
        return dict(drop_no_value(self.ground, self.term, estimates))


class EnumeratedQuery:
    """A query to a program with cr-rules, resolved by `resolve_query`, which enumeration answers."""

    def __init__(self, enumeration: Enumeration, query: Query) -> None:
        self.enumeration, self.query = enumeration, query

    def answer(self, *, exact: bool) -> QueryAnswer:
        """Compute the answer, as fractions if `exact`; raise the errors of `Enumeration.ask`."""
        answer = self.enumeration.ask(self.query)
        if isinstance(answer, dict):
            return {value: p if exact else float(p) for value, p in answer.items()}
        return answer if exact else float(answer)
