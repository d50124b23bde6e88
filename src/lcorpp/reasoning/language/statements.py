"""Parse statements in the dialects of plog 1.0, plog 2.0 and the papers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction

from lcorpp.reasoning.language.arithmetic import canonical_text, evaluate_number, iter_variables
from lcorpp.reasoning.language.declarations import parse_attributes, parse_sort, parse_sort_name
from lcorpp.reasoning.language.expressions import (
    parse_body,
    parse_literal,
    parse_rest_of_literal,
    parse_sum,
    parse_value,
)
from lcorpp.reasoning.language.facts import parse_fact
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import END, HASH_NAME, INTEGER, NAME, VARIABLE, Cursor
from lcorpp.reasoning.language.queries import parse_evidence, parse_question, require_assignment
from lcorpp.reasoning.language.syntax import (
    SEMANTICS,
    Body,
    BodyLiteral,
    DomainDirective,
    DynamicRange,
    Expression,
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

_CR_ARROWS = (":+", "+-")


def parse_statements(cursor: Cursor) -> Iterator[Statement]:
    """Parse the statements of a program."""
    while cursor.kind != END:
        cursor.anonymous_count = 0
        if cursor.word in _SECTIONS and cursor.second_kind in (NAME, HASH_NAME, END, "[", ":-", "?"):
            cursor.uses_plog2 = True
            cursor.take()
        else:
            yield from _PARSERS.get(cursor.word, _parse_declaration_or_rule)(cursor)


def _parse_declaration_or_rule(cursor: Cursor) -> Iterator[Statement]:
    at = cursor.at
    if cursor.kind == HASH_NAME:
        yield parse_sort(cursor, parse_sort_name(cursor), at)
        return
    if fact := parse_fact(cursor):
        yield fact
        return
    left = parse_sum(cursor, plus_minus_is_arrow=True)
    is_name = isinstance(left, Term) and not left.arguments
    if cursor.kind == ":" or (cursor.kind == "," and cursor.second_kind == NAME and is_name):
        yield from parse_attributes(cursor, _require_name(left, "an attribute"))
    elif cursor.kind == "=" and cursor.second_kind == "{":
        yield parse_sort(cursor, _require_name(left, "a sort").name, at)
    else:
        literal = parse_rest_of_literal(cursor, left, plus_minus_is_arrow=True)
        yield _parse_rule(cursor, literal, None, at)


def _require_name(expression: Expression | Literal, what: str) -> Term:
    if not isinstance(expression, Term) or expression.arguments:
        raise SourceIssue(expression.at, f"expected the name of {what}")
    return expression


def _parse_domains(cursor: Cursor) -> Iterator[DomainDirective]:
    """Parse `#domain s(X;Y), t(Z).`"""
    at = cursor.at
    cursor.take()
    more = True
    while more:
        sort = cursor.expect(NAME)
        cursor.expect("(")
        names = [variable.name for variable in cursor.parse_list(_parse_named_variable, ";")]
        cursor.expect(")")
        yield DomainDirective(sort, tuple(dict.fromkeys(names)), at=at)
        more = cursor.accept(",")
    cursor.expect(".")


def _parse_named_variable(cursor: Cursor) -> Variable:
    at, name = cursor.at, cursor.expect(VARIABLE)
    if name == "_":
        raise SourceIssue(at, "expected a named variable, not '_'")
    return Variable(name, at=at)


def _parse_constant(cursor: Cursor) -> Iterator[Statement]:
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
    return iter(())


def _parse_semantics(cursor: Cursor) -> Iterator[Statement]:
    """Parse `#semantics 2009.` or `#semantics 2018.`, which overrides the dialect."""
    cursor.take()
    at, given = cursor.at, cursor.expect(INTEGER)
    if given not in SEMANTICS:
        raise SourceIssue(at, f"unknown semantics {given}; expected {' or '.join(SEMANTICS)}")
    if cursor.semantics not in (None, given):
        raise SourceIssue(at, f"the semantics {cursor.semantics} is already chosen")
    cursor.semantics = given  # type: ignore[assignment]  # mypy does not see the test above
    cursor.expect(".")
    return iter(())


def _parse_query(cursor: Cursor) -> Iterator[Statement]:
    """Parse `?question.` The full stop is optional at the end of the text."""
    at = cursor.at
    yield replace(parse_question(cursor), at=at)
    if cursor.kind != END:
        cursor.expect(".")


def _parse_evidence(cursor: Cursor) -> Iterator[Statement]:
    yield parse_evidence(cursor)
    cursor.expect(".")


# rules


def _parse_clause(cursor: Cursor) -> Iterator[Statement]:
    """Parse a constraint, or a random selection, a pr-atom or a cr-rule with its label if it has one."""
    at, label = cursor.at, None
    if cursor.accept("["):
        label = _parse_term(cursor, "a label such as r or r(X)")
        cursor.expect("]")
        at = label.at
    if cursor.accept("random"):
        term, dynamic_range = _parse_selection_head(cursor)
        body, is_cr_rule = _parse_tail(cursor)
        yield Selection(term, dynamic_range, body, label, is_cr_rule, at=at)
    elif cursor.accept("pr"):
        yield _parse_probability(cursor, label, at)
    elif cursor.next_is(":-", *_CR_ARROWS):
        yield _parse_rule(cursor, None, label, at)
    else:
        yield _parse_rule(cursor, parse_literal(cursor, plus_minus_is_arrow=True), label, at)


def _parse_rule(cursor: Cursor, literal: BodyLiteral | None, label: Term | None, at: Place) -> Rule:
    """Parse a rule after its head; a constraint has none."""
    head = require_assignment(literal, "the head of a rule") if literal else None
    body, is_cr_rule = _parse_tail(cursor, needs_body=head is None)
    if label and not is_cr_rule:
        rule = Rule(head, body)
        raise SourceIssue(at, f"only random selections, pr-atoms and cr-rules have a label, not '{rule}'")
    return Rule(head, body, label, is_cr_rule, at=at)


def _parse_tail(cursor: Cursor, *, needs_body: bool = False) -> tuple[Body, bool]:
    """Parse the rest of a rule after its head; return the body and whether the rule is a cr-rule."""
    body: Body = ()
    arrow = cursor.kind
    if cursor.next_is(":-", *_CR_ARROWS):
        cursor.take()
        cursor.uses_plog2 |= arrow == ":+"
        if needs_body or not cursor.next_is("."):
            body = parse_body(cursor)
    cursor.expect(".")
    return body, arrow in _CR_ARROWS


def _parse_term(cursor: Cursor, what: str) -> Term:
    term = parse_value(cursor)
    if not isinstance(term, Term):
        raise SourceIssue(term.at, f"expected {what}, not {term}")
    return term


def _parse_selection_head(cursor: Cursor) -> tuple[Term, DynamicRange | None]:
    """Parse `(term)`, `(term : {X : condition})` or `(term, p)`."""
    cursor.expect("(")
    term = _parse_term(cursor, "an attribute")
    dynamic_range = None
    if cursor.accept(":"):
        cursor.expect("{")
        variable = _parse_named_variable(cursor)
        cursor.expect(":")
        dynamic_range = DynamicRange(variable, parse_body(cursor), at=variable.at)
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


_PARSERS: dict[str, Callable[[Cursor], Iterator[Statement]]] = {
    "#domain": _parse_domains,
    "#const": _parse_constant,
    "#semantics": _parse_semantics,
    "?": _parse_query,
    "obs": _parse_evidence,
    "do": _parse_evidence,
    **dict.fromkeys(("[", "random", "pr", ":-", *_CR_ARROWS), _parse_clause),
}
"""The first token of a statement -> its parser; other statements are declarations or rules."""
