"""People who are tracked: their samples go to the streaming classifiers in a thread of its own."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from time import monotonic, sleep
from types import MappingProxyType
from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import ConnectionLostError, DataError, LcorppError, WorldError
from lcorpp.learning import StreamingClassifier, TrainedClassifier
from lcorpp.learning.streaming.clock import Clock, StampCheck, describe_doubtful_stamps
from lcorpp.values import Array, Label, count_window
from lcorpp.worlds.ros.perception import Perception
from lcorpp.worlds.ros.sensor_messages import Sample

PERIOD = 0.2
"""Seconds after which the thread checks whether it should end."""
MAX_SAMPLES = 3000
"""Samples of a person that are kept: the latest."""
WATCH_PERIOD = 0.02
"""Seconds between two looks at a person who is watched."""
MAX_STALE = 1.0
"""Seconds without the inputs of a sense, e.g. a face, after which its last output does not count."""
CLOCK_STEP = 1.0
"""Seconds between two stamps of people that continue each other, at most."""


@dataclass
class Track:
    """A person's samples so far.

    A stamp more than `max_silence` from the last one begins the track anew once the next stamp is not near
    the last one either. Else it was wrong, and its sample is dropped.

    first, last: stamps of the first and the last sample in seconds. seen: when the last one came, on the
    clock of all stamps. received: the same on the clock of this computer. waiting: the sample of a doubtful
    stamp. stamps: the check of the stamps. sensed: sense -> stamp of the last sample that has its inputs.
    """

    first: float
    last: float
    seen: float = 0.0
    received: float = 0.0
    samples: list[Sample] = field(default_factory=list)
    waiting: Sample | None = None
    stamps: StampCheck = field(default_factory=StampCheck)
    sensed: dict[str, float] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """The duration."""
        return self.last - self.first

    def select(self, sample: Sample, max_silence: float) -> list[Sample]:
        """Return the samples to use now: this one, the one that waits, both or none."""
        waiting, self.waiting = self.waiting, None
        if abs(sample.time - self.last) <= max_silence:
            return [sample]
        if waiting is None:
            self.waiting = sample
            return []
        if abs(sample.time - waiting.time) <= max_silence:
            return [waiting, sample]
        self.waiting = sample
        return [waiting]

    def add(self, sample: Sample, max_silence: float) -> None:
        """Add a sample that is used; a stamp far from the last one begins the track anew."""
        if abs(sample.time - self.last) > max_silence:
            self.first = self.last = sample.time
            self.samples.clear()
        self.last = max(self.last, sample.time)
        self.samples.append(sample)
        del self.samples[:-MAX_SAMPLES]


def find_windows(domain: Domain) -> dict[str, float]:
    """Return sense -> seconds of its windows, for senses that are trained on windows."""
    return {sense.name: sense.seconds for sense in domain.senses if sense.step and sense.seconds}


def make_stream(
    trained: TrainedClassifier, seconds: float | None = None, **options: Any
) -> StreamingClassifier:
    """Return the streaming classifier of a robot.

    Args:
        seconds: of the windows that the classifier was trained on; None for whole tracks.
        options: of `StreamingClassifier`.

    Raises:
        DataError: the classifier is not one of tracks.
    """
    streams = StreamingClassifier.from_trained(trained, **options)
    if seconds is None:
        return streams
    points = count_window(seconds, 1 / streams.rules.rate)
    return StreamingClassifier.from_trained(trained, min_points=points, window=points, **options)


class PeopleTracks:
    """All people who are tracked now, and the classifiers' outputs for them.

    Everybody is classified all the time, whomever the robot attends to. A wrong time stamp of one person
    changes neither the tracks of others nor who is present. Methods may be called from any thread.

    Args:
        classifiers: sense -> its classifier of tracks; it gives labels.
        max_silence: seconds without a sample after which a person has left.
        windows: sense -> seconds of the windows that its classifier was trained on: it sees the last ones.
        is_live: whether people without samples leave by the clock of this computer, too.
    """

    def __init__(
        self,
        classifiers: Mapping[str, TrainedClassifier],
        *,
        max_silence: float = 3.0,
        windows: Mapping[str, float] = MappingProxyType({}),
        is_live: bool = True,
    ) -> None:
        self._streams = {
            name: make_stream(trained, windows.get(name), max_silence=max_silence)
            for name, trained in classifiers.items()
        }
        self._max_silence, self._is_live = max_silence, is_live
        self._tracks = dict[str, Track]()
        self._lock = threading.Lock()
        self._clock, self._has_warned = Clock(min(max_silence, CLOCK_STEP)), False

    def add(self, samples: Sequence[Sequence[Any]]) -> None:
        """Add samples of any people; those that are not finite are left out.

        A sense takes the samples that have all inputs of its classifier, e.g. a face; the others are gaps.

        Args:
            samples: each is a `Sample`, or time, person, x and y.

        Raises:
            DataError: a sample is malformed; then none of them is used. Or a classifier fails.
        """
        checked, now = [_check(sample) for sample in samples], monotonic()
        with self._lock:
            used = list[Sample]()
            for sample in checked:
                if all(map(isfinite, (sample.time, sample.x, sample.y))):
                    used += self._add(sample, now)
            for name, streams in self._streams.items():
                rows = [_read_inputs(sample, streams.inputs) for sample in used]
                for sample, row in zip(used, rows, strict=True):
                    if row:
                        self._tracks[sample.person].sensed[name] = sample.time
                streams.push_many(
                    [(s.time, s.person, *row) for s, row in zip(used, rows, strict=True) if row]
                )
            self._remove_absent(now)

    def _add(self, sample: Sample, now: float) -> list[Sample]:
        """Add a sample to the track of its person; return the samples that are used now."""
        time, person = sample.time, sample.person
        self._clock.observe(time)
        track = self._tracks.setdefault(person, Track(time, time))
        track.seen, track.received = self._clock.elapsed, now
        if not self._streams and track.stamps.observe(not track.samples or time > track.last):
            self._warn(describe_doubtful_stamps(person, time))  # the streams warn themselves
        used = track.select(sample, self._max_silence)
        for one in used:
            track.add(one, self._max_silence)
        return used

    def _warn(self, message: str) -> None:
        if not self._has_warned:
            self._has_warned = True
            warnings.warn(message, stacklevel=4)

    def list_people(self) -> dict[str, float]:
        """Return the people who are present, with the seconds of their tracks."""
        with self._lock:
            self._remove_absent(monotonic())
            return {person: track.seconds for person, track in self._tracks.items()}

    def _remove_absent(self, now: float) -> None:
        """Remove people without samples for too long, by the stamps of others or by this computer's clock."""
        limit = self._max_silence
        for person, track in list(self._tracks.items()):
            is_silent = self._is_live and now - track.received > limit
            if is_silent or self._clock.elapsed - track.seen > limit:
                del self._tracks[person]

    def signals(self, person: str) -> dict[str, Array]:
        """Return sense -> the signal (inputs of its classifier, samples) of a person so far."""
        with self._lock:
            track = self._tracks.get(person)
            if track is None:
                return {}
            found = {
                name: [row for sample in track.samples if (row := _read_inputs(sample, streams.inputs))]
                for name, streams in self._streams.items()
            }
        return {name: np.array(rows).T for name, rows in found.items() if rows}

    def classify(self, person: str, sense: str) -> Label | None:
        """Return the current output of a sense for a person.

        None with too few samples, or if the sense has perceived nothing of the person for `MAX_STALE`.
        """
        with self._lock:
            track = self._tracks.get(person)
            if track is None or track.last - track.sensed.get(sense, -inf) > MAX_STALE:
                return None
            try:
                classifier = self._streams[sense].classifier(person)
            except DataError:
                return None
        return classifier.classify(np.zeros(1))

    def classifiers(self, person: str) -> dict[str, PersonClassifier]:
        """Return sense -> the classifier of a person, for the decision loop."""
        return {sense: PersonClassifier(self, person, sense) for sense in self._streams}


