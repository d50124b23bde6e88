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
    assert tracks.list_people()["8"] == pytest.approx(2.9)


def walk_together(start, seconds, *people):
    """Return a list of samples for each frame."""
    walks = [walk(person, start, seconds, offset) for offset, person in enumerate(people)]
    return list(map(list, zip(*walks, strict=True)))


FAULTS = {
    "of another id": lambda frame: frame.append((frame[0][0] + 3e7, "9", 1.0, 1.0)),
    "of a person": lambda frame: frame.__setitem__(0, (frame[0][0] + 3e7, *frame[0][1:])),
    "of a message": lambda frame: frame.__setitem__(
        slice(None), [(time + 3e7, *rest) for time, *rest in frame]
    ),
    "that is earlier": lambda frame: frame.__setitem__(0, (frame[0][0] - 50.0, *frame[0][1:])),
    "that is not a number": lambda frame: frame.__setitem__(0, (float("nan"), *frame[0][1:])),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_wrong_stamps_delete_no_tracks(parts, tracks, fault):
    reference = PeopleTracks(parts[1], max_silence=2.0)
    faulty = walk_together(100.0, 8.0, "7", "8")
    for number, frame in enumerate(walk_together(100.0, 8.0, "7", "8")):
        reference.add(frame)
        if number in (30, 55):
            FAULTS[fault](faulty[number])
        tracks.add(faulty[number])
        assert {"7", "8"} <= tracks.list_people().keys()
    found = tracks.list_people()
    assert (found["7"], found["8"]) == pytest.approx((7.9, 7.9))
    assert tracks.classify("8", "motion") == reference.classify("8", "motion") is not None


def test_a_clock_of_all_that_is_reset_keeps_the_people(tracks):
    for frame in walk_together(1e9, 3.0, "7", "8") + walk_together(5.0, 3.0, "7", "8"):
        tracks.add(frame)
        assert tracks.list_people().keys() == {"7", "8"}
    assert tracks.list_people() == pytest.approx({"7": 2.9, "8": 2.9})


def test_people_whose_stamps_differ_by_an_offset_stay_until_they_leave(tracks):
    people, away = ("5", "6", "7", "8"), slice(60, 75)
    for number, frame in enumerate(walk_together(100.0, 12.0, *people)):
        samples = [(s[0] + 1000 * (s[1] in "78"), *s[1:]) for s in frame]
        tracks.add([s for s in samples if s[1] != "8" or number not in range(120)[away]])
        assert "8" in tracks.list_people()  # it was away for 1.5 s of at most 2
    for frame in walk_together(112.0, 2.5, "5", "6"):
        tracks.add(frame)
    assert tracks.list_people().keys() == {"5", "6"}


@pytest.mark.parametrize("stamp", [lambda t: 5.0, lambda t: float(np.float32(1.7e9 + t))])
@pytest.mark.parametrize("has_classifier", [True, False])
def test_stamps_that_stand_still_are_a_warning(parts, tracks, stamp, has_classifier):
    found = tracks if has_classifier else PeopleTracks({})
    samples = [(stamp(time), *rest) for time, *rest in walk("7", 0.0, 2.0)]
    with pytest.warns(UserWarning, match="most of the last 20 samples of '7' have no later time stamp"):
        found.add(samples)


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
