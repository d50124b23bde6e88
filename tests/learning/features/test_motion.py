from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.pipeline import make_pipeline

from lcorpp.errors import DataError
from lcorpp.learning import ChannelStandardizer, Motion
from lcorpp.learning.features.motion_features import MOTION_FEATURES, TrackHistory
from lcorpp.values import stack_signals, strip_padding

ALL = ("x", "y", "velocity", "heading", "facing")
GAZE = ("gaze_angle", "robot_angle", "face_distance")
FEATURES = tuple(name for name, known in MOTION_FEATURES.items() if not known.needs[0] & set(GAZE))
OF_GAZE = tuple(name for name in MOTION_FEATURES if name not in FEATURES)
OWN = ("velocity", "acceleration", "turn_rate", "ahead", "left", "facing_ahead")
"""The features that are the same from wherever a person is seen."""
SECOND = {"rate": 1.0, "interval": 0.5}
"""Every second sample comes out."""


def tracks(seed: int, cases: int = 4, channels: int = 2, points: int = 50) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(cases, channels, points)).cumsum(axis=2)


def rows_of(x, **parameters) -> dict[str, list[float]]:
    """The rows of one case by name, rounded."""
    motion = Motion(**{**SECOND, **parameters})
    rows = motion.fit_transform(np.array([x], dtype=float))[0]
    return dict(zip(motion.rows_, np.round(rows, 9).tolist(), strict=True))


def test_every_second_point_relative_to_the_first():
    assert rows_of([[5.0, 6, 7, 8, 9], [1, 1, 2, 3, 5]]) == {"x": [0, 2, 4], "y": [0, 1, 4]}


def test_points_between_samples_are_interpolated():
    assert rows_of([[1.0, 3], [0, 4]], rate=4, interval=1)["y"] == [0, 1, 2, 3, 4]


def test_the_papers_tracks_become_thirty_points():
    assert Motion().fit_transform(tracks(0, points=304)).shape == (4, 2, 30)


def test_speed_and_heading_of_a_walk_known_by_hand():
    """One metre ahead, then two to the left, then standing: a second each, the last sample not reached."""
    found = rows_of([[0, 0.5, 1, 1, 1, 1, 1, 9], [0, 0, 0, 1, 2, 2, 2, 9]], features=("velocity", "heading"))
    assert found == {"velocity": [0, 1, 2, 0], "heading_cos": [0, 1, 0, 0], "heading_sin": [0, 0, 1, 0]}


def test_measured_speed_and_heading_are_used_unchanged():
    east, west = [0.0] * 3, [np.pi] * 3
    x = [[0, 1, 2], [0, 0, 0], [7.0, 7, 8], west, east]
    found = rows_of(x, inputs=ALL, features=("velocity", "heading", "facing"))
    assert found["velocity"] == [7, 8]
    assert found["heading_cos"] == [-1, -1]
    assert found["facing_cos"] == [1, 1]


def test_angles_are_interpolated_the_shorter_way_round():
    """From 170 degrees to -170: half way is 180, not 0; the number of turns counted does not matter."""
    for turns in (0, 2 * np.pi, -4 * np.pi):
        x = [[0, 0], [0, 0], [np.deg2rad(170), np.deg2rad(-170) + turns]]
        found = rows_of(x, inputs=("x", "y", "facing"), features=("facing",), rate=2, interval=1)
        assert found["facing_cos"] == pytest.approx([np.cos(np.deg2rad(170)), -1, np.cos(np.deg2rad(170))])
        assert found["facing_sin"][1] == pytest.approx(0, abs=1e-9)