class SensedPeople:
    """The people of several trackers, each with the classifiers of its senses.

    The trackers' ids are those of `PeoplePositions`: a person whom several of them detect has one name.

    Args:
        tracks: the people of each tracker.
    """

    def __init__(self, tracks: Sequence[PeopleTracks]) -> None:
        self._tracks = tuple(tracks)

    def list_people(self) -> dict[str, float]:
        """Return the people who are present, with the seconds of their longest tracks."""
        seconds = dict[str, float]()
        for tracks in self._tracks:
            for person, own in tracks.list_people().items():
                seconds[person] = max(own, seconds.get(person, 0.0))
        return seconds

    def signals(self, person: str) -> dict[str, Array]:
        """Return sense -> the signal (inputs, samples) of a person so far, if the sense perceives them."""
        return {sense: own for tracks in self._tracks for sense, own in tracks.signals(person).items()}

    @property
    def now(self) -> float:
        """The time of this computer's monotonic clock in seconds."""
        return monotonic()

    def wait(self) -> bool:
        """Wait for more samples for a moment; return whether there may be more: always."""
        sleep(WATCH_PERIOD)
        return True

    def classify(self, person: str, sense: str) -> Label | None:
        """Return the current output of a sense for a person; None as `PeopleTracks.classify`."""
        own = self.classifiers(person).get(sense)
        return None if own is None else own.classify(np.zeros(1))

    def classifiers(self, person: str) -> dict[str, PersonClassifier]:
        """Return sense -> the classifier of a person, for the decision loop."""
        return {sense: own for tracks in self._tracks for sense, own in tracks.classifiers(person).items()}


