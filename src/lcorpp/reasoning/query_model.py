"""A program grounded for one query: its worlds, its answer, and an estimate if the worlds are too many."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from functools import cached_property

from lcorpp.reasoning.answers import Estimate, QueryAnswer, normalise_marginal
from lcorpp.reasoning.circuit.trellis import build_trellis
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.errors import no_value_error, no_world_error
from lcorpp.reasoning.grounding.ground_program import Clause
from lcorpp.reasoning.grounding.grounder import QUERY_TERM, ground_program
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.resolve import collect_interventions
from lcorpp.reasoning.transitions.likelihood_weighting import estimate
from lcorpp.reasoning.transitions.transition_system import build_transition_system


class QueryModel:
    """The worlds of a program that satisfy the conditions of a query.

    Observations and interventions are part of the ground program, as a literal may be `a!=v`. The literals of
    the query define the term `QUERY_TERM`.

    Args:
        program: a program without cr-rules.
        query: a query resolved by `resolve_query`.
        keep_clauses: whether to keep the ground clauses, which explanations need.

    Raises:
        ProgramError: arithmetic is undefined, or a term is set to two values.
    """

    def __init__(self, program: Program, query: Query, *, keep_clauses: bool = False) -> None:
        self.program, self.query = program, query
        do = collect_interventions(query)
        observed = [observation.literal for observation in query.observations]
        self.term = canonical_text(query.subject) if query.subject else QUERY_TERM
        ground = ground_program(program, do, observed, query.literals)
        self.clauses: list[Clause] = ground.clauses if keep_clauses else []
        self.system = build_transition_system(ground, (self.term,))

    @cached_property
    def worlds(self) -> WorldQueries:
        """The worlds.

        Raises:
            TooLargeError: the program has too many states.
            ProgramError: a world violates a condition of the language.
        """
        return WorldQueries(build_trellis(self.system))

    def answer(self, *, exact: bool) -> QueryAnswer:
        """Compute the answer, as fractions if `exact`.

        Raises:
            TooLargeError, ProgramError: as `worlds`; or the subject may have no value.
            UndefinedError: no possible world satisfies the conditions.
        """
        conditions = self._format_conditions()
        weights: Mapping[str, Fraction | float]
        weights = (
            self.worlds.exact_weights(self.term, {}) if exact else self.worlds.float_weights(self.term, {})
        )
        if self.query.subject:
            return normalise_marginal(self.program, self.term, weights, conditions)  # type: ignore[type-var, return-value]
        total = sum(weights.values())
        if not total:
            raise no_world_error(self.program, conditions)
        return weights.get("true", 0 * total) / total

    def estimate(self, samples: int) -> QueryAnswer:
        """Estimate the answer by likelihood weighting; the numbers are `Estimate`s.

        Raises:
            ProgramError: a sampled world violates a condition of the language, or lacks a value.
            UndefinedError: no sampled world satisfies the conditions.
        """
        values = estimate(self.system, self.term, {}, samples).values
        estimates = {value: Estimate(p, error) for value, (p, error) in values.items()}
        if self.query.subject is None:
            return estimates.get("true", Estimate(0.0, 0.0))
        share = estimates.pop("")
        if share:
            raise no_value_error(self.program, self.term, share)
        return dict(estimates)

    def _format_conditions(self) -> str:
        parts = [
            str(part).removesuffix(".") for part in (*self.query.observations, *self.query.interventions)
        ]
        return f" has {', '.join(parts)}" if parts else ""
