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
from typing import TYPE_CHECKING

from lcorpp.errors import ProgramError, check_type
from lcorpp.reasoning.answers import PossibleWorld, QueryAnswer, Value, make_no_world_error
from lcorpp.reasoning.inference import Facts, Inference, Worlds
from lcorpp.reasoning.language.arithmetic import as_value, canonical_text, compare_values
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Formula, Intervention, Literal, Observation, Query, Statement
from lcorpp.reasoning.questions import QUERY_TERM, is_joint, list_terms
from lcorpp.reasoning.resolve import check_at_least, make_query

if TYPE_CHECKING:
    import numpy as np


Condition = Sequence[Sequence[tuple[str, frozenset[str | None]]]]
"""A disjunction of conjunctions of a term and the values with which it meets them; None is for no value."""

TABLE_CACHE_SIZE = 100
"""A reasoner caches at most this many tables of worlds."""


@dataclass(frozen=True, eq=False)
class _WorldTable:
    """Worlds with their measures over a common denominator, so that sums are sums of integers.

    values: the worlds, term -> value. weights: the numerators.
    """

    values: Sequence[Mapping[str, str]]
    weights: Sequence[int]

    @cached_property
    def cumulative(self) -> list[int]:
        return list(accumulate(self.weights))

    @property
    def total(self) -> int:
        return self.cumulative[-1] if self.weights else 0

    def filter(self, conditions: Iterable[Condition]) -> _WorldTable:
        """Return the worlds that satisfy all conditions."""
        conditions = list(conditions)
        pairs = zip(self.values, self.weights, strict=True)
        kept = [(values, weight) for values, weight in pairs if all(_is_met(c, values) for c in conditions)]
        return _WorldTable([values for values, _ in kept], [weight for _, weight in kept])

    def list_worlds(self, numbers: Iterable[int]) -> tuple[PossibleWorld, ...]:
        """List some worlds with their probabilities."""
        return tuple([PossibleWorld(self.values[i], Fraction(self.weights[i], self.total)) for i in numbers])


class EnumeratedWorlds(Worlds):
    """The worlds that satisfy the conditions of a query.

    Args:
        select: returns the table of those that have some facts.
        formula: the formula of the query.
    """

    def __init__(self, select: Callable[[Facts], _WorldTable], formula: Condition) -> None:
        self._select, self._formula = select, formula

    def compute_exact_weights(self, question: str, facts: Facts) -> dict[Value, Fraction]:
        table, names = self._select(facts), list_terms(question)
        sums: dict[Value, int] = {}
        for values, weight in zip(table.values, table.weights, strict=True):
            if question == QUERY_TERM:
                value: Value = "true" if _is_met(self._formula, values) else ""
            else:
                own = tuple([values.get(name, "") for name in names])
                value = "" if "" in own else own if is_joint(question) else own[0]
            sums[value] = sums.get(value, 0) + weight
        return {value: Fraction(weight) for value, weight in sums.items()}

    def compute_float_weights(self, question: str, facts: Facts) -> dict[Value, float]:
        weights = self.compute_exact_weights(question, facts)
        total = sum(weights.values())
        return {value: float(weight / total) for value, weight in weights.items() if total}

    def most_probable(self, facts: Facts, count: int) -> tuple[PossibleWorld, ...]:
        table = self._select(facts)
        positive = [i for i, weight in enumerate(table.weights) if weight]
        return table.list_worlds(nsmallest(count, positive, key=lambda i: -table.weights[i]))

    def sample(self, count: int, rng: np.random.Generator, facts: Facts) -> list[dict[str, str]] | None:
        table = self._select(facts)
        if not table.total:
            return None
        numbers = [Fraction(number) * table.total for number in rng.random(count).tolist()]
        return [dict(table.values[bisect_right(table.cumulative, number)]) for number in numbers]

    def count(self) -> int:
        return len(self._select({}).values)


