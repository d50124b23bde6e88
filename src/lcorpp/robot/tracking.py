"""People who are tracked: their samples go to the streaming classifiers in a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from time import monotonic
from typing import Any

import numpy as np

from lcorpp.errors import ConnectionLostError, DataError, LcorppError, WorldError
from lcorpp.learning import StreamingClassifier, TrainedClassifier
from lcorpp.values import Array, Label
from lcorpp.worlds.ros.perception import Perception, Sample

PERIOD = 0.2
"""Seconds after which the thread checks whether it should end."""
MAX_SAMPLES = 3000
"""Samples of a person that are kept: the latest."""


@dataclass
class Track:
    """A person's samples so far.

    first, last: time of the first and the last one in seconds. received: when the last one came, on the
    clock of this computer.
    """

    first: float
    last: float
    received: float
    samples: list[tuple[float, float, float]] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """The duration."""
        return self.last - self.first


class PeopleTracks:
    """All people who are tracked now, and the classifiers' outputs for them.

    Everybody is classified all the time, whomever the robot attends to. Methods may be called from any
    thread.

    Args:
        classifiers: sense -> its classifier of tracks; it gives labels.
        max_silence: seconds without a sample after which a person has left.
    """

    def __init__(
        self,
        classifiers: Mapping[str, TrainedClassifier],
        *,
        max_silence: float = 3.0,
    ) -> None:
        self._streams = {
            name: StreamingClassifier.from_trained(trained, max_silence=max_silence)
            for name, trained in classifiers.items()
        }
        self._max_silence = max_silence
        self._tracks = dict[str, Track]()
        self._lock = threading.Lock()
        self._clock = -np.inf

    def add(self, samples: list[Sample]) -> None:
        """Add samples of any people.

        Raises:
            DataError: as `StreamingClassifier.push_many`.
        """
        now = monotonic()
        with self._lock:
            for streams in self._streams.values():
                streams.push_many(samples)
            for time, person, x, y in samples:
                # a clock that goes back, e.g. of a simulator that was reset, starts anew
                self._clock = time if time < self._clock - self._max_silence else max(self._clock, time)
                track = self._tracks.get(person)
                if track is None or abs(time - track.last) > self._max_silence:
                    track = self._tracks[person] = Track(time, time, now)
                track.last, track.received = max(track.last, time), now
                track.samples.append((time, x, y))
                del track.samples[:-MAX_SAMPLES]
            self._remove_absent(now)

    def list_people(self) -> dict[str, float]:
        """Return the people who are present, with the seconds of their tracks."""
        with self._lock:
            self._remove_absent(monotonic())
            return {person: track.seconds for person, track in self._tracks.items()}

    def _remove_absent(self, now: float) -> None:
        """Remove people without samples for too long, by the stamps of others or by this computer's clock."""
        limit = self._max_silence
        for person, track in list(self._tracks.items()):
            if self._clock - track.last > limit or now - track.received > limit:
                del self._tracks[person]

    def signals(self, person: str) -> dict[str, Array]:
        """Return sense -> the positions (2, samples) of a person so far."""
        with self._lock:
            track = self._tracks.get(person)
            if track is None:
                return {}
            positions = np.array(track.samples)[:, 1:].T
        return dict.fromkeys(self._streams, positions)

    def classify(self, person: str, sense: str) -> Label | None:
        """Return the current output of a sense for a person; None with too few samples."""
        with self._lock:
            try:
                classifier = self._streams[sense].classifier(person)
            except DataError:
                return None
        return classifier.classify(np.zeros(1))

    def classifiers(self, person: str) -> dict[str, PersonClassifier]:
        """Return sense -> the classifier of a person, for the decision loop."""
        return {sense: PersonClassifier(self, person, sense) for sense in self._streams}


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
