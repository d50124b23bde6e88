"""Predict for several people at once: each has a slot of the classifier's state while tracked."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lcorpp.learning.streaming.clock import StampCheck
from lcorpp.learning.streaming.predictions import Prediction
from lcorpp.learning.streaming.resampler import Sample, TrackResampler
from lcorpp.learning.streaming.state import StreamState
from lcorpp.learning.streaming.trigger import Trigger, TriggerState
from lcorpp.values import Array, freeze

MIN_SLOTS = 16
"""Slots of the classifier's state that the first person allocates; full slots are doubled."""

NOT_DECIDED = TriggerState()


@dataclass(eq=False, slots=True)
class TrackedPerson:
    """One id.

    resampler: its current track. slot: its index in the classifier's state. prediction: the current one.
    last_seen: clock time of its last sample. stamps: the check of its stamps. probabilities: (K,) after the
    last point, NaN before the first prediction. trigger: its state for the track.
    """

    resampler: TrackResampler
    slot: int
    prediction: Prediction
    last_seen: float = 0.0
    stamps: StampCheck = field(default_factory=StampCheck)
    probabilities: Array = field(default_factory=lambda: np.empty(0))
    trigger: TriggerState = NOT_DECIDED


class PeoplePredictor:
    """Keep the predictions for tracked people up to date.

    Args:
        state: of the classifier. A new person takes a slot of it, a removed one frees it for others.
        min_points: points of a track before the first prediction.

    Attributes:
        trigger: decides when enough of a track is seen; None never does. slots: number of allocated slots.
    """

    def __init__(self, state: StreamState, min_points: int) -> None:
        self._state, self._min_points = state, min_points
        self._free: list[int] = []  # slots without a person
        self.slots = 0
        self.trigger: Trigger | None = None

    def begin(self, name: Hashable, resampler: TrackResampler) -> TrackedPerson:
        """Return a new person."""
        if not self._free:
            old, self.slots = self.slots, max(MIN_SLOTS, 2 * self.slots)
            self._state.grow(self.slots)
            self._free = list(range(self.slots - 1, old - 1, -1))
        return TrackedPerson(resampler, self._free.pop(), Prediction(name, 0, 0, None, None))

    def update(self, people: Mapping[Hashable, TrackedPerson]) -> None:
        """Update the predictions of some people with the new points of their tracks."""
        due = []
        for person in people.values():
            new_points, is_new_track = person.resampler.take_points()
            if is_new_track:
                self._state.reset(np.array([person.slot]))
                person.trigger = NOT_DECIDED
            if new_points:
                due.append((person, new_points))
        self._advance(due)
        for name, person in people.items():
            track, points = person.resampler.track_count, person.resampler.point_count
            if (track, points) != (person.prediction.track, person.prediction.points):
                known = freeze(person.probabilities) if points >= self._min_points else None
                if self.trigger is not None and known is not None:
                    person.trigger = self.trigger.advance(person.trigger, points, known)
                decision, time = person.trigger.decision, person.resampler.time
                person.prediction = Prediction(name, track, points, time, known, decision)

    def end(self, person: TrackedPerson) -> None:
        """Free the slot of a person."""
        self._state.reset(np.array([person.slot]))
        self._free.append(person.slot)

    def _advance(self, due: Sequence[tuple[TrackedPerson, Sequence[Sample]]]) -> None:
        """Advance the state by the new points of people: the first point of each, then the second, ..."""
        for turn in range(max((len(new_points) for _, new_points in due), default=0)):
            batch = [(person, new_points[turn]) for person, new_points in due if len(new_points) > turn]
            slots, points = [person.slot for person, _ in batch], [point for _, point in batch]
            probabilities = self._state.advance(np.array(slots), np.array(points))
            for (person, _), row in zip(batch, probabilities, strict=True):
                person.probabilities = row
