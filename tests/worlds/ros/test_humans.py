"""People as frames of ROS4HRI: persons, faces, gazes and bodies."""

import sqlite3
from contextlib import closing
from math import atan2, cos, hypot, pi, sin
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from lcorpp.errors import DataError
from lcorpp.worlds.ros.people import humans
from lcorpp.worlds.ros.people.humans import HumanReader, measure_gaze
from lcorpp.worlds.ros.people.people_bag import read_people_bag
from lcorpp.worlds.ros.transforms import TransformTree
from tests.worlds.ros.humans_bag import (
    LEVEL,
    OPTICAL,
    TO_GAZE,
    HumansBag,
    multiply,
    named,
    see,
    show,
    transform,
    turn_face,
)

ENGAGEMENT = Path(__file__).parents[4] / "shared" / "data" / "engagement"
ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}


def read_frames(*messages, **options):
    reader = HumanReader("/tf", **options)
    found = [[(p.id, p.x, p.y) for p in reader.read({"transforms": list(m)})] for m in messages]
    return [*found, [(p.id, p.x, p.y) for p in reader.flush()]]


def test_a_face_with_a_gaze_is_one_person():
    face, gaze = transform("face_a1"), transform("gaze_a1", "face_a1", **ZERO)
    later = transform("face_a1", time=6.0)
    assert read_frames([face, gaze], [gaze], [later]) == [[("a1", 1.0, 2.0)], [], [], [("a1", 1.0, 2.0)]]
    alone = transform("gaze_a1"), transform("gaze_a1", time=5.5, x=3.0)
    assert read_frames([alone[0]], [face], [alone[1]]) == [
        [("a1", 1.0, 2.0)],
        [],
        [("a1", 1.0, 2.0)],  # the face, whose own gaze has not come; a gaze that is not below it counts less
        [],
    ]


def test_a_face_counts_until_there_are_persons():
    face, gaze = transform("/face_a1"), transform("gaze_a1", "face_a1", **ZERO)
    person, later = transform("/person_ann", "/map", x=1.1), transform("/face_a1", time=6.0)
    found = read_frames([face, gaze], [person, later, gaze], [later])
    assert found == [[("a1", 1.0, 2.0)], [("ann", 1.1, 2.0)], [], []]


def test_in_an_optical_frame_the_z_axis_is_ahead():
    face = transform("face_a1", "camera_color_optical_frame", x=0.5, y=-0.2, z=2.0)
    assert read_frames([face])[-1] == [("a1", 2.0, -0.5)]


@pytest.mark.parametrize("turn", [-0.7, 0.0, 0.4])
@pytest.mark.parametrize("has_gaze", [True, False])
def test_the_gaze_of_a_known_face(turn, has_gaze):
    """The face is 3 m ahead, 1 m to the right and .5 m above the camera, level, and turned to its left."""
    reader = HumanReader("/tf")
    face = transform("face_a", OPTICAL, turn_face(turn), x=1.0, y=-0.5, z=3.0)
    rotation = TO_GAZE if has_gaze else LEVEL
    found = reader.read({"transforms": [face]})
    if has_gaze:
        found += reader.read({"transforms": [transform("gaze_a", "face_a", rotation, **ZERO)]})
    (person,) = found + reader.flush()
    assert (person.x, person.y, person.columns["z"]) == pytest.approx((3.0, -1.0, 0.5))
    columns = person.columns
    distance = hypot(3.0, 1.0, 0.5)
    assert columns["face_distance"] == pytest.approx(distance)
    assert columns["robot_angle"] == pytest.approx(np.arccos(3.0 / distance))
    assert cos(columns["facing"]) == pytest.approx(cos(pi + turn))
    assert sin(columns["facing"]) == pytest.approx(sin(pi + turn))
    assert columns["tilt"] == pytest.approx(0.0, abs=1e-12)
    direction = np.array([cos(pi + turn), sin(pi + turn), 0.0])
    expected = np.arccos(direction @ np.array([-3.0, 1.0, -0.5]) / distance)
    assert columns["gaze_angle"] == pytest.approx(expected)


def test_the_angle_is_exact_near_zero():
    found = measure_gaze(np.array([2.0, 0.0, 0.0]), np.array([-1.0, 1e-9, 0.0]))
    assert found["gaze_angle"] == pytest.approx(1e-9)


