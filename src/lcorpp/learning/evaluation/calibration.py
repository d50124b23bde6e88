"""Calibrate classifier probabilities and convert them to likelihoods for the reasoner.

The probabilities of a classifier increase with the frequency of a class but rarely equal it: an LSTM that is
trained long is overconfident, one with class weights assumes balanced classes, and some people look like the
other class whatever they do. A calibration with a few parameters, fitted to out-of-fold predictions, corrects
this; dividing by the class frequencies of these cases leaves the likelihood of the motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize
from scipy.special import softmax

from lcorpp.arguments import check_arguments, check_fields, to_numbers
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.evaluation.validation import Validation
from lcorpp.values import Array, Likelihood, freeze
from lcorpp.values.probabilities import MIN_CREDIBLE

STARTS = ((0.0, 0.01), (1.0, 0.1))
"""Starting points of a fit: logarithm of the slope, and sum of the lapses. The better result is taken."""

MIN_LAPSE, MAX_LAPSE_SUM = 1e-6, 0.9
"""The smallest lapse, so that no class becomes impossible, and the largest sum of lapses."""

ROUNDING = 1e-6
"""How far above 1 a probability may be: classifiers compute with single precision."""

ARRAYS = ("offsets", "lapses", "shares")
"""The fields of a calibration that are arrays (K,)."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """The calibration curve ``lapses + (1 - sum of lapses) softmax(slope log p + offsets)``.

    For two classes without lapses this is Platt's logistic curve; with them it is the psychometric curve,
    whose ends lie above 0 and below 1.

    evidence: the name in `lcorpp.values.EVIDENCE`.
    classes: (K,) the class names, in the order of the probabilities.
    slope: above 0; below 1 the classifier was overconfident.
    offsets: (K,) one per class, the last 0.
    lapses: (K,) the smallest probability of each class, not negative.
    shares: (K,) the class frequencies among the cases of the fit, positive, summing to 1.

    Source: Platt 1999; Guo, Pleiss, Sun and Weinberger, ICML 2017; Wichmann and Hill, Perception and
    Psychophysics 63, 2001, for the lapses.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import Calibration
        >>> curve = Calibration(("no", "yes"), 0.5, np.zeros(2), lapses=np.zeros(2), shares=np.full(2, 0.5))
        >>> curve.calibrate([[0.1, 0.9]]).round(3).tolist()  # odds of 9 become odds of 3
        [[0.25, 0.75]]
    """

    evidence: ClassVar[str] = "soft"
    classes: tuple[str, ...]
    slope: float
    offsets: Array
    lapses: Array
    shares: Array

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ARRAYS:
            object.__setattr__(self, name, freeze(getattr(self, name)))
        k = len(self.classes)
        if k < 2 or any(part.shape != (k,) for part in (self.offsets, self.lapses, self.shares)):
            raise DataError(f"a calibration of {k} classes needs as many offsets, lapses and shares")
        numbers = np.concatenate([[self.slope], self.offsets, self.lapses, self.shares])
        if not np.isfinite(numbers).all() or self.slope <= 0 or self.shares.min() <= 0:
            raise DataError("a calibration needs finite numbers, a slope above 0 and positive shares")
        if self.lapses.min() < 0 or self.lapses.sum() >= 1:
            raise DataError("the lapses of a calibration are not negative and sum to less than 1")
        if abs(self.shares.sum() - 1) > 1e-9:
            raise DataError(f"the shares of a calibration sum to {self.shares.sum():g}, not 1")

    def __repr__(self) -> str:
        rows = zip(self.classes, self.offsets, self.lapses, self.shares, strict=True)
        parts = [f"{name}: offset {o:.3g}, lapse {lapse:.3g}, share {s:.3g}" for name, o, lapse, s in rows]
        shown = parts if len(parts) <= 6 else [*parts[:6], f"and {len(parts) - 6} more classes"]
        return f"<Calibration: slope {self.slope:.3g}; {'; '.join(shown)}>"

    def calibrate(self, probabilities: Array) -> Array:
        """(cases, K) calibrated probabilities, at the class frequencies of the cases of the fit.

        Raises:
            DataError: `probabilities` (cases, K) are not finite, or not from 0 to 1.
        """
        logs = _clip_and_log(probabilities, len(self.classes))
        curve = softmax(self.slope * logs + self.offsets, axis=1)
        return np.asarray(self.lapses + (1 - self.lapses.sum()) * curve)

    def likelihoods(self, probabilities: Array) -> list[Likelihood]:
        """The likelihood of each case (cases, K): calibrated probabilities over class frequencies."""
        return [Likelihood(self.classes, row) for row in self.calibrate(probabilities) / self.shares]

    def to_json(self) -> dict[str, Any]:
        """Return the parameters as plain values."""
        arrays = {name: getattr(self, name).tolist() for name in ARRAYS}
        return {"classes": list(self.classes), "slope": self.slope, **arrays}

    @classmethod
    def from_json(cls, numbers: Mapping[str, Any]) -> Calibration:
        """Restore the calibration that `to_json` returned.

        Raises:
            DataError: the parameters do not match.
        """
        with report_damage("a calibration"):
            classes = tuple(str(name) for name in numbers["classes"])
            return cls(classes, float(numbers["slope"]), *(np.array(numbers[name]) for name in ARRAYS))


@check_arguments
def fit_calibration(
    classes: Sequence[str], probabilities: Array, labels: Sequence[str], weights: Array | None = None
) -> Calibration:
    """Fit a calibration to predictions on cases that the classifier was not trained on.

    Args:
        classes: (K,) the columns of `probabilities` (cases, K).
        labels: (cases,) the true classes.
        weights: (cases,) as in `Dataset`; None is 1 for all.

    Raises:
        DataError: there are no cases, a label is not one of `classes`, a probability is not from 0 to 1, or a
            weight is not above 0.

    Maximum likelihood with Platt's smoothed targets: the target of a case of a class with n cases is
    (n + 1) / (n + K). The logarithm of the slope has a standard normal prior, which matters only for some ten
    cases.

    Examples:
        >>> from lcorpp.learning import fit_calibration
        >>> predicted = 10 * [[0.1, 0.9]] + 10 * [[0.9, 0.1]]  # P(no), P(yes)
        >>> labels = 8 * ["yes"] + 2 * ["no"] + 8 * ["no"] + 2 * ["yes"]  # 80 % are correct, not 90 %
        >>> fit_calibration(["no", "yes"], predicted, labels).calibrate([[0.1, 0.9]]).round(2).tolist()
        [[0.25, 0.75]]
    """
    columns = {name: column for column, name in enumerate(classes)}
    if not len(labels):
        raise DataError("no cases to calibrate on")
    for name in labels:
        if name not in columns:
            raise DataError(f"a case is of class {name!r}; {expected_one_of(list(classes))}")
    index = np.array([columns[name] for name in labels])
    k, weight = (
        len(classes),
        np.ones(len(index)) if weights is None else np.asarray(weights, dtype=np.float64),
    )
    logs = _clip_and_log(probabilities, k)
    if (
        len(logs) != len(index)
        or weight.shape != index.shape
        or not ((weight > 0) & np.isfinite(weight)).all()
    ):
        raise DataError(
            f"{len(index)} labels need as many rows of probabilities, not {len(logs)}, and as many weights,"
            f" finite and above 0, not {weight}"
        )
    counts = np.bincount(index, weight, minlength=k)
    cases = counts.sum()
    targets = ((np.eye(k) * counts[:, None] + 1) / (counts[:, None] + k))[index] * weight[:, None]

    def loss(parameters: Array) -> tuple[float, Array]:
        slope, offsets, lapses = _unpack_parameters(parameters, k)
        curve = softmax(slope * logs + offsets, axis=1)
        calibrated = lapses + (1 - lapses.sum()) * curve
        by_probability = -targets / calibrated / cases
        centred = by_probability - (by_probability * curve).sum(axis=1, keepdims=True)
        by_score = (1 - lapses.sum()) * curve * centred
        by_lapse = by_probability.sum(axis=0) - (by_probability * curve).sum()
        by_slope = slope * float((by_score * logs).sum()) + parameters[0] / cases
        value = -(targets * np.log(calibrated)).sum() / cases + parameters[0] ** 2 / 2 / cases
        return float(value), np.concatenate([[by_slope], by_score[:, :-1].sum(axis=0), by_lapse])

    bounds = [(-5.0, 5.0), *[(None, None)] * (k - 1), *[(MIN_LAPSE, MAX_LAPSE_SUM / k)] * k]
    starts = [np.concatenate([[slope], np.zeros(k - 1), np.full(k, lapses / k)]) for slope, lapses in STARTS]
    fits = [minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds) for start in starts]
    best = min(fits, key=lambda result: float(result.fun))
    shares = (counts + 0.5) / (counts + 0.5).sum()
    return Calibration(tuple(classes), *_unpack_parameters(best.x, k), shares)


@check_arguments
def cross_calibrate(validation: Validation) -> Array:
    """(cases, K) the out-of-fold probabilities, each fold calibrated by a fit to the other folds.

    The fits count the cases by weight, as `fit_calibration` in `train_and_validate` does.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, cross_calibrate, cross_validate
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> validation = cross_validate(QuadraticLogistic(), data)  # which is underconfident
        >>> validation.probabilities[0].round(2).tolist(), cross_calibrate(validation)[0].round(2).tolist()
        ([0.55, 0.45], [0.82, 0.18])
    """
    calibrated = np.empty_like(validation.probabilities)
    folds, labels = np.array(validation.folds), np.array(validation.labels)
    given = validation.probabilities
    for fold in np.unique(folds):
        others = folds != fold
        calibration = fit_calibration(
            validation.classes, given[others], labels[others].tolist(), validation.weights[others]
        )
        calibrated[~others] = calibration.calibrate(given[~others])
    return calibrated


def _unpack_parameters(parameters: Array, k: int) -> tuple[float, Array, Array]:
    """Slope, offsets (k,) and lapses (k,)."""
    return float(np.exp(parameters[0])), np.append(parameters[1:k], 0.0), parameters[k:]


@contextmanager
def report_damage(what: str) -> Iterator[None]:
    """Turn what fails while parameters are read into a DataError; `what` names their owner."""
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"not parameters of {what}, or damaged ones: {error}") from None


def check_probabilities(probabilities: npt.ArrayLike, k: int) -> Array:
    """Return probabilities as an array (cases, k) after checking them.

    Raises:
        DataError: another shape, or a number that is not from 0 to 1.
    """
    checked = to_numbers(probabilities, "the probabilities")
    if checked.ndim != 2 or checked.shape[1] != k:
        raise DataError(
            f"probabilities of shape {checked.shape}; expected (cases, {k}), a column for each class"
        )
    bad = ~((checked >= 0) & (checked <= 1 + ROUNDING))
    if bad.any():
        row, column = np.argwhere(bad)[0].tolist()
        raise DataError(
            f"the probability of case {row}, class {column} (counted from 0) is {checked[row, column]};"
            " expected a number from 0 to 1"
        )
    return checked


def _clip_and_log(probabilities: npt.ArrayLike, k: int) -> Array:
    """(cases, k) logarithms of checked probabilities."""
    return np.log(np.clip(check_probabilities(probabilities, k), MIN_CREDIBLE, 1 - MIN_CREDIBLE))
