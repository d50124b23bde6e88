"""Arithmetic of ProbLog, whose operators differ from those of P-log that look alike.

`/` is exact division and gives a floating-point number for integers, too, `//` rounds down, `mod`, `rem` and
`div` agree with it: the remainder has the sign of the divisor. Numbers are Python's, as in ProbLog.

Source: ProbLog 2.3, measured.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable
from fractions import Fraction
from typing import Any

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.translation.prolog_terms import (
    Compound,
    PrologTerm,
    PrologVariable,
    Real,
    abbreviate,
    unquote,
)

MAX_BITS = 10_000
"""Maximal size of an integer."""


def _power(base: Any, exponent: Any) -> Any:
    if not (isinstance(base, float) or isinstance(exponent, float)) and (
        (base.numerator.bit_length() + base.denominator.bit_length()) * abs(exponent) > MAX_BITS
    ):
        raise OverflowError
    return base**exponent


def _shift(number: int, places: int) -> int:
    if places > MAX_BITS:
        raise OverflowError
    return number << places


_FUNCTIONS: dict[tuple[str, int], Callable[..., Any]] = {
    ("+", 2): operator.add,
    ("-", 2): operator.sub,
    ("*", 2): operator.mul,
    ("/", 2): operator.truediv,
    ("//", 2): operator.floordiv,
    ("mod", 2): operator.mod,
    ("rem", 2): operator.mod,
    ("div", 2): lambda x, y: (x - x % y) // y,
    ("**", 2): _power,
    ("^", 2): _power,
    ("min", 2): min,
    ("max", 2): max,
    ("+", 1): operator.pos,
    ("-", 1): operator.neg,
    ("abs", 1): abs,
    ("sign", 1): lambda x: (x > 0) - (x < 0),
    ("truncate", 1): math.trunc,
    ("integer", 1): int,
    ("float", 1): float,
    ("float_integer_part", 1): int,
    ("float_fractional_part", 1): lambda x: x - int(x),
    ("round", 1): round,
    ("floor", 1): math.floor,
    ("ceiling", 1): math.ceil,
    ("/\\", 2): operator.and_,
    ("\\/", 2): operator.or_,
    ("xor", 2): operator.xor,
    ("#", 2): operator.xor,
    ("><", 2): operator.xor,
    ("<<", 2): _shift,
    (">>", 2): operator.rshift,
    ("\\", 1): operator.invert,
    ("atan", 2): math.atan2,
    ("atan2", 2): math.atan2,
    ("exp", 2): math.pow,
    ("pi", 0): lambda: math.pi,
    ("e", 0): lambda: math.e,
    ("inf", 0): lambda: math.inf,
    ("nan", 0): lambda: math.nan,
    ("epsilon", 0): lambda: sys.float_info.epsilon,
    **{
        (name, 1): getattr(math, name)
        for name in (
            "sqrt", "exp", "log", "log10", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh",
            "tanh", "asinh", "acosh", "atanh", "lgamma", "gamma", "erf", "erfc",
        )
    },
}  # fmt: skip

COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "=:=": operator.eq, "=\\=": operator.ne, "<": operator.lt, "=<": operator.le, ">": operator.gt,
    ">=": operator.ge,
}  # fmt: skip
"""The relations that compute both sides."""


def is_function(term: Compound) -> bool:
    """Whether a term calls an arithmetic function."""
    return (unquote(term.name), len(term.arguments)) in _FUNCTIONS


def compute(term: PrologTerm, at: Place) -> int | float:
    """Compute an arithmetic expression as ProbLog does.

    Raises:
        SourceIssue: a variable, an unknown function, a division by zero, or another undefined value.
    """
    value: int | float = _evaluate(term, at, float)
    return value


def compute_probability(term: PrologTerm, at: Place) -> Fraction:
    """Compute a probability: decimal numbers and their quotients are exact.

    Raises:
        SourceIssue: as `compute`, or the result is not between 0 and 1.
    """
    value = _evaluate(term, at, lambda real: Fraction(repr(real)) if real.exact is None else real.exact)
    if isinstance(value, float) and math.isfinite(value):
        value = Fraction(repr(value))
    if isinstance(value, float) or not 0 <= value <= 1:
        raise SourceIssue(at, f"the probability {abbreviate(term)} is not between 0 and 1")
    return Fraction(value)


def make_number(value: int | float) -> int | Real:
    """Make a term of a computed number."""
    return value if isinstance(value, int) else Real(value)


def _evaluate(term: PrologTerm, at: Place, convert: Callable[[Real], Any]) -> Any:
    """Evaluate an expression, with a conversion of its decimal numbers; integers become fractions, too."""
    if isinstance(term, int):
        return term if convert is float else Fraction(term)
    if isinstance(term, Real):
        return convert(term) if math.isfinite(term) else float(term)
    if isinstance(term, PrologVariable):
        raise SourceIssue(at, f"arithmetic with the variable {term}, which has no value here")
    function = _FUNCTIONS.get((unquote(term.name), len(term.arguments)))
    if function is None:
        kind = f"{term.name}/{len(term.arguments)} is not an arithmetic function of ProbLog"
        raise SourceIssue(at, kind if term.arguments else f"{abbreviate(term)} is not a number")
    arguments = [_evaluate(argument, at, convert) for argument in term.arguments]
    try:
        value = function(*arguments)
        if isinstance(value, int) and value.bit_length() > MAX_BITS:
            raise OverflowError
    except ZeroDivisionError:
        raise SourceIssue(at, f"division by zero in {abbreviate(term)}") from None
    except (ValueError, TypeError, OverflowError):
        raise SourceIssue(at, f"{abbreviate(term)} has no value, or one that is too large") from None
    if isinstance(value, complex):
        raise SourceIssue(at, f"the value of {abbreviate(term)} is not a real number")
    return value