def test_positions_are_in_the_first_frame_that_is_connected():
    """The camera is at (.2, 0, 1.2) on the robot, which is at (5, 1) and faces +y."""
    reader = HumanReader("/tf", targets=("map", "base_link"))
    quarter = (0.0, 0.0, sin(pi / 4), cos(pi / 4))
    optical = transform(OPTICAL, "camera", (-0.5, 0.5, -0.5, 0.5), **ZERO)
    camera = transform("camera", "base_link", x=0.2, y=0.0, z=1.2)
    face = transform("face_a", OPTICAL, LEVEL, x=0.0, y=-0.4, z=2.0)
    reader.read({"transforms": [optical, camera]})
    assert reader.read({"transforms": [face]}) == []
    (on_robot,) = reader.read({"transforms": [transform("gaze_a", "face_a", TO_GAZE, **ZERO)]})
    assert (on_robot.frame, on_robot.x, on_robot.y) == ("base_link", pytest.approx(2.2), pytest.approx(0.0))
    assert on_robot.columns["z"] == pytest.approx(1.6)
    assert abs(on_robot.columns["facing"]) == pytest.approx(pi)
    reader.read({"transforms": [transform("base_link", "odom", quarter, x=4.0, y=1.0, z=0.0)]})
    reader.read({"transforms": [transform("odom", "map", x=1.0, y=0.0, z=0.0)]})
    face = transform("face_a", OPTICAL, LEVEL, time=6.0, x=0.0, y=-0.4, z=2.0)
    reader.read({"transforms": [face]})
    (in_map,) = reader.flush()
    assert (in_map.frame, in_map.x, in_map.y) == ("map", pytest.approx(5.0), pytest.approx(3.2))
    assert in_map.columns["facing"] == pytest.approx(-pi / 2)
    for name in ("gaze_angle", "robot_angle", "face_distance"):
        assert in_map.columns[name] == pytest.approx(on_robot.columns[name])


def test_the_gaze_is_relative_to_the_head_of_the_robot():
    """The head is half a metre to the left of the camera and faces a quarter to the left."""
    reader = HumanReader("/tf", head="head")
    quarter = (0.0, 0.0, sin(pi / 4), cos(pi / 4))
    camera = transform(OPTICAL, "base", (-0.5, 0.5, -0.5, 0.5), **ZERO)
    reader.read({"transforms": [camera, transform("head", "base", quarter, x=0.0, y=0.5, z=0.0)]})
    reader.read({"transforms": [transform("face_a", OPTICAL, LEVEL, x=0.0, y=0.0, z=2.0)]})
    (person,) = reader.flush()
    assert person.columns["face_distance"] == pytest.approx(hypot(2.0, 0.5))
    assert person.columns["gaze_angle"] == pytest.approx(atan2(0.5, 2.0))
    assert person.columns["robot_angle"] == pytest.approx(pi / 2 + atan2(0.5, 2.0))


def name_face(reader, person, face, part="face"):
    return [d.id for d in reader.read_human(f"/humans/persons/{person}/{part}_id", {"data": face})]


def show_face(reader, face, time, **at):
    gaze = transform(f"gaze_{face}", f"face_{face}", TO_GAZE, time, **ZERO)
    message = [transform(f"face_{face}", OPTICAL, LEVEL, time, **({"z": 2.0} | at)), gaze]
    return [d.id for d in reader.read({"transforms": message})]


def test_a_face_waits_for_its_person():
    reader = HumanReader("/tf", waits=True)
    assert show_face(reader, "f", 1.0) + show_face(reader, "f", 1.5) == []
    assert name_face(reader, "ann", "f") == ["ann", "ann"]
    assert show_face(reader, "f", 1.6) == ["ann"]


def test_a_face_without_a_person_has_its_own_id_after_a_second():
    reader = HumanReader("/tf", waits=True)
    assert [show_face(reader, "f", time) for time in (1.0, 1.5, 2.1, 2.2)] == [[], [], ["f"] * 3, ["f"]]


