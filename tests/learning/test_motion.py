from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.pipeline import make_pipeline

from lcorpp.errors import DataError
from lcorpp.learning import Motion, Scaling


def tracks(seed: int, cases: int = 4, channels: int = 2, points: int = 50) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(cases, channels, points)).cumsum(axis=2)


def test_every_second_point_relative_to_the_first():
    x = np.array([[[5.0, 6, 7, 8, 9], [1, 1, 2, 3, 5]]])
    assert Motion(points=3).fit_transform(x).tolist() == [[[0, 2, 4], [0, 1, 4]]]


def test_points_between_are_interpolated():
    x = np.array([[[1.0, 3], [0, 4]]])
    assert Motion(points=5).fit_transform(x).tolist() == [[[0, 0.5, 1, 1.5, 2], [0, 1, 2, 3, 4]]]


def test_further_channels_are_not_made_relative():
    x = np.array([[[1.0, 2], [1, 2], [7, 9]]])
    assert Motion(points=2).fit_transform(x)[0, 2].tolist() == [7, 9]


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), points=st.integers(2, 120))
def test_interpolation_agrees_with_numpy(seed, points):
    x = tracks(seed)
    at = np.linspace(0, 49, points)
    expected = np.array([[np.interp(at, np.arange(50), c) - c[0] for c in case] for case in x])
    np.testing.assert_allclose(Motion(points=points).fit_transform(x), expected, atol=1e-12)  # rounding


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), x=st.floats(-1e3, 1e3), y=st.floats(-1e3, 1e3))
def test_place_does_not_matter(seed, x, y):
    here = tracks(seed)
    there = here + np.array([x, y])[:, None]
    motion = Motion().fit(here)
    np.testing.assert_allclose(motion.transform(here), motion.transform(there), atol=1e-9)  # kilometres


def test_scaling_knows_the_training_data_only():
    train, other = tracks(1), 100 * tracks(2) + 7
    scaling = Scaling().fit(train)
    scaled = scaling.transform(train)
    np.testing.assert_allclose(scaled.mean(axis=(0, 2)), 0, atol=1e-12)
    np.testing.assert_allclose(scaled.std(axis=(0, 2)), 1, atol=1e-12)
    before = scaling.mean_.copy()
    np.testing.assert_allclose(
        scaling.transform(other), (other - train.mean((0, 2))[:, None]) / train.std((0, 2))[:, None]
    )
    assert np.array_equal(scaling.mean_, before)


def test_a_constant_channel_becomes_zero():
    x = np.concatenate([tracks(0), np.full((4, 1, 50), 3.0)], axis=1)
    assert np.all(Scaling().fit_transform(x)[:, 2] == 0)


def test_it_stands_in_a_pipeline_and_is_cloned():
    pipeline = clone(make_pipeline(Motion(points=7), Scaling()))
    assert pipeline.fit_transform(tracks(0)).shape == (4, 2, 7)
    assert pipeline.get_params()["motion__points"] == 7


@pytest.mark.parametrize(
    ("x", "words"),
    [
        (np.zeros((4, 50)), r"shape \(cases, channels, time points\), not \(4, 50\)"),
        (np.zeros((4, 2, 1)), "at least 2"),
        (np.full((1, 2, 3), np.nan), "case 0, channel 0, time point 0"),
        (np.zeros((1, 3, 9)), "trained on tracks of 2 channels, given 3"),
    ],
)
def test_bad_tracks_are_told(x, words):
    for step in (Motion(), Scaling()):
        with pytest.raises(DataError, match=words):
            step.fit(tracks(0)).transform(x)


def test_one_point_is_no_motion():
    with pytest.raises(DataError, match="at least 2 points, not 1"):
        Motion(points=1).fit(tracks(0))