def test_features_relative_to_the_robot_of_a_known_track():
    """A person three metres before a robot that looks along y comes on, looking to the robot's left."""
    x = [[1, 1, 1], [5, 4.5, 4], [np.pi] * 3]
    found = rows_of(x, inputs=("x", "y", "facing"), features=FEATURES, robot=(1.0, 2.0, np.pi / 2))
    assert found == {
        "x": [0, -1],
        "y": [0, 0],
        "velocity": [0, 1],
        "heading_cos": [0, -1],
        "heading_sin": [0, 0],
        "facing_cos": [0, 0],
        "facing_sin": [1, 1],
        "acceleration": [0, 0],
        "turn_rate": [0, 0],
        "ahead": [0, 1],
        "left": [0, 0],
        "facing_ahead_cos": [0, 0],
        "facing_ahead_sin": [0, -1],
        "approach_cos": [0, 1],
        "approach_sin": [0, 0],
        "attention_cos": [0, 0],
        "attention_sin": [-1, -1],  # a quarter turn clockwise from the robot
        "distance": [3, 2],
        "distance_rate": [0, -1],
        "bearing_cos": [1, 1],
        "bearing_sin": [0, 0],
        "bearing_rate": [0, 0],
    }


def test_turning_and_acceleration_of_a_walk_known_by_hand():
    """North for .3 m, then .4 m; a metre west, then standing, then east."""
    x = [[1, 1, 1, 0, 0, 0.5], [2, 2.3, 2.7, 2.7, 2.7, 2.7]]
    found = rows_of(x, rate=2, features=(*OWN[:5], "bearing_rate"))
    assert found["velocity"] == [0, 0.6, 0.8, 2, 0, 1]
    assert found["acceleration"] == pytest.approx([0, 0, 0.4, 2.4, -4, 2])
    assert found["turn_rate"] == pytest.approx([0, 0, 0, np.pi, 0, 0])  # a quarter turn to the left in .5 s
    assert found["ahead"] == pytest.approx([0, 0.3, 0.7, 0.7, 0.7, 0.7])
    assert found["left"] == pytest.approx([0, 0, 0, 1, 1, 0.5])
    assert found["bearing_rate"][3] == pytest.approx(2 * np.arctan2(1, 2.7))


def test_changes_of_measured_speed_and_heading():
    x = [[0.0] * 4, [0.0] * 4, [1.0, 2, 0.05, 2], [0, np.pi / 2, 0, 3], [0.0, 1, 2, 3]]
    found = rows_of(x, rate=2, inputs=ALL, features=("acceleration", "turn_rate", "facing_ahead"))
    assert found["acceleration"] == pytest.approx([0, 2, -3.9, 3.9])
    assert found["turn_rate"] == pytest.approx([0, np.pi, 0, 0])
    assert found["facing_ahead_cos"] == pytest.approx(np.cos([0, 1 - np.pi / 2, 2, 0]))
    assert found["facing_ahead_sin"] == pytest.approx(np.sin([0, 1 - np.pi / 2, 2, 0]))


def test_a_track_that_stays_near_its_first_point_leads_ahead():
    found = rows_of([[0, 0.1, 0.1, -0.2], [0, 0, 0.2, 0.1]], rate=2, features=("ahead", "left"))
    assert found["ahead"] == pytest.approx([0, 0.1, np.hypot(0.1, 0.2), np.hypot(0.2, 0.1)])
    assert found["left"] == pytest.approx([0] * 4)


def test_gaze_known_by_hand():
    """A person looks past the robot, then straight at it, then away, farther off than people interact."""
    x = [[np.pi / 6, 0, np.pi / 2], [0, 0, 0], [2, 1.5, 4.5]]
    found = rows_of(x, rate=2, inputs=GAZE, features=OF_GAZE)
    assert found["gaze_angle"] == pytest.approx(x[0])
    assert found["gaze_rate"] == pytest.approx([0, -np.pi / 3, np.pi])
    assert found["looks"] == [0, 1, 0]
    assert found["mutual_gaze"] == pytest.approx([2 / 3, 1, 0])  # 1 - tan(30) / tan(60)
    assert found["social_engagement"] == pytest.approx([1 / 3, 2 / 3, 0])
    assert found["face_distance"] == [2, 1.5, 4.5]
    assert found["face_distance_rate"] == pytest.approx([0, -1, 6])


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_gaze_does_not_depend_on_the_pose_of_the_robot(seed):
    """Trackers of faces measure it from the robot's head."""
    x = np.concatenate([measured(seed)[:, :2], np.abs(tracks(seed, channels=3)) % np.pi], axis=1)
    motion = {"inputs": ("x", "y", *GAZE), "features": OF_GAZE}
    seen = Motion(**motion).fit_transform(x)
    assert np.array_equal(seen, Motion(robot=(1.0, -2.0, 0.3), **motion).fit_transform(x))


