"""Static checks of a program: names, arities, sorts, labels, safety and sizes.

`conformance` checks terms and literals, `safety` variables and arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import find_variables
from lcorpp.reasoning.language.conformance import (
    check_formula,
    check_intervention,
    check_query,
    require_selections,
)
from lcorpp.reasoning.language.facts import Fact
from lcorpp.reasoning.language.issues import Place, SortMismatch, SourceIssue
from lcorpp.reasoning.language.safety import check_variables
from lcorpp.reasoning.language.signature import Signature, build_signature
from lcorpp.reasoning.language.syntax import (
    Clause,
    DynamicRange,
    Intervention,
    Literal,
    Number,
    Observation,
    Probability,
    Query,
    Rule,
    Selection,
    Statement,
)
from lcorpp.reasoning.language.traversal import as_clause, get_body, get_head, list_expressions


def check_statements(statements: Sequence[Statement]) -> Signature:
    """Check a program and return its signature; raise SourceIssue for the first error."""
    signature = build_signature(statements)
    labels: dict[str, Place] = {}
    for statement in statements:
        clause = as_clause(statement)
        if isinstance(clause, Selection) and clause.label:
            label = str(clause.label)
            if label in labels:
                raise SourceIssue(clause.at, f"label [{label}] is already used at {labels[label]}")
            labels[label] = clause.at
        if clause:
            _check_clause(clause, signature)
        elif isinstance(statement, Query):
            check_query(statement, signature)
        elif isinstance(statement, Observation):
            check_formula(statement.formula, signature)
        elif isinstance(statement, Intervention):
            check_intervention(statement, signature)
    return signature


def _check_clause(clause: Clause, signature: Signature) -> None:
    if isinstance(clause, Fact) and _is_valid(clause, signature):
        return
    if isinstance(clause, Probability):
        _check_probability(clause, signature)
    check_variables(clause, signature)
    if isinstance(clause, Selection) and clause.range:
        _check_range(clause, clause.range, signature)


def _is_valid(fact: Fact, signature: Signature) -> bool:
    """Whether the values of a fact are in their sorts, so that it needs no other checks."""
    attribute = signature.attributes.get(fact.name)
    if attribute is None or len(attribute.arguments) + 1 != len(fact.values):
        return False
    sorts = (*attribute.arguments, attribute.range)
    return all(str(value) in signature.sorts[sort] for value, sort in zip(fact.values, sorts, strict=True))


def _check_range(selection: Selection, dynamic_range: DynamicRange, signature: Signature) -> None:
    """Check a dynamic range as if it were a rule for the possible values."""
    variable = dynamic_range.variable
    if variable.name in find_variables(*list_expressions(selection)):
        raise SourceIssue(variable.at, f"variable {variable} of the dynamic range is also used outside of it")
    body = (*selection.body, *dynamic_range.condition)
    check_variables(Rule(Literal(selection.term, "=", variable), body, at=selection.at), signature)


def _check_probability(atom: Probability, signature: Signature) -> None:
    """Check the label and the number of a pr-atom."""
    signature.get_attribute(atom.term)
    selections = require_selections(atom.term, atom.at, signature)
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

    Raises:
        SourceIssue: a statement has another error.
    """
    signature = build_signature(statements)
    return tuple(statement for statement in statements if _has_instances(statement, signature))


def _has_instances(statement: Statement, signature: Signature) -> bool:
    clause = as_clause(statement)
    try:
        if clause:
            _check_clause(clause, signature)
    except SortMismatch:
        assert clause
        head = get_head(clause)
        if head:
            signature.get_attribute(head.term)
        literals = [part for part in (head, *get_body(clause)) if isinstance(part, Literal)]
        positive = [part for part in literals if not part.negated and not signature.is_sort(part)]
        try:
            signature.check_slots(signature.iter_body_slots(positive))
        except SortMismatch:
            return False
        raise
    return True
