"""Patience: the hazard of leaving by kind of person and time waited, learnt from stays that a robot observes.

Most stays are censored: the robot attends to a person, or loses sight of them, before they would leave. A
hazard that is constant within intervals of the time waited is estimated from the number of people who left
in an interval over the seconds that all spent in it, which is consistent under censoring (the
occurrence/exposure rate; as the intervals shrink, the Nelson-Aalen estimate). Gamma priors make it usable
from the first person on: the rate of an interval is drawn towards that of the kind, that of the kind
towards the one expected of everybody.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from lcorpp.errors import DecisionError
from lcorpp.values import Array

INTERVALS = (0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 80.0, 120.0)
"""Starts of the intervals of the time waited, in seconds; the last has no end."""
KIND_WEIGHT, INTERVAL_WEIGHT = 2.0, 6.0
"""Departures that the prior of a kind counts as, and the prior of an interval."""


@dataclass(eq=False)
class _Stays:
    """Stays of one kind. departures: (I,) their number in each interval. seconds: (I,) spent in each."""

    departures: Array = field(default_factory=lambda: np.zeros(len(INTERVALS)))
    seconds: Array = field(default_factory=lambda: np.zeros(len(INTERVALS)))


class Patience:
    """Online estimate of the hazard of leaving.

    Args:
        seconds: expected stay of a person of whose kind nothing is known.

    Raises:
        DecisionError: `seconds` is not a positive number.
    """

    def __init__(self, seconds: float = 40.0) -> None:
        if not (seconds > 0 and isfinite(seconds)):
            raise DecisionError(f"the expected stay is {seconds!r} seconds; expected a positive number")
        self._seconds, self._stays = seconds, dict[Hashable, _Stays]()

    def __repr__(self) -> str:
        kinds = ", ".join(f"{kind}: {self.mean_stay(kind):.3g} s" for kind in self._stays)
        return f"<Patience: {kinds or 'no stays'}>"

    def observe(self, kind: Hashable, seconds: float, *, left: bool, weight: float = 1.0) -> None:
        """Record a stay.

        Args:
            kind: of the person, e.g. what the camera sees of them.
            seconds: time waited, until the person left or the observation ended.
            left: whether the person left; False if the robot attended to them, or does not know.
            weight: e.g. P(interested): passers-by say nothing about the patience of those who wait.

        Raises:
            DecisionError: the time or the weight is negative or not finite.
        """
        if not (0 <= seconds < np.inf and 0 <= weight < np.inf):
            raise DecisionError(
                f"a stay of {seconds!r} seconds with weight {weight!r}; expected finite numbers, 0 or more"
            )
        stays = self._stays.setdefault(kind, _Stays())
        stays.seconds += weight * _spread(0.0, seconds)
        if left:
            stays.departures[np.searchsorted(INTERVALS, seconds, side="right") - 1] += weight

    def hazard(self, kind: Hashable, waited: float, ahead: float) -> float:
        """Return the mean hazard of leaving, per second, of a person who has waited for some time.

        Args:
            waited: seconds so far. ahead: seconds from now, positive, over which the hazard is averaged.
        """
        return float(_spread(waited, waited + ahead) @ self._rates(kind)) / ahead

    def mean_stay(self, kind: Hashable) -> float:
        """Return the inverse of the hazard of a kind at any time waited, in seconds."""
        stays = self._stays.get(kind, _Stays())
        return float(
            (stays.seconds.sum() + KIND_WEIGHT * self._seconds) / (stays.departures.sum() + KIND_WEIGHT)
        )

    def _rates(self, kind: Hashable) -> Array:
        """(I,) the hazard in each interval: the posterior means of the rates."""
        stays, mean_stay = self._stays.get(kind, _Stays()), self.mean_stay(kind)
        return (stays.departures + INTERVAL_WEIGHT) / (stays.seconds + INTERVAL_WEIGHT * mean_stay)


def _spread(begin: float, end: float) -> Array:
    """(I,) the seconds of a span that lie in each interval."""
    starts, ends = np.array(INTERVALS), np.array((*INTERVALS[1:], np.inf))
    spent: Array = np.clip(end, starts, ends) - np.clip(begin, starts, ends)
    return spent