def measured(seed: int, points: int = 50) -> np.ndarray:
    x = tracks(seed, channels=5, points=points)
    x[:, 2] = np.abs(x[:, 2])
    return x


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), rate=st.floats(0.7, 60), points=st.integers(2, 120))
def test_interpolation_agrees_with_numpy(seed, rate, points):
    interval = 3 / rate / (points - 1) * 1.01
    x = tracks(seed, points=points)
    at = np.arange(4) / rate
    expected = np.array([[np.interp(at, np.arange(points) * interval, c) - c[0] for c in case] for case in x])
    found = Motion(rate=rate, interval=interval).fit_transform(x)
    np.testing.assert_allclose(found, expected, atol=1e-9)  # rounding of times, times the speed


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), rate=st.sampled_from([2.7, 3.0, 30.0, 1 / 0.033]), end=st.integers(16, 50))
def test_a_prefix_of_a_track_gives_a_prefix_of_its_motion(seed, rate, end):
    for inputs, x in ((ALL, measured(seed)), (("x", "y", "facing"), measured(seed)[:, [0, 1, 4]])):
        motion = Motion(rate=rate, inputs=inputs, features=FEATURES, robot=(1.0, -2.0, 0.3)).fit(x)
        part = motion.transform(x[:, :, :end])
        assert np.array_equal(part, motion.transform(x)[:, :, : part.shape[2]])
        assert part.shape[2] >= 2
        assert part.shape[2] == int((end - 1) * 0.033 * rate + 1e-6) + 1


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), x=st.floats(-1e3, 1e3), y=st.floats(-1e3, 1e3))
def test_relative_features_do_not_depend_on_place(seed, x, y):
    here = measured(seed)
    there = here + np.array([x, y, 0, 0, 0])[:, None]
    motion = Motion(inputs=ALL, features=ALL).fit(here)
    np.testing.assert_allclose(motion.transform(here), motion.transform(there), atol=1e-9)  # kilometres


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), x=st.floats(-50, 50), y=st.floats(-50, 50), turned=st.floats(-9, 9))
def test_features_do_not_depend_on_the_frame_of_the_tracks(seed, x, y, turned):
    here = measured(seed)
    cosine, sine = np.cos(turned), np.sin(turned)
    there = here + np.array([0, 0, 0, turned, turned])[:, None]
    there[:, 0] = cosine * here[:, 0] - sine * here[:, 1] + x
    there[:, 1] = sine * here[:, 0] + cosine * here[:, 1] + y
    for inputs, rows in ((ALL, [0, 1, 2, 3, 4]), (("x", "y", "facing"), [0, 1, 4])):
        parameters = {"inputs": inputs, "features": FEATURES}
        seen = Motion(robot=(0, 0, 0), **parameters).fit_transform(here[:, rows])
        same = Motion(robot=(x, y, turned), **parameters).fit_transform(there[:, rows])
        np.testing.assert_allclose(seen, same, atol=1e-6)  # a short step has a direction to 1e-7


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), x=st.floats(-50, 50), y=st.floats(-50, 50), turned=st.floats(-9, 9))
def test_own_features_do_not_depend_on_where_the_robot_stands(seed, x, y, turned):
    for inputs, rows in ((ALL, [0, 1, 2, 3, 4]), (("x", "y", "facing"), [0, 1, 4])):
        seen = measured(seed)[:, rows]
        one = Motion(inputs=inputs, features=OWN).fit_transform(seen)
        other = Motion(inputs=inputs, features=OWN, robot=(x, y, turned)).fit_transform(seen)
        np.testing.assert_allclose(one, other, atol=1e-6)


