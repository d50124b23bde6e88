"""The errors of questions that have no answer."""

from __future__ import annotations

from collections.abc import Mapping

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning.language.program import Program


def shown(facts: Mapping[str, str], do: Mapping[str, str]) -> str:
    """Evidence and interventions as the end of `impossible`."""
    parts = [f"{term}={value}" for term, value in facts.items()]
    parts += [f"do({term}={value})" for term, value in do.items()]
    return f" has {', '.join(parts)}" if parts else ""


def impossible(program: Program, conditions: str) -> UndefinedError:
    """There is nothing to divide by."""
    return UndefinedError(f"{program.file}: no possible world of positive measure{conditions}")


def no_value(program: Program, term: str, share: object, where: str = "") -> ProgramError:
    """A distribution over values would not sum to one; `where` is the row of a batch."""
    return ProgramError(
        f"{program.file}: {where}{term} has no value with probability {share}; ask for {term}=value instead"
    )
