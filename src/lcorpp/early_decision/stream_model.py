"""The stream of predictions for a person as a Markov chain of bins, one chain for each class.

Successive predictions see almost the same motion, so they are strongly dependent: as independent observations
they would count the same evidence again and again. A chain P(b' | b, class) that is counted class by class
still does so, as the errors of its many numbers add up along a track. Here a prediction makes the one before
it redundant: given the newer bin, the older one does not depend on the class, P(b | b', class) = P(b | b').
By Bayes' rule

    P(b' | b, class) = P(b | b') P(b' | class) / sum over b' of the same,

where P(b | b') is counted from all tracks together, and P(b' | class) is the calibration of the new stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning import PredictionTimeline
from lcorpp.learning.streaming.trigger import list_ages
from lcorpp.values import Array, Flags, Indices, freeze

CELLS = 24
"""Number of cells of equal numbers of cases, of which the bins are composed."""

PSEUDO_COUNT = 0.5
"""Of each class in each cell, so that a cell of one class has finite information."""


def choose_edges(scores: Array, is_class: Flags, bins: int) -> Array:
    """Return the edges (B - 1,) of the bins with the largest mutual information with the class.

    With equally frequent classes. Dynamic programming over the cells finds the optimum among all bins that
    are unions of neighbouring cells.

    Args:
        scores: (cases,). is_class: (2, cases) whether a case is of each class.
        bins: B.

    Returns:
        Edges that rise; a score that equals an edge is above it. Scores of fewer different values than bins
        repeat the last edge, so that the last bins but one are empty.

    Source: Fisher, "On grouping for maximum homogeneity", JASA 53, 1958; the information is Jensen and
    Shannon's divergence of the two classes.
    """
    cuts = np.unique(np.quantile(scores, np.linspace(0, 1, CELLS + 1)[1:-1]))
    n = len(cuts) + 1
    cell = np.searchsorted(cuts, scores, side="right")
    counts = np.array([np.bincount(cell[own], minlength=n) for own in is_class]) + PSEUDO_COUNT
    sums = np.concatenate([np.zeros((2, 1)), counts.cumsum(axis=1)], axis=1) / counts.sum(axis=1)[:, None]
    share = sums[:, None, :] - sums[:, :, None]  # (2, n + 1, n + 1) of the cells from i to before j
    mean = share.mean(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = 0.5 * (share * np.log(share / mean)).sum(axis=0)
    gain[~(mean > 0)] = -np.inf  # an empty bin
    best = np.full(n + 1, -np.inf)
    best[0] = 0.0
    origins = []
    for _ in range(min(bins, n)):
        total = best[:, None] + gain
        origins.append(total.argmax(axis=0))
        best = total.max(axis=0)
    chosen, end = list[int](), n
    for origin in reversed(origins):
        end = int(origin[end])
        chosen.append(end)
    edges = cuts[np.array(chosen[-2::-1], np.intp) - 1] if len(chosen) > 1 else cuts[:0]
    missing = bins - 1 - len(edges)
    filler = edges[-1] if len(edges) else float(np.max(scores))
    return np.concatenate([edges, np.full(missing, filler)])


SMOOTHING = 0.5
"""Pseudo-count of each bin given a class, and of the end of a track (Jeffreys' prior of two outcomes)."""

STAGES, BINS = 6, 4
"""Default number of stages and of bins; others change the return little (benchmarks/robot/watch.py)."""

ENDED = -1
"""The bin of a track that has ended before the stage."""

ARRAYS = ("edges", "first", "steps", "ends")


@dataclass(frozen=True, eq=False)
class StreamModel:
    """What a classifier of two classes predicts for a person at K ages of the track, the stages, in B bins.

    classes: (2,) the class names.
    points: (K,) number of points at the fixed rate at each stage, rising. seconds: (K,) age of the track.
    edges: (K, B - 1) rising; the bin is the number of edges that the uncalibrated probability of the first
        class reaches.
    first: (2, B) P(bin at the first stage | class).
    steps: (K - 1, 2, B, B) P(bin at the next stage | class, bin).
    ends: (K, 2) P(the track ends before the stage | class), if it has lasted until the stage before.

    Raises:
        DataError: shapes do not match, or a row is not a distribution.
    """

    classes: tuple[str, ...]
    points: tuple[int, ...]
    seconds: tuple[float, ...]
    edges: Array
    first: Array
    steps: Array
    ends: Array

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ARRAYS:
            object.__setattr__(self, name, freeze(getattr(self, name)))
        k, b = len(self.points), self.first.shape[-1]
        shapes = {"edges": (k, b - 1), "first": (2, b), "steps": (k - 1, 2, b, b), "ends": (k, 2)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise DataError(f"{name} of a stream has shape {getattr(self, name).shape}; expected {shape}")
        if len(self.classes) != 2 or len(self.seconds) != k or k < 1:
            raise DataError("a stream has two classes, and as many ages as numbers of points, at least one")
        if np.diff([0, *self.points]).min() <= 0 or np.diff([0.0, *self.seconds]).min() <= 0:
            raise DataError(f"the stages of a stream must rise, not {self.points} points, {self.seconds} s")
        numbers = np.concatenate([getattr(self, name).ravel() for name in ARRAYS])
        if not np.isfinite(numbers).all() or (np.diff(self.edges, axis=1) < 0).any():
            raise DataError("a stream has finite numbers, and edges of bins that rise")
        rows = np.concatenate([self.first, self.steps.reshape(-1, b)])
        if (
            min(rows.min(), self.ends.min()) < 0
            or self.ends.max() > 1
            or abs(rows.sum(axis=1) - 1).max() > 1e-9
        ):
            raise DataError("the rows of a stream are distributions, and its ends are probabilities")

    def __repr__(self) -> str:
        ages = ", ".join(f"{age:.3g}" for age in self.seconds)
        return f"<StreamModel of {' and '.join(self.classes)}: {self.n_bins} bins at {ages} s>"

    @property
    def n_bins(self) -> int:
        """B, the number of bins."""
        return int(self.first.shape[1])

    @property
    def durations(self) -> Array:
        """(K,) seconds from the stage before, or from the start of the track, to each stage."""
        return np.diff(self.seconds, prepend=0.0)

    @check_arguments
    def find_bins(self, stage: int, probabilities: Array) -> Indices:
        """(n,) the bins of the uncalibrated probabilities (n,) of the first class at a stage."""
        return np.searchsorted(self.edges[stage], probabilities, side="right")

    @check_arguments
    def bin_tracks(self, timeline: PredictionTimeline) -> Indices:
        """(cases, K) the bin of each recorded track at each stage; `ENDED` where it does not last so long.

        Args:
            timeline: uncalibrated predictions for the tracks.

        Raises:
            DataError: the timeline is of other classes, or has no prediction at a stage.
        """
        if timeline.classes != self.classes:
            raise DataError(f"the stream is for {self.classes}, the timeline for {timeline.classes}")
        column_of = _map_columns(timeline)
        bins = np.full((len(timeline.labels), len(self.points)), ENDED, np.intp)
        for stage, points in enumerate(self.points):
            if points not in column_of:
                raise DataError(f"the timeline has no prediction after {points} points")
            probabilities = timeline.probabilities[:, column_of[points], 0]
            known = np.isfinite(probabilities)
            bins[known, stage] = self.find_bins(stage, probabilities[known])
        return bins


@check_arguments
def fit_stream_model(
    timeline: PredictionTimeline, *, stages: int | Sequence[float] = STAGES, bins: int = BINS
) -> StreamModel:
    """Estimate the stream of predictions from the out-of-fold predictions for recorded tracks.

    The bins of each stage are those with the most information about the class, see `choose_edges`.

    Args:
        timeline: the result of `cross_predict_over_time`; its predictions are not calibrated.
        stages: their number, or their ages in seconds, each rounded to an age with a prediction. By number
            they are spaced geometrically from the first prediction to the end of the longest track, as
            evidence comes fast at first.
        bins: of each stage.

    Raises:
        DataError: the timeline has no folds, no predictions or not two classes, or its cases are weighted;
            there are not enough ages for the stages, or not enough tracks for the bins.
    """
    timeline.require_folds()
    timeline.require_equal_weights("a stream model")
    if len(timeline.classes) != 2:
        raise DataError(f"a stream of bins needs two classes, not {len(timeline.classes)}")
    if bins < 2:
        raise DataError(f"{bins} bins show nothing; expected at least 2")
    column_of = _map_columns(timeline)
    points = _choose_stages(timeline, column_of, stages)
    columns = [column_of[number] for number in points]
    p = timeline.probabilities[:, columns, 0]
    labels = np.array(timeline.labels)
    is_class = np.array([labels == name for name in timeline.classes])  # (2, cases)
    lasts = np.isfinite(p)
    for stage, known in enumerate(lasts.T):
        if (is_class & known).sum(axis=1).min() < bins:
            age = timeline.seconds[columns[stage]]
            raise DataError(f"fewer tracks of a class last {age:.3g} s than there are bins, {bins}")
    edges = np.array([choose_edges(p[known, k], is_class[:, known], bins) for k, known in enumerate(lasts.T)])
    binned = np.array([np.searchsorted(row, p[:, k], side="right") for k, row in enumerate(edges)])
    counts = np.array(
        [
            [np.bincount(binned[k, own & lasts[:, k]], minlength=bins) for own in is_class]
            for k in range(len(p.T))
        ]
    )
    rates = _normalise(counts + SMOOTHING)  # (K, 2, B) P(bin | class)
    steps = np.empty((len(points) - 1, 2, bins, bins))
    for k in range(len(points) - 1):
        both = lasts[:, k + 1]
        moves = np.zeros((bins, bins))
        np.add.at(moves, (binned[k, both], binned[k + 1, both]), 1)
        backward = (moves + SMOOTHING / bins) / (moves + SMOOTHING / bins).sum(axis=0)  # P(b | b')
        steps[k] = _normalise(backward * rates[k + 1][:, None, :])
    before = np.column_stack([np.ones(len(p), dtype=bool), lasts[:, :-1]])
    started = np.array([(own[:, None] & before).sum(axis=0) for own in is_class]).T
    ended = np.array([(own[:, None] & before & ~lasts).sum(axis=0) for own in is_class]).T
    ends = (ended + SMOOTHING) / (started + 2 * SMOOTHING)
    seconds = tuple(timeline.seconds[columns].tolist())
    return StreamModel(timeline.classes, points, seconds, edges, rates[0], steps, ends)


def _map_columns(timeline: PredictionTimeline) -> dict[int, int]:
    """Return number of points -> the first time point with a prediction from so many, after the start."""
    return {timeline.points[column]: column for column in list_ages(timeline) if column}


def _choose_stages(
    timeline: PredictionTimeline, column_of: dict[int, int], stages: int | Sequence[float]
) -> tuple[int, ...]:
    """Return the number of points of each stage."""
    known = np.array(list(column_of), np.intp)
    if not len(known):
        raise DataError("the timeline has no predictions: the tracks are too short")
    ages = timeline.seconds[list(column_of.values())]
    if isinstance(stages, int):
        if not 1 <= stages <= len(known):
            raise DataError(f"{stages} stages; the tracks have predictions at {len(known)} ages")
        wanted = np.geomspace(ages[0], ages[-1], stages)
        chosen = [int(np.abs(ages - age).argmin()) for age in wanted]
        for k in range(1, stages):  # ages closer than two predictions: take the next one
            chosen[k] = max(chosen[k], chosen[k - 1] + 1)
        for k in range(stages - 1, -1, -1):
            chosen[k] = min(chosen[k], len(known) - stages + k)
    else:
        chosen = [int(np.abs(ages - age).argmin()) for age in stages]
        if not chosen or np.diff(chosen, prepend=-1).min() <= 0:
            raise DataError(
                f"the stages {list(stages)} are not different ages that rise;"
                f" {expected_one_of([f'{age:.3g}' for age in ages])}"
            )
    return tuple(known[chosen].tolist())


def _normalise(counts: Array) -> Array:
    """Return the rows of counts as distributions."""
    rows: Array = counts / counts.sum(axis=-1, keepdims=True)
    return rows
