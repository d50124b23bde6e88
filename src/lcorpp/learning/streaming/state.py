"""Classifier state of each tracked person: a recurrent state, or the history of points."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from sklearn.exceptions import NotFittedError
from sklearn.pipeline import Pipeline
from sklearn.utils.validation import check_is_fitted

from lcorpp.errors import DataError
from lcorpp.learning.contract import SigmoidScores, predict_proba
from lcorpp.learning.features.motion import ChannelStandardizer, Motion
from lcorpp.learning.features.motion_features import TrackHistory
from lcorpp.values import Array

Slots = npt.NDArray[np.intp]
"""(n,) distinct indices of people in a `StreamState`."""


class StreamState(Protocol):
    """A fitted pipeline with the state of each tracked person."""

    constant_cost: bool
    """Whether the cost of a point does not depend on the length of the track."""

    def grow(self, size: int) -> None:
        """Extend to `size` slots; existing slots keep their state."""

    def reset(self, slots: Slots) -> None:
        """Start new tracks in some slots."""

    def advance(self, slots: Slots, points: Array) -> Array:
        """(n, K) probabilities after one more point (n, inputs) of each; NaN if there is no prediction."""


class RecurrentState:
    """State of a classifier with `begin` and `advance`, such as the LSTM: one step per point."""

    constant_cost = True

    def __init__(self, motion: Motion, standardizers: Sequence[ChannelStandardizer], classifier: Any) -> None:
        self._motion, self._standardizers, self._classifier = motion, standardizers, classifier
        self._state = classifier.begin(0)
        # (4, slots, inputs, 1) the `TrackHistory` of each slot; NaN before the first point
        self._history = np.empty((4, 0, len(motion.inputs), 1))

    def grow(self, size: int) -> None:
        """As `StreamState.grow`."""
        old_size = self._history.shape[1]
        state = self._classifier.begin(size)
        state.put(np.arange(old_size), self._state)
        self._state = state
        more = np.full((4, size - old_size, *self._history.shape[2:]), np.nan)
        self._history = np.concatenate([self._history, more], axis=1)

    def reset(self, slots: Slots) -> None:
        """As `StreamState.reset`."""
        self._state.put(slots, self._classifier.begin(len(slots)))
        self._history[:, slots] = np.nan

    def advance(self, slots: Slots, points: Array) -> Array:
        """As `StreamState.advance`."""
        now = points[..., None]
        history = TrackHistory(*self._history[:, slots]).at(now, self._motion.inputs)
        features = self._motion.compute_features(now, history)
        self._history[:, slots] = list(vars(history.after(now)).values())
        for standardizer in self._standardizers:
            features = standardizer.standardize(features)
        state = self._state.take(slots)
        probabilities: Array = self._classifier.advance(state, features[..., 0])
        self._state.put(slots, state)
        return probabilities


class ReplayedHistory:
    """State of any other classifier: it predicts from all points so far, or from the last `window` points.

    motion, later_steps: the first step of the pipeline and all others.
    min_points: number of points of a track before the first prediction.
    """

    constant_cost = False

    def __init__(self, motion: Motion, later_steps: Any, min_points: int, window: int | None) -> None:
        self._motion, self._later_steps = motion, later_steps
        self._min_points, self._window = min_points, window
        self._points: list[deque[Array]] = []  # of each slot

    def grow(self, size: int) -> None:
        """As `StreamState.grow`."""
        self._points += [deque(maxlen=self._window) for _ in range(size - len(self._points))]

    def reset(self, slots: Slots) -> None:
        """As `StreamState.reset`."""
        for slot in slots:
            self._points[slot].clear()

    def advance(self, slots: Slots, points: Array) -> Array:
        """As `StreamState.advance`."""
        rows_by_length: dict[int, list[int]] = {}
        for row, (slot, point) in enumerate(zip(slots, points, strict=True)):
            self._points[slot].append(point)
            rows_by_length.setdefault(len(self._points[slot]), []).append(row)
        probabilities = np.full((len(slots), len(self._later_steps.classes_)), np.nan)
        for length, rows in rows_by_length.items():
            if length >= self._min_points:
                tracks = np.array([self._points[slots[row]] for row in rows]).transpose(0, 2, 1)
                features = self._motion.transform_points(tracks)
                try:
                    probabilities[rows] = predict_proba(self._later_steps, features)
                except DataError as error:
                    raise DataError(
                        f"{error}; the tracks had {length} points. A classifier of tracks of one length"
                        " needs that length as `min_points` and as `window`"
                    ) from None
        return probabilities


def make_state(pipeline: Any, min_points: int, window: int | None) -> tuple[Motion, StreamState]:
    """Return the first step of a fitted pipeline, `Motion`, and the state for the steps after it.

    Args:
        min_points, window: as for `StreamingClassifier`.

    Raises:
        DataError: the pipeline is not a fitted Pipeline that begins with `Motion`.
    """
    is_wrapped = isinstance(pipeline, SigmoidScores)
    steps = getattr(pipeline, "classifier_", pipeline.classifier) if is_wrapped else pipeline
    if not isinstance(steps, Pipeline) or not isinstance(steps[0], Motion) or len(steps) < 2:
        first = type(steps[0] if isinstance(steps, Pipeline) else steps).__name__
        hint = ": use StreamingClassifier.from_trained" if hasattr(pipeline, "estimator") else ""
        raise DataError(
            "streaming needs a Pipeline of Motion, which resamples to a fixed rate, and a classifier; this"
            f" one begins with {first}{hint}"
        )
    motion, *between, classifier = (step for _, step in steps.steps)
    try:
        check_is_fitted(motion)
        check_is_fitted(classifier)
    except NotFittedError as error:
        raise DataError(f"streaming needs a fitted pipeline: {error}") from None
    recurrent = all(hasattr(classifier, name) for name in ("begin", "advance"))
    standardizers_only = all(isinstance(step, ChannelStandardizer) for step in between)
    if recurrent and not is_wrapped and window is None and standardizers_only:
        return motion, RecurrentState(motion, between, classifier)
    later_steps = steps[1:]
    if is_wrapped:
        wrapper = SigmoidScores(later_steps)
        wrapper.classifier_, wrapper.classes_ = later_steps, later_steps.classes_
        later_steps = wrapper
    return motion, ReplayedHistory(motion, later_steps, min_points, window)
