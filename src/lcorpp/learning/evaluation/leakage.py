"""Label leakage: can a data set's labels be predicted from shortcut features instead of motion?

A shortcut feature is something other than motion, e.g. the last position. A simple model is trained on it and
cross-validated. If the model separates the classes, a classifier may do the same, and its score proves little
about motion.

Where a track begins is where it ends less the way between, so that the first position contains the motion:
who walks slowly begins near the end. Its AUC therefore compares tracks whose ways are about equally long.

The model is ridge regression on the ranks of the features, mapped by wide and narrow kernels. It fits
any shape, is robust to outliers and works with few cases. On the authors' 123 tracks its AUC is .99 by end
position and .86 by sampling; nearest neighbours reach .97 and .79; forests .99 and .86. The score of a case
is its mean over several splits into folds, because the AUC of one split of a hundred cases may be off by .02.

With few cases an AUC of .7 may be chance. The p-value compares it with the AUCs for permuted labels, so that
data without leaks raise an alarm with a probability of at most 5 %, however small they are.

Source: Williams and Seeger, NIPS 2000 (Nyström approximation: kernels centred at a subset of the cases, the
landmarks); Ojala and Garriga, "Permutation tests for studying classifier performance", JMLR 11, 2010.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve
from scipy.stats import rankdata
from sklearn.kernel_approximation import Nystroem
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import make_pipeline, make_union
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.learning.data.dataset import count_groups
from lcorpp.learning.data.npz import to_recording
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.learning.evaluation.metrics import (
    bootstrap_interval,
    cluster_bootstrap_weights,
    compute_auc,
)
from lcorpp.values import Array, Dataset, Flags, Indices, Interval

RELATIVE_TOLERANCE = 1e-9
"""Tolerance relative to the largest position: rounding error of sums of numbers with 15 digits."""

COLLINEARITY_FACTOR = 4  # rounding errors in the deviation of a point from the line between its neighbours
CLOCK_DECIMALS = 9  # of a sampling feature: the rounding of a clock is not a trace
MILLIMETRE = 1e-3

SHORTCUTS = ("start position", "end position", "duration", "sampling")
"""The shortcuts by name; `compute_shortcut_features` describes their features."""


def compute_shortcut_features(track: Track) -> dict[str, Array]:
    """Shortcut -> (features,) of one track of at least two samples.

    Start and end position: x and y. Duration: seconds and number of samples. Sampling: mean, median, standard
    deviation and maximum of the interval; fraction and longest run of collinear points; fraction of repeated
    positions and of positions in whole millimetres. These are traces of an earlier resampling, in which
    smooth and rough motion do not differ, so that they do not depend on the motion.
    """
    positions, step = track.positions, np.diff(track.times)
    tolerance = max(float(np.abs(positions).max()), MILLIMETRE) * RELATIVE_TOLERANCE
    collinear = _find_collinear(track, tolerance)
    repeated = np.all(np.abs(np.diff(positions, axis=1)) <= tolerance, axis=0)
    grid = positions / MILLIMETRE
    on_grid = np.all(np.abs(grid - np.round(grid)) <= tolerance / MILLIMETRE, axis=0)
    intervals = [step.mean(), np.median(step), step.std(), step.max()]
    collinearity = [collinear.mean() if len(collinear) else 0.0, _measure_longest_run(collinear)]
    return {
        "start position": positions[:, 0],
        "end position": positions[:, -1],
        "duration": np.array([track.duration, len(track)]),
        "sampling": np.round([*intervals, *collinearity, repeated.mean(), on_grid.mean()], CLOCK_DECIMALS),
    }


def _find_collinear(track: Track, tolerance: float) -> Flags:
    """(samples - 2,) whether each inner sample is on the line between its neighbours; tolerance: metres."""
    step = np.diff(track.times)
    velocity = np.diff(track.positions, axis=1) / step
    deviation = np.abs(np.diff(velocity, axis=1)) * np.minimum(step[1:], step[:-1])  # metres
    return np.asarray(np.all(deviation <= COLLINEARITY_FACTOR * tolerance, axis=0))


def _measure_longest_run(flags: Flags) -> float:
    """Return the length of the longest run of true flags."""
    ends = np.flatnonzero(~flags)
    return float(np.diff(np.concatenate([[-1], ends, [len(flags)]])).max() - 1)


MIN_SUSPICIOUS_AUC = 0.7
"""From this AUC on, a score on the data may describe the recording instead of the motion."""

N_SPLITS, N_SPLITS_OF_WARNING = 5, 2
MAX_FOLDS = 5

MAX_LANDMARKS = 150
"""Maximal number of landmarks, the cases at which a kernel is centred."""

KERNEL_GAMMAS = (0.2, 2.0)
"""Of the Gaussian kernels exp(-gamma * distance²), on ranks of standard deviation 1."""

MAX_P_VALUE = 0.05 / len(SHORTCUTS)
"""Data without leaks raise an alarm with a probability of at most .05 (Bonferroni)."""

N_PERMUTATIONS = 199

BOOTSTRAP_REPLICATES = 300

MAX_STRATA, MIN_STRATUM = 5, 20
"""Groups of tracks with about equally long ways: their number, and the cases in each."""

Strings = npt.NDArray[np.str_]


@dataclass(frozen=True)
class ShortcutScore:
    """How well one shortcut predicts the labels.

    name: one of `SHORTCUTS`.
    auc: area under the ROC curve, with a 95 % bootstrap confidence interval over groups; .5 is chance, 1 a
        perfect leak; for more than two classes, the mean of each against the others.
    p_value: probability of an AUC at least as high if the labels do not depend on the shortcut.
    """

    name: str
    auc: Interval
    p_value: float

    def __repr__(self) -> str:
        verdict = ", suspicious" if self.is_suspicious else ""
        return f"<ShortcutScore of {self.name}: AUC {self.auc}, p {self.p_value:.3f}{verdict}>"

    @property
    def is_suspicious(self) -> bool:
        """Whether the AUC is at least `MIN_SUSPICIOUS_AUC` and significantly above chance."""
        return self.auc.estimate >= MIN_SUSPICIOUS_AUC and self.p_value <= MAX_P_VALUE


@check_arguments
def measure_leakage(
    data: Dataset | Recording, *, n_splits: int = N_SPLITS, seed: int = 0
) -> tuple[ShortcutScore, ...]:
    """Measure how well start and end position, duration and sampling alone predict the labels of `data`.

    The cases of a `Dataset` count by weight.

    Of a `Dataset` the duration is that of each track without padding, and of the sampling only traces of an
    earlier resampling are left. A `Recording` still has the original sampling. Of a series without x and y
    the duration alone is measured.

    Args:
        n_splits: number of random splits into folds; the score of a case is their mean.
        seed: seed of the splits, the landmarks, the confidence interval and the permutations.

    Returns:
        One score for every entry of `SHORTCUTS`, in this order, also if it is at chance.

    Raises:
        DataError: there are not two classes, each in two groups or more; a track has no label; the data are
            features without time; or `n_splits` or `seed` is out of range.

    Examples:
        >>> from lcorpp.learning import Recording, Track, measure_leakage
        >>> labels = 8 * ["interested"] + 8 * ["not_interested"]  # the interested people are nearer
        >>> tracks = [Track(str(x), [0, 1], {"x": [x, x], "y": [0, 1]}, labels[x]) for x in range(16)]
        >>> scores = measure_leakage(Recording(tracks), n_splits=1)
        >>> [score.name for score in scores if score.is_suspicious]
        ['start position', 'end position']
    """
    if n_splits < 1:
        raise DataError(f"a leak check needs at least 1 split, not {n_splits}")
    if not 0 <= seed <= 2**32 - n_splits:
        raise DataError(f"the seed must lie between 0 and {2**32 - n_splits}, not {seed}")
    missing = _find_missing_requirement(data)
    if missing is not None:
        raise DataError(f"a leak check needs {missing}")
    labels, groups = map(np.array, _list_labels_and_groups(data))
    weights = data.weights if isinstance(data, Dataset) else np.ones(len(labels))
    strata = dict.fromkeys(SHORTCUTS, np.zeros(len(labels), dtype=np.intp))
    if isinstance(data, Dataset) and not (data.kind == "motion" and {"x", "y"} <= set(data.channels)):
        features = {"duration": data.lengths[:, None].astype(np.float64)}
    else:
        tracks = (to_recording(data) if isinstance(data, Dataset) else data).tracks
        rows = [compute_shortcut_features(track) for track in tracks]
        features = {name: np.stack([row[name] for row in rows]) for name in SHORTCUTS}
        strata["start position"] = _stratify_by_way(tracks)
    with threadpool_limits(1):  # small matrices: threads on busy cores would only wait for each other
        return tuple(
            _measure_shortcut(name, numbers, labels, groups, weights, strata[name], n_splits, seed)
            for name, numbers in features.items()
        )


@check_arguments
def format_leakage_warning(data: Dataset | Recording) -> str | None:
    """Return a warning to print with any score on `data`; None if no shortcut is suspicious.

    Two splits are faster than the default of `measure_leakage` and accurate enough for a warning. Data that
    cannot be measured give None: they are not trainable either, and the message of `check_trainable` is
    better.

    Examples:
        >>> from lcorpp.learning import Recording, Track, format_leakage_warning
        >>> labels = 8 * ["interested"] + 8 * ["not_interested"]  # the interested people are nearer
        >>> tracks = [Track(str(x), [0, 1], {"x": [x, x], "y": [0, 1]}, labels[x]) for x in range(16)]
        >>> print(format_leakage_warning(Recording(tracks)))
        The label can be predicted from start position alone (AUC 0.9...
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
    weights: Array,
    strata: Indices,
    n_splits: int,
    seed: int,
) -> ShortcutScore:
    """Measure how well features (cases, features) predict the labels.

    weights: (cases,) how much each case counts. strata: (cases,) groups within which cases are compared.
    """
    features = features[:, np.ptp(features, axis=0) > 0]
    chance = ShortcutScore(name, Interval(0.5, 0.5, 0.5), 1.0)
    if not features.shape[1]:  # constant features predict nothing
        return chance
    truth = labels[:, None] == np.unique(labels)
    if truth.shape[1] == 2:  # the scores of two classes sum to 0: one suffices
        truth = truth[:, 1:]
    relabelled = [truth, *_permute_among_groups(truth, groups, seed)]
    means = np.average(truth, axis=0, weights=weights)
    targets = np.concatenate(relabelled, axis=1) - np.tile(means, len(relabelled))
    predicted = _predict_out_of_fold(features, targets, groups, weights, n_splits, seed)
    scores = np.stack(np.split(predicted, len(relabelled), axis=1))
    estimate, *null = _compute_mean_auc(scores, np.stack(relabelled), strata, weights[None]).tolist()
    if np.isnan(estimate):  # no two cases can be compared
        return chance
    resampled = cluster_bootstrap_weights(groups.tolist(), count=BOOTSTRAP_REPLICATES, seed=seed) * weights
    interval = bootstrap_interval(estimate, _compute_mean_auc(scores[0], truth, strata, resampled))
    return ShortcutScore(
        name, interval, (1 + int(np.count_nonzero(np.array(null) >= estimate))) / (1 + len(null))
    )


