"""The numbers of pr-atoms as parameters, and the probabilities of a decision diagram as functions of them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from lcorpp.reasoning.circuit.decision_diagram import DecisionDiagram, build_decision_diagram
from lcorpp.reasoning.fitting.symbolic import Affine, Form, split
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Number, Probability
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class Case:
    """A set of pr-atoms that apply together: their numbers sum to at most `bound`, what fixed numbers leave.

    multiplicities: (parameter, number of values that it is the probability of).
    is_full: whether no value is left without a pr-atom, so that the sum equals `bound`.
    forms: (form, number of values with this probability).
    """

    multiplicities: tuple[tuple[int, int], ...]
    bound: Fraction
    is_full: bool
    forms: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class NumberModel:
    """The probabilities of a decision diagram as functions of p parameters.

    statements: the index of the statement of each parameter.
    start: (p,) the numbers of the program.
    constants, coefficients: (f,) and (f, p); form i is ``constants[i] + coefficients[i] @ parameters``,
        and the first p forms are the parameters.
    factors: (outcomes, n) the forms whose product is the probability of an outcome; f is for 1.
    scales: (outcomes,) the constant factor of each outcome.
    cases: the sets of pr-atoms that apply together.
    """

    diagram: DecisionDiagram
    statements: Sequence[int]
    start: Array
    constants: Array
    coefficients: Array
    factors: npt.NDArray[np.intp]
    scales: Array
    cases: Sequence[Case]

    def evaluate(self, parameters: Array) -> Array:
        """Compute the values of the forms (f,)."""
        values: Array = np.maximum(self.constants + self.coefficients @ parameters, 0.0)
        values[values < 1e-15] = 0.0  # what rounding leaves of 1 - sum
        return values


def list_free_statements(program: Program, fixed: Collection[int]) -> list[int]:
    """List the pr-atoms whose numbers are neither fixed, nor 0 or 1, nor computed from variables."""
    return [
        index
        for index, statement in enumerate(program.statements)
        if isinstance(statement, Probability)
        and index not in fixed
        and isinstance(statement.number, Number)
        and 0 < statement.number.value < 1
    ]


def build_number_model(program: Program, free: Sequence[int], observed: Collection[str]) -> NumberModel:
    """Compile a program with the numbers of the statements `free` as parameters.

    Args:
        observed: the terms that records may name.

    Raises:
        ProgramError: a world violates a condition of the language.
        TooLargeError: the program is too large to be compiled.
    """
    symbols: dict[int, Affine] = {}
    for parameter, index in enumerate(free):
        statement = program.statements[index]
        assert isinstance(statement, Probability)
        assert isinstance(statement.number, Number)
        symbols[index] = Affine.create_parameter(parameter, statement.number.value)
    ground = ground_program(program, {})
    for clause in ground.clauses:
        if clause.number is not None:
            clause.number = symbols.get(clause.statement, clause.number)
    diagram = build_decision_diagram(build_transition_system(ground, observed))
    forms: dict[Form, int] = {symbols[index].form: i for i, index in enumerate(free)}
    outcomes = [split(number) for _, number in diagram.outcomes]
    products = [[forms.setdefault(x.form, len(forms)) for x in own] for own, _ in outcomes]
    cases: dict[object, Case] = {}
    for numbers in diagram.system.probabilities.values():
        if any(isinstance(number, Affine) for number in numbers):
            case = _describe_case(numbers, forms)
            key = case.multiplicities, case.bound
            if key not in cases or case.is_full:
                cases[key] = case
    width = max([len(own) for own in products], default=0)
    factors = np.full((len(products), width), len(forms), dtype=np.intp)
    for row, own in zip(factors, products, strict=True):
        row[: len(own)] = own
    coefficients = np.zeros((len(forms), len(free)))
    for (_, terms), i in forms.items():
        for parameter, coefficient in terms:
            coefficients[i, parameter] = float(coefficient)
    return NumberModel(
        diagram,
        free,
        np.array([float(symbols[index]) for index in free]),
        np.array([float(constant) for constant, _ in forms]),
        coefficients,
        factors,
        np.array([float(scale) for _, scale in outcomes]),
        list(cases.values()),
    )


def _describe_case(numbers: Sequence[Fraction], forms: dict[Form, int]) -> Case:
    """Describe the probabilities of the values of a selection; add new forms to `forms`."""
    multiplicities: dict[int, int] = {}
    bound, is_full = Fraction(1), True
    counts: dict[int, int] = {}
    for number in numbers:
        if not isinstance(number, Affine):
            bound -= number
            continue
        form = forms.setdefault(number.form, len(forms))
        counts[form] = counts.get(form, 0) + 1
        if number.constant == 0 and list(number.coefficients.values()) == [1]:
            (parameter,) = number.coefficients
            multiplicities[parameter] = multiplicities.get(parameter, 0) + 1
        else:
            is_full = False
    return Case(tuple(sorted(multiplicities.items())), bound, is_full, tuple(counts.items()))
