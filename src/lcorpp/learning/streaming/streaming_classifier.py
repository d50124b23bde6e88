"""Streaming classifier: samples of many people in, the current prediction for each person out."""

from __future__ import annotations

import warnings
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from lcorpp.arguments import check_arguments, check_value
from lcorpp.errors import DataError
from lcorpp.learning.classifiers.trained import TrainedClassifier
from lcorpp.learning.contract import name_of
from lcorpp.learning.streaming.predictions import ConstantEstimator, Prediction, StreamReport
from lcorpp.learning.streaming.resampler import Clock, RepairCounts, Sample, StreamRules, TrackResampler
from lcorpp.learning.streaming.state import make_state
from lcorpp.learning.streaming.timeline import PrefixCalibration
from lcorpp.learning.streaming.trigger import Trigger, TriggerState
from lcorpp.values import Array, freeze

MAX_LONE_SAMPLES = 5  # in a row after gaps longer than `max_gap`; then the unit of the stamps is doubtful
MIN_SLOTS = 16
"""Slots of the classifier's state that the first person allocates; full slots are doubled."""

NOT_DECIDED = TriggerState()


@dataclass(eq=False, slots=True)
class _Person:
    """One id.

    resampler: its current track. slot: its index in the classifier's state. prediction: the current one.
    last_seen: clock time of its last sample. probabilities: (K,) after the last point, NaN before the first
    prediction. trigger: what the trigger remembers of the track.
    """

    resampler: TrackResampler
    slot: int
    prediction: Prediction
    last_seen: float = 0.0
    probabilities: Array = field(default_factory=lambda: np.empty(0))
    trigger: TriggerState = NOT_DECIDED


