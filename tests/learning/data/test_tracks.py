"""Tracks and recordings: short representations."""

import numpy as np

from lcorpp.learning import Recording, Track

COLUMNS = {"x": np.arange(3.0), "y": np.zeros(3)}


def track(id, label):
    return Track(id, np.arange(3.0), COLUMNS, label)


def test_representations_are_short():
    recording = Recording((track("a", "wants"), track("b", None), track("c", "wants")), "some.csv")
    assert repr(recording.tracks[0]) == "Track('a', 'wants': 3 samples of x, y in 2.0 s)"
    assert repr(recording) == "Recording('some.csv', 3 tracks: 2 wants, 1 without a label)"
    assert "<td>wants</td><td>2</td><td>2.0</td>" in recording._repr_html_()
    assert repr(Recording(())) == "Recording('', 0 tracks: none)"