@pytest.mark.parametrize(
    "inputs", [ALL, ("x", "y", "facing"), ("velocity", "heading", "facing"), ("x", "y", *GAZE)]
)
def test_features_of_points_one_by_one_equal_those_of_the_track(inputs):
    """Number for number, of people who walk, stand and vanish."""
    known = (*ALL, *GAZE)
    measurements = np.concatenate([measured(3), np.abs(tracks(4, channels=3)) % np.pi], axis=1)
    points = measurements[:, [known.index(name) for name in inputs]]
    points[1] = points[1, :, :1]
    points[2, :, 20:] = points[2, :, 20:21]
    points[3, :, 30:] = np.nan
    usable = [
        name for name in MOTION_FEATURES if any(need <= set(inputs) for need in MOTION_FEATURES[name].needs)
    ]
    motion = Motion(inputs=inputs, features=usable).fit(points[:3])
    history = TrackHistory(*np.full((4, 4, len(inputs), 1), np.nan))
    found = []
    for now in np.split(points, points.shape[2], axis=2):
        history = history.at(now, inputs)
        found.append(motion.compute_features(now, history))
        history = history.after(now)
    whole = motion.transform_points(points)
    assert np.array_equal(np.concatenate(found, axis=2), whole, equal_nan=True)
    assert np.isnan(whole[3, :, 30:]).all()
    assert np.isfinite(whole[3, :, :30]).all()


def test_standardization_uses_the_training_data_only():
    train, other = tracks(1), 100 * tracks(2) + 7
    scaling = ChannelStandardizer().fit(train)
    scaled = scaling.transform(train)
    np.testing.assert_allclose(scaled.mean(axis=(0, 2)), 0, atol=1e-12)
    np.testing.assert_allclose(scaled.std(axis=(0, 2)), 1, atol=1e-12)
    before = scaling.mean_.copy()
    np.testing.assert_allclose(
        scaling.transform(other), (other - train.mean((0, 2))[:, None]) / train.std((0, 2))[:, None]
    )
    assert np.array_equal(scaling.mean_, before)


def test_padding_does_not_count_in_the_standardization():
    long, short = tracks(1), tracks(2, points=20)
    scaling = ChannelStandardizer().fit(stack_signals([*long, *short]))
    numbers = np.concatenate([np.moveaxis(each, 1, 0).reshape(2, -1) for each in (long, short)], axis=1)
    np.testing.assert_allclose(scaling.mean_, numbers.mean(axis=1))
    np.testing.assert_allclose(scaling.scale_, numbers.std(axis=1))
    equal = ChannelStandardizer().fit(long)
    assert np.array_equal([equal.mean_, equal.scale_], [long.mean((0, 2)), long.std((0, 2))])


@settings(max_examples=30)
@given(
    seed=st.integers(0, 10**6),
    rate=st.sampled_from([2.7, 3.0, 30.0, 1 / 0.033]),
    lengths=st.lists(st.integers(16, 50), min_size=4, max_size=4),
)
def test_a_padded_track_has_the_motion_of_the_track_alone(seed, rate, lengths):
    alone = [track[:, :length] for track, length in zip(measured(seed), lengths, strict=True)]
    motion = Motion(rate=rate, inputs=ALL, features=FEATURES, robot=(1.0, -2.0, 0.3))
    found = motion.fit_transform(stack_signals(alone))
    for track, points in zip(alone, found, strict=True):
        assert np.array_equal(strip_padding(points), motion.transform(track[None])[0])


@pytest.mark.parametrize("value", [3.0, 0.1])  # the sum of many .1 is rounded
def test_a_constant_channel_becomes_zero(value):
    x = np.concatenate([tracks(0), np.full((4, 1, 50), value)], axis=1)
    scaling = ChannelStandardizer().fit(x)
    np.testing.assert_allclose(scaling.transform(x)[:, 2], 0, atol=1e-12)
    np.testing.assert_allclose(scaling.transform(x + 0.5)[:, 2], 0.5)


