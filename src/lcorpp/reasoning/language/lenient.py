"""The lenient reading: statements that do not fit their declarations have no instance, and are left out.

That holds where a value or an argument outside of its sort stands in a head or in a literal that has to be
true, and where such a literal has a wrong number of arguments. Anywhere else a misfit stays an error: under
`not`, in what is observed, set or asked, in the number of arguments of a head.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lcorpp.reasoning.language.checker import check_attribute, check_statement
from lcorpp.reasoning.language.declared import build_signature
from lcorpp.reasoning.language.issues import SortMismatch
from lcorpp.reasoning.language.safety import check_slots
from lcorpp.reasoning.language.signature import Signature, get_body
from lcorpp.reasoning.language.syntax import CrRule, Literal, Probability, Rule, Selection, Statement


def drop_ill_sorted(statements: Sequence[Statement]) -> tuple[Statement, ...]:
    """The statements without those that have no instance.

    Raises:
        Offence: something else is wrong with one.
    """
    signature = build_signature(statements)
    return tuple(statement for statement in statements if _fits(statement, signature))


def _fits(statement: Statement, signature: Signature) -> bool:
    try:
        check_statement(statement, signature)
    except SortMismatch:
        inner = statement.statement if isinstance(statement, CrRule) else statement
        if isinstance(inner, Rule | Selection | Probability) and _has_no_instance(inner, signature):
            return False
        raise
    return True


def _has_no_instance(statement: Rule | Selection | Probability, signature: Signature) -> bool:
    for literal in _heads(statement):
        check_attribute(literal.term, signature)
        if not _is_within(literal, signature):
            return True
    needed = (part for part in get_body(statement) if isinstance(part, Literal) and not part.negated)
    return any(not _is_within(literal, signature) for literal in needed)


def _heads(statement: Rule | Selection | Probability) -> Iterator[Literal]:
    """What a statement gives a value; a selected term stands under a relation that asks for no value."""
    if isinstance(statement, Rule):
        if statement.head:
            yield statement.head
    elif isinstance(statement, Probability):
        yield Literal(statement.term, "=", statement.value)
    else:
        yield Literal(statement.term, "<", statement.term)


def _is_within(literal: Literal, signature: Signature) -> bool:
    if signature.is_sort(literal):
        return True
    try:
        check_attribute(literal.term, signature)
        check_slots(signature.literal_slots(literal), signature)
    except SortMismatch:
        return False
    return True