class Enumeration(Inference):
    """Answer queries of a program by enumeration of its possible worlds.

    The methods are those of `Reasoner`; evidence consists of values, not likelihoods.

    Each set of interventions enumerates the worlds once, at the first query. Observations filter the worlds.
    With cr-rules observations can also create worlds, so each set of observations enumerates anew.

    Args:
        program: the program.
        limit: the maximum number of worlds; methods raise a `TooLargeError` if there are more.

    Raises:
        ProgramError: `limit` is not positive.

    Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, sections 3 and 4.

    Examples:
        >>> from lcorpp import Enumeration, parse_plog
        >>> die = parse_plog("sides = {1..6}. roll : sides. random(roll). high : boolean. high :- roll > 4.")
        >>> str(Enumeration(die).exact("roll", {"high": "true"})["6"])
        '1/2'
    """

    def __init__(self, program: Program, *, limit: int = 200_000) -> None:
        check_type(program, Program, "program", ProgramError)
        check_at_least(limit, 1, "limit")
        self.program, self.limit = program, limit
        self._tables: dict[object, _WorldTable] = {}

    def __reduce__(self) -> tuple[Callable[[Program], Enumeration], tuple[Program]]:
        return partial(Enumeration, limit=self.limit), (self.program,)  # without the caches

    def __repr__(self) -> str:
        return f"Enumeration({self.program.file}, limit={self.limit})"

    def find_worlds(self, query: Query, terms: tuple[str, ...] = ()) -> EnumeratedWorlds:
        """Find the worlds that satisfy the conditions of a resolved query, see `Inference`."""

        def select(facts: Facts) -> _WorldTable:
            given = make_query(self.program, "", facts, {}).observations
            return self._select((*query.observations, *given), query.interventions)

        return EnumeratedWorlds(select, self._make_condition(query.formula))

    def ask(self, query: Query, *, exact: bool = True) -> QueryAnswer:
        """Answer a query, see `Inference.ask`; in fractions by default."""
        return super().ask(query, exact=exact)

    @property
    def worlds(self) -> tuple[PossibleWorld, ...]:
        """The possible worlds with their probabilities.

        Raises:
            ProgramError: a world breaks a condition of the language, or there are too many worlds.
            UndefinedError: there is no world of positive measure.
        """
        table = self._select((), {})
        if not table.total:
            raise make_no_world_error(self.program, "")
        return table.list_worlds(range(len(table.values)))

    def _select(
        self, observations: Iterable[Observation], interventions: Iterable[Intervention]
    ) -> _WorldTable:
        """Return the worlds that satisfy conditions, in an order that does not depend on the solver."""
        key = frozenset(observations), frozenset(interventions)
        table = self._tables.get(key)
        if table is None:
            if key[0] and not self.program.has_cr_rules:
                conditions = [self._make_condition(observation.formula) for observation in key[0]]
                table = self._select((), key[1]).filter(conditions)
            else:
                table = self._enumerate(sorted([*key[0], *key[1]], key=str))
            if len(self._tables) >= TABLE_CACHE_SIZE:
                self._tables.clear()
            self._tables[key] = table
        return table

    def _enumerate(self, conditions: Iterable[Statement]) -> _WorldTable:
        from lcorpp.reasoning.enumeration.worlds import enumerate_worlds  # here, as it loads clingo

        program = self.program.with_statements((*self.program.statements, *conditions))
        worlds = sorted(enumerate_worlds(program, self.limit), key=lambda world: [*world[0].items()])
        common = lcm(*[measure.denominator for _, measure in worlds])
        weights = [measure.numerator * (common // measure.denominator) for _, measure in worlds]
        return _WorldTable([values for values, _ in worlds], weights)

    def _make_condition(self, formula: Formula) -> Condition:
        return [[self._find_allowed(literal) for literal in case] for case in formula]

    def _find_allowed(self, literal: Literal) -> tuple[str, frozenset[str | None]]:
        """Find the values with which a term satisfies a literal; with no value, only `not` makes it true."""
        declared = self.program.attributes[literal.term.name].values
        bound = as_value(canonical_text(literal.value))
        allowed = {v for v in declared if compare_values(as_value(v), literal.relation, bound)}
        return canonical_text(literal.term), frozenset(
            {*declared, None} - allowed if literal.negated else allowed
        )


def _is_met(condition: Condition, values: Mapping[str, str]) -> bool:
    return any(all(values.get(term) in allowed for term, allowed in case) for case in condition)
