"""Static checks of a program: names, arities, sorts, labels, safety and sizes.

`conformance` checks terms and literals, `safety` variables and arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import iter_variables
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
from lcorpp.reasoning.language.traversal import as_selection, get_body, iter_expressions, list_expressions


def check_statements(statements: Sequence[Statement]) -> Signature:
    """Check a program and return its signature.

    Raises:
        SourceIssue: the first error.
    """
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
        _check_body(statement.body, signature)
        check_variables(
            statement.at,
            list_expressions(statement),
            list(signature.iter_slots(statement)),
            statement.body,
            signature,
        )
    elif isinstance(statement, Selection):
        _check_selection(statement, signature)
    elif isinstance(statement, Probability):
        _check_probability(statement, signature)
    elif isinstance(statement, Query):
        check_query(statement, signature)
    elif isinstance(statement, Observation):
        check_ground_literal(statement.literal, signature)
    elif isinstance(statement, Intervention):
        check_intervention(statement, signature)


# terms and literals


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


# statements


def _check_selection(selection: Selection, signature: Signature) -> None:
    check_attribute(selection.term, signature)
    _check_body(selection.body, signature)
    outer = list_expressions(selection)
    outcomes = len(signature.attributes[selection.term.name].values)
    slots = list(signature.iter_slots(selection))
    check_variables(selection.at, outer, slots, selection.body, signature, outcomes=outcomes)
    if selection.range:
        chosen, condition = selection.range.variable, selection.range.condition
        if any(variable == chosen for expression in outer for variable in iter_variables(expression)):
            raise SourceIssue(chosen.at, f"variable {chosen} of the dynamic range is also used outside of it")
        _check_body(condition, signature)
        slots = [*slots, *signature.iter_range_slots(selection)]
        inner = [*outer, chosen, *iter_expressions(condition)]
        check_variables(selection.at, inner, slots, (*selection.body, *condition), signature)


def _check_probability(statement: Probability, signature: Signature) -> None:
    check_attribute(statement.term, signature)
    _check_body(statement.condition, signature)
    selections = require_selections(statement.term, statement.at, signature)
    if statement.label:
        label = statement.label
        named = [s.label for s in selections if s.label]
        if not any(other.name == label.name for other in named):
            raise SourceIssue(
                label.at,
                f"no random selection of {statement.term.name} has the label [{label}];"
                f" {expected_one_of(list(map(str, named)))}",
            )
        sizes = {len(other.arguments) for other in named if other.name == label.name}
        if label.arguments and len(label.arguments) not in sizes:
            raise SourceIssue(
                label.at,
                f"label [{label}] has {len(label.arguments)} arguments, the selection's has {min(sizes)}",
            )
    if isinstance(statement.number, Number) and not 0 <= statement.number.value <= 1:
        raise SourceIssue(
            statement.number.at, f"the probability {statement.number.value} is not between 0 and 1"
        )
    check_variables(
        statement.at,
        list_expressions(statement),
        list(signature.iter_slots(statement)),
        statement.condition,
        signature,
        statement.number,
    )


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
        if isinstance(inner, Rule | Selection | Probability) and _has_no_instance(inner, signature):
            return False
        raise
    return True


def _has_no_instance(statement: Rule | Selection | Probability, signature: Signature) -> bool:
    for literal in _iter_heads(statement):
        check_attribute(literal.term, signature)
        if not _is_well_sorted(literal, signature):
            return True
    needed = (part for part in get_body(statement) if isinstance(part, Literal) and not part.negated)
    return any(not _is_well_sorted(literal, signature) for literal in needed)


def _iter_heads(statement: Rule | Selection | Probability) -> Iterator[Literal]:
    """Iterate over the heads of a statement; a selected term gets a relation without value slot."""
    if isinstance(statement, Rule):
        if statement.head:
            yield statement.head
    elif isinstance(statement, Probability):
        yield Literal(statement.term, "=", statement.value)
    else:
        yield Literal(statement.term, "<", statement.term)


def _is_well_sorted(literal: Literal, signature: Signature) -> bool:
    if signature.is_sort(literal):
        return True
    try:
        check_attribute(literal.term, signature)
        check_slots(signature.iter_literal_slots(literal), signature)
    except SortMismatch:
        return False
    return True
