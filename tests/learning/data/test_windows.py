"""Windows of equal duration: known values, and the rule for short tracks."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import Recording, to_dataset
from lcorpp.learning.data.npz import to_recording
from lcorpp.values import Dataset

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


def test_angles_are_resampled_the_shorter_way_round():
    turning = np.linspace(3.0, 3.4, 361)
    track = walk("a", heading=(turning + np.pi) % (2 * np.pi) - np.pi)
    data = to_dataset(Recording((track,)), interval=0.05, points=201, channels=("x", "y", "heading"))
    np.testing.assert_allclose(np.unwrap(data.trajectories[0, 2])[[0, -1]], [3 + 0.4 / 6, 3.4], atol=1e-6)
    assert np.abs(data.trajectories[0, 2]).max() <= np.pi


def test_short_tracks_are_left_out_and_counted_by_class():
    seconds = (12.0, 9.95, 9.99, 10.0, 3.0)
    tracks = [walk(str(i), ("in", "out")[i % 2], seconds=s, rate=100) for i, s in enumerate(seconds)]
    data = to_dataset(Recording(tuple(tracks)))
    assert data.groups == ("0", "2", "3")  # 9.99 s lacks less than half an interval
    assert data.notes == ("2 of 5 tracks are shorter than 9.999 s and left out: 1 in, 1 out",)


def test_rectangular_tracks_are_unchanged():
    rng = np.random.default_rng(0)
    data = Dataset(rng.normal(size=(4, 2, 30)), ("a", "b") * 2, ("p", "q", "q", "r"), interval=0.1)
    back = to_dataset(to_recording(data), interval=0.1, points=30)
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
        ({"points": 1000}, r"walks: every track is shorter than 32\.967 s .* the longest lasts 12\.000 s"),
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
