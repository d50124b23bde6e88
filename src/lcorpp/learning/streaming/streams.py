"""Everybody that a tracker sees, sample by sample, with what the classifier thinks of each by now."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from lcorpp.errors import DataError
from lcorpp.learning.classifiers.trained import TrainedClassifier
from lcorpp.learning.streaming.clock import Clock
from lcorpp.learning.streaming.predictions import Answer, Report, Said
from lcorpp.learning.streaming.prefix_calibration import Early
from lcorpp.learning.streaming.state import memory_of
from lcorpp.learning.streaming.track import Repairs, Rules, Sample, Track
from lcorpp.values import Array, freeze


class _Person:
    """One id: its track, its place in the memory, when it was last heard of, and the answer by now."""

    __slots__ = ("answer", "heard", "probabilities", "slot", "track")

    def __init__(self, track: Track, slot: int, name: Hashable) -> None:
        self.track, self.slot, self.heard = track, slot, 0.0
        self.probabilities: Array = np.empty(0)
        self.answer = Answer(name, 0, 0, None, None)


class Streams:
    """Classify people while they move, from samples of any number of people in any order.

    A sample brings a person's track to points at the fixed rate of the pipeline's `Motion`, by their time
    stamps, and every new point to a new answer. The answer is what the pipeline would say of the whole track
    up to there: `predict_proba`, given all points of `regular`. Nothing a person does changes the answer of
    another. With a classifier that carries a state (`begin` and `advance`: the LSTM) a sample costs the same
    however long the track is; others are asked about the whole track again at each point.

    Before `least` points, that is in the first (least - 1) / rate seconds, nothing is known: the answer has
    no probabilities. A robot that has to act then has the reasoner's prior, which knows more than the share
    of a class in training data.

    What is done with samples that are not as they should be, all of it counted in `report`:

    - not finite: refused, with the first told by name; the person goes on with the next sample.
    - out of order: sorted, if not more than `patience` behind; answers come that much later. Older ones are
      dropped. A second sample of the same time is dropped.
    - missing: gaps of up to `longest_gap` are crossed in a straight line. After a longer one a new track
      begins, as it does when a person jumps faster than `fastest` (an id given to another person, or units
      that are not metres), and when the clock goes back by more than `longest_gap`.
    - without end: a track that has lasted `longest` ends, and a new one begins.
    - ids that vanish: forgotten `forget` seconds after their last sample, by the stamps of the others (a few
      wrong ones do not matter, see `Clock`). An id that comes again is somebody new. What is kept is bounded
      by the number of people seen in that time.

    Args:
        pipeline: fitted, its first step a `Motion`; its `inputs` are the values of a sample.
        patience: seconds to wait for samples that are out of order; 0 where a tracker keeps the order.
        longest_gap: seconds without a sample that end a track.
        longest: seconds that a track may last.
        fastest: metres per second that nobody moves at.
        forget: seconds of silence after which an id is dropped.
        least: points of a track before there is an answer.
        window: ask about no more than so many points, the last ones, as if the track had begun with them: for
            classifiers of tracks of one length, which have it as their `least` as well. None asks about all.

    Raises:
        DataError: the pipeline does not begin with a `Motion`, or an option is out of range.
        NotFittedError: the pipeline is not fitted.
    """

    def __init__(
        self,
        pipeline: Any,
        *,
        patience: float = 0.0,
        longest_gap: float = 1.0,
        longest: float = 60.0,
        fastest: float = 12.0,
        forget: float = 5.0,
        least: int = 2,
        window: int | None = None,
    ) -> None:
        if least < 2:
            raise DataError(f"one point shows no motion: least must be 2 or more, not {least}")
        if window is not None and window < least:
            raise DataError(f"window must be least, {least}, or more points, not {window}")
        self._motion, self._memory = memory_of(pipeline, least, window)
        self._rules = Rules(self._motion.rate, patience, longest_gap, longest, fastest, forget)
        self._least, self._inputs = least, tuple(self._motion.inputs)
        self._people: dict[Hashable, _Person] = {}  # those silent for longest come first
        self._free: list[int] = []
        self._places = 0
        self._clock = Clock(longest_gap)
        self._forgotten, self._leavers = Repairs(), 0
        self._trained = TrainedClassifier(pipeline)
        self._early: Early | None = None
        self.classes = self._trained.classes

    @classmethod
    def of(cls, trained: TrainedClassifier, *, early: Early | None = None, **options: Any) -> Self:
        """Streams of a trained classifier, with its cut and calibration.

        Args:
            early: how far to trust it before the end of a track, from `calibrate_over_time`.
            options: as of the class.
        """
        streams = cls(trained.estimator, **options)
        streams._trained, streams._early = trained, early
        return streams

    def classifier(self, person: Hashable) -> TrainedClassifier:
        """What is known of a person now, as the classifier that the decision loop wants.

        It says the same of any instance. Its `soft()` gives the likelihoods, with the calibration for as many
        points if `of` was given `early`. Without, calibration, cut and confusion are those of whole tracks:
        then validate on `prefix` what is to be asked early.

        Raises:
            DataError: there is no answer for the person yet.
        """
        answer = self.answers.get(person)
        if answer is None or answer.probabilities is None:
            seen = "was not seen" if answer is None else f"was seen for {answer.points} points, too few"
            raise DataError(f"there is no answer for {person!r}, who {seen}")
        calibration = self._early.at(answer.points) if self._early else self._trained.calibration
        said = Said(self.classes, answer.probabilities)
        return replace(self._trained, estimator=said, calibration=calibration)

    @property
    def inputs(self) -> tuple[str, ...]:
        """What the values of a sample are, in their order."""
        return self._inputs

    @property
    def carried(self) -> bool:
        """Whether a sample costs the same however long the track is."""
        return self._memory.carried

    @property
    def answers(self) -> Mapping[Hashable, Answer]:
        """The answers of everybody who is followed, as they are now."""
        return MappingProxyType({name: person.answer for name, person in self._people.items()})

    def push(self, time: float, person: Hashable, *values: float) -> Answer:
        """Take one sample and say what is known of the person now.

        Args:
            time: seconds, on a clock that all people share.
            person: the tracker's id.
            values: as the pipeline's `inputs`: x and y in metres, ...

        Raises:
            DataError: a sample of another form; numbers that are not finite are counted, not raised.
        """
        return self.push_many([(time, person, *values)])[person]

    def push_many(self, samples: Iterable[Sequence[Any]]) -> dict[Hashable, Answer]:
        """Take samples (time, person, x, y, ...) and say what is known now of everybody in them.

        Samples that come together are worked on together: this is faster than `push` for each.

        Raises:
            DataError: a sample of another form; then none of them was taken. Or the classifier fails; then
                the people in these samples are forgotten.
        """
        checked = [self._checked(sample) for sample in samples]
        heard = {name: self._take(time, name, sample) for time, name, sample in checked}
        self._advance(heard)
        self._forget()
        return {name: person.answer for name, person in heard.items()}

    def leave(self, person: Hashable) -> Answer:
        """Stop following somebody: the last answer, with the samples that waited for older ones.

        Raises:
            DataError: nobody of that id is followed.
        """
        if person not in self._people:
            raise DataError(f"nobody of id {person!r} is followed")
        leaver = self._people[person]
        leaver.track.finish()
        self._advance({person: leaver})
        self._drop(person)
        return leaver.answer

    def report(self) -> Report:
        """What was refused, dropped and bridged so far, person by person."""
        people = {name: person.track.repairs.copy() for name, person in self._people.items()}
        return Report(MappingProxyType(people), self._forgotten.copy(), self._leavers)

    def _checked(self, sample: Sequence[Any]) -> tuple[float, Hashable, Sample]:
        try:
            time, name, *values = sample
            hash(name)
            numbers = tuple(map(float, values))
            if len(numbers) == len(self._inputs):
                return float(time), name, numbers
        except (TypeError, ValueError, OverflowError):
            pass
        raise DataError(f"sample {sample!r}; expected time, person, {', '.join(self._inputs)}")

    def _take(self, time: float, name: Hashable, sample: Sample) -> _Person:
        """Give a sample to the track of its person."""
        if isfinite(time):
            self._clock.tell(time)
        person = self._people.pop(name, None) or self._welcome(name)
        self._people[name] = person
        person.heard = self._clock.passed
        person.track.arrive(time, sample)
        return person

    def _welcome(self, name: Hashable) -> _Person:
        if not self._free:
            there, self._places = self._places, max(16, 2 * self._places)
            self._memory.grow(self._places)
            self._free = list(range(self._places - 1, there - 1, -1))
        return _Person(Track(self._rules, self._inputs, self._motion.angles), self._free.pop(), name)

    def _advance(self, people: Mapping[Hashable, _Person]) -> None:
        """Bring the answers of some people to the points that became known; those of one turn together."""
        due = []
        for person in people.values():
            points, anew = person.track.drain()
            if anew:
                self._memory.begin(np.array([person.slot]))
            if points:
                due.append((person, points))
        try:
            self._ask(due)
        except BaseException:
            for name in people:  # what is known of them no longer belongs to their tracks
                self._drop(name)
            raise
        for name, person in people.items():
            track = person.track
            if (track.number, track.count) != (person.answer.track, person.answer.points):
                known = freeze(person.probabilities) if track.count >= self._least else None
                person.answer = Answer(name, track.number, track.count, track.time, known)

    def _ask(self, due: Sequence[tuple[_Person, Sequence[Sample]]]) -> None:
        """Ask the classifier about new points of people, in turn."""
        for turn in range(max((len(points) for _, points in due), default=0)):
            those = [(person, points[turn]) for person, points in due if len(points) > turn]
            slots = np.array([person.slot for person, _ in those])
            now = np.array([point for _, point in those])
            probabilities = self._memory.advance(slots, now)
            for (person, _), row in zip(those, probabilities, strict=True):
                person.probabilities = row

    def _forget(self) -> None:
        """Drop who was silent for too long; they come first."""
        while self._people:
            name, person = next(iter(self._people.items()))
            if self._clock.passed - person.heard <= self._rules.forget:
                return
            self._drop(name)

    def _drop(self, name: Hashable) -> None:
        person = self._people.pop(name)
        self._memory.begin(np.array([person.slot]))
        self._free.append(person.slot)
        self._forgotten.add(person.track.repairs)
        self._leavers += 1
