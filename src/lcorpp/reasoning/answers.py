"""Answers: marginals, possible worlds, and the errors of questions without an answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any, TypeVar

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError
from lcorpp.reasoning.language.program import Program

if TYPE_CHECKING:
    from lcorpp.values import Label

Numeric = Fraction | float

Value = Any
"""A value of an attribute as text; of the joint of several attributes a tuple with one for each."""

QueryAnswer = dict[Value, Numeric] | Numeric
"""The distribution of an attribute or several, value -> probability, or one probability."""

MAX_JOINT_VALUES = 10_000
"""Several attributes in one query have at most this many combinations of values."""

MAX_SHOWN_TERMS = 8
"""The `repr` of a world shows at most this many terms."""

_Number = TypeVar("_Number", Fraction, float)


@dataclass(frozen=True, eq=False)
class PossibleWorld:
    """A possible world of a program.

    values: term -> value, for the terms that have a value.
    measure: its probability, given the evidence and interventions for which it was computed.
    """

    values: Mapping[str, str]
    measure: Fraction

    def __repr__(self) -> str:
        shown = dict(list(self.values.items())[:MAX_SHOWN_TERMS])
        n_hidden = len(self.values) - len(shown)
        more = f" and {n_hidden} more" if n_hidden else ""
        return f"PossibleWorld({self.measure}: {format_world(shown)}{more})"


def format_world(values: Mapping[str, str]) -> str:
    """Format the terms and values of a world: ``{prize=1, selected=2}``."""
    return f"{{{', '.join(f'{term}={value}' for term, value in values.items())}}}"


def normalise_marginal(
    program: Program, term: str, weights: Mapping[Value, _Number], conditions: str
) -> dict[Value, _Number]:
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
    return {value: weights.get(value, zero) / total for value in list_values(program, term)}


def list_values(program: Program, term: str) -> tuple[Any, ...]:
    """List the values of a term; those of a joint `?a, b` are tuples.

    Raises:
        TooLargeError: a joint has more than `MAX_JOINT_VALUES`.
    """
    ranges = [
        program.attributes[name.partition("(")[0]].values for name in term.removeprefix("?").split(", ")
    ]
    if not term.startswith("?"):
        return ranges[0]
    size = prod(map(len, ranges))
    if size > MAX_JOINT_VALUES:
        raise TooLargeError(
            f"{program.file}: {term[1:]} together have {size} values; expected at most {MAX_JOINT_VALUES}"
        )
    return tuple(product(*ranges))


def format_conditions(facts: Mapping[str, Label], do: Mapping[str, str]) -> str:
    """Format evidence and interventions as the end of the message of `make_no_world_error`."""
    parts = [f"{term}={value}" for term, value in facts.items()]
    parts += [f"do({term}={value})" for term, value in do.items()]
    return f" has {', '.join(parts)}" if parts else ""


def make_no_world_error(program: Program, conditions: str) -> UndefinedError:
    """Make the error for evidence of probability zero."""
    return UndefinedError(f"{program.file}: no possible world of positive measure{conditions}")


def make_no_value_error(program: Program, term: str, probability: object, where: str = "") -> ProgramError:
    """Make the error for a term that may have no value, so that its distribution does not sum to 1.

    Args:
        probability: that the term has no value.
        where: the row of a batch, at the beginning of the message.
    """
    return ProgramError(
        f"{program.file}: {where}{term.removeprefix('?')} has no value with probability {probability};"
        f" ask for {term.removeprefix('?').replace(', ', '=value, ')}=value instead"
    )
