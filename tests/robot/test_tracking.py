"""People's tracks and the classifiers' outputs for them."""

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.robot.tracking import MAX_SAMPLES, PeopleTracks


@pytest.fixture
def tracks(parts, monkeypatch):
    """With a clock of the computer that stands still."""
    monkeypatch.setattr("lcorpp.robot.tracking.monotonic", lambda: 0.0)
    return PeopleTracks(parts[1], max_silence=2.0)


def walk(person, start, seconds, offset=0.0):
    return [(start + t, person, offset, 8 - 0.5 * t) for t in np.arange(0, seconds, 0.1)]


def test_the_label_is_that_of_the_classifier_for_the_whole_track(parts, tracks):
    samples = walk("7", 100.0, 6.0)
    tracks.add(samples)
    trained = parts[1]["motion"]
    motion = trained.estimator[0]
    times, positions = np.array([s[0] for s in samples]), np.array([s[2:] for s in samples]).T
    expected = trained.estimator[1:].predict(motion.transform_stamped(times, positions))[0]
    assert tracks.classifiers("7")["motion"].classify(None) == expected
    assert tracks.signals("7")["motion"].shape == (2, len(samples))


def test_people_who_leave_are_forgotten_and_come_back_as_new_ones(tracks):
    tracks.add(walk("7", 0.0, 3.0))
    tracks.add(walk("8", 2.0, 2.5, 1.0))
    assert tracks.list_people() == pytest.approx({"7": 2.9, "8": 2.4})
    tracks.add(walk("8", 4.5, 1.0, 1.0))
    assert list(tracks.list_people()) == ["8"]  # the last sample of 7 is more than 2 s old
    assert tracks.signals("7") == {}
    assert tracks.classify("7", "motion") is None
    tracks.add(walk("7", 5.5, 1.0))
    assert tracks.list_people()["7"] == pytest.approx(0.9)


def test_a_clock_that_goes_back_starts_anew(tracks):
    tracks.add(walk("7", 1e9, 2.0))
    tracks.add(walk("8", 100.0, 2.0))
    assert tracks.list_people()["8"] == pytest.approx(1.9)
    tracks.add([(1.8e9, "8", 0.0, 5.0)])  # one stamp of another clock
    tracks.add(walk("8", 102.0, 1.0))
    assert tracks.list_people()["8"] == pytest.approx(0.9)


def test_an_id_that_returns_after_a_gap_is_a_new_track(tracks):
    tracks.add(walk("7", 0.0, 3.0))
    tracks.add(walk("7", 3600.0, 1.0))
    assert tracks.list_people() == pytest.approx({"7": 0.9})
    assert tracks.signals("7")["motion"].shape[1] == 10


def test_people_leave_without_samples_of_others(tracks, monkeypatch):
    tracks.add(walk("7", 0.0, 3.0))
    monkeypatch.setattr("lcorpp.robot.tracking.monotonic", lambda: 10.0)
    assert tracks.list_people() == {}


def test_people_do_not_affect_each_other(parts):
    alone, together = PeopleTracks(parts[1]), PeopleTracks(parts[1])
    for first, second in zip(walk("7", 0.0, 6.0), walk("8", 0.0, 6.0, 2.0), strict=True):
        alone.add([first])
        together.add([second, first])
    assert alone.classify("7", "motion") == together.classify("7", "motion")


def test_with_too_few_samples_there_is_no_label(tracks):
    tracks.add(walk("7", 0.0, 0.15))
    assert tracks.classify("7", "motion") is None


def test_memory_is_bounded(tracks):
    for part in range(4):
        tracks.add([(part * 1000 + n, "7", 0.0, 1.0) for n in range(1000)])
    assert tracks.signals("7")["motion"].shape[1] == MAX_SAMPLES


def test_malformed_samples_are_errors(tracks):
    with pytest.raises(DataError, match="expected time, person, x, y"):
        tracks.add([("now", "7", 0.0, 0.0)])
