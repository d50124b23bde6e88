"""Prefixes of recorded tracks, and predictions after each of their samples."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from sklearn.base import clone

from lcorpp.errors import DataError
from lcorpp.learning.data.dataset import check_tracks, check_trainable
from lcorpp.learning.evaluation.validation import assign_folds
from lcorpp.learning.streaming.streaming_classifier import StreamingClassifier
from lcorpp.learning.streaming.timeline import PredictionTimeline
from lcorpp.values import Dataset

MIN_GAP_LIMIT = 1.0
"""Seconds; the smallest `max_gap` for recorded tracks, and the default of `StreamingClassifier`."""


def truncate(dataset: Dataset, fraction: float) -> Dataset:
    """Return the first `fraction` of every track, for training or validation on prefixes.

    Raises:
        DataError: `fraction` is not in (0, 1], or leaves less than two time points.
    """
    if not 0 < fraction <= 1:
        raise DataError(f"the fraction of a track must lie in (0, 1], not {fraction}")
    points = dataset.trajectories.shape[2]
    kept = round(fraction * points)
    if kept < 2:
        raise DataError(f"{kept} of {points} time points show no motion; at least 2 are needed")
    return replace(dataset, trajectories=dataset.trajectories[:, :, :kept])


def predict_over_time(
    pipeline: Any, dataset: Dataset, *, min_points: int = 2, window: int | None = None
) -> PredictionTimeline:
    """Return the predictions of a fitted pipeline after each sample of the tracks.

    Args:
        min_points, window: numbers of points, as for `StreamingClassifier`; a classifier that requires tracks
            of one length needs this length as both.

    Raises:
        DataError: as `StreamingClassifier`, or the tracks do not have the inputs of the pipeline.
    """
    gap = max(MIN_GAP_LIMIT, 2 * dataset.interval)
    limits = {"max_gap": gap, "max_duration": np.inf, "max_speed": np.inf, "max_silence": 2 * gap}
    streams = StreamingClassifier(pipeline, **limits, min_points=min_points, window=window)
    if streams.inputs != dataset.channels:
        raise DataError(
            f"the pipeline takes {', '.join(streams.inputs)}, the tracks are {', '.join(dataset.channels)}"
        )
    tracks = check_tracks(dataset.trajectories)
    cases, _, samples = tracks.shape
    probabilities, points = np.full((cases, samples, len(streams.classes)), np.nan), []
    for t, frame in enumerate(tracks.transpose(2, 0, 1).tolist()):
        stamp = t * dataset.interval
        predictions = streams.push_many([(stamp, case, *values) for case, values in enumerate(frame)])
        points.append(predictions[0].points)
        for case in range(cases):
            known = predictions[case].probabilities
            if known is not None:
                probabilities[case, t] = known
    return PredictionTimeline(probabilities, tuple(points), dataset.labels, streams.classes, dataset.interval)


def cross_predict_over_time(
    estimator: Any,
    dataset: Dataset,
    *,
    folds: int = 5,
    seed: int = 0,
    min_points: int = 2,
    window: int | None = None,
) -> PredictionTimeline:
    """Run `predict_over_time` out of fold: each track's classifier is trained on other people's whole tracks.

    Args:
        estimator: a pipeline of `Motion` and a classifier; each fold uses a clone.
        folds: number of folds, stratified and with whole groups.
        seed: seed of the split.
        min_points, window: as for `predict_over_time`.

    Raises:
        DataError: `dataset` is not trainable or cannot be split (see `check_trainable`), or as
            `predict_over_time`.
    """
    check_trainable(dataset, folds=folds)
    labels, fold_of = np.array(dataset.labels), assign_folds(dataset, folds, seed)
    parts = []
    for fold in range(folds):
        train, test = fold_of != fold, np.flatnonzero(fold_of == fold)
        pipeline = clone(estimator).fit(dataset.trajectories[train], labels[train])
        part = predict_over_time(pipeline, dataset.take(test), min_points=min_points, window=window)
        parts.append(part)
        if part.classes != parts[0].classes:
            raise DataError(f"the folds learnt {parts[0].classes} and {part.classes}")
    probabilities = np.empty((len(dataset), *parts[0].probabilities.shape[1:]))
    for fold, part in enumerate(parts):
        probabilities[fold_of == fold] = part.probabilities
    return replace(parts[0], probabilities=probabilities, labels=dataset.labels)
