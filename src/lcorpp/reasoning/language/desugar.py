"""Desugaring: rewrite constructs of the dialects into plain statements.

plog 1.0, recognised by `#domain`: missing declarations are inferred, see `implicit_declarations`.
plog 2.0: `?c.` of a boolean c asks for the probability of `c=true`.
both dialects: a body literal `obs(a, v, true)` is true if the program contains the observation `obs(a=v).`
    It becomes the boolean attribute `observed_a(v, true)`, with a fact for each observation of the program.
    Observations of a query do not count.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.signature import BOOLEAN
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    DomainDirective,
    Expression,
    Literal,
    Observation,
    Query,
    Rule,
    Semantics,
    SortDefinition,
    Statement,
    Term,
)
from lcorpp.reasoning.language.traversal import iter_literals, map_literals

TRUE, FALSE = Term("true"), Term("false")


def desugar(statements: Sequence[Statement], semantics: Semantics) -> tuple[Statement, ...]:
    """Rewrite the constructs of the dialects into plain statements.

    Args:
        semantics: "2018" for plog 2.0, "2009" for plog 1.0.

    Raises:
        SourceIssue: a body contains `do(...)` or an invalid `obs(...)`.
    """
    if any(isinstance(statement, DomainDirective) for statement in statements):
        from lcorpp.reasoning.language.implicit_declarations import infer_declarations  # rarely needed

        statements = infer_declarations(statements)
    if semantics == "2018":
        statements = _rewrite_boolean_queries(statements)
    return tuple(_rewrite_body_observations(statements))


def _rewrite_boolean_queries(statements: Sequence[Statement]) -> Sequence[Statement]:
    if not any(isinstance(s, Query) and s.subject for s in statements):
        return statements
    sorts = {BOOLEAN} | {s.name for s in statements if isinstance(s, SortDefinition) and TRUE in s.elements}
    booleans = {s.name for s in statements if isinstance(s, AttributeDeclaration) and s.range in sorts}
    return [
        replace(s, literals=(Literal(s.subject, "=", TRUE, at=s.subject.at),), subject=None)
        if isinstance(s, Query) and s.subject and s.subject.name in booleans
        else s
        for s in statements
    ]


def _rewrite_body_observations(statements: Sequence[Statement]) -> Sequence[Statement]:
    """Replace each `obs(...)` in a body by an attribute, and add its declaration and facts."""
    observed_in_bodies = _find_body_observations(statements)
    if not observed_in_bodies:
        return statements
    declared = {s.name: s for s in statements if isinstance(s, AttributeDeclaration)}
    new: list[Statement] = []
    for name, term in observed_in_bodies.items():
        attribute = declared.get(name)
        if attribute is None:
            raise SourceIssue(
                term.at, f"{name!r} is not declared; expected an attribute in obs(attribute, value)"
            )
        sorts = (*attribute.arguments, attribute.range, BOOLEAN)
        new.append(AttributeDeclaration(_format_observed_name(name), sorts, BOOLEAN, at=attribute.at))
    new.extend(_create_observed_facts(statements, observed_in_bodies))
    return [*(map_literals(statement, _rewrite_literal) for statement in statements), *new]


def _find_body_observations(statements: Sequence[Statement]) -> dict[str, Term]:
    """Map the attributes in `obs(...)` of bodies to their first occurrence."""
    first_terms: dict[str, Term] = {}
    for statement in statements:
        for literal, _ in iter_literals(statement):
            if literal.term.name == "do":
                raise SourceIssue(literal.at, "do(...) is not supported in the body of a rule")
            if literal.term.name == "obs":
                observed = _split_observation(literal.term)[0]
                first_terms.setdefault(observed.name, observed)
    return first_terms


def _format_observed_name(attribute: str) -> str:
    return f"observed_{attribute}"


def _split_observation(term: Term) -> tuple[Term, Expression, Expression]:
    """Split `obs(term, value, polarity)`; value and polarity are `true` by default."""
    first, *rest = term.arguments or (None,)
    if not isinstance(first, Term) or len(rest) > 2:
        raise SourceIssue(
            term.at, f"expected obs(attribute, value) or obs(attribute, value, true), not {term}"
        )
    return first, rest[0] if rest else TRUE, rest[1] if len(rest) > 1 else TRUE


def _rewrite_literal(literal: Literal) -> Literal:
    if literal.term.name != "obs":
        return literal
    observed, value, polarity = _split_observation(literal.term)
    term = Term(
        _format_observed_name(observed.name), (*observed.arguments, value, polarity), at=literal.term.at
    )
    return Literal(term, literal.relation, literal.value, literal.negated, at=literal.at)


def _create_observed_facts(
    statements: Sequence[Statement], observed_in_bodies: dict[str, Term]
) -> Iterator[Rule]:
    for statement in statements:
        if not isinstance(statement, Observation):
            continue
        literal, at = statement.literal, statement.at
        if (
            literal.negated
            or literal.term.name not in observed_in_bodies
            or literal.relation not in ("=", "!=")
        ):
            continue
        polarity = TRUE if literal.relation == "=" else FALSE
        term = Term(
            _format_observed_name(literal.term.name),
            (*literal.term.arguments, literal.value, polarity),
            at=at,
        )
        yield Rule(Literal(term, "=", TRUE, at=at), at=at)
