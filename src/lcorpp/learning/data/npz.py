"""Data sets in one file, exactly as they are, and as recordings."""

from __future__ import annotations

import io
import json
import tokenize
import zipfile
import zlib
from pathlib import Path

import numpy as np

from lcorpp.errors import DataError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.learning.data.dataset import check_tracks
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.values import Array, Dataset

FORMAT, VERSION = "lcorpp dataset", 1
SUFFIX = ".npz"

DAMAGED = (
    *(ValueError, LookupError, TypeError, AttributeError, ArithmeticError, MemoryError, RuntimeError),
    *(EOFError, OSError, zipfile.BadZipFile, zlib.error, SyntaxError, tokenize.TokenError),
)
"""What numpy, zipfile and json raise when bytes are not what they seem."""


def save_dataset(dataset: Dataset, path: str | Path) -> None:
    """Write a data set as a numpy archive (.npz) that holds numbers and JSON, nothing that runs.

    Raises:
        FileError: the file cannot be written.
    """
    head = {
        "format": FORMAT,
        "version": VERSION,
        "labels": dataset.labels,
        "groups": dataset.groups,
        "source": dataset.source,
        "notes": dataset.notes,
        "interval": dataset.interval,
        "channels": dataset.channels,
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, dataset=np.array(json.dumps(head)), trajectories=dataset.trajectories)
    write_atomically(path, buffer.getvalue())


def load_dataset(path: str | Path) -> Dataset:
    """Read what `save_dataset` wrote, to the last bit.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: it is not such a file, is damaged or of a newer version, or a number is not finite.
    """
    content = read_bytes(path)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            head, tracks = json.loads(str(archive["dataset"])), archive["trajectories"]
        if tracks.dtype.kind not in "fiu":
            raise DataError(f"its trajectories are {tracks.dtype}; expected numbers")
        for name in ("labels", "groups", "channels"):
            if not isinstance(head[name], list) or not all(isinstance(word, str) for word in head[name]):
                raise DataError(f"its {name} are {str(head[name])[:40]}; expected a list of words")
        if head["format"] != FORMAT or head["version"] != VERSION:
            raise DataError(
                f"{head['format']!r} of version {head['version']!r}; expected {FORMAT!r} {VERSION}"
            )
        return Dataset(
            check_tracks(tracks),
            tuple(map(str, head["labels"])),
            tuple(map(str, head["groups"])),
            str(head["source"]),
            tuple(map(str, head["notes"])),
            float(head["interval"]),
            tuple(map(str, head["channels"])),
        )
    except DataError as error:
        raise DataError(f"{path}: not a data set that can be used: {error}") from None
    except DAMAGED as error:
        why = "it is no numpy archive" if "pickle" in str(error) else error  # numpy's advice would be bad
        raise DataError(f"{path}: not a stored data set, or a damaged one: {why}") from None


def to_recording(dataset: Dataset) -> Recording:
    """A data set as tracks that all begin at 0 s; several of one group are told apart by a number.

    Raises:
        DataError: it has no x and y, or a number that is not finite.
    """
    check_tracks(dataset.trajectories)
    times: Array = np.arange(dataset.trajectories.shape[2], dtype=np.float64) * dataset.interval
    seen: dict[str, int] = {}
    tracks = []
    for trajectory, label, group in zip(dataset.trajectories, dataset.labels, dataset.groups, strict=True):
        seen[group] = seen.get(group, 0) + 1
        name = group if seen[group] == 1 else f"{group}#{seen[group]}"
        columns = dict(zip(dataset.channels, trajectory, strict=True))
        tracks.append(Track(name, times, columns, label, group))
    return Recording(tuple(tracks), dataset.source, dataset.notes)
