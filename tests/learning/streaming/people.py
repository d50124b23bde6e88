"""Classifiers that need no training, and people who walk, for the tests of this folder."""

from __future__ import annotations

import numpy as np
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.pipeline import Pipeline

from lcorpp.learning import ChannelStandardizer, LstmClassifier, Motion
from lcorpp.learning.classifiers.minirocket import MiniRocket
from lcorpp.learning.lstm.network import Weights


class ByWay(ClassifierMixin, BaseEstimator):
    """A classifier without memory: the further somebody went, the more interested; tracks of any length."""

    def __init__(self, *, least: int = 1) -> None:
        self.least = least
        self.asked: list[tuple[int, ...]] = []

    def fit(self, X, y):
        self.classes_ = np.unique(y)
        self.learnt_ = set(X[:, 0, 1])
        return self

    def predict_proba(self, X):
        self.asked.append(X.shape)
        if X.shape[2] < self.least:
            raise ValueError(f"at least {self.least} points are needed")
        way = np.hypot(*np.diff(X[:, :2]).transpose(1, 0, 2)).sum(axis=1)
        return np.stack([way, np.ones_like(way)], axis=1) / (1 + way)[:, None]


def walk(seed: int, samples: int = 60, inputs: int = 2) -> np.ndarray:
    """(inputs, samples) somebody on a random way, not faster than people are."""
    rng = np.random.default_rng(seed)
    return rng.normal(0, 5, (inputs, 1)) + np.cumsum(rng.uniform(-0.05, 0.05, (inputs, samples)), axis=1)


def lstm(*, classes: int = 2, inputs=("x", "y"), **motion) -> Pipeline:
    """An LSTM of 7 units with random weights behind Motion and ChannelStandardizer."""
    tracks = np.stack([walk(seed, inputs=len(inputs)) for seed in range(5)])
    first = Motion(inputs=inputs, **motion)
    scaling = ChannelStandardizer()
    rows = scaling.fit(first.fit_transform(tracks)).mean_
    rng = np.random.default_rng(1)
    weights = Weights.initialize(len(rows), 7, 1 if classes == 2 else classes, rng)
    names = np.array(["interested", "not_interested", "undecided"][:classes])
    classifier = LstmClassifier(units=7).restore_arrays({**weights.arrays(), "classes": names})
    return Pipeline([("motion", first), ("scaling", scaling), ("lstm", classifier)])


def by_way(*, least: int = 1, **motion) -> Pipeline:
    """A pipeline whose classifier has no memory."""
    tracks = np.stack([walk(seed) for seed in range(4)])
    pipeline = Pipeline([("motion", Motion(**motion)), ("way", ByWay(least=least))])
    return pipeline.fit(tracks, ["interested", "not_interested"] * 2)


def minirocket(*, inputs=("x", "y"), **motion) -> Pipeline:
    """MiniRocket of few features behind Motion and ChannelStandardizer, trained on random ways."""
    tracks = np.stack([walk(seed, samples=200, inputs=len(inputs)) for seed in range(8)])
    first, last = Motion(inputs=inputs, **motion), MiniRocket(features=252)
    pipeline = Pipeline([("motion", first), ("scaling", ChannelStandardizer()), ("minirocket", last)])
    return pipeline.fit(tracks, np.array(["interested", "not_interested"] * 4))


def batch(pipeline: Pipeline, times, samples) -> np.ndarray:
    """(K,) what the pipeline says of a whole track with time stamps."""
    return pipeline[1:].predict_proba(pipeline[0].transform_stamped(times, samples))[0]
