"""Answers: marginals, possible worlds, and the errors of questions without an answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from heapq import nsmallest
from operator import mul, truediv
from typing import TYPE_CHECKING, Any

from lcorpp.errors import NoValueError, ProgramError, UndefinedError
from lcorpp.notebook import html_table
from lcorpp.reasoning.language.arithmetic import evaluate_number
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.questions import QUERY_TERM, list_questions, list_summands, list_terms, list_values

if TYPE_CHECKING:
    from lcorpp.values import Label

Numeric = Fraction | float

Value = Any
"""A value of an attribute as text; of the joint of several attributes a tuple with one for each."""

QueryAnswer = dict[Value, Numeric] | Numeric
"""The distribution of an attribute or several, value -> probability; or a probability or expectation."""

MAX_SHOWN_TERMS = 8
"""The `repr` of a world shows at most this many terms."""


@dataclass(frozen=True, eq=False)
class PossibleWorld:
    """A possible world of a program.

    values: term -> value, for the terms that have a value.
    measure: its probability, given the evidence and interventions for which it was computed.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> die = parse_plog("sides = {1..6}. roll : sides. random(roll). pr(roll=6) = 1/2.")
        >>> (world,) = Reasoner(die).most_probable()
        >>> world.values["roll"], str(world.measure)
        ('6', '1/2')
    """

    values: Mapping[str, str]
    measure: Fraction

    def __repr__(self) -> str:
        shown = dict(list(self.values.items())[:MAX_SHOWN_TERMS])
        n_hidden = len(self.values) - len(shown)
        more = f" and {n_hidden} more" if n_hidden else ""
        return f"PossibleWorld({self.measure}: {format_world(shown)}{more})"

    def _repr_html_(self) -> str:
        return html_table(
            ("term", "value"), self.values.items(), caption=f"World of probability {self.measure}"
        )


def format_world(values: Mapping[str, str]) -> str:
    """Format the terms and values of a world: ``{prize=1, selected=2}``."""
    return f"{{{', '.join(f'{term}={value}' for term, value in values.items())}}}"


def normalise_marginal(
    program: Program,
    term: str,
    weights: Mapping[Value, Any],
    conditions: str,
    divide: Callable[[Any, Any], Any] = truediv,
) -> dict[Value, Any]:
    """Return the distribution of a question: value -> probability in the order of the declaration.

    That of `QUERY_TERM` has the value "true" alone.

    Args:
        weights: value -> weight; "" is the weight of having no value.
        conditions: the conditions of the question as text, for the error.
        divide: makes the probability from a weight and the sum of all weights.

    Raises:
        UndefinedError: all weights are 0.
        NoValueError: the term may have no value.
    """
    total = sum(weights.values())
    if not total:
        raise make_no_world_error(program, conditions)
    if weights.get("") and term != QUERY_TERM:
        raise make_no_value_error(program, term, divide(weights[""], total))
    values = ("true",) if term == QUERY_TERM else list_values(program, term)
    return {value: divide(weights.get(value, 0 * total), total) for value in values}


def answer_query(
    program: Program,
    query: Query,
    weigh: Callable[[str], Mapping[Value, Any]],
    divide: Callable[[Any, Any], Any] = truediv,
) -> QueryAnswer:
    """Answer a query.

    Args:
        query: resolved by `resolve_query`.
        weigh: returns the weights of the values of a term or joint, or those of "true" for `QUERY_TERM`.
        divide: as in `normalise_marginal`.

    Raises:
        ProgramError, UndefinedError: as `normalise_marginal`; or the number has no value.
    """
    conditions = f" has {', '.join(query.conditions)}" if query.conditions else ""

    def find_marginal(question: str) -> dict[Value, Any]:
        return normalise_marginal(program, question, weigh(question), conditions, divide)

    if query.expression:
        return compute_expectation(query, find_marginal)
    (question,) = list_questions(query)
    marginal = find_marginal(question)
    return marginal if query.subjects else marginal["true"]


def compute_expectation(query: Query, find_marginal: Callable[[str], Mapping[Value, Numeric]]) -> Numeric:
    """Compute the expectation of the expression of a query; that of a sum is the sum of expectations.

    Args:
        find_marginal: returns the distribution of a question.

    Raises:
        ProgramError: the expression divides by zero in a world of positive measure.
    """
    means: list[Numeric] = []
    for sign, summand, names, question in list_summands(query):
        numbers: list[Fraction] = []
        shares: list[Numeric] = []
        marginal = find_marginal(question) if names else {(): Fraction(1)}
        for value, share in marginal.items():
            bindings = dict(zip(names, (value,) if isinstance(value, str) else value, strict=True))
            try:
                numbers.append(sign * evaluate_number(summand, bindings))
                shares.append(share)
            except SourceIssue as issue:
                if share:
                    raise ProgramError(f"{issue}, where {format_world(bindings)}") from None
        estimate = getattr(shares[0], "estimate_mean", None)
        means.append(estimate(numbers, shares) if estimate else sum(map(mul, numbers, shares)))
    return sum(means[1:], means[0])


def rank_values(question: str, marginal: Mapping[Value, Fraction], count: int) -> tuple[PossibleWorld, ...]:
    """Return the most probable values of a joint, best first, without those of probability 0."""
    positive = [(value, p) for value, p in marginal.items() if p]
    best = nsmallest(count, positive, key=lambda pair: -pair[1])
    terms = list_terms(question)
    return tuple([PossibleWorld(dict(zip(terms, value, strict=True)), p) for value, p in best])


def format_conditions(facts: Mapping[str, Label], do: Mapping[str, str]) -> str:
    """Format evidence and interventions as the end of the message of `make_no_world_error`."""
    parts = [f"{term}={value}" for term, value in facts.items()]
    parts += [f"do({term}={value})" for term, value in do.items()]
    return f" has {', '.join(parts)}" if parts else ""


def make_no_world_error(program: Program, conditions: str) -> UndefinedError:
    """Make the error for evidence of probability zero."""
    return UndefinedError(f"{program.file}: no possible world of positive measure{conditions}")


def make_no_value_error(program: Program, term: str, probability: object, where: str = "") -> NoValueError:
    """Make the error for a term that may have no value, so that its distribution does not sum to 1.

    Args:
        probability: that the term has no value.
        where: the row of a batch, at the beginning of the message.
    """
    return NoValueError(
        f"{program.file}: {where}{term.removeprefix('?')} has no value with probability {probability};"
        f" ask for {term.removeprefix('?').replace(', ', '=value, ')}=value instead"
    )