def _permute_among_groups(truth: Flags, groups: Strings, seed: int) -> list[Flags]:
    """`N_PERMUTATIONS` times truth (cases, classes), the sequences of whole groups in random order."""
    rng = np.random.default_rng(seed)
    by_group = np.argsort(groups, kind="stable")
    sequences = np.split(truth[by_group], np.unique(groups[by_group], return_index=True)[1][1:])
    original = np.argsort(by_group)
    return [
        np.concatenate([sequences[i] for i in rng.permutation(len(sequences))])[original]
        for _ in range(N_PERMUTATIONS)
    ]


def _predict_out_of_fold(
    features: Array, targets: Array, groups: Strings, weights: Array, n_splits: int, seed: int
) -> Array:
    """(cases, targets) mean prediction over splits, by models that are trained without the case's group.

    The folds depend on no labels, so that permuted labels have the same chances as the true ones.
    """
    ranks = rankdata(features, axis=0)  # over all cases, as the kernels: they use no labels
    landmarks = min(MAX_LANDMARKS, len(ranks))
    kernels = make_union(
        *(Nystroem(gamma=g, n_components=landmarks, random_state=seed) for g in KERNEL_GAMMAS)
    )
    mapped = make_pipeline(StandardScaler(), kernels).fit_transform(ranks)
    predicted = np.zeros(targets.shape)
    for split in range(n_splits):
        folds = GroupKFold(min(MAX_FOLDS, len(set(groups))), shuffle=True, random_state=seed + split)
        for training, test in folds.split(mapped, groups=groups):
            # neither an intercept nor means over all cases: they depend on the labels of the test fold
            centre = np.average(mapped[training], axis=0, weights=weights[training])
            coefficients = _fit_ridge(mapped[training] - centre, targets[training], weights[training])
            predicted[test] += (mapped[test] - centre) @ coefficients
    return predicted / n_splits


