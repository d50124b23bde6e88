"""Intervals of fitted numbers, and which numbers the data determine.

The scores, the derivatives of the log likelihoods of the distinct records, span the directions in which the
data distinguish numbers. A number is identifiable (locally) if no direction that changes it is orthogonal to
all scores. Intervals come from the observed information, minus the second derivative of the log likelihood,
on the log-odds scale. A number at 0 or 1 has a one-sided interval from the slope of the log likelihood there.

Source: Rothenberg, "Identification in parametric models", Econometrica 39(3), 1971; Louis, "Finding the
observed information matrix when using the EM algorithm", JRSS B 44(2), 1982; Clopper and Pearson, "The use of
confidence or fiducial limits", Biometrika 26(4), 1934.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space

from lcorpp.fitting.maximisation import Objective
from lcorpp.fitting.number_model import NumberModel
from lcorpp.values import Array

Z95 = 1.959964
"""Half width of the 95 % interval of a normal estimate, in standard errors."""

BOUNDARY = 1e-6
"""A number this close to its limits is on the boundary."""

MIN_FORM = 1e-9
"""Derivatives are computed as if no form were smaller, so that they exist where a number is 0 or 1."""

NULL_SCORE = 1e-6
"""Directions whose scores are smaller than the largest by this factor are not determined."""

DIFFERENCE = 1e-6
"""The step of numerical derivatives, in units of ``sqrt(p (1 - p))``."""


def compute_uncertainty(
    objective: Objective, parameters: Array
) -> tuple[list[tuple[float, float] | None], int]:
    """Compute intervals at a maximum of the objective.

    Returns:
        The 95 % interval of each parameter, None if it is not identifiable; and the number of independent
        directions in which the data do not determine the parameters.
    """
    model, expectation, prior = objective.model, objective.expectation, objective.prior
    is_inside = (parameters > BOUNDARY) & (parameters < 1 - BOUNDARY)
    scale = np.sqrt(parameters * (1 - parameters)) * is_inside
    sums = _list_fixed_sums(model, parameters)
    # a basis of the directions that keep these sums, and the numbers at 0 or 1
    basis = scale[:, None] * null_space(np.vstack([sums * scale, np.diag(~is_inside)]), rcond=NULL_SCORE)

    def differentiate(point: Array) -> tuple[Array, Array]:
        """Return the score (p,), and that of each distinct record times the root of its repeats (p, n)."""
        values = np.maximum(model.evaluate(point), MIN_FORM)
        expected = expectation.compute(values)
        scores = model.coefficients.T @ (expected.counts / values[:, None])
        total = scores @ expected.repeats + model.coefficients.T @ (prior / values)
        repeats = expected.repeats[:-2]
        rejected = scores[:, -1:] * expected.repeats[-1] / repeats.sum()
        return total, (scores[:, :-2] + rejected) * np.sqrt(repeats)

    score, by_record = differentiate(parameters)
    _, sizes, rows = np.linalg.svd(np.linalg.qr(by_record.T @ basis, mode="r"))
    rank = int((sizes > NULL_SCORE * sizes.max(initial=0.0)).sum())
    undetermined, determined = basis @ rows[rank:].T, basis @ rows[:rank].T
    information = np.zeros((rank, rank))
    values = model.evaluate(parameters)
    for i, direction in enumerate(determined.T):
        changes = np.abs(model.coefficients @ direction)
        moves = (changes > NULL_SCORE) & (values > MIN_FORM)
        step = DIFFERENCE * (values[moves] / changes[moves]).min(initial=1.0)  # no form may reach 0
        ahead, _ = differentiate(parameters + step * direction)
        information[i] = determined.T @ (score - ahead) / step
    sizes, vectors = np.linalg.eigh((information + information.T) / 2)
    curved = sizes > NULL_SCORE**2 * sizes.max(initial=0.0)
    undetermined = np.hstack([undetermined, determined @ vectors[:, ~curved]])
    determined = determined @ vectors[:, curved]
    covariance = determined / sizes[curved] @ determined.T

    multipliers = np.linalg.pinv(sums[:, is_inside].T) @ score[is_inside]
    slopes = np.abs(score - multipliers @ sums)
    intervals: list[tuple[float, float] | None] = []
    for i, p in enumerate(parameters):
        if is_inside[i] and np.linalg.norm(undetermined[i]) > np.sqrt(NULL_SCORE) * scale[i]:
            intervals.append(None)
        elif is_inside[i]:
            odds = float(p / (1 - p))
            factor = float(np.exp(Z95 * np.sqrt(covariance[i, i]) / (p * (1 - p))))
            intervals.append((odds / (odds + factor), odds * factor / (1 + odds * factor)))
        elif slopes[i] < BOUNDARY:
            intervals.append(None)
        else:  # exact for complete records, where the slope is their number
            limit = float(0.025 ** (1 / slopes[i]))
            intervals.append((0.0, 1 - limit) if p < 0.5 else (limit, 1.0))
    return intervals, undetermined.shape[1]


def _list_fixed_sums(model: NumberModel, parameters: Array) -> Array:
    """List the coefficients (n, p) of the sums that leave nothing for other values."""
    values = model.evaluate(parameters)
    sums = [model.coefficients[c.rest] for c in model.cases if c.is_full or values[c.rest] < BOUNDARY]
    return np.array(sums).reshape(-1, len(parameters))
