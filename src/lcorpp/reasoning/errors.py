"""Errors of questions without an answer, and the warning of estimates; all reasoners share the texts."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError
from lcorpp.reasoning.language.program import Program


class ReasoningWarning(UserWarning):
    """An answer is an estimate, as the program is too large to be compiled."""


def warn_of_estimate(reason: TooLargeError, samples: int) -> None:
    """Warn that an answer is estimated from samples, and why."""
    warnings.warn(
        f"{reason}: estimated from {samples} worlds drawn at random", ReasoningWarning, stacklevel=5
    )


def format_conditions(facts: Mapping[str, str], do: Mapping[str, str]) -> str:
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
        f"{program.file}: {where}{term} has no value with probability {probability};"
        f" ask for {term}=value instead"
    )
