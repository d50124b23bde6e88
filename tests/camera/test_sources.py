"""Frames from folders, videos and bags, and the faults of each."""

import re
from pathlib import Path

import numpy as np
import pytest

from lcorpp.camera import Bag, ImageFolder, Intrinsics, Video
from lcorpp.errors import DataError, LcorppError

cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is not installed")

COLOUR = np.random.default_rng(0).integers(0, 255, (24, 32, 3)).astype(np.uint8)
DEPTH = np.full((24, 32), 2500, np.uint16)


def fails(action, message):
    with pytest.raises(LcorppError, match=re.escape(message)):
        action()


def write(folder: Path, images):
    folder.mkdir(exist_ok=True)
    for name, image in images.items():
        assert cv2.imwrite(str(folder / name), image)
    return folder


def test_a_folder_is_read_in_the_order_of_time(tmp_path):
    folder = write(tmp_path / "a", {"10.5.png": COLOUR, "9.25.png": COLOUR[::-1], "11.png": COLOUR[..., 0]})
    frames = list(ImageFolder(folder))
    assert [frame.time for frame in frames] == [9.25, 10.5, 11.0]
    assert (frames[1].image == COLOUR).all()
    assert (frames[2].image == COLOUR[..., :1]).all()  # grey is equal blue, green and red
    assert [frame.time for frame in ImageFolder(folder, rate=4.0)] == [0, 0.25, 0.5]


def test_16_bits_are_depths_in_millimetres(tmp_path):
    depth = DEPTH.copy()
    depth[0, 0] = 0
    (frame,) = ImageFolder(write(tmp_path / "a", {"0.png": depth}))
    assert frame.is_depth
    assert np.isnan(frame.image[0, 0])
    assert frame.image[1, 1] == pytest.approx(2.5)


def test_faults_of_folders(tmp_path):
    fails(lambda: ImageFolder(tmp_path / "none"), "none: is not a folder")
    fails(lambda: ImageFolder(tmp_path), "has no images; expected one of .png")
    folder = write(tmp_path / "a", {"x1.png": COLOUR})
    fails(lambda: ImageFolder(folder), "x1.png: the name is not a time; expected seconds")
    for rate in (0.0, -1.0, float("nan"), 1e6):
        fails(lambda rate=rate: ImageFolder(folder, rate=rate), "expected a number above 0, up to 1000")
    fails(
        lambda: ImageFolder(write(tmp_path / "b", {"1.png": COLOUR, "1.0.png": COLOUR})), "the same time as"
    )
    folder = write(tmp_path / "c", {"1.png": COLOUR, "2.png": COLOUR[:20]})
    fails(lambda: list(ImageFolder(folder)), "2.png: has 32 x 20 pixels; expected 32 x 24 pixels, as")
    folder = write(tmp_path / "d", {"1.png": COLOUR, "2.png": DEPTH})
    fails(lambda: list(ImageFolder(folder)), "2.png: has 32 x 24 depths; expected 32 x 24 pixels")
    data = (folder / "1.png").read_bytes()
    for damaged in (b"", b"text", data[:20], data[:4] + b"\0" * 40):
        (folder / "1.png").write_bytes(damaged)
        fails(lambda: list(ImageFolder(folder)), "1.png: cannot be read as an image")
    folder = write(tmp_path / "e", {"1.png": np.zeros((4, 4, 3), np.uint16)})
    fails(lambda: list(ImageFolder(folder)), "an image of shape (4, 4, 3), uint16; expected 8 bits")


@pytest.fixture
def video(tmp_path):
    file = tmp_path / "video.avi"
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (64, 48))
    for index in range(40):
        writer.write(np.full((48, 64, 3), 5 * index, np.uint8))
    writer.release()
    return file


def test_a_video_is_read(video):
    source = Video(video)
    frames = list(source)
    assert (len(source), len(frames), source.rate) == (40, 40, 10.0)
    assert [frame.time for frame in frames[:3]] == pytest.approx([0, 0.1, 0.2])
    assert frames[20].image.mean() == pytest.approx(100, abs=3)
    assert next(iter(Video(video, rate=7.0))).time == 0
    assert list(Video(video, rate=7.0))[7].time == pytest.approx(1.0)


def test_faults_of_videos(video, tmp_path):
    fails(lambda: Video(tmp_path / "none.avi"), "none.avi: cannot be read: no such file")
    (tmp_path / "text.avi").write_text("no video")
    fails(lambda: Video(tmp_path / "text.avi"), "text.avi: cannot be read as a video")
    fails(lambda: Video(video, rate=0.0), "the rate is 0 images a second")
    data = video.read_bytes()
    for share in (0.2, 0.5, 0.8):
        video.write_bytes(data[: int(share * len(data))])
        fails(lambda: list(Video(video)), "video.avi")


IMAGES = {
    "bgr8": (COLOUR, 3),
    "rgb8": (COLOUR[..., ::-1], 3),
    "mono8": (COLOUR[..., 0], 1),
    "16UC1": (DEPTH, 2),
    "32FC1": ((DEPTH / 1000).astype(np.float32), 4),
}


