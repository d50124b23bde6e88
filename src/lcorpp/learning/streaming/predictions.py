"""What streams say: the answer about a person by now, and what became of the samples."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.learning.streaming.track import Repairs
from lcorpp.values import Array


@dataclass(frozen=True, eq=False, slots=True)
class Answer:
    """What is known of a person by now.

    person: the id. track: how many tracks of this id were begun; the answer is about the last.
    points: of that track, at the fixed rate. time: stamp of the last of them, None without one.
    probabilities: (K,) of the classes of the classifier; None as long as there are too few points.
    """

    person: Hashable
    track: int
    points: int
    time: float | None
    probabilities: Array | None


@dataclass(frozen=True, eq=False)
class Report:
    """What became of the samples.

    people: of everybody who is followed now. forgotten: of all others together. leavers: how often somebody
    was forgotten or left.
    """

    people: Mapping[Hashable, Repairs]
    forgotten: Repairs
    leavers: int

    @property
    def total(self) -> Repairs:
        """Of all together."""
        total = self.forgotten.copy()
        for repairs in self.people.values():
            total.add(repairs)
        return total

    def __str__(self) -> str:
        lines = [f"{person}: {repairs}" for person, repairs in self.people.items()]
        if self.leavers:
            lines.append(f"{self.leavers} no longer followed: {self.forgotten}")
        return "\n".join(lines) or "no samples"


class Said:
    """Stands for an estimator: whatever it is shown, it says what was known of one person at one time."""

    def __init__(self, classes: tuple[str, ...], probabilities: Array) -> None:
        self.classes_, self._probabilities = np.array(classes), probabilities

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) the same for every case."""
        return np.tile(self._probabilities, (len(np.asarray(X)), 1))
