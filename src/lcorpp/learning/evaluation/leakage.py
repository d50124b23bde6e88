"""Label leakage: can a data set's labels be predicted from shortcut features instead of motion?

A shortcut feature is something other than motion, e.g. the last position. A simple model is trained on it and
cross-validated. If the model separates the classes, a classifier may do the same, and its score proves little
about motion.

Where a track begins is where it ends less the way between, so that the first position contains the motion:
who walks slowly begins near the end. Its AUC therefore compares tracks whose ways are about equally long.

The model is kernel ridge regression on the ranks of the features, with Gaussian kernels of several widths. It
fits any shape, is robust to outliers, works with few cases and takes milliseconds. On the authors' 123 tracks
its AUC is .99 by end position and .86 by sampling; nearest neighbours reach .97 and .79; forests, ten times
slower, .99 and .86. The AUC is the mean over several splits, because that of one split of a hundred cases may
be off by .02.

Source: Rifkin and Klautau, "In defense of one-vs-all classification", JMLR 5, 2004, section 2.3 (regularised
least squares); Williams and Seeger, NIPS 2000 (Nyström approximation: kernels centred at a subset of the
training cases, the landmarks).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg
from scipy.spatial.distance import cdist
from scipy.stats import rankdata
from threadpoolctl import threadpool_limits

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.learning.data.dataset import count_groups
from lcorpp.learning.data.npz import to_recording
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.learning.evaluation.folds import assign_folds, drop_single_groups
from lcorpp.learning.evaluation.metrics import (
    bootstrap_interval,
    cluster_bootstrap_weights,
    compute_auc,
)
from lcorpp.learning.evaluation.shortcuts import SHORTCUTS, compute_shortcut_features
from lcorpp.values import Array, Dataset, Flags, Indices, Interval

MIN_SUSPICIOUS_AUC = 0.7
"""From this AUC on, a score on the data may describe the recording instead of the motion."""

N_SPLITS, N_SPLITS_OF_WARNING = 5, 2
MAX_FOLDS = 5

KERNEL_WIDTHS, RIDGE_PENALTY = (0.3, 1.0), 0.5
"""Kernel widths: standard deviations in units of the root of the median squared distance of landmarks."""

MAX_LANDMARKS = 300
"""Maximal number of landmarks, the training cases at which a kernel is centred."""

KERNEL_JITTER = 1e-8  # added to the diagonal of the landmarks' kernel matrix, singular for equal cases

BOOTSTRAP_REPLICATES = 300

MAX_STRATA, MIN_STRATUM = 5, 20
"""Groups of tracks with about equally long ways: their number, and the cases in each."""

Strings = npt.NDArray[np.str_]


@dataclass(frozen=True)
class ShortcutScore:
    """How well one shortcut predicts the labels.

    name: one of `SHORTCUTS`.
    auc: area under the ROC curve, mean over splits, with a 95 % bootstrap confidence interval over groups; .5
        is chance, 1 a perfect leak; for more than two classes, the mean of each against the others.
    """

    name: str
    auc: Interval

    def __repr__(self) -> str:
        return f"<ShortcutScore of {self.name}: AUC {self.auc}{', suspicious' if self.is_suspicious else ''}>"

    @property
    def is_suspicious(self) -> bool:
        """Whether the AUC is at least `MIN_SUSPICIOUS_AUC` and significantly above chance."""
        return self.auc.estimate >= MIN_SUSPICIOUS_AUC and self.auc.low > 0.5


@check_arguments
def measure_leakage(
    data: Dataset | Recording, *, n_splits: int = N_SPLITS, seed: int = 0
) -> tuple[ShortcutScore, ...]:
    """Measure how well start and end position, duration and sampling alone predict the labels of `data`.

    Of a `Dataset` the duration is that of each track without padding, and of the sampling only traces of an
    earlier resampling are left. A `Recording` still has the original sampling. Of a series without x and y
    the duration alone is measured.

    Args:
        n_splits: number of random splits into folds; the AUC is their mean.
        seed: seed of the splits, the landmarks and the confidence interval.

    Returns:
        One score for every entry of `SHORTCUTS`, in this order, also if it is at chance.

    Raises:
        DataError: there are not two classes, each in two groups or more; a track has no label; the data are
            features without time; or `n_splits` is below 1.
    """
    if n_splits < 1:
        raise DataError(f"a leak check needs at least 1 split, not {n_splits}")
    missing = _find_missing_requirement(data)
    if missing is not None:
        raise DataError(f"a leak check needs {missing}")
    names, people = _list_labels_and_groups(data)
    labels, groups = np.array(names), np.array(people)
    strata = dict.fromkeys(SHORTCUTS, np.zeros(len(labels), dtype=np.intp))
    if isinstance(data, Dataset) and not (data.kind == "motion" and {"x", "y"} <= set(data.channels)):
        features = {"duration": data.lengths[:, None].astype(np.float64)}
    else:
        tracks = (to_recording(data) if isinstance(data, Dataset) else data).tracks
        rows = [compute_shortcut_features(track) for track in tracks]
        features = {name: np.stack([row[name] for row in rows]) for name in SHORTCUTS}
        strata["start position"] = _stratify_by_way(tracks)
    n_folds, tied = min(MAX_FOLDS, *count_groups(names, people).values()), drop_single_groups(people)
    folds = np.stack([assign_folds(names, tied, n_folds, seed + split) for split in range(n_splits)])
    with threadpool_limits(1):  # small matrices: threads on busy cores would only wait for each other
        return tuple(
            _measure_shortcut(name, numbers, labels, groups, folds, strata[name], seed)
            for name, numbers in features.items()
        )


@check_arguments
def format_leakage_warning(data: Dataset | Recording) -> str | None:
    """Return a warning to print with any score on `data`; None if no shortcut is suspicious.

    Two splits are faster than the default of `measure_leakage` and accurate enough for a warning. Data that
    cannot be measured give None: they are not trainable either, and the message of `check_trainable` is
    better.
    """
    if _find_missing_requirement(data) is not None:
        return None
    scores = measure_leakage(data, n_splits=N_SPLITS_OF_WARNING)
    suspicious = [score for score in scores if score.is_suspicious]
    if not suspicious:
        return None
    shortcuts = " and ".join(f"{score.name} alone (AUC {score.auc.estimate:.2f})" for score in suspicious)
    if {score.name for score in suspicious} == {"duration"}:
        return f"The label can be predicted from {shortcuts}: a classifier may learn how long tracks last."
    return (
        f"The label can be predicted from {shortcuts}: a classifier that sees positions or every sample may"
        " learn places and recordings, not intentions; give it motion relative to the first point, at a low"
        " rate."
    )


def _find_missing_requirement(data: Dataset | Recording) -> str | None:
    """Return what `measure_leakage` needs and `data` lack; None if nothing."""
    if isinstance(data, Dataset):
        if data.kind == "table":
            return "tracks over time; the data are features"
    else:
        for track in data.tracks:
            if track.label is None:
                return f"labels; track {track.id!r} has none"
    labels, groups = _list_labels_and_groups(data)
    counts = count_groups(labels, groups)
    if len(counts) < 2:
        known = f"all {len(labels)} tracks are {labels[0]}" if labels else "there are no tracks"
        return f"two classes; {known}"
    for name, count in counts.items():
        if count < 2:
            return f"every class in two groups; {name} is in {count}"
    return None


def _list_labels_and_groups(data: Dataset | Recording) -> tuple[tuple[str, ...], tuple[str, ...]]:
    if isinstance(data, Dataset):
        return data.labels, data.groups
    return tuple(map(str, data.labels)), tuple(track.group for track in data.tracks)


def _measure_shortcut(
    name: str,
    features: Array,
    labels: Strings,
    groups: Strings,
    folds: Indices,
    strata: Indices,
    seed: int,
) -> ShortcutScore:
    """Measure how well features (cases, features) predict the labels.

    folds: (splits, cases) test folds. strata: (cases,) groups within which cases are compared.
    """
    features = features[:, np.ptp(features, axis=0) > 0]
    chance = ShortcutScore(name, Interval(0.5, 0.5, 0.5))
    if not features.shape[1]:  # constant features predict nothing
        return chance
    scores = np.stack([_score_out_of_fold(features, labels, fold_of, seed) for fold_of in folds])
    truth = labels[:, None] == np.unique(labels)
    resampled = cluster_bootstrap_weights(groups.tolist(), count=BOOTSTRAP_REPLICATES, seed=seed)
    weights = np.concatenate([np.ones((1, len(labels))), resampled])
    estimate, *replicates = _compute_mean_auc(scores, truth, strata, weights)
    if np.isnan(estimate):  # no two cases can be compared
        return chance
    return ShortcutScore(name, bootstrap_interval(estimate, np.array(replicates)))


def _score_out_of_fold(features: Array, labels: Strings, fold_of: Indices, seed: int) -> Array:
    """(cases, classes) scores of each case by a model that is trained without the case's group."""
    classes = np.unique(labels)
    # ranks over all cases: they use no labels
    ranks = (rankdata(features, axis=0) - 0.5) / len(features)
    scores = np.empty((len(labels), len(classes)))
    for fold in range(fold_of.max() + 1):
        train, test = fold_of != fold, fold_of == fold
        truth = (labels[train, None] == classes).astype(np.float64)
        scores[test] = _score_by_kernel_ridge(ranks[train], truth, ranks[test], np.random.default_rng(seed))
    return scores


