"""Messages of trackers and localisations as numbers; frames by known answers and laws."""

from math import atan2, cos, hypot, pi, sin

import pytest
from hypothesis import given, strategies as st

from lcorpp.errors import WorldError
from lcorpp.worlds.ros.fields import read_stamp
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.sensor_messages import (
    CLASSES,
    PEOPLE,
    POSES,
    Detection,
    PeopleReader,
    read_people,
    read_pose,
    read_speed,
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
    "people_msgs/PositionMeasurementArray": {
        "header": HEADER_2,
        "people": [{"header": HEADER_2, "name": "person", "object_id": "7", "pos": POSITION}],
    },
    "leg_tracker/PersonArray": {"header": HEADER_1, "people": [{"id": 7, "pose": {"position": POSITION}}]},
}
NUMBERS = st.floats(-100, 100)
ANGLES = st.floats(-10, 10)


@pytest.mark.parametrize("kind", PEOPLE)
def test_each_kind_of_tracker_gives_the_same_person(kind):
    assert read_people(kind, EXAMPLES[kind]) == [Detection("7", "map", 5.5, 1.0, 2.0)]


@pytest.mark.parametrize("kind", PEOPLE)
def test_a_message_of_another_type_is_left_out_with_one_warning_a_kind(kind, caplog):
    reader, items = PeopleReader(kind, "/people"), PEOPLE[kind].items
    for message in ({}, {"data": "x"}, {"header": 3}, {items: None}, {items: "x"}, {items: [1]}, {}):
        assert reader.read(message) == []
    missing, null, text, part = caplog.messages
    assert missing == f"/people: a message that is not {kind} is left out: it has no field {items!r}"
    assert null.endswith(f"the field {items!r} is a NoneType; expected a list")
    assert text.endswith(f"the field {items!r} is a str; expected a list")
    assert part == f"/people: a part of {items!r} is left out: it is a int; expected a message"


def change(value, path, new):
    """Return a copy of a message with other values in a field, wherever it is; DELETE removes it."""
    if isinstance(value, dict):
        changed = {k: new if k == path else change(v, path, new) for k, v in value.items()}
        return {k: v for k, v in changed.items() if v is not DELETE}
    return [change(v, path, new) for v in value] if isinstance(value, list) else value


DELETE = object()
ID_FIELDS = ("name", "track_id", "id", "object_id")


@pytest.mark.parametrize("kind", PEOPLE)
@pytest.mark.parametrize("field", ["x", "y", "stamp", "header", "frame_id", "position", "translation", "id"])
def test_a_person_with_half_the_fields_is_left_out_and_others_are_not(kind, field, caplog):
    example, items = EXAMPLES[kind], PEOPLE[kind].items
    names = ID_FIELDS if field == "id" else (field,)
    for new in (DELETE, None, True, [], {}, "" if field == "frame_id" else "1.0" if field in "xy" else []):
        faulty = example
        for name in names:
            faulty = change(faulty, name, new)
        if faulty != example:  # else this type has no such field
            caplog.clear()
            assert read_people(kind, faulty) == []
            assert len(caplog.messages) == (new is not None or field not in "xy")
            if field not in ("stamp", "header", "frame_id"):  # in most types those of the whole message
                mixed = {**example, items: [*faulty[items], *example[items]]}
                assert [person.id for person in read_people(kind, mixed)] == ["7"]


@pytest.mark.parametrize("kind", PEOPLE)
def test_people_without_a_finite_position_are_left_out(kind, caplog):
    for number in (None, float("nan"), float("inf"), 10**400):
        assert read_people(kind, change(EXAMPLES[kind], "x", number)) == []
    assert caplog.messages == []


@pytest.mark.parametrize("kind", PEOPLE)
def test_of_an_id_that_is_twice_the_first_counts(kind, caplog):
    items = PEOPLE[kind].items
    twice = [*EXAMPLES[kind][items], *change(EXAMPLES[kind][items], "x", 9.0)]
    (person,) = read_people(kind, {**EXAMPLES[kind], items: twice})
    assert person.x == 1.0
    assert caplog.messages == [f"{kind}: the id '7' is twice in one message; the first one counts"]


