"""Writes out what a dialect leaves unsaid, so that a program is made of plain statements.

plog 2.0: `?c.` asks for a probability; a rule may ask `obs(a, v)`, whether the program records it.
plog 1.0, known by its `#domain`: see `undeclared`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lcorpp.reasoning.language.observed import replace_observed
from lcorpp.reasoning.language.signature import BOOLEAN
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    DomainDirective,
    Literal,
    Query,
    Semantics,
    SortDefinition,
    Statement,
    Term,
)


def desugar(statements: Sequence[Statement], dialect: Semantics) -> tuple[Statement, ...]:
    """The statements with all that they leave unsaid.

    Args:
        dialect: that of plog 2.0 if "2018".

    Raises:
        Offence: a rule asks for a record that cannot be.
    """
    if any(isinstance(statement, DomainDirective) for statement in statements):
        from lcorpp.reasoning.language.implicit_declarations import (
            infer_declarations,  # here, as most programs do without
        )

        statements = infer_declarations(statements)
    if dialect == "2018":
        statements = _with_asked(statements)
    return tuple(replace_observed(statements))


def _with_asked(statements: Sequence[Statement]) -> Sequence[Statement]:
    """With `?c.` for a boolean c as the question whether c is true."""
    if not any(isinstance(s, Query) and s.subject for s in statements):
        return statements
    booleans = {BOOLEAN} | {
        s.name for s in statements if isinstance(s, SortDefinition) and Term("true") in s.elements
    }
    asked = {s.name for s in statements if isinstance(s, AttributeDeclaration) and s.range in booleans}
    return [
        replace(s, literals=(Literal(s.subject, "=", Term("true"), at=s.subject.at),), subject=None)
        if isinstance(s, Query) and s.subject and s.subject.name in asked
        else s
        for s in statements
    ]
