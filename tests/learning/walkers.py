"""Small data sets with a known answer, for the tests of this folder."""

from __future__ import annotations

import numpy as np

from lcorpp.values import Dataset


def walkers(cases: int = 60, *, points: int = 40, classes: int = 2, seed: int = 0) -> Dataset:
    """Straight walks of `classes` speeds from anywhere, in turn slow and fast; three walks a person."""
    rng = np.random.default_rng(seed)
    kind = np.arange(cases) // 3 % classes
    angle = rng.uniform(0, 2 * np.pi, cases)
    way = (1 + 2 * kind)[:, None] * np.linspace(0, 1, points)
    start = rng.normal(0, 20, (cases, 2, 1))
    tracks = start + np.stack([np.cos(angle), np.sin(angle)], axis=1)[:, :, None] * way[:, None]
    tracks += rng.normal(0, 0.02, tracks.shape)
    labels = tuple(("slow", "fast", "fastest")[k] for k in kind)
    return Dataset(tracks, labels, tuple(str(row // 3) for row in range(cases)))
