"""Windows of equal duration: known values, and the rule for short tracks."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import Recording, Track, to_dataset
from lcorpp.learning.data.npz import to_recording
from lcorpp.values import Dataset, stack_signals

from .texts import walk


def test_windows_at_the_end_and_the_start_of_a_track():
    recording = Recording((walk("a", seconds=12), walk("b", "out", seconds=10)), "walks", ("a note",))
    data = to_dataset(recording)
    assert data.trajectories.shape == (2, 2, 304)
    np.testing.assert_allclose(data.trajectories[0, 0], 12 - 0.033 * np.arange(303, -1, -1), atol=1e-9)
    assert (data.labels, data.groups, data.source, data.notes) == (
        *(("in", "out"), ("a", "b")),
        *("walks", ("a note",)),
    )
    first = to_dataset(recording, interval=0.4, points=11, end="first")
    np.testing.assert_allclose(first.trajectories[:, 0], 0.4 * np.arange(11) * np.ones((2, 1)), atol=1e-9)
    assert (first.interval, first.channels) == (0.4, ("x", "y"))


def test_windows_every_step_from_either_end():
    """Of eleven seconds: three windows of four, the last or first ones, of one person."""
    track = Track("7", np.arange(12.0), {"x": np.arange(12.0), "y": np.zeros(12)}, "a", "ann")
    recording = Recording([track, Track("8", [0.0, 3.0], {"x": [0.0, 3], "y": [0.0, 0]}, "b")])
    data = to_dataset(recording, interval=1.0, points=5, step=3.0)
    assert [row[~np.isnan(row)].tolist() for row in data.trajectories[:, 0]] == [
        [1, 2, 3, 4, 5],
        [4, 5, 6, 7, 8],
        [7, 8, 9, 10, 11],
        [0, 1, 2, 3],  # shorter than a window
    ]
    assert (data.labels, data.groups) == (("a", "a", "a", "b"), ("ann", "ann", "ann", "8"))
    assert data.notes == ("1 of 4 windows are shorter than 4 s and used whole: 1 b",)
    first = to_dataset(recording, interval=1.0, points=5, step=3.0, end="first")
    assert first.trajectories[:3, 0, 0].tolist() == [0, 3, 6]
    with pytest.raises(DataError, match=r"the step is 0\.0 s; expected a finite number above 0"):
        to_dataset(recording, step=0.0)


def test_windows_with_a_pause_are_left_out():
    """The person is not seen between second 4 and 6."""
    times = np.array([0.0, 1, 2, 3, 4, 6, 7, 8, 9])
    recording = Recording([Track("7", times, {"x": times, "y": 0 * times}, "a")])
    data = to_dataset(recording, interval=1.0, points=3, step=1.0)
    assert data.trajectories[:, 0, 0].tolist() == [0, 1, 2, 6, 7]
    with pytest.raises(DataError, match="every window has a pause above 1 s"):
        to_dataset(recording, interval=1.0, points=6, step=1.0)


def test_angles_are_resampled_the_shorter_way_round():
    turning = np.linspace(3.0, 3.4, 361)
    track = walk("a", heading=(turning + np.pi) % (2 * np.pi) - np.pi)
    data = to_dataset(Recording((track,)), interval=0.05, points=201, channels=("x", "y", "heading"))
    np.testing.assert_allclose(np.unwrap(data.trajectories[0, 2])[[0, -1]], [3 + 0.4 / 6, 3.4], atol=1e-6)
    assert np.abs(data.trajectories[0, 2]).max() <= np.pi


def test_short_tracks_keep_their_length_and_very_short_ones_are_left_out():
    seconds = (12.0, 9.95, 9.99, 10.0, 3.0, 0.5)
    tracks = [walk(str(i), ("in", "out")[i % 2], seconds=s, rate=100) for i, s in enumerate(seconds)]
    data = to_dataset(Recording(tuple(tracks)))
    assert data.groups == ("0", "1", "2", "3", "4")
    assert data.lengths.tolist() == [304, 302, 304, 304, 91]  # 9.99 s lacks less than half an interval
    assert data.notes == (
        "1 of 6 tracks are shorter than 1 s and left out: 1 out",
        "2 of 6 tracks are shorter than 9.999 s and used whole: 1 in, 1 out",
    )
    np.testing.assert_allclose(data.trajectories[4, 0, :91], 3 - 0.033 * np.arange(90, -1, -1), atol=1e-9)
    for shortest, groups in ((0, 6), (5, 4), (9.999, 3), (99, 3)):
        assert len(to_dataset(Recording(tuple(tracks)), min_seconds=shortest)) == groups
    first = to_dataset(Recording((tracks[4],)), end="first", points=400)
    np.testing.assert_allclose(first.trajectories[0, 0], 0.033 * np.arange(91), atol=1e-9)


def test_two_points_are_the_least_of_a_track():
    recording = Recording((walk("a", seconds=12), walk("b", "out", seconds=2)))
    data = to_dataset(recording, interval=5, points=3)
    assert (data.groups, data.lengths.tolist()) == (("a",), [3])
    assert to_dataset(recording, interval=2, points=3).lengths.tolist() == [3, 2]


def test_tracks_of_the_same_interval_are_unchanged():
    rng = np.random.default_rng(0)
    tracks = stack_signals([rng.normal(size=(2, points)) for points in (30, 11, 20, 30)])
    data = Dataset(tracks, ("a", "b") * 2, ("p", "q", "q", "r"), interval=0.1)
    recording = to_recording(data)
    np.testing.assert_allclose([track.duration for track in recording.tracks], [2.9, 1, 1.9, 2.9])
    back = to_dataset(recording, interval=0.1, points=30)
    np.testing.assert_allclose(back.trajectories, data.trajectories, atol=1e-12)
    assert (back.labels, back.groups) == (data.labels, data.groups)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"points": 1}, "at least 2 time points, not 1"),
        ({"interval": 0}, "the interval is 0 s"),
        ({"interval": float("nan")}, "the interval is nan s"),
        ({"end": "middle"}, "unknown end 'middle'; expected one of last, first"),
        ({"channels": ("x", "y", "mood")}, "unknown channel 'mood'"),
        ({"channels": ("x", "y", "facing")}, "track 'a' has no facing; expected one of x, y"),
        ({"min_seconds": -1}, "the shortest track lasts -1 s; expected a finite number from 0"),
        (
            {"points": 1000, "min_seconds": 20},
            r"walks: every track is shorter than 20 s; the longest lasts 12\.000 s",
        ),
    ],
)
def test_arguments_out_of_range_are_errors(options, words):
    with pytest.raises(DataError, match=words):
        to_dataset(Recording((walk("a"),), "walks"), **options)


def test_tracks_without_labels_or_none_at_all():
    with pytest.raises(DataError, match="track 'b' has no label"):
        to_dataset(Recording((walk("a"), walk("b", None))))
    with pytest.raises(DataError, match="walks: there are no tracks"):
        to_dataset(Recording((), "walks"))
