"""Values of expressions: exact for probabilities, as ASP computes for everything else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.syntax import Arithmetic, Expression, Number, Term, Variable

MAX_INTEGER = 2**31 - 1
"""ASP computes with 32 bits; nothing here may leave them, so that nothing wraps around."""


def iter_variables(expression: Expression) -> Iterator[Variable]:
    """The variables of an expression from left to right, each as often as it occurs."""
    if isinstance(expression, Variable):
        yield expression
    elif isinstance(expression, Arithmetic):
        yield from iter_variables(expression.left)
        yield from iter_variables(expression.right)
    elif isinstance(expression, Term):
        for argument in expression.arguments:
            yield from iter_variables(argument)


def evaluate_number(expression: Expression, bindings: Mapping[str, str]) -> Fraction:
    """The value of the number of a pr-atom; division is exact.

    Args:
        bindings: the value of each variable in it, as text.

    Raises:
        SourceIssue: a division by zero, or something that is not a number.
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
    """The value of an expression in an atom, as canonical text: ``3``, ``a`` or ``cell(1,2)``.

    Raises:
        SourceIssue: a variable, a fraction, a division by zero or a number beyond 32 bits.
    """
    if isinstance(expression, Variable):
        raise SourceIssue(expression.at, f"variable {expression} is not allowed here; expected a value")
    if isinstance(expression, Term):
        arguments = ",".join(map(canonical_text, expression.arguments))
        return f"{expression.name}({arguments})" if arguments else expression.name
    return str(_integer(expression))


def _integer(expression: Expression) -> int:
    if isinstance(expression, Number):
        if expression.value.denominator != 1:
            raise SourceIssue(expression.at, f"expected an integer, not {expression}")
        value = expression.value.numerator
    elif isinstance(expression, Arithmetic):
        left, right = _integer(expression.left), _integer(expression.right)
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
    """Whether the text of a value is that of an integer."""
    return text.removeprefix("-").isdigit()


def compare(left: str, relation: str, right: str) -> bool:
    """Whether the relation holds between two values; order is that of integers, false elsewhere."""
    if relation == "=":
        return left == right
    if relation == "!=":
        return left != right
    if not (is_integer(left) and is_integer(right)):
        return False
    a, b = int(left), int(right)
    return {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b}[relation]
