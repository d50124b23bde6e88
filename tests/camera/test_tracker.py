"""The tracker: known answers, laws and errors."""

import numpy as np
import pytest

from lcorpp.camera import Tracker, TrackerOptions
from lcorpp.errors import DataError

CROSSING = [[(0.1 * t, 0.0), (6 - 0.1 * t, 0.8)] for t in range(60)]


def run(images, hz=10.0, options=None):
    tracker = Tracker(options)
    return [sample for t, positions in enumerate(images) for sample in tracker.update(t / hz, positions)]


def test_two_people_who_cross_keep_their_ids():
    rng = np.random.default_rng(0)
    samples = run([np.array(people) + rng.normal(0, 0.05, (2, 2)) for people in CROSSING])
    assert {sample[1] for sample in samples} == {1, 2}
    for person in (0, 1):
        own = np.array([s for s in samples if s[1] == person + 1])
        assert len(own) == 60  # the first hits come with the confirmation
        truth = np.array([people[person] for people in CROSSING])
        assert np.sqrt(((own[10:, 2:] - truth[10:]) ** 2).sum(axis=1).mean()) < 0.07


def test_the_order_of_the_measurements_has_no_effect():
    forward, backward = run(CROSSING), run([people[::-1] for people in CROSSING])
    by_place = [
        sorted((t, round(x, 9), round(y, 9)) for t, _, x, y in samples) for samples in (forward, backward)
    ]
    assert by_place[0] == by_place[1]


def test_a_gap_is_interpolated_when_the_person_is_seen_again():
    images = [[(0.1 * t, 1.0)] if not 20 <= t < 28 else [] for t in range(40)]
    tracker = Tracker()
    counts = [len(tracker.update(t / 10, positions)) for t, positions in enumerate(images)]
    assert counts == [0, 0, 3, *[1] * 17, *[0] * 8, 9, *[1] * 11]
    samples = run(images)
    assert [s[0] for s in samples] == pytest.approx([t / 10 for t in range(40)])
    assert max(abs(x - t) for t, _, x, _ in samples if t > 1) < 0.01  # 1 m/s


def test_a_long_gap_begins_a_new_track_and_a_lone_hit_none():
    images = [[(0.0, 0.0)] if t < 10 or t >= 40 else [(5.0, 5.0)] if t == 20 else [] for t in range(50)]
    samples = run(images)
    assert [sum(s[1] == person for s in samples) for person in (1, 2, 3)] == [10, 10, 0]


def test_a_jump_is_another_person():
    assert {s[1] for s in run([[(0.0, 0.0)]] * 10 + [[(3.0, 0.0)]] * 10)} == {1, 2}


def test_the_filter_agrees_with_one_written_out():
    rng = np.random.default_rng(1)
    measured = np.cumsum(rng.normal(0.05, 0.02, (30, 2)), axis=0)
    options = TrackerOptions(gate=1e3)
    samples = np.array(run(measured[:, None], options=options))
    mean, cov = np.array([*measured[0], 0, 0]), np.diag([0.01, 0.01, 1, 1])
    f, h, dt = np.eye(4), np.eye(2, 4), 0.1
    f[0, 2] = f[1, 3] = dt
    g = np.array([[dt**2 / 2, 0], [0, dt**2 / 2], [dt, 0], [0, dt]])
    for row, z in enumerate(measured[1:], start=1):
        mean, cov = f @ mean, f @ cov @ f.T + options.acceleration**2 * g @ g.T
        k = cov @ h.T @ np.linalg.inv(h @ cov @ h.T + 0.01 * np.eye(2))
        mean, cov = mean + k @ (z - h @ mean), (np.eye(4) - k @ h) @ cov
        assert samples[row, 2:] == pytest.approx(mean[:2])


def test_an_uncertain_measurement_moves_a_track_less():
    def end(variance):
        tracker = Tracker()
        for t in range(10):
            tracker.update(t / 10, [(0.0, 0.0)])
        return tracker.update(1.0, [(0.2, 0.0)], [variance * np.eye(2)])[0][2]

    assert 0 < end(0.1) < end(0.001) < 0.2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1.0, [(0, 0)]), "time 1 s; expected a finite number above 1, the last one"),
        ((float("nan"), []), "time nan s; expected a finite number"),
        ((2.0, [(0, 0, 0)]), r"positions of shape (1, 3); expected (n, 2)"),
        ((2.0, [(float("inf"), 0)]), "a position at 2 s is not finite"),
        ((2.0, [(1e9, 0)]), "above 1e+06 m"),
        ((2.0, [(0, 0)], np.eye(2)[None] * -1), "a covariance at 2 s is not finite and positive definite"),
        ((2.0, [(0, 0)], np.ones((2, 2, 2))), "2 covariances for 1 positions"),
    ],
)
def test_bad_measurements_are_refused(arguments, message):
    tracker = Tracker()
    tracker.update(1.0, [(0.0, 0.0)])
    with pytest.raises(DataError) as caught:
        tracker.update(*arguments)
    assert message in str(caught.value)
    assert tracker.update(1.1, []) == []  # nothing has changed


def test_constants_are_positive():
    with pytest.raises(DataError, match="noise is 0; expected a number above 0"):
        TrackerOptions(noise=0.0)