def _score_by_kernel_ridge(train: Array, truth: Array, test: Array, rng: np.random.Generator) -> Array:
    """(test cases, classes) scores of kernel ridge regression on landmarks, classes weighted equally.

    scikit-learn's KernelRidge has no landmarks, and its Nystroem draws them without regard to class.

    train, test: (cases, features). truth: (training cases, classes) one-hot classes.
    """
    cases, classes = truth.shape
    class_counts = truth.sum(axis=0)
    weights = truth @ (cases / (classes * np.maximum(class_counts, 1)))
    per_class = -(-MAX_LANDMARKS // classes)
    chosen = [rng.permutation(np.flatnonzero(truth[:, k]))[:per_class] for k in range(classes)]
    landmarks = train[np.sort(np.concatenate(chosen))]
    squared_distances = cdist(landmarks, landmarks, "sqeuclidean")
    scale = float(np.median(squared_distances[squared_distances > 0])) if squared_distances.any() else 1.0
    to_train = _average_kernels(train, landmarks, scale)
    inner = _average_kernels(landmarks, landmarks, scale)
    inner[np.diag_indices(len(landmarks))] += KERNEL_JITTER
    left = to_train.T @ (weights[:, None] * to_train) + RIDGE_PENALTY * inner
    right = to_train.T @ (weights[:, None] * (truth - 1 / classes))
    coefficients = scipy.linalg.solve(left, right, assume_a="pos")
    return np.asarray(_average_kernels(test, landmarks, scale) @ coefficients)


def _average_kernels(cases: Array, landmarks: Array, scale: float) -> Array:
    """(cases, landmarks) mean of Gaussian kernels of all `KERNEL_WIDTHS`; scale: a squared distance."""
    squared_distances = cdist(cases, landmarks, "sqeuclidean") / (2 * scale)
    return np.asarray(np.mean([np.exp(-squared_distances / width**2) for width in KERNEL_WIDTHS], axis=0))


def _stratify_by_way(tracks: Sequence[Track]) -> Indices:
    """(tracks,) the group of each track by the distance from its first to its last point."""
    ways = [np.hypot(*(track.positions[:, -1] - track.positions[:, 0])) for track in tracks]
    number = max(1, min(MAX_STRATA, len(ways) // MIN_STRATUM))
    return np.asarray((rankdata(ways) - 0.5) * number // len(ways), dtype=np.intp)


def _compute_mean_auc(scores: Array, truth: Flags, strata: Indices, weights: Array) -> Array:
    """(resamples,) mean AUC over splits and classes of scores (splits, cases, classes).

    truth: (cases, classes). weights: (resamples, cases), as in `metrics`. Cases are compared with those of
    the same stratum (cases,); NaN if no stratum has two classes. For two classes the second one suffices: the
    two scores of a case sum to 0.
    """
    areas = []
    for column in [1] if truth.shape[1] == 2 else range(truth.shape[1]):
        ordered, pairs = np.zeros((2, len(weights)))
        for stratum in np.unique(strata):
            rows = np.flatnonzero(strata == stratum)
            positive, counts = truth[rows, column], weights[:, rows]
            compared = (counts @ positive) * (counts @ ~positive)
            area = np.mean([compute_auc(split[rows, column], positive, counts) for split in scores], axis=0)
            ordered += np.where(compared > 0, area, 0) * compared
            pairs += compared
        areas.append(np.divide(ordered, pairs, out=np.full(len(weights), np.nan), where=pairs > 0))
    return np.asarray(np.mean(areas, axis=0))
