"""From what a classifier says to how often it is so: calibration, and the likelihood it gives a reasoner.

A classifier's probabilities rise with the truth but are seldom right: an LSTM that is trained long is too
sure, one with class weights believes both classes equally common, and some people look like the other kind
whatever they do. A few numbers, fitted on cases that the classifier had not seen, put that right; with the
shares of the classes in those cases divided out there remains what the motion itself speaks for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import softmax

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.evaluation.validation import Validation
from lcorpp.values import Array, Likelihood, freeze

FLOOR = 1e-3
"""What is said to be less likely than this counts as this: no data set of thousands can vouch for more, and
a forest whose trees all agree says 0."""


FIRST = ((0.0, 0.01), (1.0, 0.1))
"""Logarithm of the slope, and sum of the lapses, from which a fit begins; the better end is taken."""

LEAST_LAPSE, MOST_LAPSES = 1e-6, 0.9
"""The least lapse, so that nothing becomes impossible, and their sum at most: then the scores tell little."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Probabilities put right: ``lapses + (1 - sum of lapses) softmax(slope log p + offsets)``.

    For two classes without lapses this is Platt's logistic curve; with them it is the curve of psychometrics,
    which ends below 1 and above 0.

    classes: (K,) the class names, in the order of the probabilities.
    slope: how sure the classifier may be, above 0: below 1 it was too sure.
    offsets: (K,) one for each class, the last 0.
    lapses: (K,) how probable each class stays when everything speaks against it, not negative.
    shares: (K,) of the classes among the cases it was fitted on, positive, summing to 1.

    Source: Platt 1999; Guo, Pleiss, Sun and Weinberger, ICML 2017; Wichmann and Hill, Perception and
    Psychophysics 63, 2001, for the lapses.
    """

    classes: tuple[str, ...]
    slope: float
    offsets: Array
    lapses: Array
    shares: Array

    def __post_init__(self) -> None:
        for name in ("offsets", "lapses", "shares"):
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

    def calibrated(self, probabilities: Array) -> Array:
        """(cases, K) right probabilities where the classes are as common as in the data it was fitted on."""
        sure = softmax(self.slope * _logs(probabilities) + self.offsets, axis=1)
        return np.asarray(self.lapses + (1 - self.lapses.sum()) * sure)

    def likelihoods(self, probabilities: Array) -> list[Likelihood]:
        """What each case (cases, K) speaks for: the calibrated probabilities, the shares divided out."""
        weights = self.calibrated(probabilities) / self.shares
        return [Likelihood(self.classes, row) for row in weights]

    def to_json(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return {
            "classes": list(self.classes),
            "slope": self.slope,
            "offsets": self.offsets.tolist(),
            "lapses": self.lapses.tolist(),
            "shares": self.shares.tolist(),
        }

    @classmethod
    def from_json(cls, numbers: Mapping[str, Any]) -> Calibration:
        """What `to_json` gave.

        Raises:
            DataError: the numbers do not belong together.
        """
        classes = tuple(str(name) for name in numbers["classes"])
        offsets, lapses, shares = (np.array(numbers[name]) for name in ("offsets", "lapses", "shares"))
        return cls(classes, float(numbers["slope"]), offsets, lapses, shares)


def calibrate(classes: Sequence[str], probabilities: Array, labels: Sequence[str]) -> Calibration:
    """Fit a calibration to what a classifier said of cases that it was not trained on.

    Args:
        classes: (K,) the columns of `probabilities` (cases, K).
        labels: (cases,) what the cases are.

    Raises:
        DataError: there are no cases, or one of another class.

    Maximum likelihood, with Platt's smoothed targets: a class of n cases is right of (n + 1) / (n + K). The
    logarithm of the slope has a standard normal as its prior, which matters to some ten cases only.
    """
    index = _index(classes, labels)
    k, cases = len(classes), len(index)
    counts = np.bincount(index, minlength=k).astype(np.float64)
    wanted = ((np.eye(k) * counts[:, None] + 1) / (counts[:, None] + k))[index]
    logs = _logs(probabilities)

    def loss(parameters: Array) -> tuple[float, Array]:
        slope, offsets, lapses = _unpacked(parameters, k)
        sure = softmax(slope * logs + offsets, axis=1)
        said = lapses + (1 - lapses.sum()) * sure
        pull = -wanted / said / cases  # the derivative of the loss by each probability
        inner = (1 - lapses.sum()) * sure * (pull - (pull * sure).sum(axis=1, keepdims=True))
        by_lapse = pull.sum(axis=0) - (pull * sure).sum()
        by_slope = slope * float((inner * logs).sum()) + parameters[0] / cases
        value = -(wanted * np.log(said)).sum() / cases + parameters[0] ** 2 / 2 / cases
        return float(value), np.concatenate([[by_slope], inner[:, :-1].sum(axis=0), by_lapse])

    bounds = [(-5.0, 5.0), *[(None, None)] * (k - 1), *[(LEAST_LAPSE, MOST_LAPSES / k)] * k]
    starts = [np.concatenate([[slope], np.zeros(k - 1), np.full(k, lapses / k)]) for slope, lapses in FIRST]
    found = min(
        (minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds) for start in starts),
        key=lambda end: float(end.fun),
    )
    shares = (counts + 0.5) / (counts + 0.5).sum()
    return Calibration(tuple(classes), *_unpacked(found.x, k), shares)


def _unpacked(parameters: Array, k: int) -> tuple[float, Array, Array]:
    """Slope, offsets (k,) and lapses (k,)."""
    return float(np.exp(parameters[0])), np.append(parameters[1:k], 0.0), parameters[k:]


def calibration_of(validation: Validation) -> Calibration:
    """The calibration for the classifier trained on all cases: fitted on all out-of-fold predictions."""
    return calibrate(validation.classes, validation.probabilities, validation.labels)


def cross_calibrated(validation: Validation) -> Array:
    """(cases, K) the out-of-fold probabilities, each calibrated on the other folds."""
    calibrated = np.empty_like(validation.probabilities)
    folds, labels = np.array(validation.folds), np.array(validation.labels)
    for fold in np.unique(folds):
        others = folds != fold
        fit = calibrate(validation.classes, validation.probabilities[others], labels[others].tolist())
        calibrated[~others] = fit.calibrated(validation.probabilities[~others])
    return calibrated


def _logs(probabilities: Array) -> Array:
    return np.log(np.clip(probabilities, FLOOR, 1 - FLOOR))


def _index(classes: Sequence[str], labels: Sequence[str]) -> np.ndarray:
    """(cases,) the column of each label."""
    place = {name: column for column, name in enumerate(classes)}
    if not len(labels):
        raise DataError("no cases to calibrate on")
    for name in labels:
        if name not in place:
            raise DataError(f"a case is of class {name!r}; {expected_one_of(list(classes))}")
    return np.array([place[name] for name in labels], dtype=np.intp)
