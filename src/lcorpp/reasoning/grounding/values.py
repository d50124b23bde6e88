"""Values during grounding, and the matching of patterns with variables against them.

Integers are `int`, constants and records are text: ``3``, ``"red"``, ``"f(1,g(a))"``.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import ge, gt, le, lt

from lcorpp.reasoning.language.arithmetic import canonical_text, is_integer, iter_variables
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.syntax import Arithmetic, Expression, Literal, Term, Variable

Value = int | str


def parse_value(text: str) -> Value:
    """Convert a canonical text to a value."""
    return int(text) if is_integer(text) else text


def compare_values(left: Value, relation: str, right: Value) -> bool:
    """Compare two values; `<`, `<=`, `>` and `>=` are true for integers only."""
    if relation == "=":
        return left == right
    if relation == "!=":
        return left != right
    if isinstance(left, str) or isinstance(right, str):
        return False
    return _ORDER[relation](left, right)


_ORDER: dict[str, Callable[[int, int], bool]] = {"<": lt, "<=": le, ">": gt, ">=": ge}


def divide(dividend: int, divisor: int, operator: str, at: Place) -> int:
    """Divide integers, rounding toward zero as ASP does; any operator but ``/`` returns the remainder.

    Raises:
        SourceIssue: the divisor is zero.
    """
    if divisor == 0:
        raise SourceIssue(at, "cannot be grounded: division by zero")
    quotient = abs(dividend) // abs(divisor) * (-1 if (dividend < 0) != (divisor < 0) else 1)
    return quotient if operator == "/" else dividend - divisor * quotient


def split_record(value: str) -> tuple[str, tuple[str, ...]]:
    """Split a record into name and arguments: ``f(1,g(a))`` gives ``("f", ("1", "g(a)"))``."""
    name, bracket, rest = value.partition("(")
    if not bracket:
        return value, ()
    arguments, depth, begin = [], 0, 0
    for end, letter in enumerate(rest):
        if letter == "(":
            depth += 1
        elif letter == ")" and depth:
            depth -= 1
        elif letter in ",)" and not depth:
            arguments.append(rest[begin:end])
            begin = end + 1
    return name, tuple(arguments)


def match(pattern: Expression, value: Value, bindings: dict[str, Value]) -> bool:
    """Match a value with a record that contains variables, and add the variables' values to `bindings`.

    Arithmetic in the pattern matches every value; the caller tests it once its variables are bound.
    """
    if isinstance(pattern, Variable):
        return bindings.setdefault(pattern.name, value) == value
    if isinstance(pattern, Term) and pattern.arguments:
        if isinstance(value, int):
            return False
        name, arguments = split_record(value)
        return (
            name == pattern.name
            and len(arguments) == len(pattern.arguments)
            and all(
                match(p, parse_value(a), bindings) for p, a in zip(pattern.arguments, arguments, strict=True)
            )
        )
    return isinstance(pattern, Arithmetic) or parse_value(canonical_text(pattern)) == value


# the variables of patterns


def find_variables(expression: Expression) -> set[str]:
    """Return the variables of an expression."""
    return {variable.name for variable in iter_variables(expression)}


def find_bare_variables(literal: Literal) -> set[str]:
    """Return the arguments and the value that are plain variables: matching a fact binds them."""
    return {part.name for part in (*literal.term.arguments, literal.value) if isinstance(part, Variable)}


def find_inner_variables(literal: Literal) -> set[str]:
    """Return the variables in arithmetic and records: matching a fact does not bind them."""
    parts = (*literal.term.arguments, literal.value)
    return {name for part in parts if not isinstance(part, Variable) for name in find_variables(part)}


def find_arithmetic_variables(record: Term) -> set[str]:
    """Return the variables in arithmetic in a record: matching the record does not bind them."""
    names: set[str] = set()
    for part in record.arguments:
        if isinstance(part, Arithmetic):
            names |= find_variables(part)
        elif isinstance(part, Term):
            names |= find_arithmetic_variables(part)
    return names


def find_matched_variables(record: Term) -> set[str]:
    """Return the variables that matching a record binds."""
    names: set[str] = set()
    for part in record.arguments:
        if isinstance(part, Variable):
            names.add(part.name)
        elif isinstance(part, Term):
            names |= find_matched_variables(part)
    return names
