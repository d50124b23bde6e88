"""The maximisation step: the numbers that make given counts most probable.

If the same pr-atoms always apply together, their numbers are relative frequencies. Otherwise the objective is
concave, and each number in turn is set to its best value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.errors import ProgramError
from lcorpp.reasoning.fitting.number_model import Case, NumberModel
from lcorpp.reasoning.language.program import Program
from lcorpp.values import Array

SWEEPS = 20
"""The numbers that share no single case are set this many times."""

BISECTIONS = 60
"""Enough to halve an interval down to the precision of floating point."""


@dataclass(frozen=True, eq=False)
class Group:
    """Parameters that cases connect.

    rest: the forms of what the parameters leave for other values.
    """

    parameters: tuple[int, ...]
    cases: tuple[Case, ...]
    rest: tuple[int, ...]


def group_parameters(program: Program, model: NumberModel) -> list[Group]:
    """Group the parameters by the cases that connect them.

    Raises:
        ProgramError: the numbers of a group sum to 1 in one case, and occur in other sums too.
    """
    group_of: dict[int, set[int]] = {}  # connected parameters share one set
    for case in model.cases:
        members = {parameter for parameter, _ in case.multiplicities}
        for parameter in list(members):
            members |= group_of.get(parameter, set())
        group_of |= dict.fromkeys(members, members)
    groups = []
    for members in {id(own): own for own in group_of.values()}.values():
        cases = tuple(case for case in model.cases if case.multiplicities[0][0] in members)
        if len(cases) > 1 and any(case.is_full for case in cases):
            lines = sorted(program.statements[model.statements[i]].at.line for i in members)
            raise ProgramError(
                f"{program.file}: the numbers at lines {', '.join(map(str, lines))} sum to 1 in some worlds"
                " and occur in other sums too, so they cannot be fitted; fix all but one of them"
            )
        depends = np.flatnonzero(np.any(model.coefficients[:, sorted(members)] != 0, axis=1))
        rest = tuple(int(form) for form in depends if form >= len(model.statements))
        groups.append(Group(tuple(sorted(members)), cases, rest))
    return groups


def compute_prior_counts(model: NumberModel, strength: float) -> Array:
    """Spread `strength` pseudo-counts over the forms of each case, in proportion to the program's numbers."""
    counts: Array = np.zeros(len(model.constants))
    start = model.evaluate(model.start)
    for case in model.cases:
        for form, n_values in case.forms:
            counts[form] += strength * n_values * start[form]
    return counts


def maximise(model: NumberModel, groups: list[Group], parameters: Array, counts: Array) -> Array:
    """Return the parameters that maximise ``counts @ log(forms)``; unchanged where all counts are 0."""
    best = parameters.copy()
    for group in groups:
        own, rest = list(group.parameters), list(group.rest)
        if counts[own].sum() + counts[rest].sum() == 0:
            continue
        if len(group.cases) == 1:
            (case,) = group.cases
            multiplicities = np.array([m for _, m in case.multiplicities])
            total = counts[own].sum() + counts[rest].sum()
            best[own] = float(case.bound) * counts[own] / (multiplicities * total)
        else:
            for _ in range(SWEEPS):
                for parameter in own:
                    best[parameter] = _maximise_one(model, rest, best, parameter, counts)
    return best


def count_cases(model: NumberModel, groups: list[Group], parameters: Array, counts: Array) -> Array:
    """Return the expected number of times that each pr-atom applied (p,).

    Different cases are not counted apart; there it is what the numbers and the counts imply.
    """
    cases: Array = np.zeros(len(parameters))
    values = model.evaluate(parameters)
    for group in groups:
        own, rest = list(group.parameters), list(group.rest)
        if len(group.cases) == 1:
            cases[own] = (counts[own].sum() + counts[rest].sum()) / float(group.cases[0].bound)
            continue
        for parameter in own:
            multiplicity = max(dict(case.multiplicities).get(parameter, 0) for case in group.cases)
            if parameters[parameter] > 0:
                times = counts[parameter] / parameters[parameter]
            else:
                forms = [form for form in rest if values[form] > 0]
                times = -model.coefficients[forms, parameter] @ (counts[forms] / values[forms])
            cases[parameter] = times / multiplicity
    return cases


def _maximise_one(
    model: NumberModel, rest: list[int], parameters: Array, parameter: int, counts: Array
) -> float:
    """Return the best value of one parameter, given the others: the root of a decreasing derivative."""
    if counts[parameter] == 0 and not any(counts[i] for i in rest if model.coefficients[i, parameter]):
        return float(parameters[parameter])
    slopes = -model.coefficients[rest, parameter]
    active = slopes > 0
    slopes, weights = slopes[active], counts[rest][active]
    values = (model.constants + model.coefficients @ parameters)[rest][active]
    limits = parameters[parameter] + values / slopes  # the form is 0 there
    low, high = 0.0, float(limits.min())
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        if counts[parameter] / middle > (weights / (limits - middle)).sum():
            low = middle
        else:
            high = middle
    return low
