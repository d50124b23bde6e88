"""People in colour images: the camera above the floor, background subtraction, detectors."""

import numpy as np
import pytest

from lcorpp.camera import (
    BackgroundDetector,
    Frame,
    GroundCamera,
    HogDetector,
    ImageLocator,
    Tracker,
    find_feet,
    make_detector,
    read_homography,
    score_tracks,
    track_people,
)
from lcorpp.errors import DataError, FileError, LcorppError

pytest.importorskip("cv2", reason="opencv-python-headless is not installed")

SIZE = (320, 240)
FOCAL, HEIGHT, TILT = 300.0, 4.0, 0.45


def make_projection():
    """Return (3, 4) of a camera 4 m above the floor that looks along x; y is to the left."""
    sine, cosine = np.sin(TILT), np.cos(TILT)
    turn = np.array([[0, -1, 0], [-sine, 0, -cosine], [cosine, 0, -sine]])
    intrinsic = np.array([[FOCAL, 0, SIZE[0] / 2], [0, FOCAL, SIZE[1] / 2], [0, 0, 1]])
    return intrinsic @ np.column_stack([turn, -turn @ (0, 0, HEIGHT)])


PROJECTION = make_projection()
CAMERA = GroundCamera(np.linalg.inv(PROJECTION[:, [0, 1, 3]]), SIZE)


def draw(people, seed, light=1.0):
    """Return an image of a textured floor with people as boxes of .5 x 1.75 m, the farthest first."""
    texture = np.random.default_rng(99).integers(100, 130, (60, 80, 3)).repeat(4, 0).repeat(4, 1)
    image = texture.astype(float)
    for x, y in sorted(people, reverse=True):
        feet = CAMERA.project(np.array([[x, y + 0.22, 0], [x, y - 0.22, 0], [x, y, 1.7]]))
        (left, bottom), (right, _), (_, top) = np.rint(feet).astype(int)
        image[max(top, 0) : bottom, max(left, 0) : max(right, 0)] = (30, 30, 200)
    noise = np.random.default_rng(seed).normal(0, 3, image.shape)
    return np.clip(light * image + noise, 0, 255).astype(np.uint8)


def test_the_projection_follows_from_the_homography():
    assert CAMERA.projection / CAMERA.projection[2, 3] == pytest.approx(
        PROJECTION / PROJECTION[2, 3], rel=0.03, abs=1
    )
    points = np.array([[6.0, 1.0, 1.75], [12.0, -2.0, 0.0]])
    homogeneous = np.column_stack([points, np.ones(2)]) @ PROJECTION.T
    assert CAMERA.project(points) == pytest.approx(homogeneous[:, :2] / homogeneous[:, 2:], abs=1.5)  # pixels


def test_pixels_and_metres_are_inverse_and_the_sky_is_unknown():
    pixels = np.array([[10.0, 200.0], [300.0, 120.0]])
    assert CAMERA.to_pixels(CAMERA.to_metres(pixels)) == pytest.approx(pixels)
    assert np.isnan(CAMERA.to_metres([[160.0, -80.0]])).all()


def test_covariances_agree_with_samples():
    rng, pixel = np.random.default_rng(0), np.array([[160.0, 200.0]])
    covariance = CAMERA.measure_covariances(pixel, CAMERA.to_metres(pixel), 1.0)[0]
    sampled = np.cov(CAMERA.to_metres(pixel + rng.normal(0, 1, (4000, 2))).T)
    assert covariance == pytest.approx(sampled, rel=0.1, abs=1e-4)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.eye(2), "has shape (2, 2); expected (3, 3)"),
        (np.full((3, 3), np.nan), "not finite"),
        (np.ones((3, 3)), "is singular"),
        (np.zeros((3, 3)), "is singular"),
        (np.array([[1.0, 0, 0], [0, 1, 0], [0, 1, -240]]), "has its horizon at the bottom"),
    ],
)
def test_a_wrong_homography_is_refused(matrix, message):
    with pytest.raises(DataError) as caught:
        GroundCamera(matrix, SIZE)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 0 0\n0 1\n0 0 1\n", "h.txt:2:1: 2 numbers; expected three rows of three numbers"),
        ("1 0 0\n0 x 0\n0 0 1\n", "h.txt:2:3: 'x' is not a finite number"),
        ("1 0 0\n0 1 inf\n0 0 1\n", "h.txt:2:5: 'inf' is not a finite number"),
        ("1 0 0\n0 1 0\n", "h.txt:3:1: 2 rows; expected three rows"),
        ("1 0 0\n0 1 0\n0 0 1\n1 1 1\n", "h.txt:4:1: a fourth row"),
        ("", "h.txt:1:1: 0 rows"),
    ],
)
def test_a_malformed_homography_is_located(text, message, tmp_path):
    (tmp_path / "h.txt").write_text(text)
    with pytest.raises(LcorppError) as caught:
        read_homography(tmp_path / "h.txt")
    assert message in str(caught.value)


