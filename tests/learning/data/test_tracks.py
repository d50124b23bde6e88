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
    assert Recording(list(recording.tracks), notes=["from two days"]).notes == ("from two days",)


def test_the_last_seconds_of_a_track():
    times = np.array([0, 0.5, 1.0, 2.0, 2.5])
    one = Track("a", times, {"x": times, "y": 0 * times, "heading": -times})
    for seconds, samples in ((9, 5), (1.5, 3), (1.4, 2), (0.1, 2)):
        last = Recording((one,)).last(seconds).tracks[0]
        assert last.times.tolist() == times[-samples:].tolist()
        assert last.columns["heading"].tolist() == (-times[-samples:]).tolist()
        assert (last.id, last.group) == ("a", "a")
