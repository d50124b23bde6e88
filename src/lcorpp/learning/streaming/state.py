"""What a classifier keeps of each person it follows: a state that is carried on, or the points so far."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from lcorpp.errors import DataError
from lcorpp.learning.classifiers.contract import Scored, predicted
from lcorpp.learning.features.motion import Motion, Scaling
from lcorpp.values import Array

Slots = npt.NDArray[np.intp]
"""(n,) places of people in a memory, each at most once."""


class Memory(Protocol):
    """A fitted pipeline that follows people by their places."""

    carried: bool
    """Whether a point costs the same however many there were before."""

    def grow(self, places: int) -> None:
        """Have room for more people; those that are there stay."""

    def begin(self, slots: Slots) -> None:
        """Forget what was known in some places."""

    def advance(self, slots: Slots, points: Array) -> Array:
        """(n, K) the probabilities after one more point (n, inputs) of each; NaN before an answer."""


class Carried:
    """A classifier with `begin` and `advance`, such as the LSTM: one step for a point."""

    carried = True

    def __init__(self, motion: Motion, scalings: Sequence[Scaling], classifier: Any) -> None:
        self._motion, self._scalings, self._classifier = motion, scalings, classifier
        self._state = classifier.begin(0)
        self._first = self._before = np.empty((0, len(motion.inputs)))
        self._new = np.empty(0, dtype=np.bool_)

    def grow(self, places: int) -> None:
        """As in `Memory`."""
        there = len(self._new)
        state = self._classifier.begin(places)
        state.put(np.arange(there), self._state)
        self._state = state
        more = np.zeros((places - there, self._first.shape[1]))
        self._first, self._before = np.concatenate([self._first, more]), np.concatenate([self._before, more])
        self._new = np.concatenate([self._new, np.ones(places - there, dtype=np.bool_)])

    def begin(self, slots: Slots) -> None:
        """As in `Memory`."""
        self._state.put(slots, self._classifier.begin(len(slots)))
        self._new[slots] = True

    def advance(self, slots: Slots, points: Array) -> Array:
        """As in `Memory`."""
        new = self._new[slots]
        if new.any():
            self._first[slots[new]] = self._before[slots[new]] = points[new]
            self._new[slots] = False
        told = self._motion.told(
            points[..., None], self._before[slots][..., None], self._first[slots][..., None]
        )
        self._before[slots] = points
        for scaling in self._scalings:
            told = scaling.scaled(told)
        state = self._state.take(slots)
        probabilities: Array = self._classifier.advance(state, told[..., 0])
        self._state.put(slots, state)
        return probabilities


class Replayed:
    """Any other classifier: it is asked about all points so far, or about the last `window` of them.

    least: points of a track before it is asked.
    """

    carried = False

    def __init__(self, motion: Motion, rest: Any, least: int, window: int | None) -> None:
        self._motion, self._rest, self._least, self._window = motion, rest, least, window
        self._points: list[deque[Array]] = []

    def grow(self, places: int) -> None:
        """As in `Memory`."""
        self._points += [deque(maxlen=self._window) for _ in range(places - len(self._points))]

    def begin(self, slots: Slots) -> None:
        """As in `Memory`."""
        for slot in slots:
            self._points[slot].clear()

    def advance(self, slots: Slots, points: Array) -> Array:
        """As in `Memory`."""
        alike: dict[int, list[int]] = {}
        for row, (slot, point) in enumerate(zip(slots, points, strict=True)):
            self._points[slot].append(point)
            alike.setdefault(len(self._points[slot]), []).append(row)
        probabilities = np.full((len(slots), len(self._rest.classes_)), np.nan)
        for length, rows in alike.items():
            if length >= self._least:
                tracks = np.array([self._points[slots[row]] for row in rows]).transpose(0, 2, 1)
                probabilities[rows] = self._asked(self._motion.of_points(tracks))
        return probabilities

    def _asked(self, tracks: Array) -> Array:
        try:
            return predicted(self._rest, tracks)
        except DataError as error:
            raise DataError(
                f"{error}; asked about {tracks.shape[2]} points of a track. A classifier of tracks of one"
                " length follows people if that is its `least` and its `window`"
            ) from None


def memory_of(pipeline: Any, least: int, window: int | None) -> tuple[Motion, Memory]:
    """The first step of a fitted pipeline, and what follows people with it; arguments as of `Streams`.

    Raises:
        DataError: it is no fitted Pipeline that begins with `Motion`.
    """
    scored = isinstance(pipeline, Scored)
    steps = pipeline.classifier_ if scored else pipeline
    if not isinstance(steps, Pipeline) or not isinstance(steps[0], Motion) or len(steps) < 2:
        first = type(steps[0] if isinstance(steps, Pipeline) else steps).__name__
        hint = ": take Streams.of" if hasattr(pipeline, "estimator") else ""
        raise DataError(
            "people can be followed by a Pipeline of Motion and a classifier, which says how samples become"
            f" points at a fixed rate; this one begins with {first}{hint}"
        )
    motion, *between, classifier = (step for _, step in steps.steps)
    for step in (motion, classifier):
        check_is_fitted(step)
    carries = all(hasattr(classifier, name) for name in ("begin", "advance"))
    if carries and not scored and window is None and all(isinstance(step, Scaling) for step in between):
        return motion, Carried(motion, between, classifier)
    rest = steps[1:]
    if scored:
        rest, pipeline = Scored(rest), rest
        rest.classifier_, rest.classes_ = pipeline, pipeline.classes_
    return motion, Replayed(motion, rest, least, window)
