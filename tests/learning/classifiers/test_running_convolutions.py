"""MiniRocket point by point: its features are those of the batch, number for number."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning.classifiers.minirocket import MiniRocket

from .test_minirocket import make_waves

SHAPES = [(1, 26, 0), (2, 22, 1), (12, 18, 2), (3, 2, 3), (1, 80, 0), (12, 61, 2), (2, 200, 4)]
"""Channels, time points and seed."""

FAST = ((1, 26, 0), (12, 18, 2), (3, 2, 3))
"""Those whose model is quickly compared."""


def make_model(channels: int, points: int, seed: int = 0, features: int = 840) -> MiniRocket:
    return MiniRocket(features=features, random_state=seed).fit(*make_waves(12, channels, points, seed))


@pytest.mark.parametrize(
    ("channels", "points", "seed"),
    [s if s in FAST else pytest.param(*s, marks=pytest.mark.slow) for s in SHAPES],
)
def test_features_and_predictions_equal_the_batch_at_every_length(channels, points, seed):
    model = make_model(channels, points, seed)
    tracks = make_waves(3, channels, points + 10, seed + 1)[0]  # longer than those of the training
    state, counted = model.begin(3), model.begin(3)
    for end in range(1, points + 11):
        now = model.advance(state, tracks[:, :, end - 1])
        features = model._running.advance(counted, tracks[:, :, end - 1].astype(np.float32))
        if end < 30 or end % 10 < 2:  # an error stays in the counts
            assert np.array_equal(features, model._transform(tracks[:, :, :end]))
        if end > 1 and end % 10 < 2:  # a batch needs two points
            np.testing.assert_allclose(now, model.predict_proba(tracks[:, :, :end]), atol=1e-12)


def test_tracks_of_any_age_advance_together(monkeypatch):
    """People who come and go, in blocks of two: the prediction for each is that for the track alone."""
    monkeypatch.setattr("lcorpp.learning.classifiers.running_convolutions.BLOCK_SIZE", 2 * 840 * 4)
    model, rng = make_model(2, 40), np.random.default_rng(0)
    state, tracks = model.begin(7), [np.empty((2, 0)) for _ in range(7)]
    for _ in range(20):
        rows = rng.permutation(7)[: rng.integers(1, 8)]
        for row in rows[rng.uniform(size=len(rows)) < 0.04]:
            state.put([row], model.begin())
            tracks[row] = np.empty((2, 0))
        points = rng.normal(size=(len(rows), 2))
        some = state.take(rows)
        found = model.advance(some, points)
        state.put(rows, some)
        for row, point, now in zip(rows, points, found, strict=True):
            tracks[row] = np.column_stack([tracks[row], point])
            if tracks[row].shape[1] > 1 and row == rows[0]:  # each one in turn, as `rows` are drawn
                np.testing.assert_allclose(now, model.predict_proba(tracks[row][None])[0], atol=1e-12)
    assert state.lengths.tolist() == [track.shape[1] for track in tracks]


def test_a_copy_in_another_process_predicts_the_same():
    model = make_model(2, 30)
    again = pickle.loads(pickle.dumps(model))
    track = make_waves(1, 2, 30, 5)[0]
    one, other = model.begin(), again.begin()
    for t in range(30):
        assert np.array_equal(model.advance(one, track[:, :, t]), again.advance(other, track[:, :, t]))


def test_wrong_use_is_an_error():
    model, other = make_model(2, 30), make_model(2, 30)
    state = model.begin(3)
    assert repr(state) == "<RunningState of 3 tracks, 840 features>"
    for points in (np.zeros((3, 1)), np.zeros((2, 2)), np.full((3, 2), np.nan)):
        with pytest.raises(DataError, match=r"finite points of shape \(3, 2\), one for each track"):
            model.advance(state, points)
    with pytest.raises(DataError, match="belongs to another classifier"):
        other.advance(state, np.zeros((3, 2)))
    with pytest.raises(DataError, match="states of two classifiers"):
        other.begin(3).put([0], state.take([0]))
    assert not state.lengths.any()
    model.fit(*make_waves(12, 2, 30))
    with pytest.raises(DataError, match="trained again since"):
        model.advance(state, np.zeros((3, 2)))
