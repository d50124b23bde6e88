"""Turned cameras and depths in other units: no people are found, and notes name the cause."""

import re

import numpy as np
import pytest

from lcorpp.camera import DepthLocator, Frame, Intrinsics, Tracker
from lcorpp.camera.floor import find_floor
from lcorpp.camera.frames import make_frame
from lcorpp.camera.mounting import FloorObserver, rotate_frames, rotate_intrinsics, suggest_options
from lcorpp.errors import DataError
from tests.camera.corridor import Corridor, Mount, Person, add_noise, render

MOUNT = Mount(160, 120, 142.0)
HALL = Corridor(half_width=30, end=40, ceiling=9)


def see(mount=MOUNT, x=3.0, seed=0):
    """Return a depth image in millimetres of a person in a hall."""
    return add_noise(render(mount, [Person(x, 0.2)], HALL), np.random.default_rng(seed))


def turn(image, degrees, mount=MOUNT):
    """Return the frame and the intrinsics of a camera that is mounted turned anticlockwise."""
    image = np.ascontiguousarray(np.rot90(image, degrees // 90))
    k = mount.intrinsics
    if degrees % 180:
        k = Intrinsics(k.fy, k.fx, k.cy, k.cx)  # the principal point is the middle
    return make_frame(0.0, image, "image"), k


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_a_turned_camera_tracks_no_people_and_the_note_names_the_rotation(degrees):
    k, tracker, samples = turn(see(), degrees)[1], Tracker(), []
    locator = DepthLocator(k)
    observer = FloorObserver(locator, k)
    for index in range(12):
        frame, _ = turn(see(x=4 - 0.1 * index, seed=index), degrees)
        samples += tracker.update(index / 10, *locator.locate(frame.image))
        observer.observe(frame)
    assert samples == []
    note = observer.explain(has_people=False)
    mounted = "upside down" if degrees == 180 else "sideways"
    assert note.startswith(f"the floor was found in 0 of 12 images; is the camera mounted {mounted}?")
    assert f"--rotate {degrees} " in note


def follow(degrees, half_width, images=6):
    """Return the samples, the floors and the note of a camera that is turned between two walls."""
    mount, hall = Mount(160, 120, 142.0, 1.1, 0.1), Corridor(half_width=half_width, end=9)
    tracker, samples = Tracker(), []
    k = turn(see(mount), degrees, mount)[1]
    locator = DepthLocator(k)
    observer = FloorObserver(locator, k)
    for index in range(images):
        depths = render(mount, [Person(4.5 - 0.1 * index, 0.3)], hall)
        frame, _ = turn(add_noise(depths, np.random.default_rng(index)), degrees, mount)
        samples += tracker.update(index / 10, *locator.locate(frame.image))
        observer.observe(frame)
    return samples, locator.floor, observer.explain(has_people=bool(samples))


@pytest.mark.parametrize("half_width", [1.0, 1.6])
@pytest.mark.parametrize("degrees", [90, 270])
def test_a_wall_is_no_floor(degrees, half_width):
    """In a narrow corridor the other wall is too low for a ceiling; in a wide one the floor is nearer."""
    samples, floor, note = follow(degrees, half_width)
    assert f"is the camera mounted sideways? --rotate {degrees} turns" in note
    if half_width < 1.05:
        assert (samples, floor) == ([], None)
    else:
        assert re.match(r"the floor is 1\.6\d? m below .* one 1\.1\d? m below it and \d people", note)


@pytest.mark.parametrize("half_width", [1.0, 1.6])
def test_no_note_between_walls_if_the_camera_is_upright(half_width):
    samples, floor, note = follow(0, half_width)
    assert {person for _, person, _, _ in samples} == {1}
    assert floor.height == pytest.approx(1.1, abs=0.05)
    assert note is None


@pytest.mark.parametrize("degrees", [0, 90, 180, 270])
def test_turning_the_images_and_the_intrinsics_undoes_the_mounting(degrees):
    mount = Mount(160, 120, 142.0)
    frame, k = turn(see(mount), degrees)
    size = (frame.image.shape[1], frame.image.shape[0])
    (upright,) = rotate_frames([frame], degrees)
    assert rotate_intrinsics(k, degrees, size) == mount.intrinsics
    found = DepthLocator(rotate_intrinsics(k, degrees, size)).locate(upright.image)[0]
    expected = DepthLocator(mount.intrinsics).locate(turn(see(mount), 0)[0].image)[0]
    np.testing.assert_array_equal(found, expected)
    assert len(found) == 1


def test_intrinsics_of_a_quarter_turn():
    """A point at the right end is at the lower end after a turn clockwise."""
    k = Intrinsics(100.0, 90.0, 70.0, 40.0)
    assert rotate_intrinsics(k, 90, (160, 120)) == Intrinsics(90.0, 100.0, 79.0, 70.0)
    assert rotate_intrinsics(k, 180, (160, 120)) == Intrinsics(100.0, 90.0, 89.0, 79.0)
    image = np.arange(6.0, dtype=np.float32).reshape(2, 3)
    (turned,) = rotate_frames([Frame(0, image, "a")], 90)
    assert turned.image.tolist() == [[3, 0], [4, 1], [5, 2]]
    with pytest.raises(DataError, match="a rotation by 45 degrees; expected one of 0, 90, 180, 270"):
        rotate_intrinsics(k, 45, (160, 120))


@pytest.mark.parametrize(("roll", "is_found"), [(0, True), (12, True), (30, False), (49, False)])
def test_a_floor_is_not_far_inclined_to_a_side(roll, is_found):
    rng = np.random.default_rng(0)
    rays = rng.uniform((-0.5, 0.15), (0.5, 0.5), (600, 2))
    angle = np.radians(roll)
    disparities = np.maximum((np.sin(angle) * rays[:, 0] + np.cos(angle) * rays[:, 1]) / 1.2, 1e-3)
    assert (find_floor(rays, disparities, rng) is not None) == is_found


def test_a_plane_that_cuts_through_a_surface_is_no_floor():
    """Of a wall at the side, each plane has some points within its tolerance, evenly."""
    rays = np.random.default_rng(1).uniform((0.1, -0.5), (0.6, 0.5), (2000, 2))
    for seed in range(5):
        assert find_floor(rays, rays[:, 0] / 1.0, np.random.default_rng(seed)) is None


@pytest.mark.parametrize("tilt", [0.0, 0.5, 0.9])
def test_cameras_that_look_down_steeply_find_the_floor(tilt):
    mount = Mount(160, 120, 142.0, 2.4, tilt)
    locator = DepthLocator(mount.intrinsics)
    locator.locate(turn(see(mount), 0)[0].image)
    assert locator.floor.height == pytest.approx(2.4, abs=0.08)


def test_a_floor_that_jumps_is_used_from_its_second_image_on():
    low, high = (Mount(160, 120, 142.0, height) for height in (0.6, 1.4))
    locator = DepthLocator(low.intrinsics)
    heights, people = [], []
    for index, mount in enumerate((low, low, high, high, high, low, high)):
        people.append(len(locator.locate(turn(see(mount, seed=index), 0)[0].image)[0]))
        heights.append(locator.floor.height)
    assert people == [1, 1, 0, 1, 1, 0, 1]
    assert heights == pytest.approx([0.6, 0.6, 0.6, 1.4, 1.4, 1.4, 1.4], abs=0.05)


@pytest.mark.parametrize(
    ("stated", "kind", "words"),
    [
        (
            5000,
            np.uint16,
            r"with 1000 values a metre .* 6.*m below .*; with --depth-scale 5000 \(TUM RGB-D\)",
        ),
        (4000, np.uint16, r"4.*m below the camera; with .*--depth-scale 4000 \(RealSense L515\): 1.2 m"),
        (10000, np.uint16, r"12.*m below the camera; with .*--depth-scale 10000 \(RealSense D405\): 1.2 m"),
        (8000, np.uint16, r"9.*m below the camera; with .*--depth-scale 8000 \(RealSense SR300\): 1.2 m"),
        (100, np.uint16, r"is 0.12 m below the camera; with --depth-scale 100 \(centimetres\): 1.2 m"),
        (1000, np.float32, r"with 1 values a metre .*; with --depth-scale 1000 \(millimetres\): 1.2 m"),
    ],
)
def test_the_likely_unit_of_the_depths_is_named(stated, kind, words):
    image = np.minimum(see().astype(float) * stated / 1000, 65535).astype(kind)
    frame = make_frame(0.0, image, "image")
    locator = DepthLocator(MOUNT.intrinsics)
    assert len(locator.locate(frame.image)[0]) == 0
    observer = FloorObserver(locator, MOUNT.intrinsics)
    observer.observe(frame)
    assert re.search(words, observer.explain(has_people=False))
    right = make_frame(0.0, image, "image", stated)
    assert len(DepthLocator(MOUNT.intrinsics).locate(right.image)[0]) == 1


def test_no_note_where_nothing_is_wrong():
    frame, k = turn(see(), 0)
    locator = DepthLocator(k)
    observer = FloorObserver(locator, k)
    for _ in range(3):
        locator.locate(frame.image)
        observer.observe(frame)
    assert observer.explain(has_people=False) is None
    assert suggest_options(frame, k) is None
    unknown = make_frame(0.0, np.zeros((120, 160), np.uint16), "image")
    assert suggest_options(unknown, k) is None


def test_values_a_metre():
    frame = make_frame(0.0, np.array([[0, 5000]], np.uint16), "image", 5000)
    assert (np.isnan(frame.image[0, 0]), frame.image[0, 1], frame.depth_scale) == (True, 1, 5000)
    assert make_frame(0.0, np.array([[2.0]], np.float32), "image").depth_scale == 1
