"""Safety: check that the variables of a clause have finite ranges and its arithmetic stays in bounds.

A clause that passes these checks can be grounded.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

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
from lcorpp.reasoning.language.traversal import list_expressions

MAX_INSTANCES = 2_000_000
"""Maximal number of ground instances of one clause; each outcome of a selection counts."""

VariableSorts = Mapping[str, list[str]]


def check_variables(clause: Clause, signature: Signature) -> None:
    """Check the variables and the arithmetic of a clause; a dynamic range is checked as a clause of its own.

    Raises:
        SourceIssue: a constant or variable contradicts its sort, a variable is unsafe, there are too many
            instances, or an operand of arithmetic is not an integer or may exceed 32 bits.
    """
    body, slots, scope = clause.body, list(signature.iter_slots(clause)), list_expressions(clause)
    signature.check_slots(slots)
    used = [variable for expression in scope for variable in iter_variables(expression)]
    sorts = find_variable_sorts(slots, used, signature)
    equations = list(_iter_equations(body))
    # each outcome of a selection counts
    span = len(signature.attributes[clause.term.name].values) if isinstance(clause, Selection) else 1
    computed = _find_computed_variables(equations) | _find_joined_variables(clause, signature)
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
    bounds = _Bounds(signature, sorts, dict.fromkeys((*sorts, *records), signature.max_integer))
    bounds.add_computed(equations)
    for variable in used:
        if variable.name not in bounds.known:
            raise SourceIssue(
                variable.at,
                f"variable {variable} is unsafe; expected it as an argument or a value of an attribute,"
                " or in #domain",
            )
    require_integers(body, sorts, signature)
    for expression in scope:
        # the number of a pr-atom is computed exactly and has no bound
        if not (isinstance(clause, Probability) and expression is clause.number):
            bounds.find(expression)


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


def _iter_equations(body: Iterable[BodyLiteral]) -> Iterator[tuple[str, Expression, set[str]]]:
    """Iterate over equations: a variable, an expression and its variables.

    An equation of two variables occurs in both orders.
    """
    for literal in body:
        if isinstance(literal, ComparisonLiteral) and literal.relation == "=":
            for side, other in ((literal.left, literal.right), (literal.right, literal.left)):
                if isinstance(side, Variable):
                    yield side.name, other, find_variables(other)


def _find_computed_variables(equations: Iterable[tuple[str, Expression, set[str]]]) -> set[str]:
    """Find the variables computed by equations such as T1=T+1, which do not multiply instances."""
    computed: set[str] = set()
    others: set[str] = set()
    for variable, _, names in equations:
        if variable not in names | others and not names & computed:
            computed.add(variable)
            others |= names
    return computed


def _find_joined_variables(clause: Clause, signature: Signature) -> set[str]:
    """Find the variables whose values the grounder takes from the atoms of attributes, not from sorts."""
    terms = [clause.term] if isinstance(clause, Probability) else []
    for literal in clause.body:
        if isinstance(literal, Literal) and not literal.negated and not signature.is_sort(literal):
            terms.append(literal.term)
    return find_variables(*(argument for term in terms for argument in term.arguments))


@dataclass(eq=False, repr=False)
class _Bounds:
    """Upper bounds on the absolute values of the variables of a clause.

    sorts: the sorts of the variables.
    known: variable -> bound.
    """

    signature: Signature
    sorts: VariableSorts
    known: dict[str, int]

    def add_computed(self, equations: Iterable[tuple[str, Expression, set[str]]]) -> None:
        """Add bounds of variables computed by equations such as X=Y+1 from bounded variables."""
        missing = [
            (variable, expression, names - self.known.keys()) for variable, expression, names in equations
        ]
        waiting: dict[str, list[int]] = {}  # variable without bound -> the equations that use it
        for index, (_, _, names) in enumerate(missing):
            for name in names:
                waiting.setdefault(name, []).append(index)
        ready = [index for index, (_, _, names) in enumerate(missing) if not names]
        while ready:
            variable, expression, _ = missing[ready.pop()]
            if variable not in self.known:
                self.known[variable] = self.find(expression)
                for index in waiting.pop(variable, ()):
                    missing[index][2].remove(variable)
                    if not missing[index][2]:
                        ready.append(index)

    def find(self, expression: Expression) -> int:
        """Return an upper bound on the absolute value of an expression after a check of its arithmetic."""
        if isinstance(expression, Variable):
            return self.known[expression.name]
        if isinstance(expression, Term):
            return max(map(self.find, expression.arguments), default=0)
        if isinstance(expression, Number):
            if expression.value.denominator != 1:
                raise SourceIssue(expression.at, f"expected an integer, not {expression}")
            bound = abs(expression.value.numerator)
        else:
            for operand in (expression.left, expression.right):
                _require_integer(operand, f"arithmetic in {expression}", self.sorts, self.signature)
            left, right = self.find(expression.left), self.find(expression.right)
            bound = left * right if expression.operator == "*" else left + right
        if bound > MAX_INTEGER:
            raise SourceIssue(expression.at, f"{expression} may exceed {MAX_INTEGER}, the largest integer")
        return bound


def require_integers(body: Iterable[BodyLiteral], sorts: VariableSorts, signature: Signature) -> None:
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
            _require_integer(side, f"the order in {literal}", sorts, signature)


def _require_integer(expression: Expression, what: str, sorts: VariableSorts, signature: Signature) -> None:
    if isinstance(expression, Term):
        raise SourceIssue(expression.at, f"{what} needs integers, but {expression} is none")
    if isinstance(expression, Variable):
        for sort in sorts.get(expression.name, ()):
            if sort not in signature.integer_sorts:
                odd = next(m for m in signature.sorts[sort] if not is_integer(m))
                raise SourceIssue(
                    expression.at, f"{what} needs integers, but {expression} may be {odd} of the sort {sort}"
                )
