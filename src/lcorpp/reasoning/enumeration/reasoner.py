"""The exact reasoner: all possible worlds, enumerated once, with fractions; the reference for any other."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from math import lcm
from types import MappingProxyType
from typing import TypeVar

import numpy as np

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning.enumeration.measures import holds, measure_worlds
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Literal, Query, Term
from lcorpp.reasoning.resolve import resolve_evidence, resolve_interventions, resolve_term
from lcorpp.reasoning.world import World
from lcorpp.values import Distribution

NOTHING: Mapping[str, str] = MappingProxyType({})
"""No evidence, no interventions."""

KEPT = 10_000
"""How many answers a reasoner keeps before it forgets them and begins anew."""

TABLE_CACHE_SIZE = 100
"""How many enumerations, one for each set of interventions, and how many conditioned tables to draw from."""

_Key = TypeVar("_Key")
_Kept = TypeVar("_Kept")


@dataclass(frozen=True, eq=False)
class _Table:
    """Worlds and their weights: the measures over one denominator, so that sums are sums of integers."""

    values: tuple[Mapping[str, str], ...]
    weights: tuple[int, ...]
    total: int

    def where(self, condition: Callable[[Mapping[str, str]], bool]) -> _Table:
        kept = [i for i, values in enumerate(self.values) if condition(values)]
        weights = tuple(self.weights[i] for i in kept)
        return _Table(tuple(self.values[i] for i in kept), weights, sum(weights))


class Enumeration:
    """Answers queries of a program by enumerating its possible worlds; it has the methods of a `Reasoner`.

    Worlds are enumerated when they are first needed, once for each set of interventions. Observations only
    filter them; with cr-rules they can also create worlds, which are then enumerated for each observation.
    Answers are kept, so asking again is cheap.

    Args:
        program: the program.
        limit: the most worlds that are enumerated.

    Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, sections 3 and 4.
    """

    def __init__(self, program: Program, *, limit: int = 200_000) -> None:
        self.program = program
        self.limit = limit
        self._tables: dict[object, _Table] = {}
        self._answers: dict[object, Distribution] = {}
        self._draws: dict[object, tuple[list[float], tuple[Mapping[str, str], ...]]] = {}

    def __reduce__(self) -> tuple[Callable[[Program, int], Enumeration], tuple[Program, int]]:
        return _again, (self.program, self.limit)  # worlds are enumerated anew where it arrives

    def posterior(
        self, attribute: str, evidence: Mapping[str, str], do: Mapping[str, str] = NOTHING
    ) -> Distribution:
        """The marginal of `attribute` given evidence and interventions.

        Args:
            attribute: an attribute or a term of one, such as ``roll(d1)``.
            evidence, do: term -> value.

        Raises:
            ProgramError: the program does not know a name, `attribute` may have no value under the evidence,
                or a world breaks a condition of the language.
            UndefinedError: no possible world has the evidence.
        """
        key = (attribute, frozenset(evidence.items()), frozenset(do.items()))
        answer = self._answers.get(key)
        if answer is None:
            marginal = self.exact(attribute, evidence, do)
            answer = Distribution(tuple(marginal), np.array([float(p) for p in marginal.values()]))
            _keep(self._answers, key, answer, KEPT)
        return answer

    def exact(
        self, attribute: str, evidence: Mapping[str, str], do: Mapping[str, str] = NOTHING
    ) -> dict[str, Fraction]:
        """The same as `posterior`, as fractions by value in the order of the declaration."""
        subject = resolve_term(self.program, attribute)
        table = self._given(resolve_evidence(self.program, evidence), resolve_interventions(self.program, do))
        return self._marginal(subject, table)

    def probability(self, query: Query) -> Fraction:
        """The probability that all literals of a query hold, given its observations and interventions.

        Raises:
            ProgramError: the query is not about this program, or asks for a distribution.
            UndefinedError: no possible world satisfies its observations.
        """
        if query.subject:
            raise ProgramError(
                f"{query.at}: the query asks for a distribution; expected {query.subject}=value"
            )
        table = self._conditioned(query)
        asked = table.where(lambda values: all(holds(literal, values) for literal in query.literals))
        return Fraction(asked.total, table.total)

    def ask(self, query: Query) -> dict[str, Fraction] | Fraction:
        """The distribution that a query asks for, or its probability.

        Raises:
            ProgramError, UndefinedError: as `exact` and `probability`.
        """
        if query.subject is None:
            return self.probability(query)
        return self._marginal(query.subject, self._conditioned(query))

    @property
    def worlds(self) -> tuple[World, ...]:
        """The possible worlds with their probabilities.

        Raises:
            ProgramError: a world breaks a condition of the language, or there are too many.
            UndefinedError: there is none, or all have measure zero.
        """
        table = self._given({}, {})
        pairs = zip(table.values, table.weights, strict=True)
        return tuple(World(values, Fraction(weight, table.total)) for values, weight in pairs)

    def sample(self, rng: np.random.Generator, given: Mapping[str, str] = NOTHING) -> dict[str, str]:
        """Draw one world with its probability given some evidence.

        Returns:
            term -> value.

        Raises:
            ProgramError, UndefinedError: as `exact`.
        """
        key = frozenset(given.items())
        draw = self._draws.get(key)
        if draw is None:
            table = self._given(resolve_evidence(self.program, given), {})
            draw = ([weight / table.total for weight in accumulate(table.weights)], table.values)
            _keep(self._draws, key, draw, TABLE_CACHE_SIZE)
        cumulative, worlds = draw
        return dict(
            worlds[bisect_right(cumulative, rng.random())]
        )  # the last entry is exactly 1, above any draw

    def _marginal(self, subject: Term, table: _Table) -> dict[str, Fraction]:
        name = canonical_text(subject)
        sums = dict.fromkeys(self.program.attributes[subject.name].values, 0)
        undefined = 0
        for values, weight in zip(table.values, table.weights, strict=True):
            value = values.get(name)
            if value is None:
                undefined += weight
            else:
                sums[value] += weight
        if undefined:
            share = Fraction(undefined, table.total)
            raise ProgramError(
                f"{self.program.file}: {name} has no value with probability {share};"
                f" ask for {name}=value instead"
            )
        return {value: Fraction(weight, table.total) for value, weight in sums.items()}

    def _conditioned(self, query: Query) -> _Table:
        try:
            self.program.check_query(query)
        except SourceIssue as issue:
            raise ProgramError(str(issue)) from None
        interventions: dict[str, str] = {}
        for item in query.interventions:
            term, value = canonical_text(item.term), canonical_text(item.value)
            if interventions.setdefault(term, value) != value:
                raise ProgramError(
                    f"{item.at}: do({term}) sets two values, {interventions[term]} and {value}"
                )
        literals = [observation.literal for observation in query.observations]
        table = self._all(interventions, literals)
        return self._possible(
            table.where(lambda values: all(holds(literal, values) for literal in literals)),
            [f"obs({literal})" for literal in literals],
            interventions,
        )

    def _given(self, evidence: Mapping[str, str], do: Mapping[str, str]) -> _Table:
        facts = tuple(evidence.items())
        table = self._all(do, [_observed(term, value) for term, value in facts])
        if facts:
            table = table.where(lambda values: all(values.get(term) == value for term, value in facts))
        return self._possible(table, [f"{term}={value}" for term, value in facts], do)

    def _possible(self, table: _Table, evidence: Iterable[str], do: Mapping[str, str]) -> _Table:
        if table.total > 0:
            return table
        given = ", ".join([*evidence, *(f"do({term}={value})" for term, value in do.items())])
        world = "possible world of positive measure" if table.values else "possible world"
        raise UndefinedError(f"{self.program.file}: no {world}{f' has {given}' if given else ''}")

    def _all(self, do: Mapping[str, str], observed: Sequence[Literal]) -> _Table:
        """The worlds under some interventions, in an order that does not depend on the solver.

        Args:
            observed: what may create worlds; it is left to the caller to keep only those that agree with it.
        """
        creating = tuple(sorted(observed, key=str)) if self.program.has_cr_rules else ()
        key = (frozenset(do.items()), creating)
        if key not in self._tables:
            from lcorpp.reasoning.enumeration.asp_translation import (
                answer_sets,
            )  # here, so that clingo is loaded when needed

            sets = answer_sets(self.program, do, self.limit, creating)
            found = list(measure_worlds(self.program, sets))
            found.sort(key=lambda world: tuple(world[0].items()))
            common = lcm(*{measure.denominator for _, measure in found})
            weights = tuple(measure.numerator * (common // measure.denominator) for _, measure in found)
            table = _Table(tuple(values for values, _ in found), weights, sum(weights))
            _keep(self._tables, key, table, TABLE_CACHE_SIZE)
        return self._tables[key]


def _observed(term: str, value: str) -> Literal:
    """The observation that a term, as text, has a value."""
    found = parse_term(term, "<term>")
    assert isinstance(found, Term)
    return Literal(found, "=", parse_term(value, "<value>"))


def _again(program: Program, limit: int) -> Enumeration:
    return Enumeration(program, limit=limit)


def _keep(memory: dict[_Key, _Kept], key: _Key, value: _Kept, most: int) -> None:
    if len(memory) >= most:
        memory.clear()
    memory[key] = value
