"""Parse statements in the dialects of plog 1.0, plog 2.0 and the papers."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from lcorpp.reasoning.language.arithmetic import canonical_text, evaluate_number, iter_variables
from lcorpp.reasoning.language.declarations import (
    is_bare_name,
    parse_attributes,
    parse_hash_sort,
    parse_plain_sort,
)
from lcorpp.reasoning.language.expressions import (
    parse_body,
    parse_literal,
    parse_rest_of_literal,
    parse_sum,
    parse_value,
)
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import END, HASH_NAME, INTEGER, NAME, VARIABLE, Cursor
from lcorpp.reasoning.language.queries import (
    parse_intervention,
    parse_observation,
    parse_query_statement,
    require_assignment,
)
from lcorpp.reasoning.language.syntax import (
    SEMANTICS,
    Body,
    BodyLiteral,
    CrRule,
    DomainDirective,
    DynamicRange,
    Literal,
    Number,
    Probability,
    Rule,
    Selection,
    Statement,
    Term,
    Variable,
)

_SECTIONS = ("sorts", "attributes", "statements")

_ARROWS = (":+", "+-")


def parse_statements(cursor: Cursor) -> Iterator[Statement]:
    """Parse the statements of a program."""
    while cursor.kind != END:
        cursor.anonymous_count = 0
        yield from _parse_statement(cursor)


def _parse_statement(cursor: Cursor) -> Iterator[Statement]:
    kind, word = cursor.kind, cursor.word
    if word == "#domain":
        yield from _parse_domains(cursor)
    elif word == "#const":
        _parse_constant(cursor)
    elif word == "#semantics":
        _parse_semantics(cursor)
    elif kind == HASH_NAME:
        yield parse_hash_sort(cursor)
    elif kind == "?":
        yield parse_query_statement(cursor)
    elif kind == ":-" or kind in _ARROWS:
        yield _parse_constraint(cursor)
    elif kind == "[":
        cursor.take()
        yield _parse_labelled(cursor, _parse_label(cursor))
    elif word in _SECTIONS and cursor.second_kind in (NAME, HASH_NAME, END, "[", ":-", "?"):
        cursor.uses_plog2 = True
        cursor.take()
    elif word in ("random", "pr"):
        yield _parse_labelled(cursor, None)
    elif word == "obs":
        yield parse_observation(cursor)
        cursor.expect(".")
    elif word == "do":
        yield parse_intervention(cursor)
        cursor.expect(".")
    elif word == "not":
        raise cursor.make_unexpected_error()
    else:
        yield from _parse_declaration_or_rule(cursor)


def _parse_declaration_or_rule(cursor: Cursor) -> Iterator[Statement]:
    left = parse_sum(cursor, plus_minus_is_arrow=True)
    if cursor.kind == ":" or (cursor.kind == "," and cursor.second_kind == NAME and is_bare_name(left)):
        yield from parse_attributes(cursor, left)
    elif cursor.kind == "=" and cursor.second_kind == "{":
        yield parse_plain_sort(cursor, left)
    else:
        yield _parse_rule(cursor, parse_rest_of_literal(cursor, left, plus_minus_is_arrow=True), None)


def _parse_domains(cursor: Cursor) -> Iterator[DomainDirective]:
    """Parse `#domain s(X;Y), t(Z).`"""
    at = cursor.at
    cursor.take()
    while True:
        sort = cursor.expect(NAME)
        cursor.expect("(")
        names = cursor.parse_list(_parse_domain_variable, ";")
        cursor.expect(")")
        yield DomainDirective(sort, tuple(dict.fromkeys(names)), at=at)
        if not cursor.accept(","):
            break
    cursor.expect(".")


def _parse_domain_variable(cursor: Cursor) -> str:
    if cursor.word == "_":
        raise cursor.make_unexpected_error((VARIABLE,))
    return cursor.expect(VARIABLE)


def _parse_constant(cursor: Cursor) -> None:
    """Parse `#const name = value.`, which replaces the name in the rest of the text."""
    cursor.take()
    at, name = cursor.at, cursor.expect(NAME)
    cursor.expect("=")
    given = parse_value(cursor)
    cursor.expect(".")
    if name in cursor.constants:
        raise SourceIssue(at, f"the constant {name} is declared twice")
    text = canonical_text(given)
    cursor.constants[name] = given if isinstance(given, Term) else Number(Fraction(text), at=given.at)


def _parse_semantics(cursor: Cursor) -> None:
    """Parse `#semantics 2009.` or `#semantics 2018.`, which overrides the dialect."""
    cursor.take()
    at, given = cursor.at, cursor.expect(INTEGER)
    if given not in SEMANTICS:
        raise SourceIssue(at, f"unknown semantics {given}; expected {' or '.join(SEMANTICS)}")
    if cursor.semantics not in (None, given):
        raise SourceIssue(at, f"the semantics {cursor.semantics} is already chosen")
    cursor.semantics = given  # type: ignore[assignment]  # mypy does not see the test above
    cursor.expect(".")


# rules


def _parse_label(cursor: Cursor) -> Term:
    term = parse_value(cursor)
    if not isinstance(term, Term):
        raise SourceIssue(term.at, f"expected a label such as r or r(X), not {term}")
    cursor.expect("]")
    return term


def _parse_labelled(cursor: Cursor, label: Term | None) -> Statement:
    at = label.at if label else cursor.at
    if cursor.accept_word("random"):
        term, dynamic_range = _parse_selection_head(cursor)
        arrow = cursor.kind
        selection = Selection(term, dynamic_range, _parse_tail(cursor), label, at=at)
        return CrRule(selection, at=at) if arrow in _ARROWS else selection
    if cursor.accept_word("pr"):
        return _parse_probability(cursor, label, at)
    return _parse_rule(cursor, parse_literal(cursor, plus_minus_is_arrow=True), label)


def _parse_tail(cursor: Cursor) -> Body:
    """Parse the rest of a rule after its head, full stop included; return the body."""
    body: Body = ()
    if cursor.next_is(":-", *_ARROWS):
        if cursor.take() == ":+":
            cursor.uses_plog2 = True
        if not cursor.next_is("."):
            body = parse_body(cursor)
    cursor.expect(".")
    return body


def _parse_rule(cursor: Cursor, literal: BodyLiteral, label: Term | None) -> Rule | CrRule:
    head = require_assignment(literal, "the head of a rule")
    arrow = cursor.kind
    rule = Rule(head, _parse_tail(cursor), at=head.at)
    if arrow in _ARROWS:
        return CrRule(rule, label, at=label.at if label else head.at)
    if label:
        raise SourceIssue(
            label.at, f"only random selections, pr-atoms and cr-rules have a label, not '{rule}'"
        )
    return rule


def _parse_constraint(cursor: Cursor) -> Rule | CrRule:
    at, arrow = cursor.at, cursor.take()
    rule = Rule(None, parse_body(cursor), at=at)
    cursor.expect(".")
    return CrRule(rule, at=at) if arrow in _ARROWS else rule


def _parse_selection_head(cursor: Cursor) -> tuple[Term, DynamicRange | None]:
    """Parse `(term)`, `(term : {X : condition})` or `(term, p)`."""
    cursor.expect("(")
    term = parse_value(cursor)
    if not isinstance(term, Term):
        raise SourceIssue(term.at, f"expected an attribute, not {term}")
    dynamic_range = None
    if cursor.accept(":"):
        cursor.expect("{")
        at = cursor.at
        variable = Variable(cursor.expect(VARIABLE), at=at)
        if variable.name == "_":
            raise SourceIssue(at, "expected a named variable in a dynamic range, not '_'")
        cursor.expect(":")
        dynamic_range = DynamicRange(variable, parse_body(cursor), at=at)
        cursor.expect("}")
    elif cursor.accept(","):  # the values X with p(X)
        cursor.uses_plog2 = True
        at = cursor.at
        variable = Variable("Chosen", at=at)
        member = Term(cursor.expect(NAME), (variable,), at=at)
        dynamic_range = DynamicRange(variable, (Literal(member, "=", Term("true", at=at), at=at),), at=at)
    cursor.expect(")")
    return term, dynamic_range


def _parse_probability(cursor: Cursor, label: Term | None, at: Place) -> Probability:
    cursor.expect("(")
    literal = require_assignment(parse_literal(cursor), "a pr-atom")
    condition = parse_body(cursor) if cursor.accept("|") else ()
    cursor.expect(")")
    if not cursor.accept("=="):
        cursor.expect("=")
    number = parse_value(cursor)
    if not any(iter_variables(number)):
        number = Number(evaluate_number(number, {}), at=number.at)
    cursor.expect(".")
    return Probability(literal.term, literal.value, number, condition, label, at=at)
