"""Static checks of a program: names, arities, sorts, labels, safety and sizes.

`conformance` checks terms and literals, `safety` variables and arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import find_variables
from lcorpp.reasoning.language.conformance import (
    check_attribute,
    check_ground_literal,
    check_intervention,
    check_query,
    check_slots,
    require_selections,
)
from lcorpp.reasoning.language.issues import SortMismatch, SourceIssue
from lcorpp.reasoning.language.safety import check_variables
from lcorpp.reasoning.language.signature import Signature, build_signature
from lcorpp.reasoning.language.syntax import (
    BodyLiteral,
    CrRule,
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
from lcorpp.reasoning.language.traversal import as_selection, get_body, list_expressions, list_fact_values


def check_statements(statements: Sequence[Statement]) -> Signature:
    """Check a program and return its signature; raise SourceIssue for the first error."""
    signature = build_signature(statements)
    labels: dict[str, Selection] = {}
    for statement in statements:
        selection = as_selection(statement)
        if selection is not None:
            label = str(selection.label)
            if selection.label and label in labels:
                raise SourceIssue(selection.at, f"label [{label}] is already used at {labels[label].at}")
            labels[label] = selection
            _check_selection(selection, signature)
    for statement in statements:
        if as_selection(statement) is None:
            _check_statement(statement, signature)
    return signature


def _check_statement(statement: Statement, signature: Signature) -> None:
    if isinstance(statement, CrRule):
        statement = statement.statement
    if isinstance(statement, Rule):
        if statement.head:
            check_attribute(statement.head.term, signature)
            if _is_valid_fact(statement, statement.head.term.name, signature):
                return
        _check_body(statement.body, signature)
        check_variables(statement, signature)
    elif isinstance(statement, Selection):
        _check_selection(statement, signature)
    elif isinstance(statement, Probability):
        check_attribute(statement.term, signature)
        _check_body(statement.condition, signature)
        _check_probability(statement, signature)
        check_variables(statement, signature)
    elif isinstance(statement, Query):
        check_query(statement, signature)
    elif isinstance(statement, Observation):
        check_ground_literal(statement.literal, signature)
    elif isinstance(statement, Intervention):
        check_intervention(statement, signature)


def _is_valid_fact(rule: Rule, name: str, signature: Signature) -> bool:
    """Whether a rule is a fact of integers and names in their sorts, which needs no other checks."""
    values, attribute = list_fact_values(rule), signature.attributes[name]
    if values is None:
        return False
    sorts = (*attribute.arguments, attribute.range)
    return all(str(value) in signature.sorts[sort] for value, sort in zip(values, sorts, strict=True))


def _check_body(body: Iterable[BodyLiteral], signature: Signature) -> None:
    for literal in body:
        if not isinstance(literal, Literal):
            continue
        if not signature.is_sort(literal):
            check_attribute(literal.term, signature)
        elif len(literal.term.arguments) != 1 or (literal.relation, literal.value) != ("=", Term("true")):
            raise SourceIssue(
                literal.at, f"{literal.term.name} is a sort; expected {literal.term.name}(...) without value"
            )


def _check_selection(selection: Selection, signature: Signature) -> None:
    check_attribute(selection.term, signature)
    _check_body(selection.body, signature)
    check_variables(selection, signature)
    if selection.range:
        variable = selection.range.variable
        if variable.name in find_variables(*list_expressions(selection)):
            raise SourceIssue(
                variable.at, f"variable {variable} of the dynamic range is also used outside of it"
            )
        _check_body(selection.range.condition, signature)
        check_variables(selection, signature, selection.range)


def _check_probability(statement: Probability, signature: Signature) -> None:
    """Check the label and the number of a pr-atom."""
    selections = require_selections(statement.term, statement.at, signature)
    if statement.label:
        label = statement.label
        labels = [selection.label for selection in selections if selection.label]
        sizes = {len(other.arguments) for other in labels if other.name == label.name}
        if not sizes:
            raise SourceIssue(
                label.at,
                f"no random selection of {statement.term.name} has the label [{label}];"
                f" {expected_one_of(list(map(str, labels)))}",
            )
        if label.arguments and len(label.arguments) not in sizes:
            raise SourceIssue(
                label.at,
                f"label [{label}] has {len(label.arguments)} arguments, the selection's has {min(sizes)}",
            )
    number = statement.number
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
    try:
        _check_statement(statement, signature)
    except SortMismatch:
        inner = statement.statement if isinstance(statement, CrRule) else statement
        if not isinstance(inner, Rule | Selection | Probability):
            raise
        if isinstance(inner, Rule):
            heads = [inner.head] if inner.head else []
        elif isinstance(inner, Probability):
            heads = [Literal(inner.term, "=", inner.value)]
        else:
            heads = [Literal(inner.term, "<", inner.term)]  # an order has no slot for a value
        for head in heads:
            check_attribute(head.term, signature)
        positive = [part for part in get_body(inner) if isinstance(part, Literal) and not part.negated]
        if all(_is_well_sorted(literal, signature) for literal in (*heads, *positive)):
            raise
        return False
    return True


def _is_well_sorted(literal: Literal, signature: Signature) -> bool:
    if signature.is_sort(literal):
        return True
    try:
        check_attribute(literal.term, signature)
        check_slots(signature.iter_literal_slots(literal), signature)
    except SortMismatch:
        return False
    return True
