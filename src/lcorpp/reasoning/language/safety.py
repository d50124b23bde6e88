"""Safety: check that the variables of a clause have finite ranges and its arithmetic stays in bounds.

A clause that passes these checks can be grounded.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from lcorpp.reasoning.language.arithmetic import MAX_INTEGER, find_variables, is_integer, iter_variables
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.signature import ArgumentSlot, Signature
from lcorpp.reasoning.language.syntax import (
    BodyLiteral,
    Clause,
    ComparisonLiteral,
    Expression,
    Literal,
    Number,
    Probability,
    Selection,
    Term,
    Variable,
)
from lcorpp.reasoning.language.traversal import get_body, list_expressions

MAX_INSTANCES = 2_000_000
"""Maximal number of ground instances of one clause; each outcome of a selection counts."""


def check_variables(clause: Clause, signature: Signature) -> None:
    """Check the variables and the arithmetic of a clause; a dynamic range is checked as a clause of its own.

    Raises:
        SourceIssue: a constant or variable contradicts its sort, a variable is unsafe, there are too many
            instances, or an operand of arithmetic is not an integer or may exceed 32 bits.
    """
    body, slots, scope = get_body(clause), list(signature.iter_slots(clause)), list_expressions(clause)
    signature.check_slots(slots)
    used = [variable for expression in scope for variable in iter_variables(expression)]
    sorts = find_variable_sorts(slots, used, signature)
    # each outcome of a selection counts
    span = len(signature.attributes[clause.term.name].values) if isinstance(clause, Selection) else 1
    computed = _find_computed_variables(body) | _find_joined_variables(clause, signature)
    for name, sorts_of_variable in sorts.items():
        common = signature.count_common_members(sorts_of_variable)
        if not common:
            where = next((variable.at for variable in used if variable.name == name), clause.at)
            names = " and ".join(sorts_of_variable)
            raise SourceIssue(where, f"variable {name} cannot be of the sorts {names} at once")
        if name not in computed:
            span *= common
    if span > MAX_INSTANCES:
        raise SourceIssue(
            clause.at, f"the statement has {span} ground instances; expected at most {MAX_INSTANCES}"
        )
    # matching the known members of a record binds its variables
    records = find_variables(*(expression for expression, _ in slots if isinstance(expression, Term)))
    bounds = dict.fromkeys((*sorts, *records), signature.max_integer)
    _add_computed_bounds(body, bounds, sorts, signature)
    for variable in used:
        if variable.name not in bounds:
            raise SourceIssue(
                variable.at,
                f"variable {variable} is unsafe; expected it as an argument or a value of an attribute,"
                " or in #domain",
            )
    check_order(body, sorts, signature)
    for expression in scope:
        # the number of a pr-atom is computed exactly and has no bound
        if not (isinstance(clause, Probability) and expression is clause.number):
            _bound_magnitude(expression, bounds, sorts, signature)


def find_variable_sorts(
    slots: Iterable[ArgumentSlot], used: Iterable[Variable], signature: Signature
) -> dict[str, list[str]]:
    """Map each variable to its sorts: those of its argument slots and of `#domain`."""
    sorts: dict[str, list[str]] = {}
    for variable in used:
        if variable.name in signature.domains:
            sorts[variable.name] = [signature.domains[variable.name]]
    for expression, sort in slots:
        if isinstance(expression, Variable) and sort not in sorts.setdefault(expression.name, []):
            sorts[expression.name].append(sort)
    return sorts


def _iter_equations(body: Iterable[BodyLiteral]) -> Iterator[tuple[str, Expression]]:
    """Iterate over equations of a variable and an expression; one of two variables occurs in both orders."""
    for literal in body:
        if isinstance(literal, ComparisonLiteral) and literal.relation == "=":
            for side, other in ((literal.left, literal.right), (literal.right, literal.left)):
                if isinstance(side, Variable):
                    yield side.name, other


def _find_computed_variables(body: Iterable[BodyLiteral]) -> set[str]:
    """Find the variables computed by equations such as T1=T+1, which do not multiply instances."""
    computed: set[str] = set()
    others: set[str] = set()
    for variable, expression in _iter_equations(body):
        names = find_variables(expression)
        if variable not in names | others and not names & computed:
            computed.add(variable)
            others |= names
    return computed


def _find_joined_variables(clause: Clause, signature: Signature) -> set[str]:
    """Find the variables whose values the grounder takes from the atoms of attributes, not from sorts."""
    terms = [clause.term] if isinstance(clause, Probability) else []
    for literal in get_body(clause):
        if isinstance(literal, Literal) and not literal.negated and not signature.is_sort(literal):
            terms.append(literal.term)
    return find_variables(*(argument for term in terms for argument in term.arguments))


def _add_computed_bounds(
    body: Iterable[BodyLiteral], bounds: dict[str, int], sorts: Mapping[str, list[str]], signature: Signature
) -> None:
    """Add bounds of variables computed by equations such as X=Y+1 from bounded variables."""
    equations = [(name, expression, find_variables(expression)) for name, expression in _iter_equations(body)]
    waiting: dict[str, list[int]] = {}  # variable without bound -> the equations that use it
    for index, (_, _, names) in enumerate(equations):
        names.difference_update(bounds)
        for name in names:
            waiting.setdefault(name, []).append(index)
    ready = [index for index, (_, _, names) in enumerate(equations) if not names]
    while ready:
        variable, expression, _ = equations[ready.pop()]
        if variable not in bounds:
            bounds[variable] = _bound_magnitude(expression, bounds, sorts, signature)
            for index in waiting.pop(variable, ()):
                names = equations[index][2]
                names.remove(variable)
                if not names:
                    ready.append(index)


def _bound_magnitude(
    expression: Expression, bounds: Mapping[str, int], sorts: Mapping[str, list[str]], signature: Signature
) -> int:
    """Return an upper bound on the absolute value of an expression after a check of its arithmetic."""
    if isinstance(expression, Variable):
        return bounds[expression.name]
    if isinstance(expression, Term):
        arguments = expression.arguments
        return max((_bound_magnitude(part, bounds, sorts, signature) for part in arguments), default=0)
    if isinstance(expression, Number):
        if expression.value.denominator != 1:
            raise SourceIssue(expression.at, f"expected an integer, not {expression}")
        bound = abs(expression.value.numerator)
    else:
        for operand in (expression.left, expression.right):
            _check_integer(operand, f"arithmetic in {expression}", sorts, signature)
        left, right = (
            _bound_magnitude(side, bounds, sorts, signature) for side in (expression.left, expression.right)
        )
        bound = left * right if expression.operator == "*" else left + right
    if bound > MAX_INTEGER:
        raise SourceIssue(expression.at, f"{expression} may exceed {MAX_INTEGER}, the largest integer")
    return bound


def check_order(body: Iterable[BodyLiteral], sorts: Mapping[str, list[str]], signature: Signature) -> None:
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
            _check_integer(side, f"the order in {literal}", sorts, signature)


def _check_integer(
    expression: Expression, what: str, sorts: Mapping[str, list[str]], signature: Signature
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