def read_ids(names):
    people = [{"name": name, "position": POSITION} for name in names]
    found = read_people("people_msgs/People", {"header": HEADER_2, "people": people})
    return [person.id for person in found]


def test_ids_are_texts_or_integers():
    assert read_ids([None, "", " ", "Ann", "null", 3, 4.0, float("nan"), True, ["5"]]) == [
        "Ann",
        "null",
        "3",
        "4",
    ]


CUBE, SPHERE, CYLINDER, MESH, TEXT = 1, 2, 3, 10, 9
POINTS = [{"x": 4.0, "y": 1.0, "z": 1.0}, {"x": 4.5, "y": 1.0, "z": 1.0}]


def marker(ns, id_, kind, x, y, **more):
    pose = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": {"w": 1.0}}
    return {
        "header": HEADER_2,
        "ns": ns,
        "id": id_,
        "type": kind,
        "action": 0,
        "pose": pose,
        "points": [],
    } | more


def read_markers(*markers):
    found = read_people("visualization_msgs/MarkerArray", {"markers": list(markers)})
    return {person.id: (person.x, person.y) for person in found}


@pytest.mark.parametrize("kind", range(12))
def test_bodies_and_arrows_by_a_pose_are_people(kind, caplog):
    is_person = kind in (0, CUBE, SPHERE, CYLINDER, MESH)
    assert read_markers(marker("a", 1, kind, 4.0, 1.0)) == ({"1": (4.0, 1.0)} if is_person else {})
    assert len(caplog.messages) == (not is_person)
    assert read_markers(marker("a", 1, kind, 4.0, 1.0, action=2)) == {}


def test_the_parts_of_a_person_are_one_person(caplog):
    parts = [
        marker("velocity", 1, 0, 0.0, 0.0, points=POINTS),
        marker("heading", 501, 0, 4.0, 1.0),
        marker("text", 1001, TEXT, 4.0, 1.0, text="1"),
        marker("body", 1, CYLINDER, 4.0, 1.0),
        marker("head", 1, SPHERE, 4.05, 1.0),
        marker("shoulders", 77, CUBE, 4.0, 1.1),
        marker("trail", 1, 4, 0.0, 0.0, points=POINTS),
        marker("body", 2, CYLINDER, 4.0, 1.2),
    ]
    assert read_markers(*parts) == {"1": (4.0, 1.0), "2": (4.0, 1.2)}
    assert caplog.messages == []


DETECTION = {"bbox": {"center": {"position": POSITION}}}


@pytest.mark.parametrize(
    ("fields", "ids", "warnings"),
    [
        ({}, [], 1),  # ROS 1
        ({"is_tracking": True, "tracking_id": "7"}, ["7"], 0),  # Foxy
        ({"is_tracking": False, "tracking_id": "7"}, [], 1),
        ({"tracking_id": ""}, [], 1),
        ({"id": "7"}, ["7"], 0),
    ],
)
def test_detections_of_each_version_of_vision_msgs(fields, ids, warnings, caplog):
    message = {"header": HEADER_2, "detections": [DETECTION | fields]}
    assert [person.id for person in read_people("vision_msgs/Detection3DArray", message)] == ids
    assert len(caplog.messages) == warnings


def result(kind, score, later=True, name="class_id"):
    hypothesis = {name: kind, "score": score}
    return {"hypothesis": hypothesis, "pose": {}} if later else {**hypothesis, "pose": {}}


