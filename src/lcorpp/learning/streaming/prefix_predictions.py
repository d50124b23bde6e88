"""What a classifier said of many people while they were seen, and how right it was by then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from sklearn.metrics import roc_auc_score

from lcorpp.errors import DataError, expected_one_of
from lcorpp.values import Array, freeze


@dataclass(frozen=True, eq=False)
class OverTime:
    """What a classifier said of recorded tracks while they lasted.

    probabilities: (cases, time points, K) after each sample, NaN before the first answer.
    points: (time points,) at the fixed rate that were known by then; between two of them nothing changes.
    labels: (cases,) what they were. classes: (K,). interval: seconds between two time points.
    """

    probabilities: Array
    points: tuple[int, ...]
    labels: tuple[str, ...]
    classes: tuple[str, ...]
    interval: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "probabilities", freeze(self.probabilities))

    @property
    def seconds(self) -> Array:
        """(time points,) since the track began."""
        return np.arange(self.probabilities.shape[1], dtype=np.float64) * self.interval

    def of(self, name: str) -> Array:
        """(cases, time points) the probability of a class.

        Raises:
            DataError: there is no such class.
        """
        if name not in self.classes:
            raise DataError(f"unknown class {name!r}; {expected_one_of(self.classes)}")
        return self.probabilities[:, :, self.classes.index(name)]

    @property
    def auc(self) -> Array:
        """(time points,) how well the two classes can be told apart by then, NaN before the first answer.

        Raises:
            DataError: there are not two classes.
        """
        if len(self.classes) != 2:
            raise DataError(f"an AUC needs two classes, not {len(self.classes)}")
        is_second = np.array(self.labels) == self.classes[1]
        auc = np.full(self.probabilities.shape[1], np.nan)
        for time, now in enumerate(self.of(self.classes[1]).T):
            if time and self.points[time] == self.points[time - 1]:
                auc[time] = auc[time - 1]
            elif np.isfinite(now).all():
                auc[time] = roc_auc_score(is_second, now)
        return auc

    def auc_at(self, share: float) -> float:
        """The AUC when `share` of the tracks has been seen, as `prefix` counts it."""
        times = self.probabilities.shape[1]
        return float(self.auc[max(1, min(times, round(share * times))) - 1])
