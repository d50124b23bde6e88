"""Confusion matrices and their smoothed rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from lcorpp.errors import DataError
from lcorpp.notebook import html_table, join_some
from lcorpp.values.arrays import Array, freeze

JEFFREYS, LAPLACE = Fraction(1, 2), Fraction(1)
"""Pseudo-counts: added to each count of a confusion matrix so that no rate is 0 or 1."""

ROUNDING = 1e-9
"""Relative tolerance of sums of counts."""


@dataclass(frozen=True, eq=False, repr=False)
class ConfusionMatrix:
    """Counts of true and predicted classes: C of Algorithm 1.

    classes: (n,) the class names; rows and columns have the same order.
    counts: (n, n) counts[i, j] cases of true class i with predicted class j.
    effective_cases: (n, n) the number of cases of known class i from which the rate of j would be as
        uncertain; None means the sum of the row. It is smaller if the true classes are estimated.

    Examples:
        >>> from lcorpp import ConfusionMatrix
        >>> confusion = ConfusionMatrix(("interested", "not_interested"), [[9, 1], [2, 18]])
        >>> confusion.probabilities[0].round(3).tolist()  # 9.5 / 11 and 0.5 / 11
        [0.864, 0.136]
    """

    classes: tuple[str, ...]
    counts: Array
    effective_cases: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "counts", freeze(self.counts))
        n = len(self.classes)
        if n < 2 or self.counts.shape != (n, n):
            raise DataError(f"a confusion matrix of {n} classes cannot have shape {self.counts.shape}")
        if not np.all(np.isfinite(self.counts)) or self.counts.min() < 0:
            raise DataError("a confusion matrix contains counts: finite and not negative")
        if self.effective_cases is not None:
            cases = freeze(self.effective_cases)
            object.__setattr__(self, "effective_cases", cases)
            limits = self.counts.sum(axis=1, keepdims=True) * (1 + ROUNDING)
            if cases.shape != (n, n) or not ((cases >= 0) & (cases <= limits)).all():
                raise DataError(
                    "the effective cases of a confusion matrix are numbers from 0 to the sums of its rows,"
                    f" {self.counts.sum(axis=1).tolist()}; not {cases.tolist()}"
                )

    @property
    def effective_counts(self) -> Array:
        """(n, n, 2) for each rate the effective cases with the predicted class, and with another one."""
        sums = self.counts.sum(axis=1, keepdims=True)
        cases = sums if self.effective_cases is None else self.effective_cases
        shares = self.counts / np.where(sums > 0, sums, 1)
        return np.stack([shares * cases, (1 - shares) * cases], axis=2)

    def rates(self, smoothing: Fraction = JEFFREYS) -> tuple[tuple[Fraction, ...], ...]:
        """Return P(predicted j | true i), row by row, as exact fractions.

        Args:
            smoothing: pseudo-count added to every count, `JEFFREYS` or `LAPLACE`; 0 leaves the counts
                unchanged.

        Raises:
            DataError: `smoothing` is negative, or 0 although a class has no cases.
        """
        if smoothing < 0:
            raise DataError(f"the smoothing is {smoothing}; expected 0 or more")
        rows = []
        for row in self.counts.tolist():
            smoothed = [Fraction(count) + smoothing for count in row]
            total = sum(smoothed)
            if total == 0:
                raise DataError("a class without cases needs smoothing above 0")
            rows.append(tuple(count / total for count in smoothed))
        return tuple(rows)

    @property
    def probabilities(self) -> Array:
        """(n, n) `rates()` as floats."""
        return np.array([[float(rate) for rate in row] for row in self.rates()])

    def to_json(self) -> dict[str, Any]:
        """Return the matrix as plain values."""
        numbers = {"classes": list(self.classes), "counts": self.counts.tolist()}
        if self.effective_cases is not None:
            numbers["effective_cases"] = self.effective_cases.tolist()
        return numbers

    @classmethod
    def from_json(cls, numbers: Mapping[str, Any]) -> ConfusionMatrix:
        """Restore the matrix that `to_json` returned.

        Raises:
            DataError: the numbers are not a confusion matrix.
        """
        cases = numbers.get("effective_cases")
        return cls(
            tuple(numbers["classes"]), np.array(numbers["counts"]), None if cases is None else np.array(cases)
        )

    def __repr__(self) -> str:
        recalls = [
            f"{name}: {row[i]:g} of {sum(row):g} correct"
            for i, (name, row) in enumerate(zip(self.classes, self.counts.tolist(), strict=True))
        ]
        return f"ConfusionMatrix({join_some(recalls)})"

    def _repr_html_(self) -> str:
        rows = zip(self.classes, self.counts.tolist(), strict=True)
        return html_table(
            ("true class", *self.classes),
            [(name, *(f"{count:g}" for count in row)) for name, row in rows],
            caption="Confusion matrix; columns: predicted class",
        )
