"""Check data sets."""

from __future__ import annotations

import reprlib
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, to_numbers
from lcorpp.errors import DataError
from lcorpp.values import Array, Dataset, measure_lengths


def check_tracks(tracks: npt.ArrayLike, channels: int | None = None) -> Array:
    """Return `tracks` as float64 (cases, channels, time points) after checking them.

    A track that is shorter than others is padded: after its end all its channels are NaN.

    Args:
        channels: the number of channels of the training data; None accepts any.

    Raises:
        DataError: another shape, a track of fewer than two time points, or a number that is infinite, or NaN
            and no padding.
    """
    array = to_numbers(tracks, "the tracks")
    if array.ndim != 3 or 0 in array.shape[:2]:
        raise DataError(f"expected tracks of shape (cases, channels, time points), not {array.shape}")
    if array.shape[2] < 2:
        raise DataError(f"a track of {array.shape[2]} time points shows no motion; at least 2 are needed")
    if not np.isfinite(array).all():
        _check_padded(array)
    if channels is not None and array.shape[1] != channels:
        raise DataError(f"trained on tracks of {channels} channels, given {array.shape[1]}")
    return array


def check_labels(labels: npt.ArrayLike, cases: int) -> npt.NDArray[Any]:
    """Return labels as an array (cases,) after checking them.

    Raises:
        DataError: another shape, None or NaN, or names of several types.
    """
    try:
        array = np.asarray(labels)
        missing = [i for i, label in enumerate(array.tolist()) if label is None or label != label]
        if not missing:
            np.unique(array)  # sorts them
    except (TypeError, ValueError):
        raise DataError(f"the labels are {reprlib.repr(labels)}; expected an array of names") from None
    if missing:
        raise DataError(f"label {missing[0]} (counted from 0) is {array[missing[0]]}; expected a class")
    if array.shape != (cases,):
        raise DataError(f"{cases} cases need as many labels, not shape {array.shape}")
    return array


def _check_padded(tracks: Array) -> None:
    """Raise a DataError unless all numbers that are not finite are padding."""
    lengths = measure_lengths(tracks)
    bad = ~np.isfinite(tracks) & (np.arange(tracks.shape[2]) < lengths[:, None])[:, None]
    if bad.any():
        case, channel, time = (int(i) for i in np.argwhere(bad)[0])
        number = tracks[case, channel, time]
        padding = ", or NaN in all channels from there to the end of a shorter track"
        raise DataError(
            f"case {case}, channel {channel}, time point {time} (counted from 0) is {number}; expected a"
            f" finite number{padding if np.isnan(number) else ''}"
        )
    if lengths.min() < 2:
        case = int(lengths.argmin())
        raise DataError(
            f"case {case} (counted from 0) has {lengths[case]} time points, the others are NaN; at least 2"
            " are needed"
        )


def check_signals(signals: npt.ArrayLike) -> Array:
    """Return tracks, see `check_tracks`, or features (cases, features) as float64 after checking them.

    Raises:
        DataError: another shape, no features, or a number that is NaN or infinite.
    """
    array = to_numbers(signals, "the signals")
    if array.ndim != 2 or 0 in array.shape:
        return check_tracks(array)
    if not np.isfinite(array).all():
        case, feature = (int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise DataError(
            f"case {case}, feature {feature} (counted from 0) is {array[case, feature]}; expected a finite"
            " number"
        )
    return array


def count_groups(labels: Sequence[str], groups: Sequence[str]) -> dict[str, int]:
    """Return class -> number of groups with a case of it."""
    groups_of = defaultdict[str, set[str]](set)
    for label, group in zip(labels, groups, strict=True):
        groups_of[label].add(group)
    return {label: len(groups_of[label]) for label in sorted(groups_of)}


@check_arguments
def check_trainable(dataset: Dataset, *, folds: int = 1) -> None:
    """Check that a classifier can be trained on `dataset` and validated in `folds` grouped folds.

    Raises:
        DataError: fewer than two classes, a class in fewer groups than folds, a number that is not finite,
            tracks of fewer than two points, or identical cases only.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import check_trainable
        >>> check_trainable(Dataset([[0.2], [1.1], [1.3]], ["stands", "walks", "walks"]), folds=2)
        Traceback (most recent call last):
            ...
        lcorpp.errors.DataError: 2 folds need every class in at least 2 groups; there are: stands in 1, ...
    """
    if not len(dataset):
        raise DataError(f"there are no {dataset.unit}; at least two classes are needed")
    signals = check_signals(dataset.trajectories)
    groups = count_groups(dataset.labels, dataset.groups)
    if len(groups) < 2:
        raise DataError(
            f"all {len(dataset)} cases are of class {dataset.labels[0]!r}; at least two classes are needed"
        )
    if min(groups.values()) < folds:
        counts = ", ".join(f"{name} in {count}" for name, count in groups.items())
        raise DataError(f"{folds} folds need every class in at least {folds} groups; there are: {counts}")
    if np.array_equal(signals, np.broadcast_to(signals[:1], signals.shape), equal_nan=True):
        raise DataError(f"all {len(dataset)} {dataset.unit} are the same; nothing can be learnt from them")
