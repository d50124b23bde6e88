"""Static checks of a program: names, arities, sorts and labels; `safety` checks variables and arithmetic.

Every check raises SourceIssue for the first error.
"""

from __future__ import annotations

from collections.abc import Sequence

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import canonical_text, find_variables, is_integer
from lcorpp.reasoning.language.facts import Fact
from lcorpp.reasoning.language.issues import Place, SortMismatch, SourceIssue
from lcorpp.reasoning.language.safety import check_variables, require_integers
from lcorpp.reasoning.language.signature import Signature, build_signature
from lcorpp.reasoning.language.syntax import (
    Clause,
    Intervention,
    Literal,
    Number,
    Observation,
    Probability,
    Query,
    Rule,
    Selection,
    Statement,
    Term,
)
from lcorpp.reasoning.language.traversal import list_expressions


def check_statements(statements: Sequence[Statement]) -> Signature:
    """Check a program and return its signature."""
    signature = build_signature(statements)
    labelled: dict[str, Selection] = {}
    for statement in statements:
        if isinstance(statement, Selection) and statement.label:
            first = labelled.setdefault(str(statement.label), statement)
            if first is not statement:
                words = f"label [{statement.label}] is already used at {first.at}"
                raise SourceIssue(statement.at, words)
        check_statement(statement, signature)
    return signature


def check_statement(statement: Statement, signature: Signature) -> None:
    """Check a statement against the declarations of a program."""
    if isinstance(statement, Clause):
        _check_clause(statement, signature)
    elif isinstance(statement, Observation):
        for literal in (literal for case in statement.formula for literal in case):
            _check_ground_literal(literal, signature)
    elif isinstance(statement, Intervention):
        value = Literal(statement.term, "=", statement.value, at=statement.at)
        _check_ground_literal(value, signature)
        _list_selections(statement.term, statement.at, signature)
    elif isinstance(statement, Query):
        _check_subjects(statement, signature)
        for part in (Observation(statement.formula), *statement.observations, *statement.interventions):
            check_statement(part, signature)


def _check_ground_literal(literal: Literal, signature: Signature) -> None:
    slots = list(signature.iter_attribute_slots(literal))
    for expression in (*literal.term.arguments, literal.value):
        canonical_text(expression)  # raises for a variable
    signature.check_slots(slots)
    if literal.value is not literal.term:
        require_integers((literal,), {}, signature)


def _check_subjects(query: Query, signature: Signature) -> None:
    for i, subject in enumerate(query.subjects):
        _check_ground_literal(subject.as_literal(), signature)
        if subject in query.subjects[:i]:
            raise SourceIssue(subject.at, f"the query names {subject} twice; expected different attributes")
        words = [value for value in signature.attributes[subject.name].values if not is_integer(value)]
        if query.expression and words:
            raise SourceIssue(
                subject.at, f"{subject} may be {words[0]}, which is not a number; E[...] expects integers"
            )


def _list_selections(term: Term, at: Place, signature: Signature) -> Sequence[Selection]:
    """List the random selections of an attribute, which needs at least one."""
    selections = signature.selections.get(term.name, ())
    if not selections:
        raise SourceIssue(
            at, f"{term.name} has no random selection; expected 'random({term}).' in the program"
        )
    return selections


# clauses


def _check_clause(clause: Clause, signature: Signature) -> None:
    if isinstance(clause, Fact) and _is_valid(clause, signature):
        return
    if isinstance(clause, Probability):
        _check_probability(clause, signature)
    check_variables(clause, signature)
    if isinstance(clause, Selection) and clause.range:  # a rule for the possible values
        variable = clause.range.variable
        if variable.name in find_variables(*list_expressions(clause)):
            words = f"variable {variable} of the dynamic range is also used outside of it"
            raise SourceIssue(variable.at, words)
        body = (*clause.body, *clause.range.condition)
        check_variables(Rule(Literal(clause.term, "=", variable), body, at=clause.at), signature)


def _is_valid(fact: Fact, signature: Signature) -> bool:
    """Whether the values of a fact are in their sorts, so that it needs no other checks."""
    attribute = signature.attributes.get(fact.name)
    if attribute is None or len(attribute.arguments) + 1 != len(fact.values):
        return False
    sorts = (*attribute.arguments, attribute.range)
    return all(str(value) in signature.sorts[sort] for value, sort in zip(fact.values, sorts, strict=True))


def _check_probability(atom: Probability, signature: Signature) -> None:
    """Check the label and the number of a pr-atom."""
    signature.get_attribute(atom.term)
    selections = _list_selections(atom.term, atom.at, signature)
    if (label := atom.label) is not None:
        labels = [selection.label for selection in selections if selection.label]
        sizes = {len(other.arguments) for other in labels if other.name == label.name}
        if not sizes:
            raise SourceIssue(
                label.at,
                f"no random selection of {atom.term.name} has the label [{label}];"
                f" {expected_one_of(list(map(str, labels)))}",
            )
        if label.arguments and len(label.arguments) not in sizes:
            raise SourceIssue(
                label.at,
                f"label [{label}] has {len(label.arguments)} arguments, the selection's has {min(sizes)}",
            )
    number = atom.number
    if isinstance(number, Number) and not 0 <= number.value <= 1:
        raise SourceIssue(number.at, f"the probability {number.value} is not between 0 and 1")


# lenient mode


def drop_ill_sorted(statements: Sequence[Statement]) -> tuple[Statement, ...]:
    """Return the statements that have instances (lenient mode).

    A statement has no instance if its head or a positive body literal has a value or an argument outside of
    its sort, or if a positive body literal has a wrong number of arguments. Other contradictions to
    declarations remain errors: under `not`, in observations, interventions and queries, and in the number of
    arguments of a head.
    """
    signature = build_signature(statements)
    return tuple(s for s in statements if not isinstance(s, Clause) or _has_instances(s, signature))


def _has_instances(clause: Clause, signature: Signature) -> bool:
    try:
        _check_clause(clause, signature)
    except SortMismatch:
        if clause.head:
            signature.get_attribute(clause.head.term)
        literals = [part for part in (clause.head, *clause.body) if isinstance(part, Literal)]
        positive = [part for part in literals if not part.negated and not signature.is_sort(part)]
        try:
            signature.check_slots(signature.iter_body_slots(positive))
        except SortMismatch:
            return False
        raise
    return True