def write_bag(path, encodings, *, ros1=False, info=(500.0, 400.0), change=None, stamps=None):
    """Write a bag with a topic for each encoding, three messages each."""
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    types = store.types
    writer = Writer1(path) if ros1 else Writer2(path, version=8)
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr

    def header(stamp):
        time = types["builtin_interfaces/msg/Time"](int(stamp), round((stamp % 1) * 1e9))
        first = (0,) if ros1 else ()
        return types["std_msgs/msg/Header"](*first, time, "camera")

    with writer:
        for number, encoding in enumerate(encodings):
            pixels, size = IMAGES.get(encoding, (COLOUR, 3))
            kind = "sensor_msgs/msg/Image"
            images = writer.add_connection(f"/c{number}/image", kind, typestore=store)
            for index in range(3):
                stamp = (stamps or (100.0, 100.1, 100.2))[index]
                fields = {
                    "height": 24,
                    "width": 32,
                    "encoding": encoding,
                    "is_bigendian": 0,
                    "step": 32 * size,
                    "data": np.frombuffer(np.ascontiguousarray(pixels).tobytes(), np.uint8),
                } | ((change or {}) if index == 1 else {})
                message = types[kind](header(stamp), **fields)
                writer.write(images, int((200 + index) * 1e9), serialize(message, kind))
            if info is not None:
                kind = "sensor_msgs/msg/CameraInfo"
                cameras = writer.add_connection(f"/c{number}/camera_info", kind, typestore=store)
                k = np.array([info[0], 0, 16, 0, info[1], 12, 0, 0, 1], dtype=np.float64)
                roi = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
                rest = (np.zeros(5), k, np.eye(3).ravel(), np.zeros(12), 0, 0, roi)
                message = types[kind](header(100.0), 24, 32, "plumb_bob", *rest)
                writer.write(cameras, int(200e9), serialize(message, kind))
    return path


def test_bags_and_folders_take_the_values_for_a_metre(tmp_path):
    bag = Bag(write_bag(tmp_path / "a", ["16UC1"], ros1=False), depth_scale=5000)
    (frame, *_) = list(bag)
    assert (frame.image[0, 0], frame.depth_scale) == (pytest.approx(0.5), 5000)
    folder = tmp_path / "images"
    folder.mkdir()
    cv2.imwrite(str(folder / "0.png"), np.full((24, 32), 2500, np.uint16))
    assert next(iter(ImageFolder(folder, depth_scale=5000))).image[0, 0] == pytest.approx(0.5)
    for wrong in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(DataError, match="values a metre; expected a number above 0"):
            ImageFolder(folder, depth_scale=wrong)


@pytest.mark.parametrize("ros1", [True, False])
@pytest.mark.parametrize("encoding", list(IMAGES))
def test_bags_of_both_versions_are_read(tmp_path, encoding, ros1):
    bag = Bag(write_bag(tmp_path / ("a.bag" if ros1 else "a"), [encoding], ros1=ros1))
    frames = list(bag)
    assert (bag.topic, bag.intrinsics, len(bag)) == ("/c0/image", Intrinsics(500.0, 400.0, 16.0, 12.0), 3)
    assert [frame.time for frame in frames] == pytest.approx([100.0, 100.1, 100.2])
    expected = {"16UC1": 2.5, "32FC1": 2.5, "mono8": COLOUR[..., :1]}.get(encoding, COLOUR)
    assert frames[0].image == pytest.approx(
        expected if isinstance(expected, float) else np.broadcast_to(expected, COLOUR.shape)
    )


def test_the_topic_is_chosen(tmp_path):
    path = write_bag(tmp_path / "a", ["bgr8", "16UC1"], info=None)
    fails(lambda: Bag(path), "has 2 topics with images; expected one of /c0/image, /c1/image")
    fails(lambda: Bag(path, topic="/x"), "has no images in '/x'; expected one of /c0/image, /c1/image")
    bag = Bag(path, topic="/c1/image")
    assert bag.intrinsics is None
    assert next(iter(bag)).is_depth


def test_a_stamp_of_zero_is_replaced_by_the_time_of_recording(tmp_path):
    bag = Bag(write_bag(tmp_path / "a", ["bgr8"], stamps=(0.0, 0.0, 0.0)))
    assert [frame.time for frame in bag] == pytest.approx([200, 201, 202])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"height": 4000}, "2304 bytes for 32 x 4000 pixels, 96 a row"),
        ({"step": 3}, "expected 96 or more"),
        ({"height": 0}, "pixels"),
        ({"data": np.zeros(5, np.uint8)}, "5 bytes for 32 x 24 pixels"),
        ({"encoding": "yuv422"}, "encoding 'yuv422'; expected one of bgr8"),
        ({"height": 12}, "has 32 x 12 pixels; expected 32 x 24 pixels"),
    ],
)
def test_faults_of_messages_are_located(tmp_path, change, message):
    bag = Bag(write_bag(tmp_path / "a", ["bgr8"], change=change))
    fails(lambda: list(bag), "/c0/image: message 2: ")
    fails(lambda: list(bag), message)


def test_faults_of_bags(tmp_path):
    fails(lambda: Bag(tmp_path / "none.bag"), "none.bag: cannot be read: No such file")
    fails(lambda: Bag(write_bag(tmp_path / "k", ["16UC1"], info=(0.0, 0.0))), "the camera is not calibrated")
    fails(lambda: list(Bag(write_bag(tmp_path / "t", ["bgr8"], stamps=(2.0, 1.0, 3.0)))), "time 1.0")
    fails(
        lambda: Bag(write_bag(tmp_path / "e", [])), "has no images; expected a topic of sensor_msgs/msg/Image"
    )
    path = write_bag(tmp_path / "a.bag", ["bgr8"], ros1=True)
    data = path.read_bytes()
    for damaged in (b"", b"text", data[: len(data) // 2], data[:-100], data[:50] + b"\xff" * 60 + data[110:]):
        path.write_bytes(damaged)
        with pytest.raises(LcorppError, match=r"a\.bag"):
            list(Bag(path))
