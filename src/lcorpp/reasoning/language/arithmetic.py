"""Variables, values and arithmetic of expressions.

The numbers of pr-atoms are exact fractions, other numbers 32-bit integers as in ASP, whose division truncates
toward zero. A value is an `int`, or the text of a constant or record: ``3``, ``"red"``, ``"f(1,g(a))"``.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from operator import add, eq, ge, gt, le, lt, mul, ne, sub, truediv
from typing import Any

from lcorpp.reasoning.language.issues import Place, ReasoningWarning, SourceIssue
from lcorpp.reasoning.language.syntax import Arithmetic, Expression, Number, Term, Variable

MAX_INTEGER = 2**31 - 1
"""The largest integer of ASP systems, which compute with 32 bits."""

MAX_ROUNDING = Fraction(1, 10_000)
"""A sum of probabilities may differ by this from 1, as their numbers are rounded: six times 0.16667."""

Value = int | str


def _compute_remainder(left: Any, right: Any) -> Any:
    return left - right * int(left / right)


_OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "+": add, "-": sub, "*": mul, "/": truediv, "mod": _compute_remainder
}  # fmt: skip
"""Operations on fractions, and on integers of 32 bits, whose quotients floats truncate correctly."""

_RELATIONS: dict[str, Callable[[Any, Any], bool]] = {
    "=": eq, "!=": ne, "<": lt, "<=": le, ">": gt, ">=": ge
}  # fmt: skip


def iter_variables(expression: Expression) -> Iterator[Variable]:
    """Iterate over the variables of an expression from left to right, with repetitions."""
    if isinstance(expression, Variable):
        yield expression
    elif isinstance(expression, Arithmetic):
        yield from iter_variables(expression.left)
        yield from iter_variables(expression.right)
    elif isinstance(expression, Term):
        for argument in expression.arguments:
            yield from iter_variables(argument)


def find_variables(*expressions: Expression) -> set[str]:
    """Return the names of the variables of expressions."""
    return {variable.name for expression in expressions for variable in iter_variables(expression)}


def evaluate_number(expression: Expression, bindings: Mapping[str, str]) -> Fraction:
    """Evaluate the number of a pr-atom with exact division.

    Args:
        bindings: variable -> value, as text.

    Raises:
        SourceIssue: a division by zero, or an operand that is not a number.
    """
    if isinstance(expression, Number):
        return expression.value
    if isinstance(expression, Variable):
        value = bindings[expression.name]
        if not is_integer(value):
            raise SourceIssue(expression.at, f"{expression} has the value {value!r}, which is not a number")
        return Fraction(int(value))
    if isinstance(expression, Term):
        raise SourceIssue(expression.at, f"{expression} is not a number")
    left, right = evaluate_number(expression.left, bindings), evaluate_number(expression.right, bindings)
    return Fraction(_apply(expression, left, right))


def _apply(expression: Arithmetic, left: Any, right: Any) -> Any:
    if expression.operator in ("/", "mod") and right == 0:
        raise SourceIssue(expression.at, f"division by zero in {expression}")
    return _OPERATIONS[expression.operator](left, right)


def absorb_rounding(total: Fraction, name: str, at: Place) -> bool:
    """Return whether probabilities whose sum is not 1 should be divided by it, as rounding explains that.

    Warns that they are.

    Args:
        name: what they are the probabilities of.
        at: the place of the first of them.
    """
    if not 0 < abs(total - 1) <= MAX_ROUNDING:
        return False
    words = f"the probabilities of {name} sum to {float(total):.7g}, not 1, and are divided by their sum"
    warnings.warn(f"{at}: {words}", ReasoningWarning, stacklevel=2)
    return True


def canonical_text(expression: Expression) -> str:
    """Evaluate an expression without variables; return its canonical text: ``3``, ``a`` or ``cell(1,2)``.

    Raises:
        SourceIssue: a variable, a fraction, a division by zero or a number beyond 32 bits.
    """
    if isinstance(expression, Variable):
        raise SourceIssue(expression.at, f"variable {expression} is not allowed here; expected a value")
    if isinstance(expression, Term):
        if not expression.arguments:
            return expression.name
        return f"{expression.name}({','.join(map(canonical_text, expression.arguments))})"
    return str(evaluate_integer(expression))


def evaluate_integer(expression: Expression) -> int:
    """Evaluate an expression without variables to an integer.

    Raises:
        SourceIssue: another expression, a division by zero or a number beyond 32 bits.
    """
    if isinstance(expression, Number) and expression.value.denominator == 1:
        value = expression.value.numerator
    elif isinstance(expression, Arithmetic):
        left, right = evaluate_integer(expression.left), evaluate_integer(expression.right)
        value = int(_apply(expression, left, right))
    else:
        raise SourceIssue(expression.at, f"expected an integer, not {expression}")
    if abs(value) > MAX_INTEGER:
        raise SourceIssue(expression.at, f"the number {expression} is beyond 32 bits")
    return value


def divide(dividend: int, divisor: int, operator: str) -> int:
    """Divide integers of 32 bits and return the quotient (operator ``/``) or the remainder (``mod``)."""
    return int(_OPERATIONS[operator](dividend, divisor))


def is_integer(text: str) -> bool:
    """Whether a value, as text, is an integer."""
    return text.removeprefix("-").isdigit()


def as_value(text: str) -> Value:
    """Convert a canonical text to a value."""
    return int(text) if is_integer(text) else text


def split_record(value: str) -> tuple[str, tuple[str, ...]]:
    """Split a record into name and arguments: ``f(1,g(a))`` gives ``("f", ("1", "g(a)"))``."""
    name, bracket, rest = value.partition("(")
    if not bracket or value.startswith("'"):
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


def compare_values(left: Value, relation: str, right: Value) -> bool:
    """Whether a relation holds between values. `<`, `<=`, `>` and `>=` are false unless both are integers.

    The checker rejects an order of other values.
    """
    if relation in ("=", "!=") or (isinstance(left, int) and isinstance(right, int)):
        return _RELATIONS[relation](left, right)
    return False
