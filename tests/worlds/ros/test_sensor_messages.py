"""Messages of trackers and localisations as numbers; frames by known answers and laws."""

import json
from math import atan2, cos, hypot, pi, sin

import pytest
from hypothesis import given, strategies as st

from lcorpp.errors import WorldError
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.sensor_messages import (
    PEOPLE,
    POSES,
    Detection,
    read_people,
    read_pose,
    read_stamp,
    read_text,
)

HEADER_1 = {"seq": 1, "stamp": {"secs": 5, "nsecs": 500_000_000}, "frame_id": "/map"}
HEADER_2 = {"stamp": {"sec": 5, "nanosec": 500_000_000}, "frame_id": "map"}
POSITION = {"x": 1.0, "y": 2.0, "z": 0.0}
EXAMPLES = {
    "people_msgs/People": {"header": HEADER_2, "people": [{"name": "7", "position": POSITION}]},
    "spencer_tracking_msgs/TrackedPersons": {
        "header": HEADER_1,
        "tracks": [
            {"track_id": 7, "is_occluded": False, "pose": {"pose": {"position": POSITION}}},
            {"track_id": 8, "is_occluded": True, "pose": {"pose": {"position": POSITION}}},
        ],
    },
    "visualization_msgs/MarkerArray": {
        "markers": [
            {"header": HEADER_2, "id": 7, "action": 0, "pose": {"position": POSITION}},
            {"header": HEADER_2, "id": 8, "action": 2, "pose": {"position": POSITION}},
        ]
    },
    "vision_msgs/Detection3DArray": {
        "header": HEADER_2,
        "detections": [{"id": "7", "bbox": {"center": {"position": POSITION}}}],
    },
    "tf2_msgs/TFMessage": {
        "transforms": [
            {"header": HEADER_2, "child_frame_id": "person_7", "transform": {"translation": POSITION}},
            {"header": HEADER_2, "child_frame_id": "odom", "transform": {"translation": POSITION}},
        ]
    },
}
NUMBERS = st.floats(-100, 100)
ANGLES = st.floats(-10, 10)


@pytest.mark.parametrize("kind", PEOPLE)
def test_each_kind_of_tracker_gives_the_same_person(kind):
    assert read_people(kind, EXAMPLES[kind]) == [Detection("7", "map", 5.5, 1.0, 2.0)]


@pytest.mark.parametrize("kind", PEOPLE)
def test_a_message_of_another_type_is_an_error_that_names_the_expected_one(kind):
    for message in ({}, {"data": "x"}, {"header": 3}, {"people": [{}]}, {"markers": [1]}):
        with pytest.raises(WorldError, match=f"a message that is no {kind}"):
            read_people(kind, message)


@pytest.mark.parametrize("kind", PEOPLE)
def test_people_without_a_position_or_an_id_are_left_out(kind):
    for number in (None, float("nan"), float("inf")):
        text = json.dumps(EXAMPLES[kind]).replace('"x": 1.0', f'"x": {json.dumps(number)}')
        assert read_people(kind, json.loads(text)) == []
    text = json.dumps(EXAMPLES["people_msgs/People"]).replace('"name": "7"', '"name": ""')
    assert read_people("people_msgs/People", json.loads(text)) == []
    huge = json.dumps(EXAMPLES[kind]).replace('"x": 1.0', '"x": 1' + 400 * "0")
    with pytest.raises(WorldError, match=f"a message that is no {kind}: OverflowError"):
        read_people(kind, json.loads(huge))


def test_a_stamp_of_zero_is_none():
    assert read_stamp({"sec": 0, "nanosec": 0}) is None
    assert read_stamp({"secs": 3, "nsecs": 250_000_000}) == 3.25


@pytest.mark.parametrize("kind", POSES)
def test_the_heading_is_that_of_the_quaternion(kind):
    pose = {"position": POSITION, "orientation": {"x": 0, "y": 0, "z": sin(0.4), "w": cos(0.4)}}
    message = {"pose": pose if len(POSES[kind]) == 1 else {"pose": pose}}
    read = read_pose(kind, message)
    assert (read.x, read.y) == (1.0, 2.0)
    assert read.heading == pytest.approx(0.8)
    with pytest.raises(WorldError, match=f"a message that is no {kind}"):
        read_pose(kind, {"pose": 3})


def test_a_pose_that_is_not_finite_is_an_error():
    with pytest.raises(WorldError, match="expected finite numbers"):
        Pose(0, float("nan"), 0)


def test_texts():
    assert read_text("hri_msgs/LiveSpeech", {"incremental": "ye", "final": "yes"}) == "yes"
    with pytest.raises(WorldError, match="it has no text 'data'"):
        read_text("std_msgs/String", {"final": "yes"})


def test_a_point_ahead_is_on_the_x_axis_and_for_the_simulation_on_the_y_axis():
    pose = Pose(1, 1, pi / 2)
    assert pose.relate(1, 3) == pytest.approx((2, 0))
    assert pose.relate(1, 3, pi / 2) == pytest.approx((0, 2))
    assert pose.relate(0, 1) == pytest.approx((0, 1))  # to the left
    assert pose.face(0, 1) == pytest.approx(pi / 2)


@given(NUMBERS, NUMBERS, ANGLES, NUMBERS, NUMBERS)
def test_place_is_the_inverse_of_relate(x, y, heading, px, py):
    pose = Pose(x, y, heading)
    assert pose.place(*pose.relate(px, py)) == pytest.approx((px, py), abs=1e-9)


@given(NUMBERS, NUMBERS, ANGLES, NUMBERS, NUMBERS)
def test_after_a_turn_by_face_the_point_is_ahead(x, y, heading, px, py):
    turn = Pose(x, y, heading).face(px, py)
    assert -pi < turn <= pi
    if hypot(px - x, py - y) > 1e-3:
        ahead, left = Pose(x, y, heading + turn).relate(px, py)
        assert ahead == pytest.approx(hypot(px - x, py - y))
        assert left == pytest.approx(0, abs=1e-6)


@given(ANGLES)
def test_the_quaternion_is_that_of_the_heading(heading):
    q = Pose(0, 0, heading).quaternion()
    assert q["w"] ** 2 + q["z"] ** 2 == pytest.approx(1)
    angle = atan2(2 * q["w"] * q["z"], 1 - 2 * q["z"] ** 2)
    assert cos(angle - heading) == pytest.approx(1)
