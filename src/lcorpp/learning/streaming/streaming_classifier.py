"""Streaming classifier: samples of many people in, the current prediction for each person out."""

from __future__ import annotations

import warnings
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from types import MappingProxyType
from typing import Any, Self

from lcorpp.arguments import check_arguments, check_value
from lcorpp.errors import DataError
from lcorpp.learning.classifiers.trained import TrainedClassifier
from lcorpp.learning.contract import name_of
from lcorpp.learning.streaming.clock import Clock, describe_doubtful_stamps
from lcorpp.learning.streaming.people_predictor import PeoplePredictor, TrackedPerson
from lcorpp.learning.streaming.predictions import (
    ConstantEstimator,
    Prediction,
    StreamReport,
    predictions_to_html,
)
from lcorpp.learning.streaming.prefix_sets import PrefixSets
from lcorpp.learning.streaming.resampler import RepairCounts, Sample, StreamRules, TrackResampler
from lcorpp.learning.streaming.state import make_state
from lcorpp.learning.streaming.timeline import PrefixCalibration
from lcorpp.learning.streaming.trigger import Trigger

MAX_LONE_SAMPLES = 5  # in a row after gaps longer than `max_gap`; then the unit of the stamps is doubtful


class StreamingClassifier:
    """Classify people while they move, from samples of any number of people in any order.

    The time stamps of the samples place a person's track on points at the fixed rate of the pipeline's
    `Motion`, and every new point updates the prediction. The prediction equals `predict_proba` of the
    pipeline for the whole track so far, resampled by `resample`. People do not affect each other's
    predictions. For a classifier with `begin` and `advance` (LSTM, MiniRocket) the cost of a sample does not
    depend on the length of the track; other classifiers predict again from the whole track at each point.

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
        rules: for invalid samples. min_points: as above.
        constant_cost: whether the cost of a sample does not depend on the length of the track.

    Raises:
        DataError: the pipeline does not begin with `Motion`, or an option is out of range.
        NotFittedError: the pipeline is not fitted.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import StreamingClassifier, learner, train
        >>> walks = [np.outer([speed, 0], np.arange(30) / 10) for speed in (0.2, 0.3, 0.4, 1.1, 1.2, 1.3)]
        >>> data = Dataset(walks, 3 * ["slow"] + 3 * ["fast"], interval=0.1)
        >>> streams = StreamingClassifier.from_trained(train(learner("summaries", interval=0.1), data))
        >>> for n in range(11):
        ...     prediction = streams.push(n / 10, "person 7", 1.5 * n / 10, 0.0)
        >>> streams.classes, prediction.points, prediction.probabilities.round(2).tolist()
        (('fast', 'slow'), 4, [0.61, 0.39])
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
        self._motion, state = make_state(pipeline, min_points, window)
        self.rules = StreamRules(
            self._motion.rate, allowed_lateness, max_gap, max_duration, max_speed, max_silence
        )
        self.min_points, self.inputs = min_points, tuple(self._motion.inputs)
        self._people: dict[Hashable, TrackedPerson] = {}  # in the order of their last samples
        self._predictor = PeoplePredictor(state, min_points)
        self._clock, self._warned = Clock(max_gap), set[str]()
        self._removed, self._removals = RepairCounts(), 0
        self._trained = TrainedClassifier(pipeline)
        self._prefix_calibration: PrefixCalibration | None = None
        self._prefix_sets: PrefixSets | None = None
        self.classes, self.constant_cost = self._trained.classes, state.constant_cost

    def __repr__(self) -> str:
        name = name_of(self._trained.estimator)
        return f"<StreamingClassifier: {name}; classes {', '.join(self.classes)}; {len(self._people)} people>"

    def _repr_html_(self) -> str:
        return predictions_to_html(self.predictions.values(), self.classes, caption=repr(self)[1:-1])

    @classmethod
    @check_arguments
    def from_trained(
        cls,
        trained: TrainedClassifier,
        *,
        prefix_calibration: PrefixCalibration | None = None,
        prefix_sets: PrefixSets | None = None,
        trigger: Trigger | None = None,
        **options: Any,
    ) -> Self:
        """Return a streaming classifier with the threshold and calibration of a trained classifier.

        Args:
            prefix_calibration: the calibration of early predictions, from `calibrate_prefixes`; None takes
                that of the trigger, if there is one.
            prefix_sets: the prediction sets of early predictions, from `fit_prefix_sets`.
            trigger: decides when enough of a track is seen, see `Prediction.decision`; from `fit_trigger`.
            options: the keyword arguments of the class.

        Raises:
            DataError: as the class, or the trigger or the prefix sets are for other classes.
        """
        streams = cls(trained.estimator, **options)
        for what, part in (("trigger is", trigger), ("prefix sets are", prefix_sets)):
            if part is not None and part.classes != streams.classes:
                raise DataError(
                    f"the {what} for {', '.join(part.classes)}; the classifier for"
                    f" {', '.join(streams.classes)}"
                )
        if prefix_calibration is None and trigger is not None:
            prefix_calibration = trigger.calibration
        streams._trained, streams._prefix_calibration = trained, prefix_calibration
        streams._prefix_sets = prefix_sets
        streams._predictor.trigger = trigger
        return streams

    def classifier(self, person: Hashable) -> TrainedClassifier:
        """The current prediction for a person as a classifier for the decision loop.

        Its label is the same for any instance. Its `soft()` and `sets()` give likelihoods for the number of
        points if there are a prefix calibration and prefix sets. Otherwise calibration and prediction sets
        are those of whole tracks, as threshold and confusion matrix always are; for early decisions, validate
        on `truncate`.

        Raises:
            DataError: there is no prediction for the person yet.
        """
        prediction = self.predictions.get(person)
        if prediction is None or prediction.probabilities is None:
            reason = "has no samples" if prediction is None else f"has {prediction.points} points, too few"
            raise DataError(f"there is no prediction for {person!r}, who {reason}")
        own: dict[str, Any] = {"estimator": ConstantEstimator(self.classes, prediction.probabilities)}
        if self._prefix_calibration is not None:
            own["calibration"] = self._prefix_calibration.at(prediction.points)
        if self._prefix_sets is not None:
            own["prediction_sets"] = self._prefix_sets.at(prediction.points)
        return replace(self._trained, **own)

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
            if self._clock.elapsed - person.last_seen <= self.rules.max_silence:
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

    def _add(self, time: float, name: Hashable, sample: Sample) -> TrackedPerson:
        """Add a sample to the track of its person."""
        if isfinite(time):
            self._clock.observe(time)
        person = self._people.pop(name, None)
        if person is None:
            resampler = TrackResampler(self.rules, self.inputs, self._motion.angles)
            person = self._predictor.begin(name, resampler)
        self._people[name] = person
        person.last_seen = self._clock.elapsed
        repairs = person.resampler.repairs
        unused = repairs.duplicates + repairs.late
        person.resampler.add(time, sample)
        if person.stamps.observe(repairs.duplicates + repairs.late == unused):
            self._warn_once("stamps stand still", describe_doubtful_stamps(name, time))
        if person.resampler.lone_samples >= MAX_LONE_SAMPLES:
            message = (
                f"the last {MAX_LONE_SAMPLES} samples of {name!r} came after gaps longer than max_gap,"
                f" the last at {time:.15g}; expected seconds: are these milliseconds?"
            )
            self._warn_once("stamps far apart", message)
        return person

    def _warn_once(self, kind: str, message: str) -> None:
        if kind not in self._warned:
            self._warned.add(kind)
            warnings.warn(message, stacklevel=4)

    def _update(self, people: Mapping[Hashable, TrackedPerson]) -> None:
        try:
            self._predictor.update(people)
        except BaseException:
            for name in people:  # their state no longer matches their tracks
                self._drop(name)
            raise

    def _drop(self, name: Hashable) -> None:
        person = self._people.pop(name)
        self._predictor.end(person)
        self._removed.add(person.resampler.repairs)
        self._removals += 1
