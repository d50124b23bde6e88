"""Rows of boxes in images: the point of each that stands for its person, and the rows that are people."""

from __future__ import annotations

from collections import Counter

import numpy as np

from lcorpp.learning.data.csv_reader import RowBatch
from lcorpp.values import Array

PEDESTRIAN = "Pedestrian"
"""The kind of the Stanford Drone Dataset whose rows are read; others ride or drive."""


def use_centres(batch: RowBatch, left_out: Counter[str]) -> RowBatch:
    """Use the centre of a box seen from above, of pedestrians in view."""
    lost = batch.numbers["lost"] != 0
    kinds = np.array([kind != PEDESTRIAN for kind in batch.texts["kind"]], dtype=bool)
    for kind in sorted(set(batch.texts["kind"]) - {PEDESTRIAN}):
        left_out[f"{kind or 'no kind'}"] += batch.texts["kind"].count(kind)
    left_out["lost pedestrians"] += int((lost & ~kinds).sum())
    batch = batch.take(np.flatnonzero(~(lost | kinds)))
    x = (batch.numbers["xmin"] + batch.numbers["xmax"]) / 2
    y = (batch.numbers["ymin"] + batch.numbers["ymax"]) / 2
    return _with_points(batch, x, y)


def use_world(batch: RowBatch, left_out: Counter[str]) -> RowBatch:
    """Use the position in the world, of rows that are to be considered (confidence above 0)."""
    ignored = batch.numbers["conf"] == 0
    left_out["confidence 0"] += int(ignored.sum())
    batch = batch.take(np.flatnonzero(~ignored))
    return _with_points(batch, batch.numbers["world x"], batch.numbers["world y"])


def use_feet(batch: RowBatch, left_out: Counter[str]) -> RowBatch:
    """Use the middle of the lower edge of a box in a camera's image, where the feet are."""
    ignored = batch.numbers["conf"] == 0
    left_out["confidence 0"] += int(ignored.sum())
    if "class" in batch.numbers:
        others = ~ignored & (batch.numbers["class"] != 1)
        left_out["classes other than 1, pedestrians"] += int(others.sum())
        ignored |= others
    batch = batch.take(np.flatnonzero(~ignored))
    x = batch.numbers["left"] + batch.numbers["width"] / 2
    return _with_points(batch, x, batch.numbers["top"] + batch.numbers["height"])


def _with_points(batch: RowBatch, x: Array, y: Array) -> RowBatch:
    return RowBatch(batch.lines, {**batch.numbers, "x": x, "y": y}, batch.texts)
