"""Learning from judged trials: they join the data of Algorithm 1; after a batch the classifier is trained."""

from __future__ import annotations

import logging
from collections.abc import Callable, Container, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.assembly.robot_parts import ClassifierPart
from lcorpp.assembly.track_robot import find_track_senses
from lcorpp.domains import Domain, Sense
from lcorpp.errors import DataError, LcorppError
from lcorpp.learning import StreamingClassifier, TrainedClassifier, train_and_validate
from lcorpp.learning.features.resampling import resample
from lcorpp.learning.store import NewTrack, Store, TrackSchema
from lcorpp.learning.streaming.resampler import TrackResampler
from lcorpp.values import Array, ConfusionMatrix, Dataset
from lcorpp.web.robot import PlayRobot
from lcorpp.web.trial import JudgedTrial
from lcorpp.workers import start_worker

LOG = logging.getLogger(__name__)

Sample = tuple[float, ...]


def find_learning_sense(domain: Domain, trained: Container[str]) -> Sense | None:
    """Return the first sense of tracks whose class follows from a person's true value; None without.

    Args:
        trained: the senses with a trained classifier.
    """
    for sense in find_track_senses(domain):
        if sense.name in trained and sense.report_labels is not None:
            return sense
    return None


def open_store(path: Path, sense: Sense, data: Dataset) -> Store:
    """Open or create a store of walks of any length; raises as `Store`."""
    return Store(path, TrackSchema(data.channels, data.interval, sense.classes))


class BatchLearner:
    """Keeps judged trials, and trains the classifier of one sense again after a batch (Algorithm 1).

    robot: with the classifier of the last training.
    notify: takes what the page has to know: {"type": "learning"} and {"type": "learnt", ...}. It is called
        when a training begins, and at its end from another thread. It must not raise.

    Args:
        robot: with the classifier of the initial training.
        sense: that learns. data: its initial data.
        batch_size: K, number of trials between two trainings.
        store: see `open_store`; the trials are added to it, and earlier ones read from it. None keeps them in
            memory.
        make_executor: returns the executor that runs the training, by default in a process of its own. It is
            called again if that process has ended, e.g. because the system had no memory left.
    """

    def __init__(
        self,
        robot: PlayRobot,
        sense: Sense,
        data: Dataset,
        *,
        batch_size: int,
        store: Store | None = None,
        seed: int = 0,
        make_executor: Callable[[], Any] = start_worker,
    ) -> None:
        self.robot, self._sense, self._data = robot, sense, data
        self._batch_size, self._seed = batch_size, seed
        self.notify: Callable[[Mapping[str, Any]], None] = lambda _: None
        self._make_executor, self._executor = make_executor, make_executor()
        self._is_closed = False
        self._cases: list[tuple[Array, str]] = []
        self._groups: list[str] = []
        self._n_new, self._training = 0, False
        self._last: Sequence[Sample] = ()
        self._store = store
        if store is not None:
            snapshot = store.snapshot()
            kept = snapshot.dataset(snapshot.select())
            self._cases += zip(kept.trajectories, kept.labels, strict=True)
            self._groups += kept.groups

    @property
    def n_stored(self) -> int:
        """Number of kept trials with a track."""
        return len(self._cases)

    def keep(self, trial: JudgedTrial) -> dict[str, int]:
        """Keep a judged trial; after a batch the training begins. A trial without a track is left out."""
        name, domain = self._sense.name, self.robot.domain
        samples = find_last_track(self.robot.classifiers[name], trial.samples[name])
        if samples:
            times, *values = map(np.array, zip(*samples, strict=True))
            track = resample(times, np.array(values), 1 / self._data.interval)
            label = domain.class_of(name, trial.truth)
            if self._store is not None:
                self._store.append(NewTrack(track, label, "person", context=trial.facts))
            self._cases.append((track, label))
            self._groups.append(f"play-{len(self._cases)}")
            self._last, self._n_new = samples, self._n_new + 1
            if self._n_new >= self._batch_size and not self._training:
                self._train()
        return {"stored": self.n_stored, "batch": self._batch_size}

    def close(self) -> None:
        """Stop the training; `notify` is not called any more."""
        self._is_closed = True
        self.notify = lambda _: None
        self._executor.shutdown(kill_workers=True)

    def _train(self) -> None:
        self._training, self._n_new = True, 0
        self.notify({"type": "learning"})
        data = self._data.append(self._cases, self._groups)
        estimator = self.robot.classifiers[self._sense.name].estimator
        task = (train_again, estimator, data, self._seed)
        try:
            future = self._executor.submit(*task)
        except BrokenExecutor:  # the process ended after its last training
            self._executor = self._make_executor()
            future = self._executor.submit(*task)
        future.add_done_callback(self._finish)

    def _finish(self, future: Future[TrainedClassifier]) -> None:
        """Use the new classifier, whose rates replace the former ones in the program."""
        self._training = False
        if self._is_closed or future.cancelled():
            return
        error = future.exception()
        if isinstance(error, BrokenExecutor):
            self._executor, self._n_new = self._make_executor(), self._batch_size
            reason = (
                "the process of the training ended, perhaps for lack of memory;"
                " the next judged trial starts another one"
            )
        elif error is not None:
            reason = str(error) if isinstance(error, LcorppError) else f"{type(error).__name__}: {error}"
        if error is not None:
            LOG.warning("the classifier stays as it is: %s", reason)
            self.notify({"type": "learnt", "error": reason})
            return
        name, before, trained = self._sense.name, self.robot, future.result()
        former = before.classifiers[name]
        part = ClassifierPart.of("trained on the page", trained, confusion=trained.confusion)
        parts = replace(before.parts, classifiers={**before.parts.classifiers, name: part})
        self.robot = PlayRobot(parts, {**before.classifiers, name: trained}, before.strategy)
        self.notify(
            {
                "type": "learnt",
                "sense": name,
                "classes": list(trained.classes),
                "before": _list_counts(former.confusion),
                "after": _list_counts(trained.confusion),
                "accuracy": [_compute_accuracy(former.confusion), _compute_accuracy(trained.confusion)],
                "track": compare_on_track(former, trained, self._last),
            }
        )


