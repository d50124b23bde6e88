"""The reference reasoner: enumerate all possible worlds once, and answer queries with exact fractions."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from heapq import nsmallest
from itertools import accumulate
from math import lcm
from operator import truediv
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.errors import ProgramError, check_type
from lcorpp.reasoning.answers import (
    PossibleWorld,
    QueryAnswer,
    Value,
    answer_query,
    format_conditions,
    make_no_world_error,
    normalise_marginal,
)
from lcorpp.reasoning.language.arithmetic import as_value, canonical_text, compare_values
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Formula, Literal, Query
from lcorpp.reasoning.questions import get_interventions
from lcorpp.reasoning.resolve import (
    check_count,
    check_rng,
    resolve_evidence,
    resolve_interventions,
    resolve_query,
    resolve_subject,
)
from lcorpp.values import Distribution

if TYPE_CHECKING:
    from lcorpp.reasoning.enumeration.asp_translation import Condition

NOTHING: Mapping[str, str] = {}
"""No evidence, no interventions."""

TABLE_CACHE_SIZE = 100
"""A reasoner caches at most this many tables of worlds."""


@dataclass(frozen=True, eq=False)
class _WorldTable:
    """Worlds with their measures over a common denominator, so that sums are sums of integers.

    values: the worlds, term -> value. weights: the numerators.
    """

    values: tuple[Mapping[str, str], ...]
    weights: tuple[int, ...]

    @cached_property
    def cumulative(self) -> list[int]:
        return list(accumulate(self.weights))

    @property
    def total(self) -> int:
        return self.cumulative[-1] if self.weights else 0

    def filter(self, conditions: Iterable[Condition]) -> _WorldTable:
        """Return the worlds that satisfy all conditions."""
        conditions = list(conditions)
        kept = [
            i
            for i, values in enumerate(self.values)
            if all(
                any(all(values.get(term) in allowed for term, allowed in case) for case in condition)
                for condition in conditions
            )
        ]
        return _WorldTable(tuple([self.values[i] for i in kept]), tuple([self.weights[i] for i in kept]))

    def weigh(self, term: str) -> dict[Value, Fraction]:
        """Sum the measures by the value of a term or a joint `?a, b`; "" is for no value."""
        names = term.removeprefix("?").split(", ")
        sums: dict[Value, int] = {}
        for values, weight in zip(self.values, self.weights, strict=True):
            own = tuple([values.get(name, "") for name in names])
            value = "" if "" in own else own if term.startswith("?") else own[0]
            sums[value] = sums.get(value, 0) + weight
        return {value: Fraction(weight) for value, weight in sums.items()}

    def list_worlds(self, count: int | None = None) -> tuple[PossibleWorld, ...]:
        """List the worlds with their probabilities: all in order, or the most probable ones."""
        numbers: Iterable[int] = range(len(self.values))
        if count is not None:
            positive = [i for i in numbers if self.weights[i]]
            numbers = nsmallest(count, positive, key=lambda i: -self.weights[i])
        return tuple([PossibleWorld(self.values[i], Fraction(self.weights[i], self.total)) for i in numbers])


class Enumeration:
    """Answer queries of a program by enumeration of its possible worlds.

    The methods are those of `Reasoner` with the same name; evidence consists of values, not likelihoods.

    Each set of interventions enumerates the worlds once, at the first query. Observations filter the worlds.
    With cr-rules observations can also create worlds, so each set of observations enumerates anew.

    Args:
        program: the program.
        limit: the maximum number of worlds; methods raise a `ProgramError` if there are more.

    Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, sections 3 and 4.
    """

    def __init__(self, program: Program, *, limit: int = 200_000) -> None:
        check_type(program, Program, "program", ProgramError)
        check_type(limit, int, "limit", ProgramError)
        self.program = program
        self.limit = limit
        self._tables: dict[object, _WorldTable] = {}

    def __reduce__(self) -> tuple[Callable[[Program], Enumeration], tuple[Program]]:
        return partial(Enumeration, limit=self.limit), (self.program,)  # without the caches

    def __repr__(self) -> str:
        return f"Enumeration({self.program.file}, limit={self.limit})"

    def posterior(
        self,
        attribute: str | Sequence[str],
        evidence: Mapping[str, str] = NOTHING,
        do: Mapping[str, str] = NOTHING,
    ) -> Distribution:
        """Compute the marginal of an attribute, or of several jointly, given evidence and interventions.

        Args:
            attribute: an attribute or a term of one, such as ``roll(d1)``; or several, see `Reasoner`.
            evidence, do: term -> value.

        Raises:
            ProgramError: the program does not know a name, `attribute` may have no value under the evidence,
                or a world breaks a condition of the language.
            UndefinedError: no possible world has the evidence.
        """
        marginal = self.exact(attribute, evidence, do)
        return Distribution(tuple(marginal), np.array([float(p) for p in marginal.values()]))

    def exact(
        self,
        attribute: str | Sequence[str],
        evidence: Mapping[str, str] = NOTHING,
        do: Mapping[str, str] = NOTHING,
    ) -> dict[Value, Fraction]:
        """Compute the same as `posterior`, as fractions by value in the order of the declaration."""
        term = resolve_subject(self.program, attribute)
        facts, set_to = resolve_evidence(self.program, evidence), resolve_interventions(self.program, do)
        weights = self._select(_make_conditions(facts), set_to).weigh(term)
        return normalise_marginal(self.program, term, weights, format_conditions(facts, set_to))

    def ask(self, query: Query, *, exact: bool = True) -> QueryAnswer:
        """Answer a query, see `Reasoner.ask`.

        Raises:
            ProgramError: as `exact`, or the query does not fit the program.
            UndefinedError: no possible world satisfies its observations.
        """
        query = resolve_query(self.program, query)
        table = self._select_by_query(query)

        def weigh(term: str) -> dict[Value, Fraction]:
            if query.subjects:
                return table.weigh(term)
            true = table.filter([self._make_condition(query.formula)]).total
            return {"true": Fraction(true), "": Fraction(table.total - true)}

        return answer_query(
            self.program, query, weigh, truediv if exact else lambda w, total: float(w / total)
        )

    def list_worlds(self, query: Query, count: int) -> tuple[PossibleWorld, ...]:
        """List the most probable worlds under the conditions of a query, see `Reasoner.list_worlds`."""
        check_count(count)
        return self._select_by_query(resolve_query(self.program, query)).list_worlds(count)

    @property
    def worlds(self) -> tuple[PossibleWorld, ...]:
        """The possible worlds with their probabilities.

        Raises:
            ProgramError: a world breaks a condition of the language, or there are too many worlds.
            UndefinedError: there is no world of positive measure.
        """
        return self._select_positive({}).list_worlds()

    def sample(self, rng: np.random.Generator, given: Mapping[str, str] = NOTHING) -> dict[str, str]:
        """Draw one world with its probability given evidence.

        Returns:
            term -> value.

        Raises:
            ProgramError, UndefinedError: as `exact`.
        """
        check_rng(rng)
        table = self._select_positive(resolve_evidence(self.program, given))
        return dict(table.values[bisect_right(table.cumulative, Fraction(rng.random()) * table.total)])

    # tables of worlds

    def _select_positive(self, facts: Mapping[str, str]) -> _WorldTable:
        """Return the worlds with the evidence; raise UndefinedError if their measure is 0."""
        table = self._select(_make_conditions(facts), {})
        if not table.total:
            raise make_no_world_error(self.program, format_conditions(facts, {}))
        return table

    def _select_by_query(self, query: Query) -> _WorldTable:
        conditions = [self._make_condition(observation.formula) for observation in query.observations]
        return self._select(conditions, get_interventions(query))

    def _select(self, conditions: Iterable[Condition], do: Mapping[str, str]) -> _WorldTable:
        """Return the worlds that satisfy conditions, in an order that does not depend on the solver."""
        chosen = frozenset(conditions)
        key = chosen, frozenset(do.items())
        table = self._tables.get(key)
        if table is None:
            if chosen and not self.program.has_cr_rules:
                table = self._select((), do).filter(chosen)
            else:
                table = self._enumerate(do, sorted(chosen, key=str))
            if len(self._tables) >= TABLE_CACHE_SIZE:
                self._tables.clear()
            self._tables[key] = table
        return table

    def _enumerate(self, do: Mapping[str, str], observed: list[Condition]) -> _WorldTable:
        from lcorpp.reasoning.enumeration.worlds import enumerate_worlds  # here, as it loads clingo

        worlds = sorted(
            enumerate_worlds(self.program, do, self.limit, observed), key=lambda w: [*w[0].items()]
        )
        common = lcm(*[measure.denominator for _, measure in worlds])
        weights = [measure.numerator * (common // measure.denominator) for _, measure in worlds]
        return _WorldTable(tuple([values for values, _ in worlds]), tuple(weights))

    def _make_condition(self, formula: Formula) -> Condition:
        return tuple([tuple([self._find_allowed(literal) for literal in case]) for case in formula])

    def _find_allowed(self, literal: Literal) -> tuple[str, frozenset[str | None]]:
        """Find the values with which a term satisfies a literal; with no value, only `not` makes it true."""
        declared = self.program.attributes[literal.term.name].values
        bound = as_value(canonical_text(literal.value))
        allowed = {v for v in declared if compare_values(as_value(v), literal.relation, bound)}
        return canonical_text(literal.term), frozenset(
            {*declared, None} - allowed if literal.negated else allowed
        )


def _make_conditions(facts: Mapping[str, str]) -> list[Condition]:
    return [(((term, frozenset([value])),),) for term, value in facts.items()]
