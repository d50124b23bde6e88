from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import DataError
from lcorpp.learning.features.resampling import resample


def test_by_hand():
    """Samples at 10, 10.4, 11, 12.5 s; a point each second: the first, the third, and two thirds on."""
    assert resample([10, 10.4, 11, 12.5], [[0, 4, 10, 25]], 1.0).tolist() == [[0, 10, 20]]


def test_a_sample_within_a_microsecond_is_the_point_itself():
    track = [[0.0, 1, 9]]
    assert resample([0, 1 - 9e-7, 1.5], track, 1.0).tolist() == [[0, 1]]
    assert resample([0, 1 - 3e-6, 1.5], track, 1.0)[0, 1] == pytest.approx(1 + 8 * 3e-6 / 0.5, rel=1e-4)


def test_one_sample_is_one_point():
    assert resample([7.0], [[3.0], [4.0]], 3.0).tolist() == [[3], [4]]


@settings(max_examples=50)
@given(seed=st.integers(0, 10**6), rate=st.floats(0.5, 40), origin=st.sampled_from([0.0, 1.7e9]))
def test_random_times_agree_with_numpy(seed, rate, origin):
    rng = np.random.default_rng(seed)
    times = origin + np.cumsum(rng.uniform(1e-3, 0.4, 40))
    track = rng.normal(size=(3, 40)).cumsum(axis=1)
    found = resample(times, track, rate)
    elapsed = times - times[0]
    at = np.arange(found.shape[1]) / rate
    assert at[-1] - 1e-6 <= elapsed[-1] < at[-1] + 1 / rate + 1e-6
    expected = np.array([np.interp(at, elapsed, channel) for channel in track])
    np.testing.assert_allclose(found, expected, atol=5e-3)  # a microsecond at up to 4000 a second


@settings(max_examples=50)
@given(seed=st.integers(0, 10**6), end=st.integers(1, 40))
def test_a_prefix_of_samples_gives_a_prefix_of_points(seed, end):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(1e-3, 0.4, 40))
    track = rng.normal(size=(3, 40))
    part = resample(times[:end], track[:, :end], 3.0, angles=(2,))
    assert np.array_equal(part, resample(times, track, 3.0, angles=(2,))[:, : part.shape[1]])


@pytest.mark.parametrize(
    ("times", "samples", "words"),
    [
        ([], np.zeros((2, 0)), r"not \(0,\) and \(2, 0\)"),
        ([0, 1], np.zeros((2, 3)), r"not \(2,\) and \(2, 3\)"),
        ([0, np.nan, 2], np.zeros((2, 3)), r"sample 1 \(counted from 0\): its time is not finite"),
        ([0, 1, 2], [[0, 0, np.inf]], r"sample 2 \(counted from 0\): it is not finite"),
        ([0, 2, 2], np.zeros((2, 3)), "sample 2 .* has time 2 s, its predecessor 2 s; expected incr"),
        ([0, 2, 1.5], np.zeros((2, 3)), "sample 2 .* has time 1.5 s"),
        ([0, 1e12], np.zeros((2, 2)), r"the track lasts 1e\+12 s; expected less than 1e\+07 s"),
    ],
)
def test_malformed_samples_are_located(times, samples, words):
    with pytest.raises(DataError, match=words):
        resample(times, samples, 1.0)