@pytest.mark.parametrize(
    ("results", "classes", "is_person"),
    [
        ([], CLASSES, True),
        (None, CLASSES, True),
        ([result("chair", 0.9)], CLASSES, False),
        ([result("Person", 0.4)], CLASSES, True),
        ([result("chair", 0.9), result("person", 0.4)], CLASSES, False),
        ([result("chair", 0.3), result("person", 0.4)], CLASSES, True),
        ([result("chair", None), result("person", 0.4)], CLASSES, True),
        ([result("chair", 0.9, name="id")], CLASSES, False),
        ([result("person", 0.9, later=False, name="id")], CLASSES, True),
        ([result(62, 0.9, later=False, name="id")], CLASSES, False),
        ([result(1, 0.9, later=False, name="id")], ("1",), True),
        ([result("1", 0.9)], ("0",), False),
        ([result("", 0.9)], CLASSES, True),
        ([{"score": 1.0}], CLASSES, False),
        ([3], CLASSES, False),
        ("x", CLASSES, False),
    ],
)
def test_a_detection_is_a_person_by_its_most_probable_class(results, classes, is_person, caplog):
    reader = PeopleReader("vision_msgs/Detection3DArray", "/objects", classes=classes)
    fields = {"id": "7"} if results is None else {"id": "7", "results": results}
    message = {"header": HEADER_2, "detections": [DETECTION | fields]}
    for _ in range(2):
        assert len(reader.read(message)) == is_person
    assert len(caplog.messages) == (not is_person)


def test_the_class_that_is_left_out_is_named(caplog):
    message = {"header": HEADER_2, "detections": [DETECTION | {"id": "7", "results": [result("chair", 1)]}]}
    PeopleReader("vision_msgs/Detection3DArray", "/objects").read(message)
    (text,) = caplog.messages
    assert text.startswith(
        "/objects: detections of the class 'chair' are left out; the classes of people are"
    )
    assert text.endswith("human, pedestrian, people, person (robot.toml: [people] classes)")


def test_a_stamp_of_zero_is_none():
    assert read_stamp({"stamp": {"sec": 0, "nanosec": 0}}, "stamp") is None
    assert read_stamp({"secs": 3, "nsecs": 250_000_000}) == 3.25


@pytest.mark.parametrize("kind", POSES)
def test_the_heading_is_that_of_the_quaternion(kind):
    pose = {"position": POSITION, "orientation": {"x": 0, "y": 0, "z": sin(0.4), "w": cos(0.4)}}
    message = {"pose": pose if len(POSES[kind]) == 1 else {"pose": pose}}
    read = read_pose(kind, message)
    assert (read.x, read.y) == (1.0, 2.0)
    assert read.heading == pytest.approx(0.8)
    for field in ("x", "z", "w"):
        for number in (None, float("nan"), float("inf"), 10**400):
            assert read_pose(kind, change(message, field, number)) is None or field == "z"
        assert read_pose(kind, change(message, "w", 0.0)) is not None  # half a turn, with z
        with pytest.raises(WorldError, match=f"a message that is not {kind}: .*{field}"):
            read_pose(kind, change(message, field, "0.5"))
    with pytest.raises(WorldError, match=f"a message that is not {kind}"):
        read_pose(kind, {"pose": 3})


@pytest.mark.parametrize("kind", POSES)
def test_a_quaternion_of_zeros_is_no_heading(kind):
    pose = {"position": POSITION, "orientation": dict.fromkeys("xyzw", 0.0)}
    assert read_pose(kind, {"pose": pose if len(POSES[kind]) == 1 else {"pose": pose}}) is None


@pytest.mark.parametrize("x", [1e9, -1e308, 10**400])
def test_a_position_that_is_no_place_is_left_out(x):
    kind, message = "people_msgs/People", EXAMPLES["people_msgs/People"]
    assert read_people(kind, change(message, "x", x)) == []
    pose = {"position": {**POSITION, "x": x}, "orientation": dict(zip("xyzw", (0, 0, 0, 1), strict=True))}
    assert read_pose("geometry_msgs/PoseStamped", {"pose": pose}) is None


def test_a_pose_that_is_not_finite_is_an_error():
    with pytest.raises(WorldError, match="expected finite numbers"):
        Pose(0, float("nan"), 0)


def test_the_speed_is_that_of_the_twist():
    twist = {"linear": {"x": 0.3, "y": 0.4, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": -0.2}}
    assert read_speed({"twist": {"twist": twist}}) == pytest.approx(0.7)
    assert read_speed({"twist": {"twist": change(twist, "x", None)}}) is None
    assert read_speed({"twist": {}}) is None


def test_texts():
    assert read_text("hri_msgs/LiveSpeech", {"incremental": "ye", "final": "yes"}) == "yes"
    with pytest.raises(WorldError, match="a message that is not std_msgs/String: it has no field 'data'"):
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
