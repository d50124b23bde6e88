"""Tracks without a meaning, for tests of how a classifier computes."""

from __future__ import annotations

import numpy as np


def tracks(cases: int = 40, channels: int = 2, points: int = 8, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(cases, channels, points))


def labels(x: np.ndarray, classes: int = 2) -> np.ndarray:
    return np.array(["a", "b", "c"])[np.arange(len(x)) % classes]
