"""Checks of names that one file of a domain folder uses and another one declares."""

from __future__ import annotations

import re

from lcorpp.errors import DomainError, expected_one_of
from lcorpp.files import read_text
from lcorpp.planning import Pomdp
from lcorpp.reasoning import Program


def attribute_values(location: str, name: str, program: Program) -> tuple[str, ...]:
    """The values of a P-log attribute without arguments.

    Args:
        location: where the attribute is used, for the message.

    Raises:
        DomainError: `program` has no such attribute.
    """
    if name not in program.attributes:
        raise DomainError(
            f"{location}: {program.file} has no attribute {name!r};"
            f" {expected_one_of(tuple(program.attributes))}"
        )
    attribute = program.attributes[name]
    if attribute.arguments:
        raise DomainError(
            f"{location}: {name!r} takes arguments ({program.file}:{attribute.line}); expected one without"
        )
    return attribute.values


def check_same_names(location: str, names: tuple[str, ...], known: tuple[str, ...], what: str) -> None:
    """Raise `DomainError` for unknown and for missing names; `what` describes the known names."""
    for name in names:
        if name not in known:
            raise DomainError(f"{location}: {name!r} is not among {what}; {expected_one_of(known)}")
    for name in known:
        if name not in names:
            raise DomainError(f"{location}: {name!r} is missing; expected {what}: {', '.join(known)}")


def locate_declaration(pomdp: Pomdp, kind: str) -> str:
    """Return ``file:line`` of the declaration of the states, actions or observations in a POMDP file."""
    for number, line in enumerate(read_text(pomdp.file).splitlines(), 1):
        if re.match(rf"\s*{kind}\s*:", line):
            return f"{pomdp.file}:{number}"
    return pomdp.file
