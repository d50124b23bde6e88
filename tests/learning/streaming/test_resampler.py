from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import DataError
from lcorpp.learning.features.resampling import resample
from lcorpp.learning.streaming.resampler import RepairCounts, StreamRules, TrackResampler

INPUTS = ("x", "y", "facing")


def rules(**changed: float) -> StreamRules:
    usual = {
        "rate": 2.0,
        "allowed_lateness": 0.0,
        "max_gap": 1.0,
        "max_duration": 60.0,
        "max_speed": 12.0,
        "max_silence": 5.0,
    }
    return StreamRules(**{**usual, **changed})


def track(**changed: float) -> TrackResampler:
    return TrackResampler(rules(**changed), INPUTS, (2,))


def still(x: float = 0.0) -> tuple[float, ...]:
    return (x, 0.0, 0.0)


def points(of: TrackResampler, samples) -> list[tuple[float, ...]]:
    """What becomes known of samples (time, x), in turn, from the beginning of the present track."""
    found: list[tuple[float, ...]] = []
    for time, x in samples:
        of.add(time, still(x))
        more, anew = of.take_points()
        found = [*more] if anew else [*found, *more]
    return found


def test_by_hand():
    """Two points a second of samples at 10, 10.2, 10.6, 11 s."""
    one = track()
    assert points(one, [(10, 0), (10.2, 2)]) == [still(0)]
    assert (one.point_count, one.time) == (1, 10)
    assert points(one, [(10.6, 4)]) == [pytest.approx(still(3.5))]
    assert points(one, [(11, 5)]) == [still(5)]
    assert (one.track_count, one.point_count, one.time) == (1, 3, 11)
    assert str(one.repairs) == "4 samples"


def test_one_gap_can_complete_several_points():
    assert points(track(rate=4.0), [(0, 0), (1, 4)]) == [still(x) for x in range(5)]


@settings(max_examples=100)
@given(
    seed=st.integers(0, 10**6),
    rate=st.floats(0.5, 40),
    origin=st.sampled_from([0.0, 1.7e9]),
    end=st.integers(1, 50),
)
def test_points_equal_those_of_resample(seed, rate, origin, end):
    rng = np.random.default_rng(seed)
    times = (origin + np.cumsum(rng.choice([0.033, 0.2, 0.9], 50) * rng.uniform(0.3, 1.1, 50)))[:end]
    samples = np.cumsum(rng.uniform(-0.05, 0.05, (3, 50)), axis=1)[:, :end]
    samples[2] = rng.uniform(-10, 10, end)
    one = TrackResampler(rules(rate=rate), INPUTS, (2,))
    found = []
    for time, sample in zip(times.tolist(), samples.T.tolist(), strict=True):
        one.add(time, tuple(sample))
        found += one.take_points()[0]
        assert len(found) == one.point_count
    expected = resample(times, samples, rate, angles=(2,))
    assert np.array(found).T.shape == expected.shape
    np.testing.assert_allclose(np.array(found).T, expected, rtol=0, atol=1e-12)  # rounding of one product


@settings(max_examples=100)
@given(seed=st.integers(0, 10**6), lateness=st.floats(0.02, 0.9))
def test_the_order_of_arrival_within_the_allowed_lateness_does_not_matter(seed, lateness):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.01, 0.1, 60) + (rng.uniform(size=60) < 0.05) * 1.5)
    xs = np.cumsum(rng.uniform(-0.05, 0.05, 60))
    arrival = np.argsort(times + rng.uniform(0, 0.99 * lateness, 60))
    results = []
    for order in (np.arange(60), arrival):
        one = track(allowed_lateness=lateness)
        found = points(one, zip(times[order].tolist(), xs[order].tolist(), strict=True))
        one.flush()
        more, anew = one.take_points()
        results.append((more if anew else [*found, *more], one.track_count, one.repairs))
    assert results[0] == results[1]
    assert results[0][2].late == 0


def test_samples_are_used_once_the_allowed_lateness_has_passed():
    one = track(allowed_lateness=0.3)
    assert points(one, [(0.1, 1), (0.0, 0), (0.29, 2)]) == []
    assert points(one, [(0.4, 4)]) == [still(0)]
    assert points(one, [(0.85, 8.5), (0.79, 7.9), (0.5, 5)]) == [still(5)]


def test_late_samples_are_dropped_and_counted():
    one = track()
    assert points(one, [(0, 0), (0.55, 5.5), (0.45, 9), (0.54, 9)]) == [still(0), pytest.approx(still(5))]
    assert str(one.repairs) == "4 samples; late samples dropped: 2; gaps interpolated: 1"
    patient = track(allowed_lateness=0.2)
    points(patient, [(0, 0), (0.5, 0), (0.25, 0), (0.29, 0)])
    assert patient.repairs.late == 0
    points(patient, [(0.24, 0), (0.29, 0), (0.299, 1)])
    assert (patient.repairs.late, patient.repairs.duplicates) == (1, 1)


