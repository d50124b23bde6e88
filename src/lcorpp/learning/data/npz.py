"""Save and load data sets exactly (.npz), and convert a data set to a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.archives import locate_damage, pack_archive, unpack_archive
from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.learning.data.dataset import check_signals
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.notebook import join_some
from lcorpp.values import CHANNELS, Dataset, strip_padding
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp dataset", 1)
SUFFIX = ".npz"


@check_arguments
def save_dataset(dataset: Dataset, path: str | Path) -> None:
    """Write a data set as a numpy archive (.npz) of numbers and JSON, without executable content.

    Raises:
        FileError: the file cannot be written.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import load_dataset, save_dataset
        >>> save_dataset(Dataset([[0.2], [1.1]], ["stands", "walks"], channels=["speed"]), "walking.npz")
        >>> load_dataset("walking.npz").trajectories.tolist()
        [[0.2], [1.1]]
    """
    fields = ("labels", "groups", "source", "notes", "interval", "channels")
    header = {name: getattr(dataset, name) for name in fields}
    arrays = {"trajectories": dataset.trajectories, "weights": dataset.weights}
    write_atomically(path, pack_archive(FORMAT, header, arrays))


@check_arguments
def load_dataset(path: str | Path) -> Dataset:
    """Read a data set that `save_dataset` wrote, bit for bit.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: the file is not a data set, is damaged or has a newer version, or a number is not finite.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import load_dataset, save_dataset
        >>> save_dataset(Dataset([[0.2], [1.1]], ["stands", "walks"], channels=["speed"]), "walking.npz")
        >>> load_dataset("walking.npz")
        Dataset(2 cases (stands: 1, walks: 1), features speed, 2 groups)
    """
    content = read_bytes(path)
    with locate_damage(path, "data set"):
        header, archive = unpack_archive(FORMAT, content)
        tracks = archive["trajectories"]
        weights: Any = archive.get("weights", ())  # files of older versions have none
        if tracks.dtype.kind not in "fiu":
            raise DataError(f"its trajectories are {tracks.dtype}; expected numbers")
        for name in ("labels", "groups", "channels"):
            if not isinstance(header[name], list) or not all(isinstance(word, str) for word in header[name]):
                raise DataError(f"its {name} are {str(header[name])[:40]}; expected a list of words")
        return Dataset(
            check_signals(tracks),
            tuple(header["labels"]),
            tuple(header["groups"]),
            str(header["source"]),
            tuple(map(str, header["notes"])),
            float(header["interval"]),
            tuple(header["channels"]),
            weights,
        )


def to_recording(dataset: Dataset) -> Recording:
    """Convert a data set to tracks that begin at 0 s; a number distinguishes the tracks of one group.

    Raises:
        DataError: the data set is not motion, has no x and y, or a number is not finite.
    """
    if dataset.kind != "motion":
        raise DataError(
            f"the data are {join_some(dataset.channels)}; expected tracks of {', '.join(CHANNELS)}"
        )
    check_signals(dataset.trajectories)
    counts: dict[str, int] = {}
    tracks = []
    for trajectory, label, group in zip(dataset.trajectories, dataset.labels, dataset.groups, strict=True):
        counts[group] = counts.get(group, 0) + 1
        name = group if counts[group] == 1 else f"{group}#{counts[group]}"
        values = strip_padding(trajectory)
        times = np.arange(values.shape[1], dtype=np.float64) * dataset.interval
        tracks.append(Track(name, times, dict(zip(dataset.channels, values, strict=True)), label, group))
    return Recording(tuple(tracks), dataset.source, dataset.notes)
