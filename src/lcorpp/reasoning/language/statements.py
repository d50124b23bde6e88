"""Reads statements: what a P-log program is made of, in the words of plog 1.0, plog 2.0 and the papers."""

from __future__ import annotations

from collections.abc import Iterator

from lcorpp.reasoning.language.arithmetic import evaluate_number, iter_variables
from lcorpp.reasoning.language.declarations import (
    attribute,
    constant,
    domains,
    hash_sort,
    is_name,
    plain_sort,
    semantics,
)
from lcorpp.reasoning.language.expressions import (
    body,
    literal,
    literal_from,
    operand,
    value,
)
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lexer import END, HASH_NAME, NAME, VARIABLE, Cursor
from lcorpp.reasoning.language.queries import intervention, observation, outcome, query_statement
from lcorpp.reasoning.language.syntax import (
    Body,
    Comparison,
    CrRule,
    DynamicRange,
    Literal,
    Number,
    Place,
    Probability,
    Rule,
    Selection,
    Statement,
    Term,
    Variable,
)

_SECTIONS = ("sorts", "attributes", "statements")

_ARROWS = (":+", "+-")


def statements(cursor: Cursor) -> Iterator[Statement]:
    """All statements of a program, one after the other."""
    while cursor.kind != END:
        cursor.anonymous = 0
        yield from _statement(cursor)


def _statement(cursor: Cursor) -> Iterator[Statement]:
    kind = cursor.kind
    if kind == HASH_NAME:
        yield from _directive(cursor)
    elif kind == "?":
        yield query_statement(cursor)
    elif kind == ":-" or kind in _ARROWS:
        yield _constraint(cursor)
    elif kind == "[":
        cursor.take()
        yield _labelled(cursor, _label(cursor))
    elif (
        kind == NAME
        and cursor.word in _SECTIONS
        and cursor.following in (NAME, HASH_NAME, END, "[", ":-", "?")
    ):
        cursor.dialect_2 = True
        cursor.take()
    elif kind == NAME and cursor.word in ("random", "pr"):
        yield _labelled(cursor, None)
    elif kind == NAME and cursor.word == "obs":
        yield observation(cursor)
        cursor.expect(".")
    elif kind == NAME and cursor.word == "do":
        yield intervention(cursor)
        cursor.expect(".")
    elif kind == NAME and cursor.word == "not":
        raise cursor.unexpected()
    else:
        yield from _declaration_or_rule(cursor)


def _directive(cursor: Cursor) -> Iterator[Statement]:
    if cursor.word == "#domain":
        yield from domains(cursor)
    elif cursor.word == "#const":
        constant(cursor)
    elif cursor.word == "#semantics":
        semantics(cursor)
    else:
        yield hash_sort(cursor)


def _declaration_or_rule(cursor: Cursor) -> Iterator[Statement]:
    left = operand(cursor, arrow=True)
    if cursor.kind == ":" or (cursor.kind == "," and cursor.following == NAME and is_name(left)):
        yield from attribute(cursor, left)
    elif cursor.kind == "=" and cursor.following == "{":
        yield plain_sort(cursor, left)
    else:
        yield _rule(cursor, literal_from(left, cursor, arrow=True), None)


# rules


def _label(cursor: Cursor) -> Term:
    term = value(cursor)
    if not isinstance(term, Term):
        raise SourceIssue(term.at, f"expected a label such as r or r(X), not {term}")
    cursor.expect("]")
    return term


def _labelled(cursor: Cursor, label: Term | None) -> Statement:
    at = label.at if label else cursor.at
    if cursor.accept_word("random"):
        term, chosen = _selected(cursor)
        arrow = cursor.kind
        given = _tail(cursor)
        selection = Selection(term, chosen, given, label, at=at)
        return CrRule(selection, at=at) if arrow in _ARROWS else selection
    if cursor.accept_word("pr"):
        return _probability(cursor, label, at)
    return _rule(cursor, literal(cursor, arrow=True), label)


def _tail(cursor: Cursor) -> Body:
    """What follows a head, the dot included."""
    if not cursor.sees(":-", *_ARROWS):
        cursor.expect(".")
        return ()
    if cursor.take() == ":+":
        cursor.dialect_2 = True
    given = () if cursor.sees(".") else body(cursor)
    cursor.expect(".")
    return given


def _rule(cursor: Cursor, found: Literal | Comparison, label: Term | None) -> Rule | CrRule:
    head = outcome(found, "the head of a rule")
    arrow = cursor.kind
    given = _tail(cursor)
    rule = Rule(head, given, at=head.at)
    if arrow in _ARROWS:
        return CrRule(rule, label, at=label.at if label else head.at)
    if label:
        raise SourceIssue(
            label.at, f"only random selections, pr-atoms and cr-rules have a label, not '{rule}'"
        )
    return rule


def _constraint(cursor: Cursor) -> Rule | CrRule:
    at, arrow = cursor.at, cursor.take()
    rule = Rule(None, body(cursor), at=at)
    cursor.expect(".")
    return CrRule(rule, at=at) if arrow in _ARROWS else rule


def _selected(cursor: Cursor) -> tuple[Term, DynamicRange | None]:
    """`(term)`, `(term : {X : condition})` or `(term, p)`."""
    cursor.expect("(")
    term = value(cursor)
    if not isinstance(term, Term):
        raise SourceIssue(term.at, f"expected an attribute, not {term}")
    chosen = None
    if cursor.accept(":"):
        cursor.expect("{")
        at = cursor.at
        variable = Variable(cursor.expect(VARIABLE), at=at)
        if variable.name == "_":
            raise SourceIssue(at, "the values of a dynamic range need a name; expected a variable, not '_'")
        cursor.expect(":")
        chosen = DynamicRange(variable, body(cursor), at=at)
        cursor.expect("}")
    elif cursor.accept(","):
        chosen = _unary_range(cursor)
    cursor.expect(")")
    return term, chosen


def _unary_range(cursor: Cursor) -> DynamicRange:
    cursor.dialect_2 = True
    at = cursor.at
    name = cursor.expect(NAME)
    variable = Variable("Chosen", at=at)
    condition = Literal(Term(name, (variable,), at=at), "=", Term("true", at=at), at=at)
    return DynamicRange(variable, (condition,), at=at)


def _probability(cursor: Cursor, label: Term | None, at: Place) -> Probability:
    cursor.expect("(")
    found = outcome(literal(cursor), "a pr-atom")
    condition = body(cursor) if cursor.accept("|") else ()
    cursor.expect(")")
    if not cursor.accept("=="):
        cursor.expect("=")
    number = value(cursor)
    if not any(iter_variables(number)):
        number = Number(evaluate_number(number, {}), at=number.at)
    cursor.expect(".")
    return Probability(found.term, found.value, number, condition, label, at=at)
