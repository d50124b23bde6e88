"""Questions: the terms whose distributions answer a query.

A question has a name: that of a term, `?a, b` for the joint of terms, whose values are tuples, or `?` for the
truth of a formula.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import prod
from typing import Any

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.language.arithmetic import canonical_text, iter_variables
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Arithmetic, Expression, Query, Term

QUERY_TERM = "?"
"""The name of the term that has the value `true` in the worlds in which the formula of a query is true."""

MAX_JOINT_VALUES = 10_000
"""Several attributes in one query have at most this many combinations of values."""


def name_joint(terms: Sequence[Term]) -> str:
    """Return the name of the joint of terms."""
    return QUERY_TERM + ", ".join(map(canonical_text, terms))


def name_question(terms: Sequence[Term]) -> str:
    """Return the name of the question for the subjects of a query: one term, several, or none."""
    return canonical_text(terms[0]) if len(terms) == 1 else name_joint(terms)


def is_joint(question: str) -> bool:
    """Whether the question is the joint of terms."""
    return question.startswith(QUERY_TERM) and question != QUERY_TERM


def list_terms(question: str) -> list[str]:
    """List the terms of a question."""
    return question.removeprefix(QUERY_TERM).split(", ")


def list_question_terms(question: str) -> list[str]:
    """List the terms of a question: those of a joint, or itself; none of ""."""
    if is_joint(question):
        return list_terms(question)
    return [question] if question else []


def list_values(program: Program, question: str) -> tuple[Any, ...]:
    """List the values of a term, or of a joint.

    Raises:
        TooLargeError: a joint has more than `MAX_JOINT_VALUES`.
    """
    ranges = [program.signature.find_attribute(term).values for term in list_terms(question)]
    if not is_joint(question):
        return ranges[0]
    size = prod(map(len, ranges))
    if size > MAX_JOINT_VALUES:
        raise TooLargeError(
            f"{program.file}: {question[1:]} together have {size} values; expected at most {MAX_JOINT_VALUES}"
        )
    return tuple(product(*ranges))


def list_questions(query: Query) -> list[str]:
    """List the questions that answer a query."""
    if query.expression is None:
        return [name_question(query.subjects)] if query.formula or query.subjects else []
    return [question for _, _, names, question in list_summands(query) if names]


def list_summands(query: Query) -> Iterator[tuple[int, Expression, list[str], str]]:
    """Split the expression of a query into summands.

    Yields:
        The sign of a summand, the summand, its variables, and the question for their values.
    """
    assert query.expression
    names = dict.fromkeys(variable.name for variable in iter_variables(query.expression))
    subjects = dict(zip(names, query.subjects, strict=True))
    for sign, summand in _split_sum(query.expression, 1):
        own = list(dict.fromkeys(variable.name for variable in iter_variables(summand)))
        yield sign, summand, own, name_question([subjects[name] for name in own])


def _split_sum(expression: Expression, sign: int) -> Iterator[tuple[int, Expression]]:
    if isinstance(expression, Arithmetic) and expression.operator in ("+", "-"):
        yield from _split_sum(expression.left, sign)
        yield from _split_sum(expression.right, sign if expression.operator == "+" else -sign)
    else:
        yield sign, expression


def get_interventions(query: Query) -> dict[str, str]:
    """Return the interventions of a query: term -> value."""
    return {canonical_text(item.term): canonical_text(item.value) for item in query.interventions}