def _fit_ridge(features: Array, targets: Array, weights: Array) -> Array:
    """(features, targets) coefficients of ridge regression with penalty 1 and no intercept.

    weights: (cases,) of cases. The smaller of two equal systems is solved, over features or over cases.
    """
    root = np.sqrt(weights)[:, np.newaxis]
    x, y = root * features, root * targets
    if x.shape[0] < x.shape[1]:
        return np.asarray(x.T @ solve(x @ x.T + np.eye(x.shape[0]), y, assume_a="pos"))
    return np.asarray(solve(x.T @ x + np.eye(x.shape[1]), x.T @ y, assume_a="pos"))


def _stratify_by_way(tracks: Sequence[Track]) -> Indices:
    """(tracks,) the group of each track by the distance from its first to its last point."""
    ways = [np.hypot(*(track.positions[:, -1] - track.positions[:, 0])) for track in tracks]
    number = max(1, min(MAX_STRATA, len(ways) // MIN_STRATUM))
    return np.asarray((rankdata(ways) - 0.5) * number // len(ways), dtype=np.intp)


def _compute_mean_auc(scores: Array, truth: Flags, strata: Indices, weights: Array) -> Array:
    """(n,) mean AUC over classes: of one score with n weights, or of n scores.

    scores, truth: (cases, classes), and weights (n, cases) as in `metrics`; or scores, truth: (n, cases,
    classes), and weights (1, cases). Cases are compared with those of the same stratum (cases,); NaN if no
    stratum has two classes.
    """
    areas, n = [], len(weights) if scores.ndim == 2 else len(scores)
    for score, positive in zip(np.moveaxis(scores, -1, 0), np.moveaxis(truth, -1, 0), strict=True):
        ordered, pairs = np.zeros((2, n))
        for stratum in np.unique(strata):
            rows = np.flatnonzero(strata == stratum)
            flags, counts = positive[..., rows], weights[:, rows]
            compared = (counts * flags).sum(axis=1) * (counts * ~flags).sum(axis=1)
            area = compute_auc(score[..., rows], flags, counts)
            ordered += np.where(compared > 0, area, 0) * compared
            pairs += compared
        areas.append(np.divide(ordered, pairs, out=np.full(len(pairs), np.nan), where=pairs > 0))
    return np.asarray(np.mean(areas, axis=0))
