"""Does a data set give its labels away by something that is not motion?

A rule is trained on what is no motion, such as the last position alone, and cross-validated. A rule that
tells the classes apart shows that a classifier might, too, and that its score says little about motion.

The rule is regression with Gaussian kernels of several widths on the ranks of the numbers: it takes any
shape, minds no outliers, is right with few cases and takes milliseconds. On the authors' 123 tracks it finds
AUC .99 by end position and .86 by traces of sampling; nearest neighbours find .97 and .79; forests, ten times
slower, .99 and .86. The AUC is a mean over several divisions, since one of a hundred cases may be off by .02.

Source: Rifkin and Klautau, "In defense of one-vs-all classification", JMLR 5, 2004, section 2.3 (regularised
least squares); Williams and Seeger, NIPS 2000 (the landmarks).
"""

from __future__ import annotations

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
from lcorpp.learning.data.tracks import Recording
from lcorpp.learning.evaluation.shortcuts import TRACES, traces_of
from lcorpp.values import Array, Dataset

SUSPICIOUS = 0.7
"""From this AUC on, a score on the data says more about the recording than about motion."""

DIVISIONS, FOLDS = 5, 5
WIDTHS, RIDGE, LANDMARKS = (0.3, 1.0), 0.5, 300
"""Widths of the kernels in typical distances, how much the rule is smoothed, and how many cases span it."""

RESAMPLINGS, LEVEL = 300, 0.95

Words = npt.NDArray[np.str_]
Rows = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Leak:
    """How far labels can be told from something that is not motion.

    name: what it is, one of `TRACES`. auc: area under the ROC curve, a mean over divisions; .5 is chance, 1 a
        perfect leak; of more than two classes each against the others, and the mean.
    low, high: its 95 % interval, from samples of the groups drawn with replacement.
    """

    name: str
    auc: float
    low: float
    high: float

    @property
    def flagged(self) -> bool:
        """Whether it is large enough to doubt a score, and not by chance."""
        return self.auc >= SUSPICIOUS and self.low > 0.5


def leak_check(data: Dataset | Recording, *, divisions: int = DIVISIONS, seed: int = 0) -> tuple[Leak, ...]:
    """How far end position, duration and sampling alone tell the labels of `data`.

    The durations of a `Dataset` are all the same, and so are the times between its points; what is left of
    sampling are the traces of an earlier resampling. A `Recording` shows what was lost.

    Args:
        divisions: how often the cases are divided anew; the AUC is the mean.
        seed: of the divisions, the landmarks and the interval.

    Returns:
        One leak for every entry of `TRACES`.

    Raises:
        DataError: there are not two classes, each in two groups or more, a track has no label or no place, or
            `divisions` is below 1.
    """
    if divisions < 1:
        raise DataError(f"a leak check needs at least 1 division, not {divisions}")
    obstacle = _obstacle(data)
    if obstacle is not None:
        raise DataError(f"a leak check needs {obstacle}")
    recording = to_recording(data) if isinstance(data, Dataset) else data
    labels = np.array([str(label) for label in recording.labels])
    groups = np.array([track.group for track in recording.tracks])
    found = [traces_of(track) for track in recording.tracks]
    held_out = np.stack([_held_out(labels, groups, seed + division) for division in range(divisions)])
    with threadpool_limits(1):  # small matrices: on busy cores threads would only wait for each other
        return tuple(
            _leak(name, np.stack([traces[name] for traces in found]), labels, groups, held_out, seed)
            for name in TRACES
        )


def leak_note(data: Dataset | Recording) -> str | None:
    """A sentence to print beside any score on `data`, None where nothing is known to give the labels away.

    It is `leak_check` with two divisions: quicker, and enough to warn. There is none on data that cannot be
    checked: they cannot be learnt from either, which `check_trainable` says better.
    """
    if _obstacle(data) is not None:
        return None
    flagged = [leak for leak in leak_check(data, divisions=2) if leak.flagged]
    if not flagged:
        return None
    told = " and ".join(f"{leak.name} alone (AUC {leak.auc:.2f})" for leak in flagged)
    return (
        f"The label can be told from {told}: a classifier that sees positions or every sample may learn"
        " places and recordings, not intentions; give it motion relative to the first point, at a low rate."
    )


def _obstacle(data: Dataset | Recording) -> str | None:
    """What `leak_check` needs and `data` lack, None if nothing."""
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
    people: dict[str, set[str]] = {}
    for label, group in zip(labels, groups, strict=True):
        people.setdefault(label, set()).add(group)
    if len(people) < 2:
        known = f"all {len(labels)} tracks are {labels[0]}" if labels else "there are no tracks"
        return f"two classes; {known}"
    for name, known_as in people.items():
        if len(known_as) < 2:
            return f"every class in two groups; {name} is in {len(known_as)}"
    return None


