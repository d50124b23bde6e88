"""Label leakage: can a data set's labels be predicted from shortcut features instead of motion?

A shortcut feature is something other than motion, e.g. the last position. A simple model is trained on it and
cross-validated. If the model separates the classes, a classifier may do the same, and its score proves little
about motion.

The model is kernel ridge regression on the ranks of the features, with Gaussian kernels of several widths. It
fits any shape, is robust to outliers, works with few cases and takes milliseconds. On the authors' 123 tracks
its AUC is .99 by end position and .86 by sampling; nearest neighbours reach .97 and .79; forests, ten times
slower, .99 and .86. The AUC is the mean over several splits, because that of one split of a hundred cases may
be off by .02.

The traces of sampling are those that resampling leaves in exact numbers: points on a straight line between
two others, positions that repeat to the last digit, values on a grid. Smooth and rough motion have the same
traces, so a difference in motion is not mistaken for one in recording.

Source: Rifkin and Klautau, "In defense of one-vs-all classification", JMLR 5, 2004, section 2.3 (regularised
least squares); Williams and Seeger, NIPS 2000 (the landmarks).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg
from scipy.spatial.distance import cdist
from scipy.stats import rankdata
from sklearn.model_selection import StratifiedGroupKFold, StratifiedKFold
from threadpoolctl import threadpool_limits

from lcorpp.errors import DataError
from lcorpp.learning.data.npz import to_recording
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.values import Array, Dataset, Interval

MIN_SUSPICIOUS_AUC = 0.7
"""From this AUC on, a score on the data may describe the recording instead of the motion."""

DIVISIONS, FOLDS = 5, 5
WIDTHS, RIDGE, LANDMARKS = (0.3, 1.0), 0.5, 300
"""Widths of the kernels in units of the median distance, ridge penalty, and maximal number of landmark
cases."""

RESAMPLES, CONFIDENCE = 300, 0.95

EXACT = 1e-9
"""Tolerance relative to the largest position: rounding error of sums of numbers with 15 digits."""

MILLIMETRE = 1e-3

SHORTCUT_FEATURES: Mapping[str, tuple[str, ...]] = {
    "end position": ("x", "y"),
    "duration": ("duration", "samples"),
    "sampling": (
        "mean interval",
        "median interval",
        "deviation of the interval",
        "longest interval",
        "share on a straight line",
        "longest straight line",
        "share that repeat",
        "share in whole millimetres",
    ),
}
"""The shortcuts that are checked, each with its features."""

Words = npt.NDArray[np.str_]
Indices = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Leak:
    """How well one shortcut predicts the labels.

    name: one of `SHORTCUT_FEATURES`.
    auc: area under the ROC curve, mean over divisions, with a 95 % interval from resampled groups; .5 is
        chance, 1 a perfect leak; for more than two classes, the mean of each against the others.
    """

    name: str
    auc: Interval

    def __repr__(self) -> str:
        return f"<Leak by {self.name}: AUC {self.auc}{', suspicious' if self.flagged else ''}>"

    @property
    def flagged(self) -> bool:
        """Whether the AUC is at least `MIN_SUSPICIOUS_AUC` and significantly above chance."""
        return self.auc.estimate >= MIN_SUSPICIOUS_AUC and self.auc.low > 0.5


def check_leakage(
    data: Dataset | Recording, *, divisions: int = DIVISIONS, seed: int = 0
) -> tuple[Leak, ...]:
    """Measure how well end position, duration and sampling alone predict the labels of `data`.

    All tracks of a `Dataset` have the same duration and interval; only traces of an earlier resampling are
    left. A `Recording` still has the original sampling.

    Args:
        divisions: number of random splits; the AUC is their mean.
        seed: seed of the splits, the landmarks and the interval.

    Returns:
        One leak for every entry of `SHORTCUT_FEATURES`.

    Raises:
        DataError: there are not two classes, each in two groups or more; a track has no label or position; or
            `divisions` is below 1.
    """
    if divisions < 1:
        raise DataError(f"a leak check needs at least 1 division, not {divisions}")
    missing = _missing_for_check(data)
    if missing is not None:
        raise DataError(f"a leak check needs {missing}")
    recording = to_recording(data) if isinstance(data, Dataset) else data
    labels = np.array([str(label) for label in recording.labels])
    groups = np.array([track.group for track in recording.tracks])
    features = [shortcut_features(track) for track in recording.tracks]
    folds = np.stack([_assign_folds(labels, groups, seed + division) for division in range(divisions)])
    with threadpool_limits(1):  # small matrices: threads on busy cores would only wait for each other
        return tuple(
            _measure_leak(name, np.stack([each[name] for each in features]), labels, groups, folds, seed)
            for name in SHORTCUT_FEATURES
        )


def leakage_note(data: Dataset | Recording) -> str | None:
    """A warning to print with any score on `data`; None if no leak is found.

    It uses `check_leakage` with two divisions, which is faster and accurate enough for a warning. Data that
    cannot
    be checked give None: they are not trainable either, and `check_trainable` has the better message.
    """
    if _missing_for_check(data) is not None:
        return None
    flagged = [leak for leak in check_leakage(data, divisions=2) if leak.flagged]
    if not flagged:
        return None
    shortcuts = " and ".join(f"{leak.name} alone (AUC {leak.auc.estimate:.2f})" for leak in flagged)
    return (
        f"The label can be predicted from {shortcuts}: a classifier that sees positions or every sample may"
        " learn places and recordings, not intentions; give it motion relative to the first point, at a low"
        " rate."
    )


def shortcut_features(track: Track) -> dict[str, Array]:
    """The features of one track for each name of `SHORTCUT_FEATURES`."""
    positions, step = track.positions, np.diff(track.times)
    tolerance = max(float(np.abs(positions).max()), MILLIMETRE) * EXACT
    straight = _on_straight_line(track, tolerance)
    repeated = np.all(np.abs(np.diff(positions, axis=1)) <= tolerance, axis=0)
    on_grid = np.all(
        np.abs(positions / MILLIMETRE - np.round(positions / MILLIMETRE)) <= tolerance / MILLIMETRE, axis=0
    )
    sampling = (
        *(step.mean(), np.median(step), step.std(), step.max()),
        *(straight.mean() if len(straight) else 0.0, _longest_run(straight)),
        *(repeated.mean(), on_grid.mean()),
    )
    return {
        "end position": positions[:, -1],
        "duration": np.array([track.duration, len(track)]),
        "sampling": np.round(sampling, 9),  # the rounding of a clock is not a trace
    }


def _on_straight_line(track: Track, tolerance: float) -> Flags:
    """(samples - 2,) whether a sample lies on the line between its neighbours, in place and time."""
    step = np.diff(track.times)
    velocity = np.diff(track.positions, axis=1) / step
    deviation = np.abs(np.diff(velocity, axis=1)) * np.minimum(step[1:], step[:-1])
    straight: Flags = np.all(deviation <= 4 * tolerance, axis=0)
    return straight


def _longest_run(flags: Flags) -> float:
    """The length of the longest run of true flags."""
    ends = np.flatnonzero(~flags)
    return float(np.diff(np.concatenate([[-1], ends, [len(flags)]])).max() - 1)


def _missing_for_check(data: Dataset | Recording) -> str | None:
    """What `check_leakage` needs and `data` lack; None if nothing."""
    if isinstance(data, Dataset):
        labels, groups = data.labels, data.groups
        if not {"x", "y"} <= set(data.channels):
            return f"the channels x and y; there are {', '.join(data.channels)}"
    else:
        for track in data.tracks:
            if track.label is None:
                return f"labels; track {track.id!r} has none"
        labels = tuple(str(label) for label in data.labels)
        groups = tuple(track.group for track in data.tracks)
    groups_of: dict[str, set[str]] = {}
    for label, group in zip(labels, groups, strict=True):
        groups_of.setdefault(label, set()).add(group)
    if len(groups_of) < 2:
        known = f"all {len(labels)} tracks are {labels[0]}" if labels else "there are no tracks"
        return f"two classes; {known}"
    for name, members in groups_of.items():
        if len(members) < 2:
            return f"every class in two groups; {name} is in {len(members)}"
    return None


def _measure_leak(
    name: str, features: Array, labels: Words, groups: Words, folds: Indices, seed: int
) -> Leak:
    """The leak by features (cases, features); folds: (divisions, cases) the test fold of each case."""
    features = features[:, np.ptp(features, axis=0) > 0]
    if not features.shape[1]:  # constant features predict nothing
        return Leak(name, Interval(0.5, 0.5, 0.5))
    scores = np.stack([_out_of_fold_scores(features, labels, fold_of, seed) for fold_of in folds])
    truth = labels[:, None] == np.unique(labels)
    members = [np.flatnonzero(groups == group) for group in np.unique(groups)]
    rng = np.random.default_rng(seed)
    resampled = []
    for _ in range(RESAMPLES):
        rows = np.concatenate([members[i] for i in rng.integers(len(members), size=len(members))])
        if truth[rows].any(axis=0).all():
            resampled.append(_mean_auc(scores[:, rows], truth[rows]))
    low, high = np.quantile(resampled, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Leak(name, Interval(_mean_auc(scores, truth), float(low), float(high), CONFIDENCE))


def _assign_folds(labels: Words, groups: Words, seed: int) -> Indices:
    """(cases,) the test fold of each case; folds are stratified and keep groups whole."""
    folds = min(FOLDS, *(len(set(groups[labels == name])) for name in np.unique(labels)))
    fold_of = np.empty(len(labels), dtype=np.intp)
    ungrouped = len(set(groups)) == len(groups)  # then the plain split is the same, and much faster
    splitter = (StratifiedKFold if ungrouped else StratifiedGroupKFold)(
        folds, shuffle=True, random_state=seed
    )
    for fold, (_, test) in enumerate(splitter.split(labels, labels, None if ungrouped else groups)):
        fold_of[test] = fold
    return fold_of


def _out_of_fold_scores(features: Array, labels: Words, fold_of: Indices, seed: int) -> Array:
    """(cases, classes) scores by a model that was trained without the case's group."""
    classes = np.unique(labels)
    ranks = (rankdata(features, axis=0) - 0.5) / len(features)
    scores = np.empty((len(labels), len(classes)))
    for fold in range(fold_of.max() + 1):
        train, test = fold_of != fold, fold_of == fold
        truth = (labels[train, None] == classes).astype(np.float64)
        scores[test] = _kernel_ridge(ranks[train], truth, ranks[test], np.random.default_rng(seed))
    return scores


