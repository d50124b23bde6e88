"""Legs in scans of a simulated scanner, at known places; people tracked by them; several trackers."""

from math import cos, hypot, inf, pi, sin

import numpy as np
import pytest

from lcorpp.worlds.ros.people import positions
from lcorpp.worlds.ros.people.laser_scan import LaserReader, find_legs, pair_legs
from lcorpp.worlds.ros.people.positions import PeoplePositions
from lcorpp.worlds.ros.pose import Pose

RADIUS = 0.06
STEP = np.radians(0.5)
HALF, FULL = np.arange(-180, 181) * STEP, np.arange(-360, 360) * STEP


def scan(circles, angles=HALF, *, wall=6.0, noise=0.0, seed=0):
    """Return the ranges of rays from the origin to circles (x, y, radius), and to a wall all around."""
    ranges = np.full(len(angles), wall)
    for x, y, radius in circles:
        along = x * np.cos(angles) + y * np.sin(angles)
        aside = np.abs(x * np.sin(angles) - y * np.cos(angles))
        hits = (along > 0) & (aside < radius)
        depth = along - np.sqrt(np.maximum(radius**2 - aside**2, 0))
        ranges = np.where(hits, np.minimum(ranges, depth), ranges)
    return ranges + noise * np.random.default_rng(seed).standard_normal(len(angles))


def message(time, ranges, angles=HALF):
    header = {"frame_id": "laser", "stamp": {"sec": int(time), "nanosec": round(time % 1 * 1e9)}}
    limits = {"angle_min": float(angles[0]), "angle_increment": float(STEP), "range_min": 0.05}
    shown = [None if not np.isfinite(r) else float(r) for r in ranges]
    return {"header": header, **limits, "range_max": 20.0, "ranges": shown}


def legs_at(x, y, stride=0.3):
    return [(x, y + stride / 2, RADIUS), (x, y - stride / 2, RADIUS)]


@pytest.mark.parametrize("angles", [HALF, FULL])
@pytest.mark.parametrize("place", [(2.0, 0.0), (1.0, 1.5), (3.0, -1.0)])
def test_both_legs_are_found_at_their_places(angles, place):
    people = pair_legs(find_legs(scan(legs_at(*place), angles, noise=0.01), angles))
    np.testing.assert_allclose(people, [place], atol=0.05)


def test_a_leg_where_a_full_circle_begins_is_found():
    legs = find_legs(scan([(-2.0, 0.0, RADIUS)], FULL), FULL)
    np.testing.assert_allclose(legs, [(-2.0, 0.0)], atol=0.03)


def test_walls_pillars_and_what_is_at_a_wall_are_no_legs():
    assert len(find_legs(scan([]), HALF)) == 0
    assert len(find_legs(scan([(2.0, 0.0, 0.4)]), HALF)) == 0  # too wide
    assert len(find_legs(scan([(5.95, 0.0, RADIUS)]), HALF)) == 0  # no step to the wall beside it
    assert len(find_legs(scan([(9.0, 0.0, 0.2)], wall=12.0), HALF)) == 0  # too far
    assert len(find_legs(np.full(361, inf), HALF)) == 0
    assert len(find_legs(np.zeros(0), np.zeros(0))) == 0


def test_two_people_are_four_legs_in_the_nearest_pairs():
    legs = np.array([(2, 0.9), (2, 0.6), (2, -0.6), (2, -0.9), (2, 3)])
    assert sorted(map(tuple, pair_legs(legs).round(2).tolist())) == [(2, -0.75), (2, 0.75), (2, 3)]
    assert pair_legs(np.zeros((0, 2))).shape == (0, 2)


def read_walk(reader, start, velocity, *, others=(), seconds=3.0, first=0.0, pose=None):
    """Return the samples of a person who walks past the scanner of a robot at a pose."""
    samples = []
    for k in range(round(seconds * 10)):
        x, y = (start[axis] + velocity[axis] * k / 10 for axis in (0, 1))
        swing = 0.25 * sin(2 * pi * 0.9 * k / 10)
        circles = [(x + swing / 2, y + 0.1, RADIUS), (x - swing / 2, y - 0.1, RADIUS), *others]
        if pose is not None:
            circles = [(*pose.relate(cx, cy), radius) for cx, cy, radius in circles]
        samples += reader.read(message(first + k / 10, scan(circles, noise=0.01, seed=k)))
    return samples


def test_a_walker_is_one_track_and_a_table_none():
    reader = LaserReader("/scan", "/map", lambda x, y: (x, y))
    table = [(1.5, 1.2, 0.04), (1.5, 1.9, 0.04)]
    samples = read_walk(reader, (4.0, -0.5), (-1.0, 0.0), others=table)
    assert {sample.id for sample in samples} == {"1-1"}
    assert {sample.frame for sample in samples} == {"map"}
    assert len(samples) >= 28  # also those before it had moved
    for sample in samples:
        assert hypot(sample.x - (4.0 - sample.time), sample.y + 0.5) < 0.2
    times = [sample.time for sample in samples]
    assert times == sorted(times)