def test_the_first_of_two_samples_with_equal_stamps_is_kept():
    for lateness in (0.0, 0.2):
        one = track(allowed_lateness=lateness)
        found = points(one, [(0, 0), (0.5, 1), (0.5, 2), (1.0, 3), (1.0, 7), (1.5, 4)])
        assert found[:3] == [still(0), still(1), still(3)]
        assert one.repairs.duplicates == 2


@pytest.mark.parametrize(
    ("time", "sample", "words"),
    [
        (0.5, (0.0, math.nan, 0.0), "y is nan at 0.500 s"),
        (0.5, (math.inf, 0.0, 0.0), "x is inf at 0.500 s"),
        (0.5, (0.0, 0.0, 1e300), "facing is 1e+300 at 0.500 s"),
        (math.nan, (0.0, 0.0, 0.0), "its time is nan"),
        (math.inf, (0.0, 0.0, 0.0), "its time is inf"),
    ],
)
def test_samples_that_are_not_finite_are_rejected_and_the_track_continues(time, sample, words):
    one = track()
    one.add(0.0, still(0))
    one.add(time, sample)
    one.add(0.4, (math.nan,) * 3)
    one.add(1.0, still(1))
    assert one.take_points() == ([still(0), still(0.5), still(1)], True)
    assert str(one.repairs) == f"4 samples; rejected: 2 (the first: {words}); gaps interpolated: 1"


def test_short_gaps_are_interpolated_and_long_gaps_begin_a_new_track():
    one = track()
    assert points(one, [(0, 0), (1.0, 2)]) == [still(0), still(1), still(2)]
    assert (one.track_count, one.repairs.interpolated_gaps, one.repairs.long_gaps) == (1, 1, 0)
    assert points(one, [(2.01, 3), (2.51, 4)]) == [still(3), still(4)]
    assert (one.track_count, one.repairs.interpolated_gaps, one.repairs.long_gaps, one.time) == (
        2,
        1,
        1,
        2.51,
    )


def test_an_impossible_speed_begins_a_new_track():
    one = track()
    assert points(one, [(0, 0), (0.03, 1.5), (0.06, 0), (0.09, 5)]) == [still(5)]
    assert (one.track_count, one.repairs.jumps) == (2, 1)
    millimetres = track()
    assert points(millimetres, [(step * 0.033, step * 40.0) for step in range(90)]) == [still(89 * 40.0)]
    assert millimetres.repairs.jumps == 89


def test_a_clock_that_goes_back_begins_a_new_track():
    for lateness in (0.0, 0.2):
        one = track(allowed_lateness=lateness)
        found = points(one, [(100, 0), (100.5, 1), (101, 2), (3, 7), (3.5, 8), (4, 9)])
        assert found[:2] == [still(7), still(8)]
        assert (one.track_count, one.repairs.clock_resets, one.repairs.late) == (2, 1, 0)


def test_a_new_track_begins_after_the_maximal_duration():
    one = track(max_duration=2.0)
    assert points(one, [(step * 0.25, step) for step in range(10)]) == [still(9)]
    assert (one.track_count, one.repairs.overlong_tracks, one.time) == (2, 1, 2.25)


def test_repair_counts_are_added():
    total = RepairCounts(samples=3, rejected=1, first_rejected="a")
    total.add(RepairCounts(samples=2, rejected=2, first_rejected="b", jumps=1))
    assert total == RepairCounts(samples=5, rejected=3, first_rejected="a", jumps=1)
    assert str(total) == "5 samples; rejected: 3 (the first: a); new tracks after jumps: 1"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            {"allowed_lateness": -0.1},
            "allowed_lateness must be at least 0 and at most max_gap, 1 s, not -0.1",
        ),
        ({"allowed_lateness": 1.1}, "not 1.1"),
        ({"allowed_lateness": math.nan}, "not nan"),
        ({"max_gap": 0.0}, "max_gap must be above 0, not 0.0"),
        ({"max_gap": math.inf}, "max_gap must be finite, not inf"),
        ({"max_silence": 0.5}, "max_silence must be at least max_gap, 1 s, not 0.5"),
        ({"max_speed": math.nan}, "max_speed must be above 0, not nan"),
        ({"max_duration": 0.9}, "max_duration must be at least two points, 1 s, not 0.9"),
    ],
)
def test_rules_out_of_range_are_errors(changed, words):
    with pytest.raises(DataError, match=words):
        rules(**changed)
