"""Conformance: check ground terms, literals and queries against the signature of a program.

Every check raises SourceIssue for the first error.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from lcorpp.reasoning.language.arithmetic import canonical_text, is_integer
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.safety import check_order
from lcorpp.reasoning.language.signature import Signature
from lcorpp.reasoning.language.syntax import (
    Formula,
    Intervention,
    Literal,
    Query,
    Selection,
    Term,
)
from lcorpp.reasoning.language.traversal import as_literal


def check_query(query: Query, signature: Signature) -> None:
    """Check a query against the declarations of a program."""
    for i, subject in enumerate(query.subjects):
        _check_ground_term(subject, signature)
        if subject in query.subjects[:i]:
            raise SourceIssue(subject.at, f"the query names {subject} twice; expected different attributes")
        words = [value for value in signature.attributes[subject.name].values if not is_integer(value)]
        if query.expression and words:
            raise SourceIssue(
                subject.at, f"{subject} may be {words[0]}, which is no number; E[...] expects integers"
            )
    for formula in (query.formula, *(observation.formula for observation in query.observations)):
        check_formula(formula, signature)
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


def check_formula(formula: Formula, signature: Signature) -> None:
    """Check the literals of a formula, which has no variables."""
    for literal in chain.from_iterable(formula):
        check_ground_literal(literal, signature)


def check_ground_literal(literal: Literal, signature: Signature) -> None:
    """Check a literal without variables."""
    _check_ground_term(literal.term, signature)
    canonical_text(literal.value)  # raises for a variable
    signature.check_slots(signature.iter_attribute_slots(literal))
    check_order((literal,), {}, signature)


def _check_ground_term(term: Term, signature: Signature) -> None:
    signature.get_attribute(term)
    canonical_text(term)  # raises for a variable
    signature.check_slots(signature.iter_attribute_slots(as_literal(term)))
