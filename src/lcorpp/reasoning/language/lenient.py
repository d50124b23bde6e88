"""Lenient mode: remove statements that have no instance because they contradict their declarations.

A statement has no instance if its head or a positive body literal has a value or an argument outside of its
sort, or if a positive body literal has a wrong number of arguments. Other contradictions remain errors: under
`not`, in observations, interventions and queries, and in the number of arguments of a head.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lcorpp.reasoning.language.checker import check_attribute, check_statement
from lcorpp.reasoning.language.issues import SortMismatch
from lcorpp.reasoning.language.safety import check_slots
from lcorpp.reasoning.language.signature import Signature, build_signature
from lcorpp.reasoning.language.syntax import CrRule, Literal, Probability, Rule, Selection, Statement
from lcorpp.reasoning.language.traversal import get_body


def drop_ill_sorted(statements: Sequence[Statement]) -> tuple[Statement, ...]:
    """Return the statements that have instances.

    Raises:
        SourceIssue: a statement has another error.
    """
    signature = build_signature(statements)
    return tuple(statement for statement in statements if _has_instances(statement, signature))


def _has_instances(statement: Statement, signature: Signature) -> bool:
    try:
        check_statement(statement, signature)
    except SortMismatch:
        inner = statement.statement if isinstance(statement, CrRule) else statement
        if isinstance(inner, Rule | Selection | Probability) and _has_no_instance(inner, signature):
            return False
        raise
    return True


def _has_no_instance(statement: Rule | Selection | Probability, signature: Signature) -> bool:
    for literal in _iter_heads(statement):
        check_attribute(literal.term, signature)
        if not _is_well_sorted(literal, signature):
            return True
    needed = (part for part in get_body(statement) if isinstance(part, Literal) and not part.negated)
    return any(not _is_well_sorted(literal, signature) for literal in needed)


def _iter_heads(statement: Rule | Selection | Probability) -> Iterator[Literal]:
    """Iterate over the heads of a statement; a selected term gets a relation without value slot."""
    if isinstance(statement, Rule):
        if statement.head:
            yield statement.head
    elif isinstance(statement, Probability):
        yield Literal(statement.term, "=", statement.value)
    else:
        yield Literal(statement.term, "<", statement.term)


def _is_well_sorted(literal: Literal, signature: Signature) -> bool:
    if signature.is_sort(literal):
        return True
    try:
        check_attribute(literal.term, signature)
        check_slots(signature.literal_slots(literal), signature)
    except SortMismatch:
        return False
    return True
