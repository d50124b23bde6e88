"""Conformance: check ground terms, literals and queries against the signature of a program.

Every check raises SourceIssue for the first error.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import canonical_text, is_integer, iter_variables
from lcorpp.reasoning.language.issues import Place, SortMismatch, SourceIssue
from lcorpp.reasoning.language.signature import ArgumentSlot, Signature
from lcorpp.reasoning.language.syntax import (
    BodyLiteral,
    Expression,
    Intervention,
    Literal,
    Query,
    Selection,
    Term,
    Variable,
)
from lcorpp.reasoning.language.traversal import as_literal


def check_query(query: Query, signature: Signature) -> None:
    """Check a query against the declarations of a program."""
    for i, subject in enumerate(query.subjects):
        _check_ground_term(subject, signature)
        if subject in query.subjects[:i]:
            raise SourceIssue(subject.at, f"the query names {subject} twice; expected different attributes")
    for literal in (*query.literals, *(observation.literal for observation in query.observations)):
        check_ground_literal(literal, signature)
    for intervention in query.interventions:
        check_intervention(intervention, signature)


def check_intervention(intervention: Intervention, signature: Signature) -> None:
    """Check the intervention, whose term needs a random selection."""
    check_ground_literal(Literal(intervention.term, "=", intervention.value, at=intervention.at), signature)
    require_selections(intervention.term, intervention.at, signature)


def require_selections(term: Term, at: Place, signature: Signature) -> Sequence[Selection]:
    """Return the random selections of an attribute, which needs at least one."""
    selections = signature.selections.get(term.name, ())
    if not selections:
        raise SourceIssue(
            at, f"{term.name} has no random selection; expected 'random({term}).' in the program"
        )
    return selections


def check_ground_literal(literal: Literal, signature: Signature) -> None:
    """Check a literal without variables."""
    _check_ground_term(literal.term, signature)
    canonical_text(literal.value)  # raises for a variable
    check_slots(signature.iter_attribute_slots(literal), signature)
    check_order((literal,), {}, signature)


def _check_ground_term(term: Term, signature: Signature) -> None:
    signature.get_attribute(term)
    canonical_text(term)  # raises for a variable
    check_slots(signature.iter_attribute_slots(as_literal(term)), signature)


def check_slots(slots: Iterable[ArgumentSlot], signature: Signature) -> None:
    """Check that constants in argument slots are members of their sorts; raise SortMismatch if not."""
    for expression, sort in slots:
        if not any(iter_variables(expression)):
            value = canonical_text(expression)
            if value not in signature.sorts[sort]:
                known = expected_one_of(list(signature.sorts[sort]))
                raise SortMismatch(expression.at, f"{value!r} is not a member of the sort {sort}; {known}")


def check_order(body: Iterable[BodyLiteral], sorts: dict[str, list[str]], signature: Signature) -> None:
    """Check that only integers are compared by order."""
    for literal in body:
        if literal.relation in ("=", "!="):
            continue
        sides = [literal.value] if isinstance(literal, Literal) else [literal.left, literal.right]
        if (
            isinstance(literal, Literal)
            and signature.attributes[literal.term.name].range not in signature.integer_sorts
        ):
            raise SourceIssue(
                literal.at, f"{literal} orders values of {literal.term.name}, which are not integers"
            )
        for side in sides:
            check_integer(side, f"the order in {literal}", sorts, signature)


def check_integer(
    expression: Expression, what: str, sorts: dict[str, list[str]], signature: Signature
) -> None:
    if isinstance(expression, Term):
        raise SourceIssue(expression.at, f"{what} needs integers, but {expression} is none")
    if isinstance(expression, Variable):
        for sort in sorts.get(expression.name, ()):
            if sort not in signature.integer_sorts:
                odd = next(m for m in signature.sorts[sort] if not is_integer(m))
                raise SourceIssue(
                    expression.at, f"{what} needs integers, but {expression} may be {odd} of the sort {sort}"
                )
