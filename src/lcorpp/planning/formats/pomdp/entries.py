"""Single numbers of a table as statements gave them, in the order of the text."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.planning.formats.pomdp.tokens import Places
from lcorpp.values import Array

Indices = npt.NDArray[np.int64]


class Entries:
    """Statements of one number each, kept in chunks.

    axes: how many indices a number has; an index may be `ALL`.
    """

    def __init__(self, axes: int) -> None:
        self._axes = axes
        self._chunks: list[tuple[Indices, Array, Places]] = []

    def add(self, indices: npt.ArrayLike, values: npt.ArrayLike, places: npt.ArrayLike) -> None:
        """Add indices (n, axes), values (n,) and their offsets in the text (n,), later than all before."""
        self._chunks.append(
            (
                np.asarray(indices, dtype=np.int64).reshape(-1, self._axes),
                np.asarray(values, dtype=np.float64).reshape(-1),
                np.asarray(places, dtype=np.int64).reshape(-1),
            )
        )

    def clear(self) -> None:
        """Forget all: a later statement replaces them."""
        self._chunks.clear()

    def arrays(self) -> tuple[Indices, Array, Places]:
        """(n, axes) indices, (n,) values and (n,) places of all."""
        if not self._chunks:
            return np.zeros((0, self._axes), dtype=np.int64), np.zeros(0), np.zeros(0, dtype=np.int64)
        if len(self._chunks) > 1:
            parts = zip(*self._chunks, strict=True)
            self._chunks = [tuple(np.concatenate(part) for part in parts)]  # type: ignore[list-item]
        return self._chunks[0]


def last_of_each(keys: Indices) -> npt.NDArray[np.intp]:
    """The index of the last occurrence of each key, rising."""
    order = np.argsort(keys, kind="stable")
    last = np.ones(len(keys), dtype=bool)
    last[:-1] = keys[order][1:] != keys[order][:-1]
    return np.sort(order[last])