def test_motion_works_in_a_pipeline_and_can_be_cloned():
    pipeline = clone(make_pipeline(Motion(rate=4.0, features=("x", "heading")), ChannelStandardizer()))
    assert pipeline.fit_transform(tracks(0)).shape == (4, 3, 7)
    assert pipeline.get_params()["motion__rate"] == 4.0
    with pytest.raises(NotFittedError):
        Motion().transform(tracks(0))


@pytest.mark.parametrize(
    ("x", "words"),
    [
        (np.zeros((4, 50)), r"shape \(cases, channels, time points\), not \(4, 50\)"),
        (np.zeros((4, 2, 1)), "at least 2"),
        (np.full((1, 2, 30), np.nan), "case 0 .* has 0 time points, the others are NaN"),
        (np.zeros((1, 3, 30)), "trained on tracks of 2 channels, given 3"),
    ],
)
def test_malformed_tracks_are_errors(x, words):
    for step in (Motion(), ChannelStandardizer()):
        with pytest.raises(DataError, match=words):
            step.fit(tracks(0)).transform(x)


def test_a_track_too_short_for_two_points_is_an_error():
    words = (
        r"case \d \(counted from 0\): 10 time points .* last 0.297 s; motion at 3 points per second needs"
        " more than 0.333 s"
    )
    for use in (Motion().fit, Motion().fit(tracks(0)).transform):
        for short in (tracks(0)[:, :, :10], stack_signals([*tracks(0), tracks(0)[0, :, :10]])):
            with pytest.raises(DataError, match=words):
                use(short)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"rate": 0.0}, "a rate of 0.0 points per second; expected one above 0 and up to 1000"),
        ({"rate": float("nan")}, "a rate of nan"),
        ({"rate": 1e9}, "a rate of 1000000000.0"),
        ({"interval": 0.0}, "the interval is 0.0 s"),
        ({"interval": float("inf")}, "the interval is inf s"),
        ({"features": ("x", "z")}, "unknown feature 'z'; expected one of x, y, velocity, heading"),
        ({"features": "x"}, "features must be a non-empty sequence of names, not 'x'"),
        ({"features": ()}, r"a non-empty sequence of names, not \(\)"),
        ({"features": ("x", "x")}, "features are x, x; expected every name once"),
        ({"features": ("facing",)}, "feature 'facing' needs the input facing; the inputs are x, y"),
        ({"features": ("attention",)}, "feature 'attention' needs the input x and y and facing"),
        ({"inputs": ("x", "distance")}, "unknown input 'distance'; expected one of x, y, velocity, heading"),
        ({"inputs": ("x",)}, "feature 'x' needs the input x and y; the inputs are x"),
        (
            {"inputs": ("x", "facing"), "features": ("velocity",)},
            "feature 'velocity' needs the input velocity or x and y",
        ),
        ({"inputs": ("x", "y", "facing")}, "the inputs are x, y, facing, but the tracks have 2 channels"),
        ({"robot": (0.0, 0.0)}, r"the robot's pose is \(0.0, 0.0\); expected x, y and heading"),
        ({"robot": (0.0, 0.0, float("nan"))}, "the robot's pose"),
    ],
)
def test_inconsistent_parameters_are_errors(parameters, words):
    with pytest.raises(DataError, match=words):
        Motion(**parameters).fit(tracks(0))


def test_stored_state_of_other_features_is_an_error():
    stored = Motion(features=("x", "heading")).fit(tracks(0)).to_arrays()
    assert Motion(features=("x", "heading")).restore_arrays(stored).rows_ == (
        "x",
        "heading_cos",
        "heading_sin",
    )
    with pytest.raises(DataError, match="the features give x, y, not"):
        Motion().restore_arrays(stored)
