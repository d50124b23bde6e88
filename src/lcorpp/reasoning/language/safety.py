"""Safety: check that the variables of a statement have finite ranges and its arithmetic stays in bounds.

A statement that passes these checks can be grounded.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lcorpp.reasoning.language.arithmetic import MAX_INTEGER, iter_variables
from lcorpp.reasoning.language.conformance import check_integer, check_order, check_slots
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.signature import ArgumentSlot, Signature
from lcorpp.reasoning.language.syntax import (
    Arithmetic,
    BodyLiteral,
    ComparisonLiteral,
    Expression,
    Number,
    Term,
    Variable,
)

MAX_INSTANCES = 2_000_000
"""Maximal number of ground instances of one statement; each outcome of a selection counts."""


def check_variables(
    at: Place,
    scope: Sequence[Expression],
    slots: list[ArgumentSlot],
    body: Iterable[BodyLiteral],
    signature: Signature,
    number: Expression | None = None,
    outcomes: int = 1,
) -> None:
    """Check the variables and the arithmetic of a statement.

    Args:
        scope: the expressions of the statement.
        slots: the expressions with a required sort.
        number: the number of a pr-atom, which is computed exactly and has no bound.
        outcomes: the number of values of each instance of a selection.

    Raises:
        SourceIssue: a constant or variable contradicts its sort, a variable is unsafe, there are too many
            instances, or an operand of arithmetic is not an integer or may exceed 32 bits.
    """
    check_slots(slots, signature)
    used = [variable for expression in scope for variable in iter_variables(expression)]
    sorts = find_variable_sorts(slots, used, signature)
    span = outcomes
    computed = _find_computed_variables(body)
    for name, found in sorts.items():
        common = signature.count_common_members(found)
        if not common:
            where = next((v.at for v in used if v.name == name), at)
            raise SourceIssue(where, f"variable {name} cannot be of the sorts {' and '.join(found)} at once")
        if name not in computed:
            span *= common
    if span > MAX_INSTANCES:
        raise SourceIssue(at, f"the statement has {span} ground instances; expected at most {MAX_INSTANCES}")
    bounds = dict.fromkeys(sorts, signature.max_integer)
    for expression, _ in slots:
        if isinstance(expression, Term):  # a record: matching its known members binds its variables
            bounds.update((v.name, signature.max_integer) for v in iter_variables(expression))
    _add_computed_bounds(body, bounds)
    for variable in used:
        if variable.name not in bounds:
            raise SourceIssue(
                variable.at,
                f"variable {variable} is unsafe; expected it as an argument or a value of an attribute,"
                " or in #domain",
            )
    check_order(body, sorts, signature)
    for expression in scope:
        if expression is not number:
            _check_arithmetic(expression, bounds, sorts, signature)


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


def _find_computed_variables(body: Iterable[BodyLiteral]) -> set[str]:
    """Find the variables computed by equations such as T1=T+1, which do not multiply instances."""
    computed: set[str] = set()
    others: set[str] = set()
    for comparison in body:
        if not isinstance(comparison, ComparisonLiteral) or comparison.relation != "=":
            continue
        for side, other in (
            (comparison.left, comparison.right),
            (comparison.right, comparison.left),
        ):
            names = {variable.name for variable in iter_variables(other)}
            if isinstance(side, Variable) and side.name not in names | others and not names & computed:
                computed.add(side.name)
                others |= names
                break
    return computed


def _add_computed_bounds(body: Iterable[BodyLiteral], bounds: dict[str, int]) -> None:
    """Add bounds of variables computed by equations such as X=Y+1 from bounded variables."""
    waiting: dict[str, list[tuple[Variable, Expression, set[str]]]] = {}
    ready: list[tuple[Variable, Expression]] = []
    for equation in body:
        if not isinstance(equation, ComparisonLiteral) or equation.relation != "=":
            continue
        for side, other in ((equation.left, equation.right), (equation.right, equation.left)):
            if isinstance(side, Variable) and side.name not in bounds:
                missing = {v.name for v in iter_variables(other)} - bounds.keys()
                for name in missing:
                    waiting.setdefault(name, []).append((side, other, missing))
                if not missing:
                    ready.append((side, other))
    while ready:
        side, other = ready.pop()
        if side.name in bounds:
            continue
        bounds[side.name] = _bound_magnitude(other, bounds)
        for next_side, next_other, missing in waiting.pop(side.name, ()):
            missing.discard(side.name)
            if not missing:
                ready.append((next_side, next_other))


def _bound_magnitude(expression: Expression, bounds: dict[str, int]) -> int:
    """Return an upper bound on the absolute value of an expression."""
    if isinstance(expression, Variable):
        return bounds[expression.name]
    if isinstance(expression, Number):
        if expression.value.denominator != 1:
            raise SourceIssue(expression.at, f"expected an integer, not {expression}")
        return abs(expression.value.numerator)
    if isinstance(expression, Term):
        return max((_bound_magnitude(argument, bounds) for argument in expression.arguments), default=0)
    left, right = _bound_magnitude(expression.left, bounds), _bound_magnitude(expression.right, bounds)
    return left * right if expression.operator == "*" else left + right


def _check_arithmetic(
    expression: Expression, bounds: dict[str, int], sorts: dict[str, list[str]], signature: Signature
) -> None:
    if _bound_magnitude(expression, bounds) > MAX_INTEGER:
        raise SourceIssue(expression.at, f"{expression} may exceed {MAX_INTEGER}, the largest integer")
    if isinstance(expression, Term):
        for argument in expression.arguments:
            _check_arithmetic(argument, bounds, sorts, signature)
    elif isinstance(expression, Arithmetic):
        for operand in (expression.left, expression.right):
            check_integer(operand, f"arithmetic in {expression}", sorts, signature)
            _check_arithmetic(operand, bounds, sorts, signature)
