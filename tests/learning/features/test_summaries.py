"""SummaryFeatures of motion and the logistic regression on them: by hand, and equal to scikit-learn's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.linear_model import LogisticRegression

from lcorpp.errors import DataError
from lcorpp.learning import QuadraticLogistic, SummaryFeatures
from lcorpp.values import stack_signals


def path(x, y):
    return np.stack([x, y])[None].astype(float)


def test_summaries_of_a_straight_walk_and_a_return():
    t = np.arange(9) / 3
    straight = SummaryFeatures().fit_transform(path(1.2 * t, 0 * t))[0]
    np.testing.assert_allclose(straight[:8], [1.2, 1.2, 1.2, 1.2, 0, 1.2, 1.2, 1.2], atol=1e-9)  # speed
    np.testing.assert_allclose(straight[8:32], 0, atol=1e-9)  # no change of speed, no turning
    np.testing.assert_allclose(straight[-3:], [1.2 * t[-1], 1, 0])
    back = SummaryFeatures().fit_transform(path(np.minimum(t, t[-1] - t), 0 * t))[0]
    assert back[-2] == 0  # nothing of the way was made good
    assert back[24 + 6] == pytest.approx(np.pi)  # the largest turn
    still = SummaryFeatures().fit_transform(path(0 * t, 0 * t))[0]
    np.testing.assert_array_equal(still[:-1], 0)
    assert still[-1] == 1


@settings(max_examples=50)
@given(arrays(float, st.tuples(st.just(2), st.just(2), st.integers(2, 12)), elements=st.floats(-1e6, 1e6)))
def test_any_finite_track_has_finite_summaries(tracks):
    found = SummaryFeatures().fit_transform(tracks)
    assert found.shape[0] == 2
    assert np.isfinite(found).all()


@settings(max_examples=50)
@given(
    st.lists(st.integers(2, 40), min_size=1, max_size=6),
    st.integers(0, 10**6),
    st.integers(0, 3),
    st.sampled_from([3.0, None]),
)
def test_a_padded_track_has_the_summaries_of_the_track_alone(lengths, seed, padding, rate):
    rng, width = np.random.default_rng(seed), max(lengths) + padding
    alone = [rng.normal(size=(3, length)).cumsum(axis=1) for length in lengths]
    tracks = stack_signals([*alone, np.zeros((3, width))])[:-1]
    summaries = SummaryFeatures(rate=rate).fit(tracks)
    expected = np.concatenate([summaries.transform(track[None]) for track in alone])
    assert np.array_equal(summaries.transform(tracks), expected)


def test_tracks_and_arrays_of_other_shapes_are_errors():
    with pytest.raises(DataError, match="need x and y; the tracks have 1 channels"):
        SummaryFeatures().fit(np.zeros((3, 1, 5)))
    with pytest.raises(DataError, match="fitted to tracks of 2 channels, given 3"):
        SummaryFeatures().fit(np.zeros((3, 2, 5))).transform(np.zeros((3, 3, 5)))
    with pytest.raises(DataError, match="C must be"):
        QuadraticLogistic(C=0).fit(np.eye(4), ["a", "b", "a", "b"])


@pytest.mark.parametrize("classes", [2, 3])
def test_quadratic_logistic_equals_scikit_learn_on_features_and_squares(classes):
    rng = np.random.default_rng(0)
    y = np.arange(150) % classes
    X = rng.normal(y[:, None] * [1, 0, -1], 1, (150, 3))
    X[:, 1] = np.where(y == 0, X[:, 1], X[:, 1] * 4)  # told by its square alone
    mine = QuadraticLogistic(C=0.5).fit(X, y)
    z = np.clip((X - X.mean(axis=0)) / X.std(axis=0), -3, 3)
    both = np.concatenate([z, z**2 - 1], axis=1)
    theirs = LogisticRegression(C=0.5, max_iter=2000, class_weight="balanced").fit(both, y)
    np.testing.assert_allclose(mine.predict_proba(X), theirs.predict_proba(both), atol=1e-9)
    assert (mine.predict(X) == theirs.predict(both)).all()
    again = QuadraticLogistic(C=0.5).restore_arrays(mine.to_arrays())
    assert np.array_equal(again.predict_proba(X), mine.predict_proba(X))
    with pytest.raises(DataError, match="trained on 3 features, given shape"):
        mine.predict_proba(X[:, :2])
    with pytest.raises(DataError, match="needs finite weights"):
        QuadraticLogistic().restore_arrays({**mine.to_arrays(), "bias": np.zeros(7)})
