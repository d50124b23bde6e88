"""Learners on padded tracks: a track in a batch of longer ones counts as the track alone."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from lcorpp.errors import DataError
from lcorpp.learning import learner, train, with_prefix_ensemble
from lcorpp.values import Dataset, stack_signals

LENGTHS = (40, 60, 100, 304)
"""1.3 to 10 s."""


def walks(cases: int = 40, seed: int = 0) -> Dataset:
    """Random walks of all lengths, faster in one class."""
    rng = np.random.default_rng(seed)
    fast = rng.permutation(cases) % 2 == 0
    tracks = [
        rng.normal(0.03, 0.04 if is_fast else 0.02, size=(2, LENGTHS[case % len(LENGTHS)])).cumsum(axis=1)
        for case, is_fast in enumerate(fast)
    ]
    return Dataset(stack_signals(tracks), tuple(np.where(fast, "fast", "slow").tolist()))


def widen(tracks: np.ndarray) -> np.ndarray:
    """The same tracks with more padding."""
    return np.pad(tracks, ((0, 0), (0, 0), (0, 50)), constant_values=np.nan)


def make(name: str, **options):
    epochs = {"epochs": 2} if name.startswith("lstm") else {}
    return learner(name, **epochs, **options)


@pytest.mark.parametrize("name", ["lstm", "lstm-fast", "summaries", "forest", "minirocket"])
def test_padding_changes_nothing(name):
    data = walks(16)
    tracks, labels = data.trajectories, np.array(data.labels)
    trained = make(name).fit(tracks, labels)
    found = trained.predict_proba(tracks)
    assert np.isfinite(found).all()
    alone = [
        trained.predict_proba(track[None, :, :length])[0]
        for track, length in zip(tracks, data.lengths, strict=True)
    ]
    np.testing.assert_allclose(found, alone, atol=1e-6)
    again = make(name).fit(widen(tracks), labels)
    assert np.array_equal(trained.predict_proba(widen(tracks)), found)
    assert np.array_equal(again.predict_proba(tracks), found)


def test_a_prefix_ensemble_weighs_its_copies_by_the_length_of_each_track():
    data = walks()
    tracks, labels = data.trajectories, np.array(data.labels)
    trained = with_prefix_ensemble(make("lstm-fast")).fit(tracks, labels)
    alone = [
        trained.predict_proba(track[None, :, :length])[0]
        for track, length in zip(tracks, data.lengths, strict=True)
    ]
    np.testing.assert_allclose(trained.predict_proba(tracks), alone, atol=1e-6)
    again = with_prefix_ensemble(make("lstm-fast")).fit(widen(tracks), labels)
    assert np.array_equal(again.predict_proba(tracks), trained.predict_proba(tracks))


def test_a_series_may_have_unequal_lengths():
    data = walks()
    for name in ("lstm-fast", "summaries", "forest"):
        estimator = make(name, kind="series", inputs=("pitch", "loudness"))
        trained = estimator.fit(data.trajectories, np.array(data.labels))
        found = trained.predict_proba(data.trajectories)
        np.testing.assert_allclose(trained.predict_proba(data.trajectories[:1, :, :40]), found[:1], atol=1e-6)


def test_a_track_of_one_point_is_located():
    tracks = widen(walks(8).trajectories)
    tracks[3, :, 1:] = np.nan
    with pytest.raises(DataError, match=r"case 3 \(counted from 0\) has 1 time points, the others are NaN"):
        make("summaries").fit(tracks, np.array(["a", "b"] * 4))


def test_a_learner_that_cannot_take_padding_is_named_with_the_reason():
    data = walks()
    flat = make_pipeline(FunctionTransformer(lambda X: X.reshape(len(X), -1)), LogisticRegression())
    words = (
        r"failed in fit: .*contains NaN.*; expected fit\(X, y\) to accept X of shape \(40, 2, 304\), whose"
    )
    with pytest.raises(DataError, match=rf"(?s){words} shorter tracks end in NaN and y of the classes fast"):
        train(flat, data)