def test_a_homography_is_read(tmp_path):
    (tmp_path / "h.txt").write_text("# pixels to metres\n1, 0, 2\n0 1 3\n\n0 0 1 # the last\n")
    assert read_homography(tmp_path / "h.txt").tolist() == [[1, 0, 2], [0, 1, 3], [0, 0, 1]]
    with pytest.raises(FileError):
        read_homography(tmp_path / "none.txt")


def walk_across(time):
    """Two people who come after a second and cross, and one who is there at first and leaves late."""
    people = [(8.0, -3.2 + 0.9 * time), (9.5, 3.2 - 0.9 * time)] if time >= 1 else []
    return people + ([(7.0, 1.8 + max(0.0, time - 3))] if time < 4 else [])


@pytest.mark.parametrize("change", ["none", pytest.param("light", marks=pytest.mark.slow)])
def test_people_in_front_of_a_background_are_tracked(change):
    """The one who stands there is part of the background at first; where it stood is a ghost, no person."""
    locator = ImageLocator(make_detector("background", CAMERA), CAMERA)
    truth, frames = [], []
    for index in range(60):
        time = index / 10
        light = 1 - 0.4 * (change == "light") * min(1, index / 30)
        people = walk_across(time)
        frames.append(Frame(time, draw(people, index, light), f"image {index}"))
        if index >= 10:
            truth += [(time, i, *p) for i, p in enumerate(people[:2])]
    samples = [s for _, new in track_people(frames, locator, Tracker()) for s in new if s[0] >= 1]
    score = score_tracks(truth, samples, max_distance=0.7)
    assert score.misses <= 0.1 * score.truths
    assert score.switches <= 1
    assert score.rmse < 0.35
    late = [s for s in samples if s[0] > 5]
    assert all(min(np.hypot(s[2] - p[0], s[3] - p[1]) for p in walk_across(s[0])) < 1 for s in late)


def test_people_who_overlap_in_the_image_are_two():
    detector = BackgroundDetector(CAMERA)
    for index in range(20):
        detector(draw([], index))
    feet = find_feet(detector, draw([(8.0, 0.0), (9.5, 0.5)], 20))
    assert sorted(CAMERA.to_metres(feet)[:, 0].tolist()) == pytest.approx([8.0, 9.5], abs=0.8)


def test_an_empty_scene_has_nobody():
    detector = BackgroundDetector(CAMERA)
    assert sum(len(detector(draw([], index))) for index in range(10)) == 0


def test_hog_finds_nobody_in_noise_and_in_a_tiny_image():
    detector = HogDetector()
    assert find_feet(detector, draw([], 0)).shape == (0, 2)
    assert find_feet(detector, np.zeros((20, 20, 3), np.uint8)).shape == (0, 2)


def test_own_detectors(tmp_path):
    own = tmp_path / "own.py"
    own.write_text(
        "def boxes(image):\n    return [(100, 100, 20, 60)]\n"
        "def feet(image):\n    return [[110, 160]]\n"
        "def wrong(image):\n    return [[1, 2, 3]]\n"
        "def fails(image):\n    return image.nothing\n"
        "def nobody(image):\n    return []\n"
    )
    image = draw([], 0)
    for name in ("boxes", "feet"):
        assert find_feet(make_detector(f"{own}:{name}", CAMERA), image).tolist() == [[110, 160]]
    assert find_feet(make_detector(f"{own}:nobody", CAMERA), image).shape == (0, 2)
    with pytest.raises(DataError, match=r"own\.py:wrong\) has shape \(1, 3\)"):
        find_feet(make_detector(f"{own}:wrong", CAMERA), image)
    with pytest.raises(DataError, match=r"own\.py:8: fails\(\) failed: AttributeError"):
        find_feet(make_detector(f"{own}:fails", CAMERA), image)
    with pytest.raises(DataError, match="has no function 'none'; expected one of boxes"):
        make_detector(f"{own}:none", CAMERA)
    with pytest.raises(DataError, match="unknown detector 'yolo'; expected one of background, hog, FILE"):
        make_detector("yolo", CAMERA)


def test_feet_near_the_horizon_are_left_out():
    locator = ImageLocator(lambda image: [[160, 200], [160, -20], [160, -100]], CAMERA)
    positions, covariances = locator.locate(draw([], 0))
    assert (len(positions), covariances.shape) == (1, (1, 2, 2))


def test_images_of_another_size_are_refused():
    locator = ImageLocator(make_detector("background", CAMERA), CAMERA)
    with pytest.raises(DataError, match=r"an image of shape \(10, 10, 3\); expected \(240, 320, 3\)"):
        locator.locate(np.zeros((10, 10, 3), np.uint8))
    with pytest.raises(DataError, match=r"the last: .*expected \(240, 320, 3\)"):
        list(track_people([Frame(0, np.zeros((240, 320), np.float32), "the last")], locator))
