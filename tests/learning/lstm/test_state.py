from __future__ import annotations

import pickle

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import LstmClassifier

from .noise import labels, tracks


@pytest.fixture(scope="module", params=[2, 3])
def model(request: pytest.FixtureRequest) -> LstmClassifier:
    x = tracks(60, points=30)
    return LstmClassifier(units=20, epochs=3, learning_rate=0.05).fit(x, labels(x, request.param))


def test_advance_equals_predict_proba_of_every_prefix(model):
    x = tracks(40, points=30, seed=1)
    state = model.begin(len(x))
    for t in range(x.shape[2]):
        now = model.advance(state, x[:, :, t])
        np.testing.assert_allclose(now.sum(axis=1), 1, atol=1e-12)
        if t:  # a batch needs two points
            np.testing.assert_allclose(now, model.predict_proba(x[:, :, : t + 1]), atol=1e-6)


def test_tracks_do_not_affect_each_other(model):
    x = tracks(40, points=6, seed=2)
    together = model.begin(len(x))
    alone = [model.begin() for _ in x]
    for t in range(x.shape[2]):
        expected = model.advance(together, x[:, :, t])
        found = [model.advance(state, x[i : i + 1, :, t])[0] for i, state in enumerate(alone)]
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_taken_states_continue_some_tracks(model):
    x = tracks(5, points=6, seed=3)
    state = model.begin(5)
    for t in range(3):
        model.advance(state, x[:, :, t])
    some = state.take([3, 1])
    assert len(some) == 2
    for t in range(3, 6):
        now = model.advance(some, x[[3, 1], :, t])
    np.testing.assert_allclose(now, model.predict_proba(x[[3, 1]]), atol=1e-6)


def test_put_overwrites_the_states_of_some_tracks(model):
    x = tracks(5, points=6, seed=5)
    state = model.begin(5)
    for t in range(3):
        model.advance(state, x[:, :, t])
    some = state.take([3, 1])
    model.advance(some, x[[3, 1], :, 3])
    state.put([3, 1], some)
    for t in (4, 5):
        now = model.advance(state, x[:, :, t])
    np.testing.assert_allclose(now[[1, 3]], model.predict_proba(x[[1, 3]]), atol=1e-6)
    np.testing.assert_allclose(now[0], model.predict_proba(x[:1, :, [0, 1, 2, 4, 5]])[0], atol=1e-6)
    other = LstmClassifier(units=20, epochs=1).fit(x, labels(x))
    with pytest.raises(DataError, match="states of two classifiers"):
        state.put([0], other.begin())


def test_a_state_is_pickled_with_its_classifier(model):
    x = tracks(2, points=2, seed=4)
    state = model.begin(2)
    model.advance(state, x[:, :, 0])
    other, copy = pickle.loads(pickle.dumps((model, state)))
    assert np.array_equal(other.advance(copy, x[:, :, 1]), model.advance(state, x[:, :, 1]))


def test_malformed_points_are_errors_and_leave_the_state_unchanged(model):
    state = model.begin(2)
    model.advance(state, np.ones((2, 2)))
    before = state.hidden.copy(), state.cell.copy()
    for points, words in [
        (np.ones((3, 2)), r"points of shape \(2, 2\), one for each track, not \(3, 2\)"),
        (np.ones(2), r"not \(2,\)"),
        (np.ones((2, 3)), "2 channels, given 3"),
        (
            [[0.0, 0.0], [np.nan, 0.0]],
            r"track 1, channel 0 \(counted from 0\) is nan; expected a finite number",
        ),
        ([[0.0, np.inf], [0.0, 0.0]], "track 0, channel 1"),
        ([[0.0, 1e31], [0.0, 0.0]], "track 0, channel 1"),
    ]:
        with pytest.raises(DataError, match=words):
            model.advance(state, points)
    assert np.array_equal(state.hidden, before[0])
    assert np.array_equal(state.cell, before[1])


def test_a_state_of_another_training_is_an_error():
    x = tracks()
    model = LstmClassifier(units=2, epochs=1).fit(x, labels(x))
    state = model.begin()
    model.fit(x, labels(x))
    with pytest.raises(
        DataError, match="belongs to another classifier, or this one has been trained again since"
    ):
        model.advance(state, np.zeros((1, 2)))