def _leak(name: str, numbers: Array, labels: Words, groups: Words, held_out: Rows, seed: int) -> Leak:
    """One leak by (cases, features) numbers; held_out: (divisions, cases) the fold that each is tested in."""
    numbers = numbers[:, np.ptp(numbers, axis=0) > 0]
    if not numbers.shape[1]:  # alike for all: there is nothing to tell them by
        return Leak(name, 0.5, 0.5, 0.5)
    scores = np.stack([_out_of_fold(numbers, labels, fold_of, seed) for fold_of in held_out])
    truth = labels[:, None] == np.unique(labels)
    members = [np.flatnonzero(groups == group) for group in np.unique(groups)]
    rng = np.random.default_rng(seed)
    sampled = []
    for _ in range(RESAMPLINGS):
        rows = np.concatenate([members[i] for i in rng.integers(len(members), size=len(members))])
        if truth[rows].any(axis=0).all():
            sampled.append(_mean_auc(scores[:, rows], truth[rows]))
    low, high = np.quantile(sampled, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Leak(name, _mean_auc(scores, truth), float(low), float(high))


def _held_out(labels: Words, groups: Words, seed: int) -> Rows:
    """(cases,) the fold that each case is tested in: groups stay together, classes in proportion."""
    folds = min(FOLDS, *(len(set(groups[labels == name])) for name in np.unique(labels)))
    fold_of = np.empty(len(labels), dtype=np.intp)
    alone = len(set(groups)) == len(groups)  # then the plain division is the same, and much quicker
    splitter = (StratifiedKFold if alone else StratifiedGroupKFold)(folds, shuffle=True, random_state=seed)
    for fold, (_, test) in enumerate(splitter.split(labels, labels, None if alone else groups)):
        fold_of[test] = fold
    return fold_of


def _out_of_fold(numbers: Array, labels: Words, fold_of: Rows, seed: int) -> Array:
    """(cases, classes) scores by a rule that never saw the group of a case."""
    classes = np.unique(labels)
    ranks = (rankdata(numbers, axis=0) - 0.5) / len(numbers)
    scores = np.empty((len(labels), len(classes)))
    for fold in range(fold_of.max() + 1):
        train, test = fold_of != fold, fold_of == fold
        truth = (labels[train, None] == classes).astype(np.float64)
        scores[test] = _regression(ranks[train], truth, ranks[test], np.random.default_rng(seed))
    return scores


def _regression(train: Array, truth: Array, test: Array, rng: np.random.Generator) -> Array:
    """(test cases, classes) what the rule says, the classes counted as equally common.

    train, test: (cases, features). truth: (training cases, classes) 1 for the class of each, else 0.
    """
    cases, classes = truth.shape
    share = truth.sum(axis=0)
    weight = truth @ (cases / (classes * np.maximum(share, 1)))
    each = -(-LANDMARKS // classes)
    chosen = [rng.permutation(np.flatnonzero(truth[:, k]))[:each] for k in range(classes)]
    marks = train[np.sort(np.concatenate(chosen))]
    apart = cdist(marks, marks, "sqeuclidean")
    typical = float(np.median(apart[apart > 0])) if apart.any() else 1.0
    known, inner = _kernel(train, marks, typical), _kernel(marks, marks, typical)
    inner[np.diag_indices(len(marks))] += 1e-8  # equal cases make it singular
    left = known.T @ (weight[:, None] * known) + RIDGE * inner
    right = known.T @ (weight[:, None] * (truth - 1 / classes))
    said: Array = _kernel(test, marks, typical) @ scipy.linalg.solve(left, right, assume_a="pos")
    return said


def _kernel(cases: Array, marks: Array, typical: float) -> Array:
    """(cases, marks) how near they are, 1 for the same numbers."""
    apart = cdist(cases, marks, "sqeuclidean") / (2 * typical)
    near: Array = np.mean([np.exp(-apart / width**2) for width in WIDTHS], axis=0)
    return near


def _mean_auc(scores: Array, truth: npt.NDArray[np.bool_]) -> float:
    """Mean over divisions and classes of (divisions, cases, classes) scores against (cases, classes) truth.

    Of two classes the second is enough: their probabilities add to 1.
    """
    columns = [1] if truth.shape[1] == 2 else range(truth.shape[1])
    areas = []
    for column in columns:
        positive = truth[:, column]
        p, n = int(positive.sum()), int((~positive).sum())
        ranks = rankdata(scores[:, :, column], axis=1)[:, positive].sum(axis=1)
        areas.append(float(np.mean((ranks - p * (p + 1) / 2) / (p * n))))
    return float(np.mean(areas))
