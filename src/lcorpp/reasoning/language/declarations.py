"""Reads declarations: sorts, attributes, the domains of variables, constants, and the choice of semantics."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import TypeGuard

from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.expressions import Minus, value
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lexer import HASH_NAME, INTEGER, NAME, VARIABLE, Cursor
from lcorpp.reasoning.language.sort_expressions import sort_expression, sort_name
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    DomainDirective,
    Expression,
    Number,
    Place,
    SortDefinition,
    SortExpression,
    SortName,
    SortSet,
    Statement,
    Term,
)


def plain_sort(cursor: Cursor, name: Expression | Minus) -> SortDefinition:
    """`name = {elements}.`, the name having been read."""
    term = _name(name, "a sort")
    cursor.expect("=")
    return _definition(cursor, term.name, term.at)


def hash_sort(cursor: Cursor) -> SortDefinition:
    """`#name = expression.`"""
    at = cursor.at
    name = sort_name(cursor)
    if not cursor.accept("=="):
        cursor.expect("=")
    return _definition(cursor, name, at)


def _definition(cursor: Cursor, name: str, at: Place) -> SortDefinition:
    found = sort_expression(cursor)
    cursor.expect(".")
    return _defined(name, found, at)


def _defined(name: str, found: SortExpression, at: Place) -> SortDefinition:
    return SortDefinition(name, found.elements if isinstance(found, SortSet) else (found,), at=at)


def is_name(found: Expression | Minus) -> TypeGuard[Term]:
    """Whether something is a mere name."""
    return isinstance(found, Term) and not found.arguments


def _name(found: Expression | Minus, what: str) -> Term:
    if is_name(found):
        return found
    raise SourceIssue(found.at, f"expected the name of {what}")


def attribute(cursor: Cursor, name: Expression | Minus) -> Iterator[Statement]:
    """`name, name : sorts -> sort.`, the first name having been read; a sort without a name is given one."""
    term = _name(name, "an attribute")
    terms = [term]
    while cursor.accept(","):
        at = cursor.at
        terms.append(Term(cursor.expect(NAME), at=at))
    cursor.expect(":")
    made: list[SortDefinition] = []
    sorts = [_sort(cursor, term, made)]
    while cursor.accept(",") or cursor.accept("*"):
        sorts.append(_sort(cursor, term, made))
    target = _sort(cursor, term, made) if cursor.accept("->") else None
    cursor.expect(".")
    if target is None and len(sorts) > 1:
        raise SourceIssue(term.at, f"attribute {term} has arguments but no range; expected '-> sort'")
    arguments, target = (tuple(sorts), target) if target is not None else ((), sorts[0])
    yield from made
    for term in terms:
        yield AttributeDeclaration(term.name, arguments, target, at=term.at)


def _sort(cursor: Cursor, attribute: Term, made: list[SortDefinition]) -> str:
    if cursor.kind == NAME and cursor.following not in ("(", ".."):
        return cursor.take()
    if not cursor.sees(NAME, HASH_NAME, INTEGER, "{", "(", "-"):
        raise cursor.unexpected()
    at = cursor.at
    found = sort_expression(cursor)
    if isinstance(found, SortName):
        return found.name
    cursor.dialect_2 = True
    name = f"{attribute.name}_sort_{len(made) + 1}"
    made.append(_defined(name, found, at))
    return name


def domains(cursor: Cursor) -> Iterator[DomainDirective]:
    """`#domain s(X;Y), t(Z).`"""
    at = cursor.at
    cursor.take()
    while True:
        sort = cursor.expect(NAME)
        cursor.expect("(")
        names = [_variable(cursor)]
        while cursor.accept(";"):
            names.append(_variable(cursor))
        cursor.expect(")")
        yield DomainDirective(sort, tuple(dict.fromkeys(names)), at=at)
        if not cursor.accept(","):
            break
    cursor.expect(".")


def _variable(cursor: Cursor) -> str:
    if cursor.word == "_":
        raise cursor.unexpected((VARIABLE,))
    return cursor.expect(VARIABLE)


def constant(cursor: Cursor) -> None:
    """`#const name = value.`: from here on the name stands for the value."""
    cursor.take()
    at, name = cursor.at, cursor.expect(NAME)
    cursor.expect("=")
    given = value(cursor)
    cursor.expect(".")
    if name in cursor.constants:
        raise SourceIssue(at, f"the constant {name} is declared twice")
    settled = canonical_text(given)
    cursor.constants[name] = given if isinstance(given, Term) else Number(Fraction(settled), at=given.at)


def semantics(cursor: Cursor) -> None:
    """`#semantics 2009.` or `#semantics 2018.`, which settles what the dialect otherwise tells."""
    cursor.take()
    at, given = cursor.at, cursor.expect(INTEGER)
    if given not in ("2009", "2018"):
        raise SourceIssue(at, f"unknown semantics {given}; expected 2009 or 2018")
    if cursor.semantics not in (None, given):
        raise SourceIssue(at, f"the semantics {cursor.semantics} is already chosen")
    cursor.semantics = given
    cursor.expect(".")
