"""Maximisation: the numbers that make given counts most probable, and the ascent of the likelihood.

If the same pr-atoms always apply together, their numbers are relative frequencies. Otherwise the objective is
concave, and a step sets each number in turn to its best value: it is an ECM step. As steps shrink by nearly
constant factors, the ascent extrapolates them (SQUAREM).

Source: Meng and Rubin, "Maximum likelihood estimation via the ECM algorithm", Biometrika 80(2), 1993;
Varadhan and Roland, "Simple and globally convergent methods for accelerating the convergence of any EM
algorithm", Scandinavian Journal of Statistics 35(2), 2008.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from lcorpp.errors import ProgramError
from lcorpp.fitting.expectation import Expectation
from lcorpp.fitting.number_model import Case, NumberModel
from lcorpp.fitting.soft_records import SoftExpectation
from lcorpp.values import Array

MAX_STEPS = 10_000
"""The ascent ends after this many steps of expectation-maximisation."""

TOLERANCE = 1e-9
"""By default the ascent ends when no number changes by more than this."""

BISECTIONS = 60
"""Enough to halve an interval down to the precision of floating point."""

Progress = Callable[[int, float], None]
"""Callback with the number of steps, and the largest change of a number in the last one."""


class Objective:
    """The log likelihood of records as a function of the parameters, with a prior the log posterior.

    Args:
        strength: the pseudo-counts of each case, spread in proportion to the program's numbers.

    prior: (f,) the pseudo-counts of the forms.

    Raises:
        ProgramError: numbers sum to 1 in one case, and occur in other sums too.
    """

    def __init__(
        self, model: NumberModel, expectation: Expectation | SoftExpectation, strength: float
    ) -> None:
        self.model, self.expectation, self._groups = model, expectation, _group_cases(model)
        values, self.prior = model.evaluate(model.start), np.zeros(len(model.constants))
        for case in model.cases:
            self.prior[case.parameters] += strength * case.multiplicities * values[case.parameters]
            self.prior[case.rest] += strength * values[case.rest]

    def evaluate(self, parameters: Array) -> tuple[float, Array]:
        """Return the objective, and the expected counts (f,) of the forms."""
        values, used = self.model.evaluate(parameters), self.prior > 0
        log_likelihood, counts = self.expectation.sum_counts(values)
        return log_likelihood + float(self.prior[used] @ np.log(values[used])), counts + self.prior

    def maximise(self, parameters: Array, counts: Array) -> Array:
        """Return the parameters that maximise ``counts @ log(forms)``; unchanged where all counts are 0."""
        best = parameters.copy()
        for group in self._groups:
            if len(group) == 1:
                (case,) = group
                own = counts[case.parameters]
                total = own.sum() + counts[case.rest]
                if total > 0:
                    best[case.parameters] = float(case.bound) * own / (case.multiplicities * total)
            else:
                for i in np.unique(np.concatenate([case.parameters for case in group])):
                    best[i] = _maximise_one(self.model, [case.rest for case in group], best, i, counts)
        return best


def _group_cases(model: NumberModel) -> list[list[Case]]:
    """Group the cases by the parameters that they share."""
    rows = np.repeat(np.arange(len(model.cases)), [len(case.parameters) for case in model.cases])
    columns = np.concatenate([case.parameters for case in model.cases])
    shape = len(model.cases), len(model.start)
    numbers = sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)
    n_groups, group_of = connected_components(numbers @ numbers.T)
    groups: list[list[Case]] = [[] for _ in range(n_groups)]
    for case, group in zip(model.cases, group_of, strict=True):
        groups[group].append(case)
    program = model.diagram.system.program.source
    for cases in groups:
        if len(cases) > 1 and any(case.is_full for case in cases):
            lines = {program.statements[model.statements[i]].at.line for c in cases for i in c.parameters}
            raise ProgramError(
                f"{program.file}: the numbers at lines {', '.join(map(str, sorted(lines)))} sum to 1 in some"
                " worlds and occur in other sums too, so they cannot be fitted; fix all but one of them"
            )
    return groups


def _maximise_one(model: NumberModel, rests: list[int], parameters: Array, i: int, counts: Array) -> float:
    """Return the best value of one parameter, given the others: the root of a decreasing derivative."""
    forms = [form for form in rests if model.coefficients[form, i]]
    weights = counts[forms]
    if not counts[i] and not weights.any():
        return float(parameters[i])
    values = model.constants[forms] + model.coefficients[forms] @ parameters
    limits = parameters[i] - values / model.coefficients[forms, i]  # the form is 0 there
    low, high = 0.0, float(limits.min())
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        if counts[i] / middle > (weights / (limits - middle)).sum():
            low = middle
        else:
            high = middle
    return low


def draw_start(model: NumberModel, rng: np.random.Generator) -> Array:
    """Draw parameters for which no form is 0; the shares of the values of a case are evenly distributed."""
    drawn = np.full(len(model.start), np.inf)
    for case in model.cases:
        n = len(case.parameters)
        shares = rng.dirichlet(np.ones(n + (not case.is_full)))[:n]
        bounds = float(case.bound) * shares / case.multiplicities
        drawn[case.parameters] = np.minimum(drawn[case.parameters], bounds)
    return np.where(np.isinf(drawn), model.start, drawn)


class Ascent(NamedTuple):
    """The end of an ascent: the objective there, and whether the parameters do not change any more."""

    parameters: Array
    objective: float
    n_steps: int
    converged: bool


def climb(
    objective: Objective, start: Array, progress: Progress | None = None, *, tolerance: float = TOLERANCE
) -> Ascent:
    """Climb to a maximum of the objective, until no number changes by more than the tolerance."""
    model, n_steps, following, converged = objective.model, 0, start, False
    reached, longest = -np.inf, 4.0
    while n_steps < MAX_STEPS and not converged:
        value, counts = objective.evaluate(start)
        n_steps += 1
        if value < reached:  # the leap went too far
            start, reached, longest = following, -np.inf, max(longest / 4, 1.0)
            continue
        first = objective.maximise(start, counts)
        following = objective.maximise(first, objective.evaluate(first)[1])
        n_steps += 1
        change, last_change = first - start, following - first
        largest = float(np.abs(last_change).max())
        if progress is not None:
            progress(n_steps, largest)
        converged = largest < tolerance
        reached, curvature = value, last_change - change
        length = float(np.linalg.norm(change)) / (float(np.linalg.norm(curvature)) + TOLERANCE**2)
        length = min(max(length, 1.0), longest)
        longest = max(longest, 3 * length)
        leap = start + 2 * length * change + length**2 * curvature - following
        values, falls = model.evaluate(following), -model.coefficients @ leap
        falls[values == 0] = 0.0
        start = following + leap * min(1.0, 0.9 / (falls / np.maximum(values, TOLERANCE)).max(initial=0.9))
    return Ascent(following, objective.evaluate(following)[0], n_steps, converged)


def count_cases(model: NumberModel, values: Array, counts: Array) -> Array:
    """Return how often each pr-atom applied (p,), given the values and the expected counts of the forms."""
    times = np.zeros(len(model.statements))
    for case in model.cases:
        if values[case.rest] > 0 and not case.is_full:
            times[case.parameters] += counts[case.rest] / values[case.rest]
        else:
            times[case.parameters] += counts[case.parameters].sum() / float(case.bound)
    return times
