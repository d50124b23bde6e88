"""What users call terms and values in Python, checked against a program."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from math import prod

from lcorpp.errors import ParseError, ProgramError, TooLargeError, expected_one_of
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Query, Term

MAX_INPUTS = 100_000
"""How many terms an attribute that is named without its arguments may have."""


def resolve_term(program: Program, name: str) -> Term:
    """The term that a name stands for, such as ``time`` or ``roll(d1)``.

    Raises:
        ProgramError: it is not a term of the program.
    """
    if not isinstance(name, str):
        raise ProgramError(f"expected the name of an attribute, not {name!r}")
    try:
        term = parse_term(name, "<term>")
        if not isinstance(term, Term):
            raise ProgramError(f"{name!r} is not an attribute; {expected_one_of(list(program.attributes))}")
        term = program.signature.resolve_overload(term)
        program.check_query(Query(subject=term))
    except (ParseError, SourceIssue) as error:
        raise ProgramError(f"{name!r}: {error.message}") from None
    return term


def resolve_terms(program: Program, name: str) -> list[str]:
    """The terms that a name stands for: one, or all of an attribute that is named without its arguments.

    Raises:
        ProgramError: it names nothing in the program.
        TooLargeError: it has more terms than a circuit can have inputs.
    """
    attribute = program.attributes.get(name) if isinstance(name, str) else None
    if attribute is None or not attribute.arguments:
        return [canonical_text(resolve_term(program, name))]
    sorts = [program.signature.sorts[sort] for sort in attribute.arguments]
    count = prod(map(len, sorts))
    if count > MAX_INPUTS:
        raise TooLargeError(
            f"{program.file}: {name} has {count} terms; at most {MAX_INPUTS} can be inputs,"
            " so name those that are needed"
        )
    return [f"{name}({','.join(arguments)})" for arguments in product(*sorts)]


def check_value(program: Program, term: Term, value: str) -> None:
    """Check that a value is one of a term.

    Raises:
        ProgramError: it is not; the message lists those that are.
    """
    values = program.attributes[term.name].values
    if value not in values:
        raise ProgramError(f"{value!r} is not a value of {term}; {expected_one_of(values)}")


def resolve_evidence(program: Program, evidence: Mapping[str, str]) -> dict[str, str]:
    """Evidence under the canonical names of its terms.

    Raises:
        ProgramError: a term or value is unknown, or one term is given two values.
    """
    facts: dict[str, str] = {}
    for name, value in evidence.items():
        term = resolve_term(program, name)
        check_value(program, term, value)
        if facts.setdefault(canonical_text(term), value) != value:
            raise ProgramError(
                f"the evidence gives {name} two values, {facts[canonical_text(term)]} and {value}"
            )
    return facts


def resolve_interventions(program: Program, do: Mapping[str, str]) -> dict[str, str]:
    """Interventions under the canonical names of their terms, which must have a random selection.

    Raises:
        ProgramError: as `resolve_evidence`, or a term is never random.
    """
    for name in do:
        if not program.is_random(resolve_term(program, name)):
            raise ProgramError(f"do({name}=...): {name} has no random selection in {program.file}")
    return resolve_evidence(program, do)
