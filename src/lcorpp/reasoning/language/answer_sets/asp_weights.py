"""Weights of rules: the numbers in `&weight`, `&log`, `&problog` and weak constraints, as factors e^w."""

from __future__ import annotations

import ast
import math
import re
from fractions import Fraction

from lcorpp.reasoning.language.translation.mln_reader import MAX_WEIGHT

MAX_LENGTH, MAX_DEPTH, MAX_POWER, MAX_BITS = 200, 20, 100, 2000
"""Maximum length of the text of a weight, depth of its operators, exponent, and bits of a number in it."""

_EXPONENT = re.compile(r"[eE][+-]?0*(\d*)$")


def compute_factor(kind: str, text: str) -> Fraction:
    """Compute the factor by which a rule that is satisfied multiplies the weight of a model.

    Args:
        kind: "weight" for w, "log" for the p of ln p, "problog" for the p of ln(p / (1 - p)).
        text: an arithmetic expression, such as ``2/3`` or ``log(0.3)``.

    Returns:
        e^w; exact for "log" and "problog".

    Raises:
        ValueError: the text is no expression, or its value is not possible.

    Examples:
        >>> from lcorpp.reasoning.language.answer_sets.asp_weights import compute_factor
        >>> compute_factor("problog", "0.1"), compute_factor("log", "0.7/0.3")
        (Fraction(1, 9), Fraction(7, 3))
    """
    value = evaluate_number(text)
    if kind == "weight":
        if abs(value) > MAX_WEIGHT:
            raise ValueError(f"the weight {text}; expected at most {MAX_WEIGHT:g}, or a rule without weight")
        return Fraction(math.exp(value))
    if kind == "problog":
        if not 0 < value < 1:
            raise ValueError(f"the probability {text} is not between 0 and 1")
        return value / (1 - value)
    if value <= 0:
        raise ValueError(f"the logarithm of {text}; expected a positive number")
    weight = math.log(value.numerator) - math.log(value.denominator)
    if abs(weight) > MAX_WEIGHT:
        raise ValueError(f"the weight log({text}); expected at most {MAX_WEIGHT:g}")
    return value


def evaluate_number(text: str) -> Fraction:
    """Evaluate an arithmetic expression of numbers, + - * / ** and log, exp; exact but for the last two.

    Raises:
        ValueError: the text is something else, or has no finite value.
    """
    if len(text) > MAX_LENGTH:
        raise ValueError(f"a number of {len(text)} characters; expected at most {MAX_LENGTH}")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        return _evaluate(tree, text.strip(), 0)
    except ZeroDivisionError:
        raise ValueError(f"{text!r} divides by zero") from None
    except OverflowError:
        raise ValueError(f"{text!r} is too large") from None
    except (SyntaxError, TypeError, RecursionError, MemoryError):
        raise ValueError(f"{text!r}; expected a number, such as 0.3 or 2/3") from None


def _evaluate(node: ast.expr, text: str, depth: int) -> Fraction:
    if depth > MAX_DEPTH:
        raise TypeError
    match node:
        case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
            written = ast.get_source_segment(text, node) or ""
            exponent = _EXPONENT.search(written)
            if exponent is not None and len(exponent[1]) > 3:
                raise OverflowError
            return _check_size(Fraction(written))  # the decimals as they are written
        case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
            value = _evaluate(node.operand, text, depth + 1)
            return -value if isinstance(node.op, ast.USub) else value
        case ast.BinOp():
            left, right = (_evaluate(part, text, depth + 1) for part in (node.left, node.right))
            return _check_size(_combine(node.op, left, right))
        case ast.Call(func=ast.Name(id="log" | "exp" as name), args=[argument], keywords=[]):
            value = _evaluate(argument, text, depth + 1)
            if name == "exp":
                return _check_size(Fraction(math.exp(value)))
            if value <= 0:
                raise ValueError(f"{text!r} has a logarithm of a number that is not positive")
            return Fraction(math.log(value.numerator) - math.log(value.denominator))
    raise TypeError


def _check_size(number: Fraction) -> Fraction:
    if max(number.numerator.bit_length(), number.denominator.bit_length()) > MAX_BITS:
        raise OverflowError
    return number


def _combine(operator: ast.operator, left: Fraction, right: Fraction) -> Fraction:
    match operator:
        case ast.Add():
            return left + right
        case ast.Sub():
            return left - right
        case ast.Mult():
            return left * right
        case ast.Div():
            return left / right
        case ast.Pow() if right.denominator == 1 and abs(right) <= MAX_POWER:
            return left ** int(right)
    raise TypeError
