"""Evaluation of expressions: exact fractions for probabilities, 32-bit integers as in ASP elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.syntax import Arithmetic, Expression, Number, Term, Variable

MAX_INTEGER = 2**31 - 1
"""The largest integer of ASP systems, which compute with 32 bits."""


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
    match expression.operator:
        case "+":
            return left + right
        case "-":
            return left - right
        case "*":
            return left * right
    if right == 0:
        raise SourceIssue(expression.at, f"division by zero in {expression}")
    return left / right if expression.operator == "/" else left - right * int(left / right)


def canonical_text(expression: Expression) -> str:
    """Evaluate an expression without variables; return its canonical text: ``3``, ``a`` or ``cell(1,2)``.

    Raises:
        SourceIssue: a variable, a fraction, a division by zero or a number beyond 32 bits.
    """
    if isinstance(expression, Variable):
        raise SourceIssue(expression.at, f"variable {expression} is not allowed here; expected a value")
    if isinstance(expression, Term):
        arguments = ",".join(map(canonical_text, expression.arguments))
        return f"{expression.name}({arguments})" if arguments else expression.name
    return str(_evaluate_integer(expression))


def _evaluate_integer(expression: Expression) -> int:
    if isinstance(expression, Number):
        if expression.value.denominator != 1:
            raise SourceIssue(expression.at, f"expected an integer, not {expression}")
        value = expression.value.numerator
    elif isinstance(expression, Arithmetic):
        left, right = _evaluate_integer(expression.left), _evaluate_integer(expression.right)
        if expression.operator in ("/", "mod") and right == 0:
            raise SourceIssue(expression.at, f"division by zero in {expression}")
        quotient = abs(left) // abs(right) * (-1 if (left < 0) != (right < 0) else 1) if right else 0
        value = {
            "+": left + right,
            "-": left - right,
            "*": left * right,
            "/": quotient,
            "mod": left - right * quotient,
        }[expression.operator]
    else:
        raise SourceIssue(expression.at, f"expected an integer, not {expression}")
    if abs(value) > MAX_INTEGER:
        raise SourceIssue(expression.at, f"the number {expression} is beyond 32 bits")
    return value


def is_integer(text: str) -> bool:
    """Whether a value, as text, is an integer."""
    return text.removeprefix("-").isdigit()


def compare(left: str, relation: str, right: str) -> bool:
    """Whether the relation holds between two values. Order relations are false unless both are integers."""
    if relation == "=":
        return left == right
    if relation == "!=":
        return left != right
    if not (is_integer(left) and is_integer(right)):
        return False
    a, b = int(left), int(right)
    return {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b}[relation]