def test_a_scanner_on_a_robot_that_is_elsewhere():
    pose, mounting = Pose(3.0, 2.0, pi / 2), Pose(0.2, 0.0, 0.0)
    scanner = Pose(*pose.place(0.2, 0.0), pi / 2)
    reader = LaserReader("/scan", "map", lambda x, y: pose.place(*mounting.place(x, y)))
    samples = read_walk(reader, (3.0, 6.0), (0.0, -0.8), pose=scanner)
    assert samples
    for sample in samples:
        assert hypot(sample.x - 3.0, sample.y - (6.0 - 0.8 * sample.time)) < 0.2


def test_scans_that_are_wrong_are_left_out_with_one_warning_a_kind(caplog):
    reader = LaserReader("/scan", "map", lambda x, y: (x, y))
    good = message(5.0, scan([]))
    for changes in (
        {"ranges": None},
        {"ranges": ["near"]},
        {"angle_increment": 0.0},
        {"angle_min": None},
        {"range_max": 0.01},
        {"ranges": [[1.0, 2.0]] * 10},
        {"header": {"frame_id": "laser", "stamp": {"sec": 0, "nanosec": 0}}},
    ):
        assert reader.read({**good, **changes}) == []
    assert all(
        text.startswith("/scan: a message that is not sensor_msgs/LaserScan") for text in caplog.messages
    )
    assert len(caplog.messages) == 6
    assert reader.read(good) == []
    assert reader.read(good) == []
    assert caplog.messages[-1] == "/scan: a scan whose stamp is not after the last one is left out"


def test_a_scanner_without_a_maximum_range():
    """rosbridge writes null for an infinite number."""
    walks = []
    for maximum in (20.0, None):
        reader = LaserReader("/scan", "map", lambda x, y: (x, y))
        scans = [message(k / 10, scan(legs_at(4 - k / 10, 0.0), seed=k, noise=0.01)) for k in range(20)]
        walks.append([own for one in scans for own in reader.read({**one, "range_max": maximum})])
    assert walks[0] == walks[1]
    assert walks[0]


def test_a_clock_that_is_set_back_begins_new_tracks():
    reader = LaserReader("/scan", "map", lambda x, y: (x, y))
    before = read_walk(reader, (4.0, 0.0), (-1.0, 0.0), first=100.0)
    after = read_walk(reader, (4.0, 0.0), (-1.0, 0.0), first=10.0)
    assert {sample.id for sample in before} == {"1-1"}
    assert {sample.id for sample in after} == {"2-1"}


@pytest.fixture
def clock(monkeypatch):
    class Clock:
        now = 0.0

    monkeypatch.setattr(positions, "monotonic", lambda: Clock.now)
    monkeypatch.setattr(positions, "MAX_AGE", 3.0)
    return Clock


def test_a_person_of_two_trackers_is_one_whichever_sees_them_first(clock):
    people = PeoplePositions(main="")
    assert people.update("legs", "1-1", 2.0, 1.0) == "legs 1-1"
    assert people.update("", "7", 2.2, 1.1) == "legs 1-1"
    assert people.update("", "8", -2.0, 0.0) == "8"
    assert people.update("legs", "1-2", -2.1, 0.3) == "8"
    assert people.list_people() == {"legs 1-1": (2.2, 1.1), "8": (-2.0, 0.0)}  # by the main tracker
    clock.now = 1.5
    people.update("legs", "1-2", -1.5, 0.0)
    assert people.locate("8") == (-1.5, 0.0)  # the main one no longer sees them
    clock.now = 4.0
    assert people.locate("legs 1-1") is None
    assert people.update("", "7", 5.0, 5.0) == "7"  # a new person: the old one has left


def test_people_who_part_are_two(clock):
    people = PeoplePositions(main="")
    assert people.update("", "7", 2.0, 0.0) == "7"
    assert people.update("legs", "1", 2.4, 0.0) == "7"
    assert people.update("legs", "1", 3.2, 0.0) == "7"
    assert people.update("legs", "1", 3.6, 0.0) == "legs 1"
    assert people.update("legs", "1", 2.1, 0.0) == "legs 1"
    assert people.list_people() == {"7": (2.0, 0.0), "legs 1": (2.1, 0.0)}


def test_new_ids_of_one_tracker_are_new_people(clock):
    people = PeoplePositions(main="")
    assert [people.update("", id, 1.0, 0.0) for id in ("7", "9")] == ["7", "9"]
    assert people.update("legs", "1", 1.0, 0.0) in ("7", "9")
    assert people.update("legs", "2", 1.0, 0.0) in ("7", "9")
    assert people.update("legs", "3", 1.0, 0.0) == "legs 3"
    assert people.update("legs", "4", 1.0 + cos(0) * 0.7, 0.0) == "legs 4"
