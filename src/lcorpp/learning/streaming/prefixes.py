"""Prefixes of recorded tracks, and predictions after each of their samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.learning.contract import ensure_predict_proba, fit_clone
from lcorpp.learning.data.dataset import check_tracks
from lcorpp.learning.evaluation.folds import assign_training_folds, choose_folds, find_training_cases
from lcorpp.learning.streaming.prefix_ensemble import FRACTIONS
from lcorpp.learning.streaming.streaming_classifier import StreamingClassifier
from lcorpp.learning.streaming.timeline import PredictionTimeline
from lcorpp.values import Dataset, stack_signals

MIN_GAP_LIMIT = 1.0
"""Seconds; the smallest `max_gap` for recorded tracks, and the default of `StreamingClassifier`."""


@check_arguments
def truncate(dataset: Dataset, fraction: float) -> Dataset:
    """Return the first `fraction` of every track, for training or validation on prefixes.

    Raises:
        DataError: `fraction` is not in (0, 1], or leaves less than two time points of a track.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import truncate
        >>> data = Dataset([np.outer([1.2, 0.0], np.arange(8.0))], ["walks"], interval=1.0)
        >>> truncate(data, 0.5).trajectories.round(1).tolist()
        [[[0.0, 1.2, 2.4, 3.6], [0.0, 0.0, 0.0, 0.0]]]
    """
    if not 0 < fraction <= 1:
        raise DataError(f"the fraction of a track must lie in (0, 1], not {fraction}")
    kept = np.rint(fraction * dataset.lengths).astype(np.int64)
    if kept.min(initial=2) < 2:
        points = dataset.lengths[kept.argmin()]
        raise DataError(f"{kept.min()} of {points} time points show no motion; at least 2 are needed")
    times = np.arange(kept.max(initial=2))
    part = dataset.trajectories[:, :, : len(times)]
    return replace(dataset, trajectories=np.where(times < kept[:, None, None], part, np.nan))


@check_arguments
def with_prefixes(dataset: Dataset, fractions: Sequence[float] = FRACTIONS) -> Dataset:
    """Return several prefixes of every track, e.g. to train one classifier for tracks of any length.

    A prefix is a shorter track of the same label, group, weight and evidence. Cross-validation keeps groups
    whole, so it never predicts a prefix of a track that it was trained on.

    Args:
        fractions: of each track, as in `truncate`; 1 is the whole track.

    Returns:
        All tracks by the first fraction, in their order, then all by the second, and so on.

    Raises:
        DataError: there are no fractions; or as `truncate`.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import with_prefixes
        >>> data = Dataset([np.outer([1.2, 0.0], np.arange(8.0))], ["walks"], interval=1.0)
        >>> prefixes = with_prefixes(data, [0.25, 1.0])
        >>> prefixes.lengths.tolist(), prefixes.groups
        ([2, 8], ('0', '0'))
    """
    if not len(fractions):
        raise DataError("there are no fractions of the tracks; expected at least one in (0, 1]")
    n, parts = len(fractions), [truncate(dataset, fraction) for fraction in fractions]
    repeated = dataset.take(np.tile(np.arange(len(dataset)), n))
    return replace(
        repeated, trajectories=stack_signals([track for part in parts for track in part.trajectories])
    )


@check_arguments
def predict_over_time(
    pipeline: Any, dataset: Dataset, *, min_points: int = 2, window: int | None = None
) -> PredictionTimeline:
    """Return the predictions of a fitted pipeline after each sample of the tracks.

    Args:
        min_points, window: numbers of points, as for `StreamingClassifier`; a classifier that requires tracks
            of one length needs this length as both.

    Raises:
        DataError: as `StreamingClassifier`, or the tracks do not have the inputs of the pipeline.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import learner, predict_over_time, train
        >>> walks = [np.outer([speed, 0], np.arange(30) / 10) for speed in (0.2, 0.3, 0.4, 1.1, 1.2, 1.3)]
        >>> data = Dataset(walks, 3 * ["slow"] + 3 * ["fast"], interval=0.1)
        >>> timeline = predict_over_time(train(learner("summaries", interval=0.1), data).estimator, data)
        >>> timeline.probability_of("fast")[-1, ::7].round(1).tolist()  # of the fastest, every .7 s
        [nan, 0.6, 0.6, 0.6, 0.6]
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
    probabilities, points = np.full((cases, samples, len(streams.classes)), np.nan), [0] * samples
    for t in range(int(dataset.lengths.max())):
        running = np.flatnonzero(dataset.lengths > t).tolist()
        stamp, frame = t * dataset.interval, zip(running, tracks[running, :, t].tolist(), strict=True)
        predictions = streams.push_many([(stamp, case, *values) for case, values in frame])
        points[t:] = [predictions[running[0]].points] * (samples - t)
        for case in running:
            known = predictions[case].probabilities
            if known is not None:
                probabilities[case, t] = known
    return PredictionTimeline(
        probabilities,
        tuple(points),
        dataset.labels,
        streams.classes,
        dataset.interval,
        groups=dataset.groups,
        weights=dataset.weights,
    )


@check_arguments
def cross_predict_over_time(
    estimator: Any,
    dataset: Dataset,
    *,
    folds: int | None = None,
    seed: int = 0,
    min_points: int = 2,
    window: int | None = None,
) -> PredictionTimeline:
    """Run `predict_over_time` out of fold: each track's classifier is trained on other people's whole tracks.

    Args:
        estimator: a pipeline of `Motion` and a classifier; each fold uses a clone.
        dataset: its weights count in the training and in the timeline.
        folds: as of `cross_validate`.
        seed: seed of the split.
        min_points, window: as for `predict_over_time`.

    Raises:
        DataError: `dataset` is not trainable or cannot be split (see `check_trainable`), or as
            `predict_over_time`.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import cross_predict_over_time, learner
        >>> walks = [np.outer([speed, 0], np.arange(30) / 10) for speed in (0.2, 0.3, 0.4, 1.1, 1.2, 1.3)]
        >>> data = Dataset(walks, 3 * ["slow"] + 3 * ["fast"], interval=0.1)
        >>> timeline = cross_predict_over_time(learner("summaries", interval=0.1), data, folds=3)
        >>> timeline.auc_at(0.5)  # at half of each track
        1.0
    """
    estimator = ensure_predict_proba(estimator)
    folds = choose_folds(dataset) if folds is None else folds
    labels, fold_of = np.array(dataset.labels), assign_training_folds(dataset, folds, seed)
    parts = []
    for fold in range(folds):
        train = find_training_cases(fold_of == fold, dataset.groups)
        test = np.flatnonzero(fold_of == fold)
        pipeline = fit_clone(estimator, dataset.trajectories[train], labels[train], dataset.weights[train])
        part = predict_over_time(pipeline, dataset.take(test), min_points=min_points, window=window)
        parts.append(part)
        if part.classes != parts[0].classes:
            raise DataError(f"the folds learnt {parts[0].classes} and {part.classes}")
    probabilities = np.empty((len(dataset), *parts[0].probabilities.shape[1:]))
    for fold, part in enumerate(parts):
        probabilities[fold_of == fold] = part.probabilities
    points = tuple(map(max, *(part.points for part in parts)))  # a fold may lack the longest track
    return replace(
        parts[0],
        probabilities=probabilities,
        points=points,
        labels=dataset.labels,
        folds=tuple(fold_of.tolist()),
        groups=dataset.groups,
        weights=dataset.weights,
    )
