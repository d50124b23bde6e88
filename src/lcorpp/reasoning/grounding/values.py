"""Values as the grounder handles them: integers as such, constants and records as text."""

from __future__ import annotations

from collections.abc import Callable
from operator import ge, gt, le, lt

from lcorpp.reasoning.language.arithmetic import canonical_text, is_integer, iter_variables
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.syntax import Arithmetic, Expression, Literal, Place, Term, Variable

Value = int | str
"""A value: integers as such, constants and records as text."""


def value_of(text: str) -> Value:
    """The value that a canonical text stands for."""
    return int(text) if is_integer(text) else text


def holds(left: Value, relation: str, right: Value) -> bool:
    """Whether a relation holds between two values; order is that of integers, false elsewhere."""
    if relation == "=":
        return left == right
    if relation == "!=":
        return left != right
    if isinstance(left, str) or isinstance(right, str):
        return False
    return _ORDER[relation](left, right)


_ORDER: dict[str, Callable[[int, int], bool]] = {"<": lt, "<=": le, ">": gt, ">=": ge}


def divide(over: int, under: int, operator: str, at: Place) -> int:
    """Division and remainder of integers, toward zero as in ASP.

    Raises:
        SourceIssue: a division by zero.
    """
    if under == 0:
        raise SourceIssue(at, "cannot be grounded: division by zero")
    quotient = abs(over) // abs(under) * (-1 if (over < 0) != (under < 0) else 1)
    return quotient if operator == "/" else over - under * quotient


def split(value: str) -> tuple[str, tuple[str, ...]]:
    """The name and the arguments of a record, ``f(1,g(a))`` to ``("f", ("1", "g(a)"))``."""
    name, bracket, rest = value.partition("(")
    if not bracket:
        return value, ()
    found, depth, begin = [], 0, 0
    for end, letter in enumerate(rest):
        if letter == "(":
            depth += 1
        elif letter == ")" and depth:
            depth -= 1
        elif letter in ",)" and not depth:
            found.append(rest[begin:end])
            begin = end + 1
    return name, tuple(found)


def matches(pattern: Expression, value: Value, seen: dict[str, Value]) -> bool:
    """Whether a value has the shape of a record with variables; `seen` gathers their values.

    Arithmetic in the pattern is not matched; whoever asks tests it once the variables have values.
    """
    if isinstance(pattern, Variable):
        return seen.setdefault(pattern.name, value) == value
    if isinstance(pattern, Term) and pattern.arguments:
        if isinstance(value, int):
            return False
        name, arguments = split(value)
        return (
            name == pattern.name
            and len(arguments) == len(pattern.arguments)
            and all(matches(p, value_of(a), seen) for p, a in zip(pattern.arguments, arguments, strict=True))
        )
    return isinstance(pattern, Arithmetic) or value_of(canonical_text(pattern)) == value


def names_of(expression: Expression) -> set[str]:
    """The variables of an expression."""
    return {variable.name for variable in iter_variables(expression)}


def plain_names(literal: Literal) -> set[str]:
    """The variables that stand by themselves: matching a fact gives them."""
    return {part.name for part in (*literal.term.arguments, literal.value) if isinstance(part, Variable)}


def computed(literal: Literal) -> set[str]:
    """The variables under arithmetic or in records: matching a fact cannot give them."""
    parts = (*literal.term.arguments, literal.value)
    return {name for part in parts if not isinstance(part, Variable) for name in names_of(part)}


def nested(term: Term) -> set[str]:
    """The variables under arithmetic in a record: matching cannot give them."""
    found: set[str] = set()
    for part in term.arguments:
        if isinstance(part, Arithmetic):
            found |= names_of(part)
        elif isinstance(part, Term):
            found |= nested(part)
    return found


def matched(term: Term) -> set[str]:
    """The variables that matching a record gives."""
    found: set[str] = set()
    for part in term.arguments:
        if isinstance(part, Variable):
            found.add(part.name)
        elif isinstance(part, Term):
            found |= matched(part)
    return found
