"""Answers of reasoners: numbers, estimates and normalised marginals."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import TypeVar

from lcorpp.reasoning.errors import make_no_value_error, make_no_world_error
from lcorpp.reasoning.language.program import Program

Numeric = Fraction | float

QueryAnswer = dict[str, Numeric] | Numeric
"""The distribution of an attribute, value -> probability, or one probability."""

_Number = TypeVar("_Number", Fraction, float)


class Estimate(float):
    """An estimated probability.

    error: its standard error.
    """

    error: float

    def __new__(cls, value: float, error: float) -> Estimate:
        estimate = super().__new__(cls, value)
        estimate.error = error
        return estimate


def normalise_marginal(
    program: Program, term: str, weights: Mapping[str, _Number], conditions: str
) -> dict[str, _Number]:
    """Return the distribution of a term: value -> probability in the order of the declaration.

    Args:
        weights: value -> weight; "" is the weight of having no value.
        conditions: the conditions of the question as text, for the error.

    Raises:
        UndefinedError: all weights are 0.
        ProgramError: the term may have no value.
    """
    total = sum(weights.values())
    if not total:
        raise make_no_world_error(program, conditions)
    if weights.get(""):
        raise make_no_value_error(program, term, weights[""] / total)
    zero = 0 * total
    return {v: weights.get(v, zero) / total for v in program.attributes[term.partition("(")[0]].values}
