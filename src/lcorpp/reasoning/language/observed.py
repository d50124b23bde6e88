"""Observations in rule bodies, as some programs for plog 2.0 have them.

`obs(a, v, true)` in a body asks whether the program records that a was observed to be v; an attribute of its
own says so, and is true of what is recorded. The observations of a query are no records.
"""

from __future__ import annotations

from collections.abc import Sequence

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.rewriting import iter_literals, map_literals
from lcorpp.reasoning.language.signature import BOOLEAN
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    Expression,
    Literal,
    Observation,
    Rule,
    Statement,
    Term,
)

TRUE, FALSE = Term("true"), Term("false")


def replace_observed(statements: Sequence[Statement]) -> Sequence[Statement]:
    """The statements with an attribute in place of each `obs(...)` in a body, and its facts.

    Raises:
        SourceIssue: such a literal is not well-formed, or a body asks for `do(...)`.
    """
    asked: dict[str, Term] = {}
    for statement in statements:
        for literal, _ in iter_literals(statement):
            if literal.term.name == "do":
                raise SourceIssue(literal.at, "do(...) in the body of a rule is not read")
            if literal.term.name == "obs":
                observed = _observed(literal.term)[0]
                asked.setdefault(observed.name, observed)
    if not asked:
        return statements
    declared = {s.name: s for s in statements if isinstance(s, AttributeDeclaration)}
    made: list[Statement] = []
    for name, term in asked.items():
        attribute = declared.get(name)
        if attribute is None:
            raise SourceIssue(
                term.at, f"{name!r} is not declared; expected an attribute in obs(attribute, value)"
            )
        sorts = (*attribute.arguments, attribute.range, BOOLEAN)
        made.append(AttributeDeclaration(_name(name), sorts, BOOLEAN, at=attribute.at))
    made.extend(_fact(s) for s in statements if _is_record(s, asked))
    return [*(map_literals(statement, _asked) for statement in statements), *made]


def _name(attribute: str) -> str:
    return f"observed_{attribute}"


def _observed(term: Term) -> tuple[Term, Expression, Expression]:
    """Attribute term, value and whether it was observed to have the value."""
    first, *rest = term.arguments or (None,)
    if not isinstance(first, Term) or len(rest) > 2:
        raise SourceIssue(
            term.at, f"expected obs(attribute, value) or obs(attribute, value, true), not {term}"
        )
    return first, rest[0] if rest else TRUE, rest[1] if len(rest) > 1 else TRUE


def _asked(literal: Literal) -> Literal:
    if literal.term.name != "obs":
        return literal
    observed, value, sign = _observed(literal.term)
    term = Term(_name(observed.name), (*observed.arguments, value, sign), at=literal.term.at)
    return Literal(term, literal.relation, literal.value, literal.negated, at=literal.at)


def _is_record(statement: Statement, asked: dict[str, Term]) -> bool:
    if not isinstance(statement, Observation) or statement.literal.negated:
        return False
    return statement.literal.term.name in asked and statement.literal.relation in ("=", "!=")


def _fact(statement: Statement) -> Rule:
    assert isinstance(statement, Observation)
    literal = statement.literal
    sign = TRUE if literal.relation == "=" else FALSE
    term = Term(_name(literal.term.name), (*literal.term.arguments, literal.value, sign), at=statement.at)
    return Rule(Literal(term, "=", TRUE, at=statement.at), at=statement.at)
