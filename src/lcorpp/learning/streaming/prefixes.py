"""The beginnings of recorded tracks, and what a classifier said of them while they lasted."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.base import clone
from sklearn.model_selection import StratifiedGroupKFold

from lcorpp.errors import DataError
from lcorpp.learning.data.dataset import check_tracks, check_trainable
from lcorpp.learning.streaming.prefix_predictions import OverTime
from lcorpp.learning.streaming.streams import Streams
from lcorpp.values import Dataset


def prefix(dataset: Dataset, share: float) -> Dataset:
    """The beginnings of all tracks: their first `share` of time, for training or validation on them.

    Raises:
        DataError: `share` is not in (0, 1], or leaves less than two time points.
    """
    if not 0 < share <= 1:
        raise DataError(f"the share of a track must lie in (0, 1], not {share}")
    points = dataset.trajectories.shape[2]
    kept = round(share * points)
    if kept < 2:
        raise DataError(f"{kept} of {points} time points show no motion; at least 2 are needed")
    return replace(dataset, trajectories=dataset.trajectories[:, :, :kept])


def follow(pipeline: Any, dataset: Dataset, *, least: int = 2, window: int | None = None) -> OverTime:
    """Everything a fitted pipeline says of the tracks while they last, all people at once.

    Args:
        least, window: as of `Streams`, for a classifier that does not take tracks of any length.

    Raises:
        DataError: as of `Streams`, or the tracks are not of the pipeline's kind.
    """
    gap = max(1.0, 2 * dataset.interval)
    never = {"longest": np.inf, "fastest": np.inf}
    streams = Streams(pipeline, longest_gap=gap, forget=2 * gap, least=least, window=window, **never)
    if streams.inputs != dataset.channels:
        raise DataError(
            f"the pipeline takes {', '.join(streams.inputs)}, the tracks are {', '.join(dataset.channels)}"
        )
    tracks = check_tracks(dataset.trajectories)
    cases, _, times = tracks.shape
    said, points = np.full((cases, times, len(streams.classes)), np.nan), []
    for time, row in enumerate(tracks.transpose(2, 0, 1).tolist()):
        stamp = time * dataset.interval
        answers = streams.push_many([(stamp, case, *values) for case, values in enumerate(row)])
        points.append(answers[0].points)
        for case in range(cases):
            known = answers[case].probabilities
            if known is not None:
                said[case, time] = known
    return OverTime(said, tuple(points), dataset.labels, streams.classes, dataset.interval)


def out_of_fold_over_time(
    estimator: Any,
    dataset: Dataset,
    *,
    folds: int = 5,
    seed: int = 0,
    least: int = 2,
    window: int | None = None,
) -> OverTime:
    """`follow`, each track by a classifier that was trained on whole tracks of other people.

    Args:
        estimator: a pipeline of `Motion` and a classifier; it is cloned for every fold.
        folds: parts the groups are divided into, classes in proportion.
        seed: of the division.
        least, window: as of `Streams`.

    Raises:
        DataError: `dataset` cannot be learnt from or divided so (see `check_trainable`), or as `follow`.
    """
    check_trainable(dataset, folds=folds)
    labels, groups = np.array(dataset.labels), np.array(dataset.groups)
    parts: list[tuple[npt.NDArray[np.intp], OverTime]] = []
    splitter = StratifiedGroupKFold(folds, shuffle=True, random_state=seed)
    for train, test in splitter.split(labels, labels, groups):
        fitted = clone(estimator).fit(dataset.trajectories[train], labels[train])
        parts.append((test, follow(fitted, dataset.take(test), least=least, window=window)))
        if parts[-1][1].classes != parts[0][1].classes:
            raise DataError(f"the folds learnt {parts[0][1].classes} and {parts[-1][1].classes}")
    first = parts[0][1]
    said = np.empty((len(dataset), *first.probabilities.shape[1:]))
    for test, part in parts:
        said[test] = part.probabilities
    return replace(first, probabilities=said, labels=dataset.labels)