def test_a_person_has_several_faces_and_a_face_passes_to_another_person():
    reader = HumanReader("/tf")
    name_face(reader, "ann", "f")
    assert show_face(reader, "f", 1.0) == ["ann"]
    name_face(reader, "ann", "g")
    assert show_face(reader, "g", 1.1) == ["ann"]
    assert show_face(reader, "f", 1.2) == []  # the latest face counts, as long as it is seen
    assert show_face(reader, "f", 1.1 + humans.MAX_PAUSE + 0.1) == ["ann"]
    name_face(reader, "bob", "f")
    assert show_face(reader, "f", 2.0) == ["bob"]
    name_face(reader, "bob", "")
    assert show_face(reader, "f", 2.1) == ["bob"]


def test_a_person_is_where_the_face_is_or_the_body_without_one():
    reader = HumanReader("/tf")
    name_face(reader, "ann", "f")
    name_face(reader, "ann", "b", "body")

    def read(kind, id, time):
        found = reader.read({"transforms": [transform(f"{kind}_{id}", "map", time=time)]})
        return [(d.id, d.columns.keys()) for d in found]

    assert read("body", "b", 0.5) == [("ann", {"z"})]
    assert show_face(reader, "f", 1.0) == ["ann"]
    assert read("body", "b", 1.2) == read("person", "ann", 1.2) == []
    assert read("person", "ann", 2.0) == [("ann", {"z"})]


