"""Counts, durations, speeds and duplicates of recordings made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import Recording, Track
from lcorpp.learning.data.describe import describe, join_pairs

from .texts import crowd, walk


def test_the_description_of_two_known_walks():
    found = describe(Recording((walk("a", seconds=10), walk("b", seconds=20), walk("c", None, seconds=5))))
    known, unknown = found.classes
    assert (known.name, known.tracks, known.groups, known.samples) == ("in", 2, 2, 301 + 601)
    assert (unknown.name, unknown.tracks) == (None, 1)
    assert (known.duration.min, known.duration.median, known.duration.max) == pytest.approx((10, 15, 20))
    assert known.speed.median == pytest.approx(1)
    assert found.interval.median == pytest.approx(1 / 30)
    assert found.jitter == pytest.approx(0, abs=1e-9)
    assert found.fastest[0] == pytest.approx(1)
    assert (found.tracks, found.channels, found.reused) == (3, ("x", "y"), {})


def test_jitter_is_that_of_the_intervals():
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.normal(0.1, 0.01, 5000))
    found = describe(Recording((Track("a", times, {"x": times, "y": times}, "in"),)))
    assert found.jitter == pytest.approx(0.1, abs=0.01)  # three standard errors


def test_noise_does_not_increase_the_mean_speed():
    rng = np.random.default_rng(0)
    times = np.arange(600) / 30
    columns = {"x": rng.normal(0, 0.02, 600), "y": rng.normal(0, 0.02, 600)}
    found = describe(Recording((Track("stands", times, columns, "in"),)))
    assert found.classes[0].speed.median < 0.15
    assert found.fastest[0] > 1


def test_duplicate_tracks_are_found():
    tracks = list(crowd(30).tracks)
    same = replace(tracks[3], id="again", group="someone")
    later = replace(tracks[5], id="later", times=tracks[5].times + 1000)
    shaken = {name: values + 0.004 for name, values in tracks[7].columns.items()}
    near = replace(tracks[7], id="near", columns=shaken)
    other = replace(tracks[9], id="other", columns={k: v + 0.02 for k, v in tracks[9].columns.items()})
    third = replace(
        tracks[11],
        id="third",
        columns={"x": -tracks[11].columns["x"], "y": tracks[0].times[:1] * 0 + tracks[11].columns["y"]},
        group=tracks[2].id,
    )
    found = describe(Recording((*tracks, same, later, near, other, third)))
    assert found.identical == (("3", "again"), ("5", "later"))
    assert found.near == (("7", "near"),)
    assert found.reused == {"5": 2, "7": 2, "9": 2, "2": 2}
    assert join_pairs(found.identical) == "3 and again, 5 and later"
    assert join_pairs((("a", "b"),) * 7).endswith("a and b, ... (7 pairs)")


def test_an_empty_recording_cannot_be_described():
    with pytest.raises(DataError, match="there are no tracks to describe"):
        describe(Recording(()))