class StreamingClassifier:
    """Classify people while they move, from samples of any number of people in any order.

    The time stamps of the samples place a person's track on points at the fixed rate of the pipeline's
    `Motion`, and every new point updates the prediction. The prediction equals `predict_proba` of the
    pipeline for the whole track so far, resampled by `resample`. People do not affect each other's
    predictions. For a classifier with `begin` and `advance` (the LSTM) the cost of a sample does not depend
    on the length of the track; other classifiers predict again from the whole track at each point.

    Before `min_points` points, which take (min_points - 1) / rate seconds, the prediction has no
    probabilities. A robot that has to act then has the reasoner's prior, which is better than the class
    frequencies of training data.

    The rules for invalid samples; `report` counts all of them:

    - not finite: rejected; the report describes the first. The track continues with the next sample.
    - out of order: sorted if at most `allowed_lateness` late, which delays predictions as much; older samples
      are dropped. A second sample with the same stamp is dropped.
    - missing: gaps up to `max_gap` are interpolated linearly. After a longer one a new track begins, and also
      after a jump faster than `max_speed` (an id given to another person, or units other than metres), and if
      the clock goes back by more than `max_gap`.
    - without end: after `max_duration` a new track begins.
    - vanished ids: removed `max_silence` seconds after their last sample, by the stamps of the others (see
      `Clock` for wrong ones). An id that returns is a new person. So memory is bounded by the number of
      people seen in that time.

    Args:
        pipeline: a fitted pipeline that begins with `Motion`; its `inputs` are the values of a sample.
        allowed_lateness: seconds to wait for samples out of order; 0 if the tracker keeps the order.
        max_gap: seconds without a sample that end a track.
        max_duration: seconds, the maximal duration of a track.
        max_speed: metres per second; faster motion is an error.
        max_silence: seconds without a sample, after which an id is removed.
        min_points: points of a track before the first prediction.
        window: use only the last `window` points, as if the track had begun with them: for classifiers of
            tracks of one length, which have it as `min_points`, too. None uses all points.

    Attributes:
        inputs: the names of the values of a sample, in order. classes: (K,) the class names.
        constant_cost: whether the cost of a sample does not depend on the length of the track.

    Raises:
        DataError: the pipeline does not begin with `Motion`, or an option is out of range.
        NotFittedError: the pipeline is not fitted.
    """

    @check_arguments
    def __init__(
        self,
        pipeline: Any,
        *,
        allowed_lateness: float = 0.0,
        max_gap: float = 1.0,
        max_duration: float = 60.0,
        max_speed: float = 12.0,
        max_silence: float = 5.0,
        min_points: int = 2,
        window: int | None = None,
    ) -> None:
        if min_points < 2:
            raise DataError(f"one point shows no motion: min_points must be 2 or more, not {min_points}")
        if window is not None and window < min_points:
            raise DataError(f"window must be at least min_points, {min_points}, not {window}")
        self._motion, self._state = make_state(pipeline, min_points, window)
        self._rules = StreamRules(
            self._motion.rate, allowed_lateness, max_gap, max_duration, max_speed, max_silence
        )
        self._min_points, self.inputs = min_points, tuple(self._motion.inputs)
        self._people: dict[Hashable, _Person] = {}  # in the order of their last samples
        self._free: list[int] = []  # slots without a person
        self._slots = 0
        self._clock, self._has_warned = Clock(max_gap), False
        self._removed, self._removals = RepairCounts(), 0
        self._trained = TrainedClassifier(pipeline)
        self._prefix_calibration: PrefixCalibration | None = None
        self._trigger: Trigger | None = None
        self.classes, self.constant_cost = self._trained.classes, self._state.constant_cost

    def __repr__(self) -> str:
        name = name_of(self._trained.estimator)
        return f"<StreamingClassifier: {name}; classes {', '.join(self.classes)}; {len(self._people)} people>"

    @classmethod
    @check_arguments
    def from_trained(
        cls,
        trained: TrainedClassifier,
        *,
        prefix_calibration: PrefixCalibration | None = None,
        trigger: Trigger | None = None,
        **options: Any,
    ) -> Self:
        """Return a streaming classifier with the threshold and calibration of a trained classifier.

        Args:
            prefix_calibration: the calibration of early predictions, from `calibrate_prefixes`; None takes
                that of the trigger, if there is one.
            trigger: decides when enough of a track is seen, see `Prediction.decision`; from `fit_trigger`.
            options: the keyword arguments of the class.

        Raises:
            DataError: as the class, or the trigger is for other classes.
        """
        streams = cls(trained.estimator, **options)
        if trigger is not None and trigger.classes != streams.classes:
            raise DataError(
                f"the trigger is for {', '.join(trigger.classes)}; the classifier for"
                f" {', '.join(streams.classes)}"
            )
        if prefix_calibration is None and trigger is not None:
            prefix_calibration = trigger.calibration
        streams._trained, streams._prefix_calibration = trained, prefix_calibration
        streams._trigger = trigger
        return streams

    def classifier(self, person: Hashable) -> TrainedClassifier:
        """The current prediction for a person as a classifier for the decision loop.

        Its label is the same for any instance. Its `soft()` gives likelihoods, calibrated for the number of
        points if there is a prefix calibration. Otherwise calibration, threshold, prediction sets and
        confusion matrix are those of whole tracks; for early decisions, validate on `truncate`.

        Raises:
            DataError: there is no prediction for the person yet.
        """
        prediction = self.predictions.get(person)
        if prediction is None or prediction.probabilities is None:
            reason = "has no samples" if prediction is None else f"has {prediction.points} points, too few"
            raise DataError(f"there is no prediction for {person!r}, who {reason}")
        calibration = self._trained.calibration
        if self._prefix_calibration is not None:
            calibration = self._prefix_calibration.at(prediction.points)
        constant = ConstantEstimator(self.classes, prediction.probabilities)
        return replace(self._trained, estimator=constant, calibration=calibration)

    @property
    def predictions(self) -> Mapping[Hashable, Prediction]:
        """The current predictions for all tracked people."""
        return MappingProxyType({name: person.prediction for name, person in self._people.items()})

    def push(self, time: float, person: Hashable, *values: float) -> Prediction:
        """Process one sample and return the person's prediction.

        Args:
            time: seconds, on a clock that all people share.
            person: the tracker's id.
            values: as the pipeline's `inputs`: x and y in metres, ...

        Raises:
            DataError: the sample is malformed; numbers that are not finite are counted instead.
        """
        return self.push_many([(time, person, *values)])[person]

    def push_many(self, samples: Iterable[Sequence[Any]]) -> dict[Hashable, Prediction]:
        """Process samples (time, person, x, y, ...) and return the predictions for the people in them.

        This is faster than `push` for each, because the classifier processes all people at once.

        Raises:
            DataError: a sample is malformed; then none of them is used. Or the classifier fails; then the
                people in these samples are removed.
        """
        check_value(samples, Iterable, "the samples")
        checked = [self._check(sample) for sample in samples]
        updated = {name: self._add(time, name, sample) for time, name, sample in checked}
        self._update(updated)
        while self._people:  # the longest silent come first
            name, person = next(iter(self._people.items()))
            if self._clock.elapsed - person.last_seen <= self._rules.max_silence:
                break
            self._drop(name)
        return {name: person.prediction for name, person in updated.items()}

    def remove(self, person: Hashable) -> Prediction:
        """Remove a person and return the final prediction, which includes delayed samples.

        Raises:
            DataError: the person is not tracked.
        """
        if person not in self._people:
            raise DataError(f"there is no person {person!r}")
        removed = self._people[person]
        removed.resampler.flush()
        self._update({person: removed})
        self._drop(person)
        return removed.prediction

    def report(self) -> StreamReport:
        """Return the counts of rejected, dropped and interpolated samples, by person."""
        people = {name: replace(person.resampler.repairs) for name, person in self._people.items()}
        return StreamReport(MappingProxyType(people), replace(self._removed), self._removals)

    def _check(self, sample: Sequence[Any]) -> tuple[float, Hashable, Sample]:
        try:
            time, name, *values = sample
            hash(name)
            numbers = tuple(map(float, values))
            if len(numbers) == len(self.inputs):
                return float(time), name, numbers
        except (TypeError, ValueError, OverflowError):
            pass
        raise DataError(f"sample {sample!r}; expected time, person, {', '.join(self.inputs)}")

    def _add(self, time: float, name: Hashable, sample: Sample) -> _Person:
        """Add a sample to the track of its person."""
        if isfinite(time):
            self._clock.observe(time)
        person = self._people.pop(name, None) or self._create_person(name)
        self._people[name] = person
        person.last_seen = self._clock.elapsed
        person.resampler.add(time, sample)
        if person.resampler.lone_samples >= MAX_LONE_SAMPLES and not self._has_warned:
            self._has_warned = True
            message = (
                f"the last {MAX_LONE_SAMPLES} samples of {name!r} came after gaps longer than max_gap,"
                f" the last at {time:.15g}; expected seconds: are these milliseconds?"
            )
            warnings.warn(message, stacklevel=2)
        return person

    def _create_person(self, name: Hashable) -> _Person:
        if not self._free:
            old, self._slots = self._slots, max(MIN_SLOTS, 2 * self._slots)
            self._state.grow(self._slots)
            self._free = list(range(self._slots - 1, old - 1, -1))
        resampler = TrackResampler(self._rules, self.inputs, self._motion.angles)
        return _Person(resampler, self._free.pop(), Prediction(name, 0, 0, None, None))

    def _update(self, people: Mapping[Hashable, _Person]) -> None:
        """Update the predictions of some people with their new points."""
        due = []
        for person in people.values():
            new_points, is_new_track = person.resampler.take_points()
            if is_new_track:
                self._state.reset(np.array([person.slot]))
                person.trigger = NOT_DECIDED
            if new_points:
                due.append((person, new_points))
        try:
            self._advance(due)
        except BaseException:
            for name in people:  # their state no longer matches their tracks
                self._drop(name)
            raise
        for name, person in people.items():
            track, points = person.resampler.track_count, person.resampler.point_count
            if (track, points) != (person.prediction.track, person.prediction.points):
                known = freeze(person.probabilities) if points >= self._min_points else None
                if self._trigger is not None and known is not None:
                    person.trigger = self._trigger.advance(person.trigger, points, known)
                decision, time = person.trigger.decision, person.resampler.time
                person.prediction = Prediction(name, track, points, time, known, decision)

    def _advance(self, due: Sequence[tuple[_Person, Sequence[Sample]]]) -> None:
        """Advance the state by the new points of people: the first point of each, then the second, ..."""
        for turn in range(max((len(new_points) for _, new_points in due), default=0)):
            batch = [(person, new_points[turn]) for person, new_points in due if len(new_points) > turn]
            slots, points = [person.slot for person, _ in batch], [point for _, point in batch]
            probabilities = self._state.advance(np.array(slots), np.array(points))
            for (person, _), row in zip(batch, probabilities, strict=True):
                person.probabilities = row

    def _drop(self, name: Hashable) -> None:
        person = self._people.pop(name)
        self._state.reset(np.array([person.slot]))
        self._free.append(person.slot)
        self._removed.add(person.resampler.repairs)
        self._removals += 1