FAULTS = {
    "quaternion": (
        transform("face_f", OPTICAL, (0.5, 0.5, -0.5, 0.3)),
        "a transform is left out: the quaternion [0.5, 0.5, -0.5, 0.3] of the frame 'face_f' has length"
        " 0.917; expected 1",
    ),
    "position": (
        transform("face_f", OPTICAL, LEVEL, x=float("nan")),
        "a person is left out: transform.translation is [nan, 2.0, 0.5]; expected finite numbers",
    ),
    "own parent": (
        transform("face_f", "face_f", LEVEL),
        "a transform is left out: the frame 'face_f' is its own parent",
    ),
    "no text": (
        {**transform("face_f"), "child_frame_id": 3},
        "a transform is left out: the field 'child_frame_id' is a int; expected a text",
    ),
    "no rotation": (
        {**transform("face_f"), "transform": {"translation": dict.fromkeys("xyz", 1.0)}},
        "a transform is left out: it has no field 'rotation'",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faulty_frames_are_named_and_others_are_read(name, caplog):
    faulty, expected = FAULTS[name]
    reader = HumanReader("/tf")
    reader.read({"transforms": [faulty]})
    reader.read({"transforms": [transform("face_g", OPTICAL, LEVEL)]})
    found = {d.id: d.columns.keys() for d in reader.flush()}
    assert found.pop("g") >= {"gaze_angle", "robot_angle", "face_distance"}
    assert not found or found == {"f": {"z"}}  # a place without a direction
    assert f"/tf: {expected}" in caplog.messages


def test_two_faces_with_one_id_at_one_time_are_named(caplog):
    reader = HumanReader("/tf")
    assert show_face(reader, "f", 1.0) == ["f"]
    assert show_face(reader, "f", 1.0) == []
    assert caplog.messages == []  # the same frame again
    assert show_face(reader, "f", 1.0, x=3.0) == []
    assert caplog.messages == ["/tf: the id 'f' is twice at one time; the first one counts"]


def test_a_face_that_is_not_connected_to_the_head_has_a_place_and_no_gaze(caplog):
    reader = HumanReader("/tf", head="head")
    reader.read({"transforms": [transform("face_f", OPTICAL, LEVEL, z=2.0)]})
    (person,) = reader.flush()
    assert (person.x, person.columns) == (2.0, {"z": pytest.approx(-2.0)})
    (text,) = caplog.messages
    assert text == "/tf: no gaze of 'face_f': it is not connected to 'head', or its rotation is invalid"


def test_a_loop_of_frames_ends(caplog):
    tree = TransformTree("/tf")
    tree.add({"transforms": [transform("a", "b"), transform("b", "c"), transform("c", "a")]})
    assert tree.find("a", "map") is None
    assert caplog.messages == ["/tf: the frames above 'b' are a loop"]


@pytest.mark.parametrize("seed", range(5))
def test_a_tree_multiplies_its_links(seed):
    """Against the product of homogeneous matrices; there and back is the identity."""
    rng = np.random.default_rng(seed)
    tree, matrices = TransformTree("/tf"), {}
    for child, parent in (("a", "root"), ("b", "a"), ("c", "b"), ("d", "root"), ("e", "d")):
        q = rng.normal(size=4)
        q /= np.linalg.norm(q)
        at = dict(zip("xyz", rng.normal(size=3).tolist(), strict=True))
        tree.add({"transforms": [transform(child, parent, q.tolist(), **at)]})
        axes = [multiply(multiply(q, (*axis, 0.0)), (*-q[:3], q[3]))[:3] for axis in np.eye(3)]
        matrices[child] = np.eye(4)
        matrices[child][:3, :3], matrices[child][:3, 3] = np.array(axes).T, list(at.values())
    expected = np.linalg.inv(matrices["d"] @ matrices["e"]) @ matrices["a"] @ matrices["b"] @ matrices["c"]
    found = tree.find("c", "e")
    np.testing.assert_allclose(found.rotation, expected[:3, :3], atol=1e-12)
    np.testing.assert_allclose(found.translation, expected[:3, 3], atol=1e-12)
    back = tree.find("e", "c") @ found
    np.testing.assert_allclose(back.rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(back.translation, 0, atol=1e-12)


def test_ids_that_change_are_forgotten(monkeypatch):
    monkeypatch.setattr(humans, "MAX_FRAMES", 10)
    reader = HumanReader("/tf")
    for k in range(100):
        assert show_face(reader, f"f{k}", float(k)) == [f"f{k}"]
    assert len(reader._last) <= 10
    assert "face_f1" not in reader.tree
    assert "face_f99" in reader.tree


def test_a_bag_has_its_person_under_every_face(tmp_path):
    path = HumansBag(tmp_path / "bag", faces=((0.0, "f1"), (2.0, "f2")), named_from=0.3).write()
    samples = read_people_bag(path)
    assert {sample.person for sample in samples} == {"ann"}
    assert len(samples) == 120
    times = np.array([sample.time for sample in samples])
    np.testing.assert_allclose(times, 1000 + np.arange(120) / 30, atol=1e-6)
    found = np.array([sample.columns["facing"] for sample in samples])
    expected = pi + 0.3 * np.sin(times - 1000)
    np.testing.assert_allclose(np.cos(found), np.cos(expected), atol=1e-9)
    np.testing.assert_allclose([sample.x for sample in samples], 2 - 0.1 * (times - 1000), atol=1e-9)
    assert {(round(sample.y, 9), round(sample.columns["z"], 9)) for sample in samples} == {(-0.1, 0.2)}


def test_a_frame_of_the_robot_places_people(tmp_path, caplog):
    links = (
        transform(OPTICAL, "camera", (-0.5, 0.5, -0.5, 0.5), **ZERO),
        transform("camera", "base_link", x=0.2, y=0.0, z=1.2),
    )
    path = HumansBag(tmp_path / "bag", links=links).write()
    first = read_people_bag(path, frame="base_link")[0]
    assert (first.x, first.y, first.columns["z"]) == pytest.approx((2.2, -0.1, 1.4))
    with pytest.raises(
        DataError, match="no person's frame is connected to 'mapp'; found 'camera_optical_frame'"
    ):
        read_people_bag(path, frame="mapp")


def test_a_bag_without_people_is_an_error(tmp_path):
    path = HumansBag(tmp_path / "bag", seconds=0.0, named_from=None, links=(transform("a", "b"),)).write()
    with pytest.raises(
        DataError, match=r"has no people: no frame person_<id>, face_<id>, .* in /tf, /tf_static"
    ):
        read_people_bag(path)


@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
def test_what_is_readable_of_a_cut_bag_is_read(tmp_path, share, caplog):
    path = HumansBag(tmp_path / "bag", seconds=20.0).write()
    whole = read_people_bag(path)
    (file,) = path.glob("*.db3")
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    found = read_people_bag(path)
    assert found == whole[: len(found)] or found[:-1] == whole[: len(found) - 1]
    assert len(found) > 0.2 * len(whole)
    assert [f"{path}: is damaged: " in text for text in caplog.messages] == [True]


def test_a_bag_without_its_description_is_read(tmp_path, caplog):
    path = HumansBag(tmp_path / "bag").write()
    whole = read_people_bag(path)
    (path / "metadata.yaml").unlink()
    assert read_people_bag(path) == whole
    (text,) = caplog.messages
    assert text.endswith("messages are read")


def read_bag(path, *messages, **options):
    return read_people_bag(HumansBag(path, messages=list(messages)).write(), **options)


def test_a_person_who_left_before_the_end_has_the_face_of_before(tmp_path):
    """Another frame of a person does not take the faces away; at the end nobody is tracked."""
    messages = [named("ann", "f1", 0.0)]
    for k in range(90):
        listed = {
            "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
            "ids": ["ann"] if k < 60 else [],
        }
        messages.append(("/humans/persons/tracked", k / 30, listed))
        if k < 60:
            person = transform("person_ann", OPTICAL, LEVEL, 1000 + k / 30, x=0.0, y=0.0, z=2.0)
            messages.append(show(person, see("f1", k / 30), time=k / 30 + 0.001))
    samples = read_bag(tmp_path / "bag", *messages)
    assert {sample.person for sample in samples} == {"ann"}
    assert sum("gaze_angle" in sample.columns for sample in samples) == 60


def test_a_face_without_a_stamp_has_the_time_of_its_recording(tmp_path):
    messages = [
        show(transform("face_f", OPTICAL, LEVEL, 0.0, x=k / 30, y=0.0, z=2.0), time=k / 30) for k in range(30)
    ]
    samples = read_bag(tmp_path / "bag", *messages)
    assert len(samples) == 30
    np.testing.assert_allclose([sample.time for sample in samples], 1000 + np.arange(30) / 30, atol=1e-6)
    np.testing.assert_allclose([-sample.y for sample in samples], np.arange(30) / 30, atol=1e-9)


def test_of_an_id_that_is_twice_all_columns_are_of_the_first(tmp_path, caplog):
    messages = []
    for k in range(30):
        gaze = transform("gaze_f", "face_f", TO_GAZE, 1000 + k / 30, **ZERO)
        messages += [
            show(see("f", k / 30, x=1.0, z=1.0), time=k / 30),
            show(see("f", k / 30, x=-1.0, z=5.0), gaze, time=k / 30 + 0.001),
        ]
    samples = read_bag(tmp_path / "bag", *messages)
    assert {(s.x, s.y, round(s.columns["face_distance"], 6)) for s in samples} == {(1.0, -1.0, 1.414214)}
    assert len(caplog.messages) == 1


def test_the_order_of_face_and_gaze_in_a_message_does_not_matter(tmp_path):
    found = []
    for order in (1, -1):
        messages = []
        for k in range(30):
            gaze = transform("gaze_f", "face_f", TO_GAZE, 1000 + k / 30, **ZERO)
            messages.append(show(*[see("f", k / 30, z=2.0 + k), gaze][::order], time=k / 30))
        found.append(read_bag(tmp_path / f"bag{order}", *messages))
    assert [(s.x, s.columns) for s in found[0]] == [(s.x, s.columns) for s in found[1]]
    assert all(sample.x == pytest.approx(sample.columns["face_distance"]) for sample in found[0])


def test_ids_that_change_lose_no_samples(tmp_path):
    """Every three frames the face of ann has another id; then a face passes to bob."""
    messages = []
    for k in range(90):
        face = f"f{k // 3}"
        messages += [named("ann", face, k / 30), show(see(face, k / 30), time=k / 30 + 0.001)]
    messages += [named("bob", "f29", 3.0), show(see("f29", 3.1, x=9.0), time=3.1)]
    samples = read_bag(tmp_path / "bag", *messages)
    assert sum(sample.person == "ann" for sample in samples) == 90
    assert [(sample.person, sample.y) for sample in samples][-1] == ("bob", -9.0)


def test_a_gaze_that_is_not_below_its_face_is_the_same_person(tmp_path):
    messages = [named("ann", "f", 0.0)]
    for k in range(30):
        gaze = transform("gaze_f", OPTICAL, (1.0, 0.0, 0.0, 0.0), 1000 + k / 30, x=0.0, y=0.0, z=2.0)
        messages.append(show(see("f", k / 30), gaze, time=k / 30))
    assert {sample.person for sample in read_bag(tmp_path / "bag", *messages)} == {"ann"}


def test_samples_in_other_frames_are_left_out_with_a_warning(tmp_path, caplog):
    link = transform(OPTICAL, "base_link", (-0.5, 0.5, -0.5, 0.5), **ZERO)
    late = [show(see("f", k / 30), time=k / 30) for k in range(30)]
    late.insert(15, ("/tf_static", 0.5, {"transforms": [link]}))
    assert len(read_bag(tmp_path / "late", *late, frame="/base_link")) in (14, 15)
    assert "samples are not connected to 'base_link': left out" in caplog.messages[-1]
    mixed = [
        show(transform("face_f", OPTICAL if k % 3 else "other", LEVEL, 1000 + k / 30, **ZERO), time=k / 30)
        for k in range(30)
    ]
    assert len(read_bag(tmp_path / "mixed", *mixed)) == 20
    assert "10 of 30 samples are in another frame than most of the person's" in caplog.messages[-1]


def test_one_kind_of_fault_is_one_warning(tmp_path, caplog):
    messages = [
        show(
            transform("face_f", OPTICAL, (0.5, 0.5, -0.5, 0.3 + k / 1000), 1000 + k / 30, **ZERO), time=k / 30
        )
        for k in range(30)
    ]
    messages += [show(see("g", k / 30, x=1e10 + k), time=k / 30) for k in range(30)]
    read_bag(tmp_path / "bag", *messages)
    assert len(caplog.messages) == 3  # the rotation, the gaze that it leaves unknown, and the distance


@pytest.mark.parametrize("damage", ["payload", "page", "two files"])
def test_what_is_left_of_a_bag_with_one_fault_is_read(tmp_path, caplog, damage):
    path = HumansBag(tmp_path / "bag", seconds=20.0).write()
    whole = read_people_bag(path)
    (file,) = path.glob("*.db3")
    if damage == "payload":
        with closing(sqlite3.connect(file)) as database:
            database.execute("update messages set data = x'0001000005' where id = 700")
            database.commit()
    elif damage == "page":
        content = bytearray(file.read_bytes())
        content[len(content) // 2 : len(content) // 2 + 4096] = bytes(4096)
        file.write_bytes(content)
    else:
        (path / "bag_1.db3").write_bytes(file.read_bytes()[:100_000])
        (path / "metadata.yaml").unlink()
    found = read_people_bag(path)
    assert len(found) > 0.3 * len(whole)
    known = {(sample.time, sample.x) for sample in whole}
    assert sum((sample.time, sample.x) in known for sample in found) > 0.99 * len(found)
    assert caplog.messages


@pytest.mark.skipif(not ENGAGEMENT.is_dir(), reason="the recordings are not here (shared/data/engagement)")
@pytest.mark.parametrize(
    ("name", "people"), [("1p_AA_eng_1", 1), ("2p_AA_FV_dis_1", 2), ("2p_AA_FV_eng_1", 2)]
)
def test_recorded_faces_are_those_of_their_frames(name, people):
    """In the last bag there are frames of persons, too. The angles are computed by scipy, of all faces."""
    from scipy.spatial.transform import Rotation

    samples = read_people_bag(ENGAGEMENT / name)
    assert len({sample.person for sample in samples}) == people
    expected = []
    with AnyReader([ENGAGEMENT / name]) as reader:
        tf = [c for c in reader.connections if c.topic == "/tf"]
        for connection, _, data in reader.messages(tf):
            for one in reader.deserialize(data, connection.msgtype).transforms:
                if one.child_frame_id.startswith("face_"):
                    q, p = one.transform.rotation, one.transform.translation
                    axis = Rotation.from_quat([q.x, q.y, q.z, q.w]).apply([1, 0, 0])
                    at = np.array([p.x, p.y, p.z])
                    expected.append(np.arccos(-axis @ at / np.linalg.norm(at)))
    found = sorted(sample.columns["gaze_angle"] for sample in samples)
    np.testing.assert_allclose(found, sorted(expected), atol=1e-7)
