"""Confusion matrices and their smoothed rates."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lcorpp.errors import DataError
from lcorpp.notebook import html_table, join_some
from lcorpp.values.arrays import Array, freeze

JEFFREYS, LAPLACE = Fraction(1, 2), Fraction(1)
"""Pseudo-counts: added to each count of a confusion matrix so that no rate is 0 or 1."""


@dataclass(frozen=True, eq=False, repr=False)
class ConfusionMatrix:
    """Counts of true and predicted classes: C of Algorithm 1.

    classes: (n,) the class names; rows and columns have the same order.
    counts: (n, n) counts[i, j] cases of true class i with predicted class j.
    """

    classes: tuple[str, ...]
    counts: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "counts", freeze(self.counts))
        n = len(self.classes)
        if n < 2 or self.counts.shape != (n, n):
            raise DataError(f"a confusion matrix of {n} classes cannot have shape {self.counts.shape}")
        if not np.all(np.isfinite(self.counts)) or self.counts.min() < 0:
            raise DataError("a confusion matrix contains counts: finite and not negative")

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
            caption="Columns: predicted class",
        )
