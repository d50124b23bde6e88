"""MOTA, IDF1 and RMSE: answers known by hand."""

from math import isnan, sqrt

import numpy as np
import pytest

from lcorpp.camera import score_tracks
from lcorpp.errors import DataError


def line(person, times, y=0.0):
    return [(float(t), person, float(t), y) for t in times]


def test_equal_tracks_are_perfect():
    score = score_tracks(line("a", range(5)), line(7, range(5)), max_distance=1.0)
    assert (score.mota, score.idf1, score.rmse) == (1, 1, 0)


def test_each_kind_of_error_is_counted():
    """Track 1 follows a for four images, then track 2 does; a is missed once, track 3 is nobody."""
    tracks = line(1, range(4), 0.1) + line(2, range(5, 10), 0.3) + line(3, [2, 3], 9.0)
    score = score_tracks(line("a", range(10)), tracks, max_distance=0.5)
    assert (score.misses, score.false_positives, score.switches) == (1, 2, 1)
    assert score.mota == pytest.approx(1 - 4 / 10)
    assert score.idf1 == pytest.approx(2 * 5 / (10 + 11))
    assert score.rmse == pytest.approx(sqrt((4 * 0.01 + 5 * 0.09) / 9))


def test_a_correspondence_is_kept_though_another_track_is_nearer():
    """CLEAR MOT, figure 3: the nearest track would be a switch."""
    tracks = line(1, range(4), 0.4) + line(2, range(1, 4), 0.1)
    score = score_tracks(line("a", range(4)), tracks, max_distance=0.5)
    assert (score.switches, score.misses, score.false_positives) == (0, 0, 3)


def test_most_people_are_matched_before_the_distance_is_least():
    truth = [(0.0, "a", 0.0, 0.0), (0.0, "b", 1.0, 0.0)]
    tracks = [(0.0, 1, 0.9, 0.0), (0.0, 2, 1.9, 0.0)]  # 1 is nearer to b, but only 1 is near a
    assert score_tracks(truth, tracks, max_distance=1.0).misses == 0


def test_a_switch_after_a_gap_counts():
    tracks = line(1, range(3)) + line(2, range(6, 9))
    assert score_tracks(line("a", range(9)), tracks, max_distance=0.5).switches == 1


def test_a_track_that_changed_its_person_is_matched_once():
    """b takes the track of a, who comes back beside it."""
    truth = [*line("a", range(2)), *line("b", range(3, 9)), *line("a", range(5, 9), 0.1)]
    score = score_tracks(truth, line(1, range(9)), max_distance=0.5)
    assert (score.misses, score.false_positives, score.switches) == (4, 1, 0)


def test_scores_agree_with_py_motmetrics():
    """py-motmetrics 1.4.0 gives MOTA .716111, IDF1 .430957, 488, 2 and 21 errors for these tracks."""
    rng, truth, tracks = np.random.default_rng(0), [], {}
    for t in range(300):
        for i in range(6):
            x, y = i * 0.4 + 0.3 * np.sin(t / 9 + i), 0.5 * np.cos(t / 13 + 2 * i)
            truth.append((t, i, x, y))
            if rng.random() < 0.85:
                key = (t, (i + (t // 50) * (i % 3)) % 9)
                tracks.setdefault(key, (*key, x + rng.normal(0, 0.15), y + rng.normal(0, 0.15)))
    score = score_tracks(truth, tracks.values(), max_distance=0.5)
    assert score.idf1 == pytest.approx(0.430957, abs=1e-6)
    assert score.mota == pytest.approx(
        0.716111, abs=0.005
    )  # if two people claim a track, it prefers the first
    assert score.misses == 488


def test_names_and_order_have_no_effect():
    rng = np.random.default_rng(0)
    truth = line("a", range(9)) + line("b", range(9), 2.0)
    tracks = line(1, range(5), 0.1) + line(2, range(9), 1.8) + line(3, range(5, 9), 0.2)
    mixed = [(t, f"track {name}", x, y) for t, name, x, y in rng.permutation(np.array(tracks)).tolist()]
    assert score_tracks(truth, tracks, max_distance=0.5) == score_tracks(truth[::-1], mixed, max_distance=0.5)


def test_nothing_has_no_score():
    score = score_tracks([], [], max_distance=1.0)
    assert isnan(score.mota)
    assert isnan(score.idf1)
    assert isnan(score.rmse)


@pytest.mark.parametrize(
    ("truth", "message"),
    [
        ([(0.0, 1, 2.0)], r"truth: sample (0.0, 1, 2.0); expected (time, id, x, y)"),
        ([(0.0, 1, "x", 0)], "expected (time, id, x, y)"),
        ([(0.0, 1, float("nan"), 0)], "is not finite"),
        ([(0.0, 1, 0, 0), (0.0, 1, 1, 1)], "two samples of 1 at 0 s; expected one"),
    ],
)
def test_malformed_samples_are_refused(truth, message):
    with pytest.raises(DataError) as caught:
        score_tracks(truth, [], max_distance=1.0)
    assert message in str(caught.value)


def test_the_distance_is_positive():
    with pytest.raises(DataError, match="max_distance is 0; expected a number above 0"):
        score_tracks([], [], max_distance=0)
