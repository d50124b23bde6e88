"""The reference reasoner: enumerate all possible worlds once, and answer queries with exact fractions."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import accumulate
from math import lcm
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from lcorpp.errors import ProgramError, UndefinedError, check_type
from lcorpp.reasoning.answers import PossibleWorld, Value, normalise_marginal
from lcorpp.reasoning.enumeration.measures import measure_worlds, satisfies
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Literal, Query, Term
from lcorpp.reasoning.resolve import (
    check_rng,
    name_question,
    resolve_evidence,
    resolve_interventions,
    resolve_query,
    resolve_subject,
)
from lcorpp.values import Distribution

NOTHING: Mapping[str, str] = MappingProxyType({})
"""No evidence, no interventions."""

ANSWER_CACHE_SIZE = 10_000
"""A reasoner caches at most this many answers."""

TABLE_CACHE_SIZE = 100
"""A reasoner caches at most this many tables of worlds, and as many tables to sample from."""

_Key = TypeVar("_Key")
_Value = TypeVar("_Value")


@dataclass(frozen=True, eq=False)
class _WorldTable:
    """Worlds with their measures over a common denominator, so that sums are sums of integers.

    values: the worlds, term -> value. weights: the numerators. total: their sum.
    """

    values: tuple[Mapping[str, str], ...]
    weights: tuple[int, ...]
    total: int

    def filter(self, condition: Callable[[Mapping[str, str]], bool]) -> _WorldTable:
        kept = [i for i, values in enumerate(self.values) if condition(values)]
        weights = tuple(self.weights[i] for i in kept)
        return _WorldTable(tuple(self.values[i] for i in kept), weights, sum(weights))


class Enumeration:
    """Answer queries of a program by enumeration of its possible worlds; the methods are those of `Reasoner`.

    Each set of interventions enumerates the worlds once, at the first query. Observations filter the worlds.
    With cr-rules observations can also create worlds, so each set of observations enumerates anew. Answers
    are cached.

    Args:
        program: the program.
        limit: the maximum number of worlds.

    Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, sections 3 and 4.
    """

    def __init__(self, program: Program, *, limit: int = 200_000) -> None:
        check_type(program, Program, "program", ProgramError)
        self.program = program
        self.limit = limit
        self._tables: dict[object, _WorldTable] = {}
        self._answers: dict[object, Distribution] = {}
        self._samplers: dict[object, tuple[list[float], tuple[Mapping[str, str], ...]]] = {}

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
        facts, set_to = resolve_evidence(self.program, evidence), resolve_interventions(self.program, do)
        term = resolve_subject(self.program, attribute)
        key = (term, *map(frozenset, (facts.items(), set_to.items())))
        answer = self._answers.get(key)
        if answer is None:
            marginal = self.exact(term, facts, set_to)
            answer = Distribution(tuple(marginal), np.array([float(p) for p in marginal.values()]))
            _store(self._answers, key, answer, ANSWER_CACHE_SIZE)
        return answer

    def exact(
        self,
        attribute: str | Sequence[str],
        evidence: Mapping[str, str] = NOTHING,
        do: Mapping[str, str] = NOTHING,
    ) -> dict[Value, Fraction]:
        """Compute the same as `posterior`, as fractions by value in the order of the declaration."""
        term = resolve_subject(self.program, attribute)
        facts = resolve_evidence(self.program, evidence)
        return self._compute_marginal(
            term, self._filter_by_evidence(facts, resolve_interventions(self.program, do))
        )

    def probability(self, query: Query) -> Fraction:
        """Compute the probability that all literals of a query are true, given its conditions.

        Raises:
            ProgramError: the query does not fit the program, or asks for a distribution.
            UndefinedError: no possible world satisfies its observations.
        """
        query = resolve_query(self.program, query)
        if query.subjects:
            raise ProgramError(
                f"{query.at}: the query asks for a distribution; expected {query.subjects[0]}=value"
            )
        return self._compute_probability(query)

    def _compute_probability(self, query: Query) -> Fraction:
        table = self._filter_by_query(query)
        true = table.filter(lambda values: all(satisfies(literal, values) for literal in query.literals))
        return Fraction(true.total, table.total)

    def ask(self, query: Query) -> dict[Value, Fraction] | Fraction:
        """Answer a query: value -> probability if it asks for a distribution, otherwise a probability.

        Raises:
            ProgramError, UndefinedError: as `exact` and `probability`.
        """
        query = resolve_query(self.program, query)
        if not query.subjects:
            return self._compute_probability(query)
        return self._compute_marginal(name_question(query), self._filter_by_query(query))

    @property
    def worlds(self) -> tuple[PossibleWorld, ...]:
        """The possible worlds with their probabilities.

        Raises:
            ProgramError: a world breaks a condition of the language, or there are too many worlds.
            UndefinedError: there is no world of positive measure.
        """
        table = self._filter_by_evidence({}, {})
        pairs = zip(table.values, table.weights, strict=True)
        return tuple(PossibleWorld(values, Fraction(weight, table.total)) for values, weight in pairs)

    def sample(self, rng: np.random.Generator, given: Mapping[str, str] = NOTHING) -> dict[str, str]:
        """Draw one world with its probability given evidence.

        Returns:
            term -> value.

        Raises:
            ProgramError, UndefinedError: as `exact`.
        """
        check_rng(rng)
        facts = resolve_evidence(self.program, given)
        key = frozenset(facts.items())
        sampler = self._samplers.get(key)
        if sampler is None:
            table = self._filter_by_evidence(facts, {})
            sampler = ([weight / table.total for weight in accumulate(table.weights)], table.values)
            _store(self._samplers, key, sampler, TABLE_CACHE_SIZE)
        cumulative, worlds = sampler  # the last cumulative probability is exactly 1, above each draw
        return dict(worlds[bisect_right(cumulative, rng.random())])

    def _compute_marginal(self, term: str, table: _WorldTable) -> dict[Value, Fraction]:
        names = term.removeprefix("?").split(", ")
        weights: dict[Value, int] = defaultdict(int)
        for values, weight in zip(table.values, table.weights, strict=True):
            own = tuple(values.get(name, "") for name in names)
            weights[(own if term.startswith("?") else own[0]) if all(own) else ""] += weight
        fractions = {value: Fraction(weight, table.total) for value, weight in weights.items()}
        return normalise_marginal(self.program, term, fractions, "")

    # tables of worlds

    def _filter_by_query(self, query: Query) -> _WorldTable:
        """Return the worlds that satisfy the conditions of a resolved query."""
        interventions = {
            canonical_text(item.term): canonical_text(item.value) for item in query.interventions
        }
        literals = [observation.literal for observation in query.observations]
        table = self._enumerate(interventions, literals)
        return self._check_positive(
            table.filter(lambda values: all(satisfies(literal, values) for literal in literals)),
            [f"obs({literal})" for literal in literals],
            interventions,
        )

    def _filter_by_evidence(self, evidence: Mapping[str, str], do: Mapping[str, str]) -> _WorldTable:
        """Return the worlds that have the evidence."""
        facts = tuple(evidence.items())
        table = self._enumerate(do, [_make_literal(term, value) for term, value in facts])
        if facts:
            table = table.filter(lambda values: all(values.get(term) == value for term, value in facts))
        return self._check_positive(table, [f"{term}={value}" for term, value in facts], do)

    def _check_positive(
        self, table: _WorldTable, evidence: Iterable[str], do: Mapping[str, str]
    ) -> _WorldTable:
        if table.total > 0:
            return table
        conditions = ", ".join([*evidence, *(f"do({term}={value})" for term, value in do.items())])
        world = "possible world of positive measure" if table.values else "possible world"
        raise UndefinedError(f"{self.program.file}: no {world}{f' has {conditions}' if conditions else ''}")

    def _enumerate(self, do: Mapping[str, str], observed: Sequence[Literal]) -> _WorldTable:
        """Enumerate the worlds under interventions, in an order that does not depend on the solver.

        Args:
            observed: literals that may create worlds by cr-rules; the caller filters the worlds.
        """
        creating = tuple(sorted(observed, key=str)) if self.program.has_cr_rules else ()
        key = (frozenset(do.items()), creating)
        if key not in self._tables:
            # here, as it loads clingo
            from lcorpp.reasoning.enumeration.asp_translation import enumerate_answer_sets

            answer_sets = enumerate_answer_sets(self.program, do, self.limit, creating)
            worlds = list(measure_worlds(self.program, answer_sets))
            worlds.sort(key=lambda world: tuple(world[0].items()))
            common = lcm(*{measure.denominator for _, measure in worlds})
            weights = tuple(measure.numerator * (common // measure.denominator) for _, measure in worlds)
            table = _WorldTable(tuple(values for values, _ in worlds), weights, sum(weights))
            _store(self._tables, key, table, TABLE_CACHE_SIZE)
        return self._tables[key]


def _make_literal(term: str, value: str) -> Literal:
    """Parse a term and a value; return the literal term = value."""
    parsed = parse_term(term, "<term>")
    assert isinstance(parsed, Term)
    return Literal(parsed, "=", parse_term(value, "<value>"))


def _store(cache: dict[_Key, _Value], key: _Key, value: _Value, size: int) -> None:
    if len(cache) >= size:
        cache.clear()
    cache[key] = value
