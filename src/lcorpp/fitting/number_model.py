"""The numbers of pr-atoms as parameters, and the probabilities of a decision diagram as functions of them.

Each probability is a constant times a product of *forms*, affine functions of the parameters: the number of a
pr-atom, or what the pr-atoms of a case leave for other values.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse

from lcorpp.errors import ProgramError, expected_one_of
from lcorpp.reasoning.diagram.decision_diagram import DecisionDiagram, build_decision_diagram
from lcorpp.reasoning.grounding.ground_program import DERIVE, FORBID, GroundProgram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Number, Probability
from lcorpp.reasoning.questions import QUERY_TERM
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Array

REJECTED = QUERY_TERM
"""The term that has the value `true` in the worlds that constraints and observations exclude."""


@dataclass(frozen=True, eq=False)
class Case:
    """A set of pr-atoms that apply together: ``multiplicities @ numbers`` is at most `bound`.

    parameters: (n,) their numbers.
    multiplicities: (n,) the number of values that have each of them as their probability.
    bound: what fixed numbers leave.
    rest: the form of what the numbers leave, ``bound - multiplicities @ numbers``.
    is_full: whether no value is left for it, so that it is 0.
    """

    parameters: npt.NDArray[np.intp]
    multiplicities: Array
    bound: Fraction
    rest: int
    is_full: bool


@dataclass(frozen=True, eq=False)
class NumberModel:
    """The probabilities of a decision diagram as functions of p parameters.

    statements: the index of the statement of each parameter.
    start: (p,) the numbers of the program.
    constants, coefficients: (f,) and (f, p); form i is ``constants[i] + coefficients[i] @ parameters``,
        and the first p forms are the parameters.
    scales: (outcomes,) the constant factor of each outcome.
    factors: (f, outcomes) how often each form is a factor of an outcome.
    cases: the sets of pr-atoms that apply together.
    """

    diagram: DecisionDiagram
    statements: Sequence[int]
    start: Array
    constants: Array
    coefficients: Array
    scales: Array
    factors: sparse.csc_array
    cases: Sequence[Case]

    def evaluate(self, parameters: Array) -> Array:
        """Compute the values of the forms (f,)."""
        values: Array = np.maximum(self.constants + self.coefficients @ parameters, 0.0)
        values[values < 1e-15] = 0.0  # what rounding leaves of 1 - sum
        return values

    def restrict(self, statements: Collection[int]) -> NumberModel:
        """Return the model in which the numbers of other statements are fixed: its cases are without them.

        The parameters and forms are those of this model, so that one expectation step serves both.
        """
        is_free, cases = np.isin(self.statements, list(statements)), list[Case]()
        for case in self.cases:
            own = is_free[case.parameters]
            if own.any():
                taken = Fraction(float(case.multiplicities[~own] @ self.start[case.parameters[~own]]))
                numbers = case.parameters[own], case.multiplicities[own]
                cases.append(Case(*numbers, case.bound - taken, case.rest, case.is_full))
        return replace(self, cases=cases)


class _Form(NamedTuple):
    """An affine function of the parameters; coefficients: index of a parameter and its factor."""

    constant: Fraction
    coefficients: tuple[tuple[int, Fraction], ...]

    def add(self, other: _Form, scale: int = 1) -> _Form:
        """Return the sum of this form and a multiple of another."""
        total = dict(self.coefficients)
        for i, own in other.coefficients:
            total[i] = total.get(i, Fraction(0)) + scale * own
        return _Form(self.constant + scale * other.constant, tuple(sorted(total.items())))

    def divide(self, number: Fraction | int) -> _Form:
        """Return the form divided by a number."""
        return _Form(self.constant / number, tuple((i, own / number) for i, own in self.coefficients))


class _Factored(Fraction):
    """A fraction with the factors of which it is the product: forms and constants.

    The compiler computes with the numbers of pr-atoms as with other fractions, and this is how they are found
    in its results. Sums and quotients keep track of single forms only, which is all that the compiler needs.
    """

    __slots__ = ("factors",)
    factors: tuple[_Form | Fraction, ...]

    def __new__(cls, value: Fraction, *factors: _Form | Fraction) -> _Factored:
        number = super().__new__(cls, value)
        number.factors = factors
        return number

    def __radd__(self, other):  # type: ignore[no-untyped-def]
        total, form, more = Fraction.__radd__(self, other), _get_form(self), _get_form(other)
        return _Factored(total, form.add(more)) if form and more else total

    __add__ = __radd__

    def __rsub__(self, other):  # type: ignore[no-untyped-def]
        rest, form, whole = Fraction.__rsub__(self, other), _get_form(self), _get_form(other)
        return _Factored(rest, whole.add(form, -1)) if form and whole else rest

    def __truediv__(self, other):  # type: ignore[no-untyped-def]
        quotient, form = Fraction.__truediv__(self, other), _get_form(self)
        if form is None or isinstance(other, _Factored):
            return quotient
        return _Factored(quotient, form.divide(other))

    def __mul__(self, other):  # type: ignore[no-untyped-def]
        return _Factored(Fraction.__mul__(self, other), *self.factors, *_split(other))

    __rmul__ = __mul__


def _split(number: Fraction) -> tuple[_Form | Fraction, ...]:
    return number.factors if isinstance(number, _Factored) else (number,)


def _get_form(number: Fraction) -> _Form | None:
    """Return a number as a form; None for a product."""
    if not isinstance(number, _Factored):
        return _Form(Fraction(number), ())
    (form, *more) = number.factors
    return form if isinstance(form, _Form) and not more else None


def list_free_numbers(
    program: Program, fixed: Collection[str | int], *, with_certain: bool = False
) -> dict[int, Fraction]:
    """List the numbers of pr-atoms, by statement, that are neither fixed, nor 0 or 1, nor have variables.

    Args:
        fixed: attributes and lines.
        with_certain: whether 0 and 1 are listed, too.

    Raises:
        ProgramError: none of the pr-atoms is of an attribute or line in `fixed`, no number is free, or the
            program has cr-rules.
    """
    if program.has_cr_rules:
        raise ProgramError(f"{program.file}: the numbers of a program with cr-rules cannot be fitted")
    if isinstance(fixed, str) or not isinstance(fixed, Collection):
        raise ProgramError(f"expected a list of attributes and lines, not {fixed!r}")
    atoms = {i: s for i, s in enumerate(program.statements) if isinstance(s, Probability)}
    for selector in fixed:
        if not any(selector in (atom.term.name, atom.at.line) for atom in atoms.values()):
            names = list(dict.fromkeys([atom.term.name for atom in atoms.values()]))
            raise ProgramError(
                f"{program.file}: {selector!r} is neither an attribute with pr-atoms nor the line of one;"
                f" {expected_one_of(names)}"
            )
    free = {
        index: atom.number.value
        for index, atom in atoms.items()
        if atom.term.name not in fixed and atom.at.line not in fixed
        if isinstance(atom.number, Number) and (with_certain or 0 < atom.number.value < 1)
    }
    if not free:
        raise ProgramError(f"{program.file}: no pr-atom has a number that is free; see `fixed`")
    return free


def build_number_model(
    program: Program, free: Mapping[int, Fraction], observed: Collection[str]
) -> NumberModel:
    """Compile a program with some numbers as parameters; excluded worlds remain, see `REJECTED`.

    Args:
        free: index of a statement -> its number.
        observed: the terms that records may name.

    Raises:
        ProgramError: a world violates a condition of the language.
        TooLargeError: the program is too large to be compiled.
    """
    ground = ground_program(program, {})
    parameters = {_Form(Fraction(0), ((i, Fraction(1)),)): i for i in range(len(free))}
    numbers = {
        index: _Factored(number, form) for (index, number), form in zip(free.items(), parameters, strict=True)
    }
    for clause in ground.clauses:
        if clause.number is not None:
            clause.number = numbers.get(clause.statement, clause.number)
    _derive_rejection(ground)
    diagram = build_decision_diagram(build_transition_system(ground, [*observed, REJECTED]))
    forms = {own: (i, 1.0) for own, i in parameters.items()}  # -> (form of the model, constant factor)
    cases: dict[object, Case] = {}
    for own in diagram.system.probabilities.values():
        factored = [form for x in own if isinstance(x, _Factored) and (form := _get_form(x))]
        multiplicities = Counter([parameters[form] for form in factored if form in parameters])
        if not multiplicities:
            continue
        bound = 1 - sum([x for x in own if not isinstance(x, _Factored)], start=Fraction(0))
        shares = [form for form in factored if form not in parameters]
        key = frozenset(multiplicities.items()), bound
        rest = cases[key].rest if key in cases else len(free) + len(cases)
        for share in shares:
            forms[share] = rest, 1 / len(shares)
        cases[key] = Case(
            np.array(list(multiplicities)),
            np.array(list(multiplicities.values()), dtype=float),
            bound,
            rest,
            is_full=not shares or (key in cases and cases[key].is_full),
        )
    coefficients = np.vstack([np.eye(len(free)), np.zeros((len(cases), len(free)))])
    for case in cases.values():
        coefficients[case.rest, case.parameters] = -case.multiplicities
    scales = np.ones(len(diagram.outcomes))
    places: list[tuple[int, int]] = []
    for outcome, own_outcome in enumerate(diagram.outcomes):
        for factor in _split(own_outcome.weight):
            if isinstance(factor, _Form):
                number, scale = forms[factor]
                places.append((number, outcome))
            else:
                scale = float(factor)
            scales[outcome] *= scale
    rows, columns = np.array(places, dtype=np.intp).reshape(-1, 2).T
    return NumberModel(
        diagram,
        list(free),
        np.array(list(map(float, free.values()))),
        np.array([0.0] * len(free) + [float(case.bound) for case in cases.values()]),
        coefficients,
        scales,
        sparse.csc_array((np.ones(len(rows)), (rows, columns)), shape=(len(coefficients), len(scales))),
        list(cases.values()),
    )


def _derive_rejection(ground: GroundProgram) -> None:
    """Replace constraints by rules that derive `REJECTED`."""
    for i, clause in enumerate(ground.clauses):
        if clause.kind is FORBID:
            ground.clauses[i] = replace(clause, kind=DERIVE, term=len(ground.names))
    ground.names.append(REJECTED)
    ground.values.append(("true",))
