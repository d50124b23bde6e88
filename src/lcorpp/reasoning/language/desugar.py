"""Desugaring: rewrite constructs of the dialects into plain statements.

plog 1.0, recognised by `#domain`: missing declarations are inferred, see `inference`.
plog 2.0: `?c.` of a boolean c asks for the probability of `c=true`.
both dialects: a body literal `obs(a, v, true)` is true if the program contains the observation `obs(a=v).`
    It becomes the boolean attribute `observed_a(v, true)`, with a fact for each observation of the program.
    Observations of a query do not count. Attributes that share a name are distinguished, see `overloads`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lcorpp.reasoning.language.facts import Fact
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.sorts import BOOLEAN, SortDefinition, SortSet
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    DomainDirective,
    Expression,
    Literal,
    Observation,
    Query,
    Rule,
    Semantics,
    Statement,
    Term,
)
from lcorpp.reasoning.language.traversal import map_literals

TRUE, FALSE = Term("true"), Term("false")


def desugar(statements: Sequence[Statement], semantics: Semantics) -> tuple[Statement, ...]:
    """Rewrite the constructs of the dialects into plain statements.

    Args:
        semantics: "2018" for plog 2.0, "2009" for plog 1.0.

    Raises:
        SourceIssue: a body contains `do(...)` or an invalid `obs(...)`.
    """
    if any(isinstance(statement, DomainDirective) for statement in statements):
        from lcorpp.reasoning.language.inference import Inference  # rarely needed

        statements = Inference(statements).declare(statements)
    if semantics == "2018":
        statements = _rewrite_boolean_queries(statements)
    rewritten = _rewrite_body_observations(statements)
    names = [statement.name for statement in rewritten if isinstance(statement, AttributeDeclaration)]
    if len(set(names)) == len(names):
        return tuple(rewritten)
    from lcorpp.reasoning.language.overloads import resolve_overloads  # few programs have them

    return tuple(resolve_overloads(rewritten))


def _rewrite_boolean_queries(statements: Sequence[Statement]) -> Sequence[Statement]:
    sets = {s.name: s.sort for s in statements if isinstance(s, SortDefinition)}
    sorts = {BOOLEAN, *(name for name, s in sets.items() if isinstance(s, SortSet) and TRUE in s.elements)}
    booleans = {s.name for s in statements if isinstance(s, AttributeDeclaration) and s.range in sorts}

    def rewrite(query: Query) -> Query:
        if len(query.subjects) != 1 or query.expression or query.subjects[0].name not in booleans:
            return query
        (subject,) = query.subjects
        return replace(query, formula=((Literal(subject, "=", TRUE, at=subject.at),),), subjects=())

    return [rewrite(s) if isinstance(s, Query) else s for s in statements]


def _rewrite_body_observations(statements: Sequence[Statement]) -> Sequence[Statement]:
    """Replace each `obs(...)` in a body by an attribute, and add its declaration and facts."""
    observed: dict[tuple[str, int], Term] = {}  # the attributes in `obs(...)` of bodies, their first terms

    def rewrite(literal: Literal) -> Literal:
        if literal.term.name == "do":
            raise SourceIssue(literal.at, "do(...) is not supported in the body of a rule")
        if literal.term.name != "obs":
            return literal
        match literal.term.arguments:
            case (Term() as term, *rest) if len(rest) <= 2:
                observed.setdefault((term.name, len(term.arguments)), term)
                return replace(literal, term=_make_observed_term(term, *rest))
        raise SourceIssue(
            literal.at, f"expected obs(attribute, value) or obs(attribute, value, true), not {literal.term}"
        )

    rewritten = [s if isinstance(s, Fact) else map_literals(s, rewrite) for s in statements]
    if not observed:
        return statements
    declared = {(s.name, len(s.arguments)): s for s in statements if isinstance(s, AttributeDeclaration)}
    for (name, count), term in observed.items():
        attribute = declared.get((name, count))
        if attribute is None:
            raise SourceIssue(
                term.at, f"{name!r} is not declared; expected an attribute in obs(attribute, value)"
            )
        sorts = (*attribute.arguments, attribute.range, BOOLEAN)
        rewritten.append(AttributeDeclaration(f"observed_{name}", sorts, BOOLEAN, at=attribute.at))
    for statement in statements:
        if isinstance(statement, Observation) and len(statement.formula) == len(statement.formula[0]) == 1:
            literal, at = statement.formula[0][0], statement.at
            key = literal.term.name, len(literal.term.arguments)
            if key in observed and not literal.negated and literal.relation in ("=", "!="):
                polarity = TRUE if literal.relation == "=" else FALSE
                term = _make_observed_term(literal.term, literal.value, polarity)
                rewritten.append(Rule(Literal(term, "=", TRUE, at=at), at=at))
    return rewritten


def _make_observed_term(term: Term, value: Expression = TRUE, polarity: Expression = TRUE) -> Term:
    return Term(f"observed_{term.name}", (*term.arguments, value, polarity), at=term.at)
