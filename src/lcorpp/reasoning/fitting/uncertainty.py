"""Intervals of fitted numbers, and which numbers the data determine.

The scores, the derivatives of the log likelihoods of the distinct records, span the directions in which the
data distinguish numbers. A number is identifiable (locally) if no direction that changes it is orthogonal to
all scores. Intervals come from the observed information, minus the second derivative of the log likelihood,
on the log-odds scale.

Source: Rothenberg, "Identification in parametric models", Econometrica 39(3), 1971; Louis, "Finding the
observed information matrix when using the EM algorithm", JRSS B 44(2), 1982.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.reasoning.fitting.expectation import Expectation
from lcorpp.reasoning.fitting.number_model import NumberModel
from lcorpp.values import Array

Z95 = 1.959964
"""Half width of the 95 % interval of a normal estimate, in standard errors."""

BOUNDARY = 1e-6
"""A number this close to its limits is on the boundary."""

NULL_SCORE = 1e-6
"""Directions whose scores are smaller than the largest by this factor are not determined."""

DIFFERENCE = 1e-4
"""The step of numerical derivatives, in units of ``sqrt(p (1 - p))``."""


@dataclass(frozen=True)
class Uncertainty:
    """What the data state about the parameters.

    intervals: (low, high) 95 % interval of each parameter, None if it is not identifiable.
    n_undetermined: the number of independent directions in which the data do not determine the parameters.
    """

    intervals: Sequence[tuple[float, float] | None]
    n_undetermined: int


def compute_uncertainty(
    model: NumberModel,
    expectation: Expectation,
    repeats: Array,
    prior: Array,
    parameters: Array,
    cases: Array,
) -> Uncertainty:
    """Compute intervals at a maximum of the likelihood.

    Args:
        repeats: (n,) how often each distinct record occurs.
        prior: (f,) pseudo-counts of the forms.
        cases: (p,) the expected number of times that each pr-atom applied.
    """
    basis, is_inside = _find_directions(model, parameters)
    undetermined: Array = np.zeros((len(parameters), 0))
    covariance: Array = np.zeros((len(parameters), len(parameters)))
    if basis.shape[1]:
        scores = _compute_scores(model, expectation.compute(parameters)[1], parameters)
        weighted = (scores.T * np.sqrt(repeats)[:, None]) @ basis
        _, sizes, rows = np.linalg.svd(np.linalg.qr(weighted, mode="r"))
        rank = int((sizes > NULL_SCORE * sizes.max(initial=0.0)).sum())
        undetermined = basis @ rows[rank:].T
        determined = basis @ rows[:rank].T

        def differentiate(point: Array) -> Array:
            counts = expectation.compute(point)[1] @ repeats + prior
            total: Array = determined.T @ _compute_scores(model, counts[:, None], point)[:, 0]
            return total

        information = np.zeros((rank, rank))
        for i, direction in enumerate(determined.T):
            step = DIFFERENCE * min(1.0, _find_room(model, parameters, direction))
            ahead = differentiate(parameters + step * direction)
            behind = differentiate(parameters - step * direction)
            information[i] = (behind - ahead) / (2 * step)
        sizes, vectors = np.linalg.eigh((information + information.T) / 2)
        curved = sizes > NULL_SCORE**2 * sizes.max(initial=0.0)
        undetermined = np.hstack([undetermined, determined @ vectors[:, ~curved]])
        determined = determined @ vectors[:, curved]
        covariance = determined / sizes[curved] @ determined.T
    scale = np.sqrt(parameters * (1 - parameters))
    intervals: list[tuple[float, float] | None] = []
    for i, p in enumerate(parameters):
        unknown = np.linalg.norm(undetermined[i])
        if cases[i] < BOUNDARY or (is_inside[i] and unknown > np.sqrt(NULL_SCORE) * scale[i]):
            intervals.append(None)
        elif is_inside[i]:
            odds, error = p / (1 - p), np.sqrt(covariance[i, i]) / (p * (1 - p))
            factor = np.exp(Z95 * error)
            intervals.append((odds / (odds + factor), odds * factor / (1 + odds * factor)))
        else:  # exact for complete records (Clopper and Pearson, 1934)
            limit = float(0.025 ** (1 / cases[i]))
            intervals.append((0.0, 1 - limit) if p < 0.5 else (limit, 1.0))
    return Uncertainty(intervals, undetermined.shape[1])


def _find_directions(model: NumberModel, parameters: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Find a basis (p, n) of the directions that keep sums equal to 1, and which parameters are inside.

    A parameter is inside if it is neither 0 nor 1; others do not move.
    """
    is_inside = (parameters > BOUNDARY) & (parameters < 1 - BOUNDARY)
    equations = []
    for case in model.cases:
        left = float(case.bound) - sum(m * parameters[i] for i, m in case.multiplicities)
        if case.is_full or left < BOUNDARY:
            row = np.zeros(len(parameters))
            for parameter, multiplicity in case.multiplicities:
                row[parameter] = multiplicity
            equations.append(row)
    scale = np.sqrt(parameters * (1 - parameters)) * is_inside
    inside = np.flatnonzero(is_inside)
    matrix = np.array(equations).reshape(len(equations), len(parameters))[:, inside] * scale[inside]
    _, sizes, rows = np.linalg.svd(matrix)
    rank = int((sizes > NULL_SCORE).sum())
    basis: Array = np.zeros((len(parameters), len(inside) - rank))
    basis[inside] = scale[inside][:, None] * rows[rank:].T
    return basis, is_inside


def _find_room(model: NumberModel, parameters: Array, direction: Array) -> float:
    """Return the largest multiple of a direction, forwards and back, with which no form reaches 0."""
    values, changes = model.evaluate(parameters), np.abs(model.coefficients @ direction)
    moves = (changes > NULL_SCORE) & (values > 0)
    return float((values[moves] / changes[moves]).min(initial=np.inf))


def _compute_scores(model: NumberModel, counts: Array, parameters: Array) -> Array:
    """Compute the derivatives of log likelihoods (p, n) from the expected counts of the forms (f, n)."""
    values = model.evaluate(parameters)[:, None]
    ratios = np.divide(counts, values, out=np.zeros_like(counts), where=values > 0)
    scores: Array = model.coefficients.T @ ratios
    return scores