def _kernel_ridge(train: Array, truth: Array, test: Array, rng: np.random.Generator) -> Array:
    """(test cases, classes) scores of kernel ridge regression on landmark cases, classes weighted equally.

    scikit-learn's KernelRidge has no landmarks, and its Nystroem draws them without regard to class.

    train, test: (cases, features). truth: (training cases, classes) one-hot classes.
    """
    cases, classes = truth.shape
    class_counts = truth.sum(axis=0)
    weight = truth @ (cases / (classes * np.maximum(class_counts, 1)))
    per_class = -(-LANDMARKS // classes)
    chosen = [rng.permutation(np.flatnonzero(truth[:, k]))[:per_class] for k in range(classes)]
    landmarks = train[np.sort(np.concatenate(chosen))]
    distances = cdist(landmarks, landmarks, "sqeuclidean")
    scale = float(np.median(distances[distances > 0])) if distances.any() else 1.0
    to_train, inner = _kernel(train, landmarks, scale), _kernel(landmarks, landmarks, scale)
    inner[np.diag_indices(len(landmarks))] += 1e-8  # equal cases make the matrix singular
    left = to_train.T @ (weight[:, None] * to_train) + RIDGE * inner
    right = to_train.T @ (weight[:, None] * (truth - 1 / classes))
    scores: Array = _kernel(test, landmarks, scale) @ scipy.linalg.solve(left, right, assume_a="pos")
    return scores


def _kernel(cases: Array, landmarks: Array, scale: float) -> Array:
    """(cases, landmarks) mean of Gaussian kernels of all `WIDTHS`."""
    distances = cdist(cases, landmarks, "sqeuclidean") / (2 * scale)
    kernel: Array = np.mean([np.exp(-distances / width**2) for width in WIDTHS], axis=0)
    return kernel


def _mean_auc(scores: Array, truth: Flags) -> float:
    """Mean AUC over divisions and classes of scores (divisions, cases, classes); truth: (cases, classes).

    For two classes the second one suffices: their probabilities sum to 1.
    """
    columns = [1] if truth.shape[1] == 2 else range(truth.shape[1])
    areas = []
    for column in columns:
        positive = truth[:, column]
        p, n = int(positive.sum()), int((~positive).sum())
        ranks = rankdata(scores[:, :, column], axis=1)[:, positive].sum(axis=1)
        areas.append(float(np.mean((ranks - p * (p + 1) / 2) / (p * n))))
    return float(np.mean(areas))