def _check(sample: Sequence[Any]) -> Sample:
    try:
        own = Sample(*sample)
        return own._replace(time=float(own.time), x=float(own.x), y=float(own.y))
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"sample {sample!r}; expected time, person, x, y") from None


def _read_inputs(sample: Sample, inputs: Sequence[str]) -> list[float]:
    """Return the values of a sample by their names; none if it lacks one of them."""
    values = {**sample.columns, "x": sample.x, "y": sample.y}
    return [values[name] for name in inputs] if values.keys() >= set(inputs) else []


@dataclass(frozen=True, eq=False)
class PersonClassifier:
    """The stream of one person as a classifier (`lcorpp.protocols.Classifier`): its signal is not read."""

    tracks: PeopleTracks
    person: str
    sense: str

    def classify(self, signal: Any) -> Label | None:
        """Return the current output for the person; None with too few samples."""
        return self.tracks.classify(self.person, self.sense)


class TrackingThread:
    """A thread that passes the samples of the perception on to the tracks.

    Args:
        perception: the source. tracks: where they go.
    """

    def __init__(self, perception: Perception, tracks: PeopleTracks) -> None:
        self._perception, self._tracks = perception, tracks
        self._ends = threading.Event()
        self._error: LcorppError | None = None
        self._thread = threading.Thread(target=self._run, name="tracking", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Raise the error that ended the thread, if there was one: a message of another type or frame."""
        if self._error is not None:
            raise self._error

    def end(self) -> None:
        """End the thread."""
        self._ends.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        while not self._ends.is_set():
            try:
                samples = self._perception.update(PERIOD)
                if samples:
                    self._tracks.add(samples)
            except ConnectionLostError:
                self._ends.wait(PERIOD)  # the connection is made again; the loop of decisions notices, too
            except LcorppError as error:
                self._error = error
                return
            except Exception as error:  # e.g. of an own classifier; the loop of decisions reports it
                self._error = WorldError(f"tracking people: {type(error).__name__}: {error}")
                return
