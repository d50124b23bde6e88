"""Static checks of a program: names, arities, sorts, labels, safety and sizes.

`safety` checks variables and arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import canonical_text, iter_variables
from lcorpp.reasoning.language.issues import SortMismatch, SourceIssue
from lcorpp.reasoning.language.safety import check_order, check_slots, check_variables
from lcorpp.reasoning.language.signature import Signature, build_signature
from lcorpp.reasoning.language.syntax import (
    Comparison,
    CrRule,
    Intervention,
    Literal,
    Number,
    Observation,
    Place,
    Probability,
    Query,
    Rule,
    Selection,
    Statement,
    Term,
)
from lcorpp.reasoning.language.traversal import as_selection, iter_expressions, list_expressions


def check(statements: Sequence[Statement]) -> Signature:
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


def check_statement(statement: Statement, signature: Signature) -> None:
    """Check one statement against the declarations.

    Raises:
        SortMismatch: a term contradicts its declaration.
        SourceIssue: another error.
    """
    selection = as_selection(statement)
    if selection is not None:
        _check_selection(selection, signature)
    else:
        _check_statement(statement, signature)


def _check_statement(statement: Statement, signature: Signature) -> None:
    if isinstance(statement, CrRule):
        assert isinstance(statement.statement, Rule)
        statement = statement.statement
    if isinstance(statement, Rule):
        if statement.head:
            check_attribute(statement.head.term, signature)
        _check_body(statement.body, signature)
        check_variables(
            statement.at,
            list_expressions(statement),
            list(signature.slots(statement)),
            statement.body,
            signature,
        )
    elif isinstance(statement, Probability):
        _check_probability(statement, signature)
    elif isinstance(statement, Query):
        check_query(statement, signature)
    elif isinstance(statement, Observation):
        _check_ground(statement.literal, signature)
    elif isinstance(statement, Intervention):
        _check_intervention(statement, signature)


def check_query(query: Query, signature: Signature) -> None:
    """Check a query against the declarations of a program.

    Raises:
        SourceIssue: the first error.
    """
    if query.subject:
        _check_term(query.subject, signature)
    for literal in (*query.literals, *(observation.literal for observation in query.observations)):
        _check_ground(literal, signature)
    for intervention in query.interventions:
        _check_intervention(intervention, signature)


# terms and literals


def check_attribute(term: Term, signature: Signature) -> None:
    """Check the name and the number of arguments of an attribute term.

    Raises:
        SortMismatch: the number is wrong.
        SourceIssue: the attribute is not declared.
    """
    attribute = signature.attributes.get(term.name)
    if attribute is None:
        what = "is a sort, not an attribute" if term.name in signature.sorts else "is not declared"
        raise SourceIssue(term.at, f"{term.name!r} {what}; {expected_one_of(list(signature.attributes))}")
    if len(term.arguments) != len(attribute.arguments):
        shape = f"{term.name}({', '.join(attribute.arguments)})" if attribute.arguments else term.name
        raise SortMismatch(
            term.at,
            f"{term.name} has {len(attribute.arguments)} arguments, not {len(term.arguments)};"
            f" expected {shape}",
        )


def _check_body(body: Iterable[Literal | Comparison], signature: Signature) -> None:
    for literal in body:
        if not isinstance(literal, Literal):
            continue
        if not signature.is_sort(literal):
            check_attribute(literal.term, signature)
        elif len(literal.term.arguments) != 1 or (literal.relation, literal.value) != ("=", Term("true")):
            raise SourceIssue(
                literal.at, f"{literal.term.name} is a sort; expected {literal.term.name}(...) without value"
            )


def _check_term(term: Term, signature: Signature) -> None:
    check_attribute(term, signature)
    for argument in term.arguments:
        canonical_text(argument)
    check_slots(signature.term_slots(term), signature)


def _check_ground(literal: Literal, signature: Signature) -> None:
    _check_term(literal.term, signature)
    canonical_text(literal.value)
    check_slots(signature.literal_slots(literal), signature)
    check_order((literal,), {}, signature)


def _check_intervention(intervention: Intervention, signature: Signature) -> None:
    _check_ground(Literal(intervention.term, "=", intervention.value, at=intervention.at), signature)
    _check_random(intervention.term, intervention.at, signature)


def _check_random(term: Term, at: Place, signature: Signature) -> Sequence[Selection]:
    selections = signature.selections.get(term.name, ())
    if not selections:
        raise SourceIssue(
            at, f"{term.name} has no random selection; expected 'random({term}).' in the program"
        )
    return selections


# statements


def _check_selection(selection: Selection, signature: Signature) -> None:
    check_attribute(selection.term, signature)
    _check_body(selection.body, signature)
    outer = list_expressions(selection)
    outcomes = len(signature.attributes[selection.term.name].values)
    slots = list(signature.slots(selection))
    check_variables(selection.at, outer, slots, selection.body, signature, outcomes=outcomes)
    if selection.range:
        chosen, condition = selection.range.variable, selection.range.condition
        if any(variable == chosen for expression in outer for variable in iter_variables(expression)):
            raise SourceIssue(chosen.at, f"variable {chosen} of the dynamic range is also used outside of it")
        _check_body(condition, signature)
        slots = [*slots, *signature.range_slots(selection)]
        inner = [*outer, chosen, *iter_expressions(condition)]
        check_variables(selection.at, inner, slots, (*selection.body, *condition), signature)


def _check_probability(statement: Probability, signature: Signature) -> None:
    check_attribute(statement.term, signature)
    _check_body(statement.condition, signature)
    selections = _check_random(statement.term, statement.at, signature)
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
        list(signature.slots(statement)),
        statement.condition,
        signature,
        statement.number,
    )