def train_again(estimator: Any, data: Dataset, seed: int) -> TrainedClassifier:
    """Train a clone of the estimator, and cross-validate it."""
    return train_and_validate(estimator, data, seed=seed)[0]


def find_last_track(trained: TrainedClassifier, samples: Sequence[Sample]) -> list[Sample]:
    """Return the samples of the last unbroken track, if it is long enough to be classified."""
    streams, track, last = StreamingClassifier.from_trained(trained), list[Sample](), 0
    resampler = TrackResampler(streams.rules, streams.inputs, ())  # only its tracks are used, no points
    for sample in samples:
        resampler.add(sample[0], sample[1:])
        if resampler.track_count != last:
            track, last = [], resampler.track_count
        if not track or sample[0] > track[-1][0]:
            track.append(sample)
    return track if resampler.point_count >= streams.min_points else []


def compare_on_track(
    before: TrainedClassifier, after: TrainedClassifier, samples: Sequence[Sample]
) -> dict[str, Any] | None:
    """Return the probabilities (points, K) of two classifiers at the points of a track, with the times."""
    if not samples:
        return None
    rows: dict[str, list[Any]] = {"times": [], "before": [], "after": []}
    streams = [StreamingClassifier.from_trained(trained) for trained in (before, after)]
    times, *values = zip(*samples, strict=True)
    rate = streams[0].rules.rate  # the classifiers have the same features
    for i, point in enumerate(resample(times, values, rate).T.tolist()):
        old, new = (stream.push(times[0] + i / rate, 0, *point) for stream in streams)
        if old.probabilities is not None and new.probabilities is not None:
            rows["times"].append(old.time)
            rows["before"].append(old.probabilities.tolist())
            rows["after"].append(new.probabilities.tolist())
    return rows


def _list_counts(confusion: ConfusionMatrix | None) -> list[list[float]]:
    if confusion is None:
        raise DataError("the classifier was not validated; expected a confusion matrix")
    return [list(map(float, row)) for row in confusion.counts]


def _compute_accuracy(confusion: ConfusionMatrix | None) -> float:
    counts = np.array(_list_counts(confusion))
    return float(np.trace(counts) / counts.sum())
