"""Maximisation: the numbers that make given counts most probable, and the ascent of the likelihood.

If the same pr-atoms always apply together, their numbers are relative frequencies. Otherwise the objective is
concave, and a step sets each number in turn to its best value: it is an ECM step. As steps shrink by nearly
constant factors, the ascent extrapolates them (SQUAREM).

Source: Meng and Rubin, "Maximum likelihood estimation via the ECM algorithm", Biometrika 80(2), 1993;
Varadhan and Roland, "Simple and globally convergent methods for accelerating the convergence of any EM
algorithm", Scandinavian Journal of Statistics 35(2), 2008.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from lcorpp.errors import ProgramError
from lcorpp.fitting.expectation import Expectation
from lcorpp.fitting.number_model import Case, NumberModel
from lcorpp.reasoning.language.program import Program
from lcorpp.values import Array

MAX_STEPS = 10_000
"""The ascent ends after this many steps of expectation-maximisation."""

TOLERANCE = 1e-9
"""The ascent ends when no number changes by more than this."""

BISECTIONS = 60
"""Enough to halve an interval down to the precision of floating point."""

Group = Sequence[Case]
"""Cases that share parameters."""

Progress = Callable[[int, float], None]
"""Callback with the number of steps, and the largest change of a number in the last one."""


def group_cases(program: Program, model: NumberModel) -> list[Group]:
    """Group the cases by the parameters that they share.

    Raises:
        ProgramError: the numbers of a group sum to 1 in one case, and occur in other sums too.
    """
    groups: list[tuple[set[int], list[Case]]] = []
    for case in model.cases:
        joined = set(case.parameters.tolist()), [case]
        for group in [group for group in groups if group[0] & joined[0]]:
            groups.remove(group)
            joined = joined[0] | group[0], group[1] + joined[1]
        groups.append(joined)
    for parameters, cases in groups:
        if len(cases) > 1 and any(case.is_full for case in cases):
            lines = sorted(program.statements[model.statements[i]].at.line for i in parameters)
            raise ProgramError(
                f"{program.file}: the numbers at lines {', '.join(map(str, lines))} sum to 1 in some worlds"
                " and occur in other sums too, so they cannot be fitted; fix all but one of them"
            )
    return [cases for _, cases in groups]


def compute_prior_counts(model: NumberModel, strength: float) -> Array:
    """Spread `strength` pseudo-counts over the forms of each case, in proportion to the program's numbers."""
    counts, values = np.zeros(len(model.constants)), model.evaluate(model.start)
    for case in model.cases:
        counts[case.parameters] += strength * case.multiplicities * values[case.parameters]
        counts[case.rest] += strength * values[case.rest]
    return counts


def maximise(model: NumberModel, groups: Sequence[Group], parameters: Array, counts: Array) -> Array:
    """Return the parameters that maximise ``counts @ log(forms)``; unchanged where all counts are 0."""
    best = parameters.copy()
    for group in groups:
        if len(group) == 1:
            (case,) = group
            own = counts[case.parameters]
            total = own.sum() + counts[case.rest]
            if total > 0:
                best[case.parameters] = float(case.bound) * own / (case.multiplicities * total)
        else:
            for i in np.unique(np.concatenate([case.parameters for case in group])):
                best[i] = _maximise_one(model, [case.rest for case in group], best, i, counts)
    return best


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
    model: NumberModel,
    groups: Sequence[Group],
    expectation: Expectation,
    prior: Array,
    start: Array,
    progress: Progress | None = None,
) -> Ascent:
    """Climb to a maximum of the log likelihood, or with a prior of the log posterior.

    Args:
        prior: (f,) pseudo-counts of the forms.
    """
    used = prior > 0

    def expect(parameters: Array) -> tuple[Array, float]:
        """Return the expected counts of the forms, and the objective."""
        values = model.evaluate(parameters)
        expected = expectation.compute(values)
        objective = expected.log_likelihood + float(prior[used] @ np.log(values[used]))
        return expected.counts @ expected.repeats + prior, objective

    n_steps, following, converged = 0, start, False
    reached, longest = -np.inf, 4.0
    while n_steps < MAX_STEPS and not converged:
        counts, objective = expect(start)
        n_steps += 1
        if objective < reached:  # the leap went too far
            start, reached, longest = following, -np.inf, max(longest / 4, 1.0)
            continue
        first = maximise(model, groups, start, counts)
        following = maximise(model, groups, first, expect(first)[0])
        n_steps += 1
        change, last_change = first - start, following - first
        largest = float(np.abs(last_change).max())
        if progress is not None:
            progress(n_steps, largest)
        converged = largest < TOLERANCE
        reached, curvature = objective, last_change - change
        length = float(np.linalg.norm(change)) / (float(np.linalg.norm(curvature)) + TOLERANCE**2)
        length = min(max(length, 1.0), longest)
        longest = max(longest, 3 * length)
        leap = start + 2 * length * change + length**2 * curvature - following
        values, falls = model.evaluate(following), -model.coefficients @ leap
        falls[values == 0] = 0.0
        start = following + leap * min(1.0, 0.9 / (falls / np.maximum(values, TOLERANCE)).max(initial=0.9))
    return Ascent(following, expect(following)[1], n_steps, converged)


def count_cases(model: NumberModel, values: Array, counts: Array) -> Array:
    """Return how often each pr-atom applied (p,), given the values and the expected counts of the forms."""
    times = np.zeros(len(model.statements))
    for case in model.cases:
        if values[case.rest] > 0 and not case.is_full:
            times[case.parameters] += counts[case.rest] / values[case.rest]
        else:
            times[case.parameters] += counts[case.parameters].sum() / float(case.bound)
    return times
