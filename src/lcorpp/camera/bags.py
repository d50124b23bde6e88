"""Images and intrinsics in recordings of ROS 1 and 2, by rosbags."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments
from lcorpp.camera.damaged_bag import SUFFIX as DAMAGED_SUFFIX, DamagedBag, warn_once
from lcorpp.camera.floor import Intrinsics
from lcorpp.camera.frames import Frame, check_alike, check_depth_scale, make_frame
from lcorpp.errors import DataError, LcorppError, expected_one_of
from lcorpp.input_files import check_regular, starts_with

IMAGE, CAMERA_INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"

ENCODINGS: dict[str, tuple[str, int, tuple[int, ...]]] = {
    "bgr8": ("u1", 3, (0, 1, 2)),
    "rgb8": ("u1", 3, (2, 1, 0)),
    "bgra8": ("u1", 4, (0, 1, 2)),
    "rgba8": ("u1", 4, (2, 1, 0)),
    "mono8": ("u1", 1, (0,)),
    "8UC1": ("u1", 1, (0,)),
    "16UC1": ("u2", 1, (0,)),
    "32FC1": ("f4", 1, (0,)),
}
"""Encoding -> type of a number, numbers of a pixel, and places of blue, green, red (or the only one)."""

NANOSECOND = 1e-9


class BagTopic(Protocol):
    """A topic of a bag: its name, and type and number of its messages."""

    @property
    def topic(self) -> str: ...
    @property
    def msgtype(self) -> str: ...
    @property
    def msgcount(self) -> int: ...


class BagReader(Protocol):
    """What lcorpp calls of a reader of bags: `rosbags.highlevel.AnyReader`, or `DamagedBag`."""

    @property
    def connections(self) -> Sequence[Any]: ...
    def messages(self, connections: Any) -> Iterator[tuple[Any, int, bytes]]:
        """Yield topic, nanoseconds and content of each message of some topics."""

    def deserialize(self, data: bytes, kind: str) -> Any:
        """Return a message of a type."""


class Bag:
    """The images of one topic in a bag: a ROS 1 file (.bag) or a ROS 2 folder (with metadata.yaml).

    Times are those of the headers, or of the recording where these are 0. Depths are 16UC1 in millimetres or
    32FC1 in metres (REP 118).

    Args:
        path: of the bag.
        topic: of the images; None takes the only one.
        depth_scale: values of the depth images for a metre; None takes the units above.

    Attributes:
        topic: of the images. intrinsics: from the CameraInfo beside the topic, or the only one; None if the
            bag has none.

    Raises:
        FileError: the path does not exist.
        DataError: the bag is damaged, has no such topic, its camera is not calibrated, or rosbags is not
            installed.

    Examples:
        >>> import numpy as np
        >>> from rosbags.rosbag1 import Writer
        >>> from rosbags.typesys import Stores, get_typestore
        >>> from rosbags.typesys.stores import ros1_noetic as ros
        >>> from lcorpp.camera import Bag
        >>> header = ros.std_msgs__msg__Header(0, ros.builtin_interfaces__msg__Time(7, 0), "camera")
        >>> pixels = np.array([0, 255], np.uint8)
        >>> image = ros.sensor_msgs__msg__Image(header, 1, 2, "mono8", 0, 2, pixels)
        >>> with Writer("camera.bag") as writer:
        ...     store, kind = get_typestore(Stores.ROS1_NOETIC), "sensor_msgs/msg/Image"
        ...     topic = writer.add_connection("/image", kind, typestore=store)
        ...     writer.write(topic, 0, store.serialize_ros1(image, kind))
        >>> [(frame.time, frame.image.shape) for frame in Bag("camera.bag")]
        [(7.0, (1, 2, 3))]
    """

    @check_arguments
    def __init__(
        self, path: str | Path, *, topic: str | None = None, depth_scale: float | None = None
    ) -> None:
        self._path, self._depth_scale = Path(path), check_depth_scale(depth_scale)
        with open_bag(self._path) as reader:
            images = {c.topic: c for c in reader.connections if c.msgtype == IMAGE}
            self.topic = _choose(images, topic, self._path)
            self._count = sum(int(c.msgcount) for c in reader.connections if c.topic == self.topic)
            self.intrinsics = self._read_intrinsics(reader)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Frame]:
        first: Frame | None = None
        last = -np.inf
        with open_bag(self._path) as reader:
            chosen = [c for c in reader.connections if c.topic == self.topic]
            for number, (connection, stamp, data) in enumerate(reader.messages(chosen), start=1):
                place = f"{self._path}: {self.topic}: message {number}"
                message: Any = reader.deserialize(data, connection.msgtype)
                pixels = _read_pixels(message, place)
                frame = make_frame(_read_time(message, stamp), pixels, place, self._depth_scale)
                first = first or frame
                check_alike(frame, first)
                if frame.time <= last:
                    raise DataError(
                        f"{place}: time {frame.time:.9f} s after {last:.9f} s; expected one that rises"
                    )
                last = frame.time
                yield frame

    def _read_intrinsics(self, reader: BagReader) -> Intrinsics | None:
        """Return the intrinsics of the camera of the images."""
        cameras: dict[str, BagTopic] = {c.topic: c for c in reader.connections if c.msgtype == CAMERA_INFO}
        beside = f"{self.topic.rpartition('/')[0]}/camera_info"
        topic = beside if beside in cameras else next(iter(cameras)) if len(cameras) == 1 else None
        for connection, _, data in reader.messages([cameras[topic]]) if topic else ():
            message: Any = reader.deserialize(data, connection.msgtype)
            k = np.asarray(message.K if hasattr(message, "K") else message.k, dtype=np.float64)
            if k.size != 9 or not (k[[0, 4]] > 0).all():
                raise DataError(f"{self._path}: {topic}: the camera is not calibrated: K is {k.tolist()}")
            return Intrinsics(*k[[0, 4, 2, 5]].tolist())
        return None


IDS_LIST = "std_msgs/Header header\nstring[] ids\n"
"""The definition of hri_msgs/IdsList, which bags before ROS 2 Iron do not have."""

MAGIC = b"#ROSBAG V2.0"
"""The beginning of a bag of ROS 1."""

BAG_SUFFIXES = (".bag", ".db3", ".mcap")
"""Of files of ROS 1 and 2; a ROS 2 bag is a folder with metadata.yaml and the files."""

METADATA, METADATA_KEY = "metadata.yaml", b"rosbag2_bagfile_information"
"""The description of a ROS 2 bag, and the key near its beginning."""

MAX_DESCRIPTION = 1000
"""Bytes in which the key is searched."""


def is_bag(path: Path) -> bool:
    """Return whether a path is a bag by its names: a file of ROS 1 or 2, or a folder of ROS 2.

    A folder without a description is a bag if it has files of one, as after the recorder was killed, and no
    bags below it. A folder that cannot be read counts as a bag, so that opening it names the reason.
    """
    if not path.is_dir():
        return path.suffix.lower() in BAG_SUFFIXES
    try:
        description, inside = path / METADATA, list(path.iterdir())
        if description.is_file() and METADATA_KEY in description.read_bytes()[:MAX_DESCRIPTION]:
            return True
        return bool(_list_files(path)) and not any(child.is_dir() and is_bag(child) for child in inside)
    except OSError:
        return True


def _list_files(path: Path) -> list[Path]:
    """Return the files of a ROS 2 bag in a folder."""
    return sorted(file for file in path.iterdir() if file.suffix.lower() in BAG_SUFFIXES[1:])


@contextmanager
def open_bag(path: Path, fault: Exception | None = None) -> Iterator[BagReader]:
    """Return a reader of a bag: a ROS 1 file (.bag) or a ROS 2 folder (with metadata.yaml), or its file.

    Of a damaged ROS 2 bag in SQLite, or one without metadata.yaml, the messages before the fault are read,
    with a warning.

    Args:
        fault: of a bag that turned out to be damaged: what is readable is read.

    Raises:
        FileError: the path does not exist.
        DataError: nothing of the bag can be read, a part that is read later is damaged, or rosbags is not
            installed.
    """
    check_regular(path)
    is_file = path.is_file()
    if is_file and path.suffix.lower() not in BAG_SUFFIXES[1:] and not starts_with(path, MAGIC):
        # rosbags would read to the first newline
        raise DataError(f"{path}: cannot be read as a bag: it does not begin with {MAGIC.decode()}")
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise DataError("rosbags is not installed; pip install 'lcorpp[bags]'") from None
    store = get_typestore(Stores.LATEST)
    store.register(get_types_from_msg(IDS_LIST, "hri_msgs/msg/IdsList"))
    try:
        with ExitStack() as stack:
            try:
                if fault is not None:
                    raise fault
                folder = _find_folder(path)
                reader: BagReader = stack.enter_context(AnyReader([folder], default_typestore=store))
                _warn_of_journal(folder)
            except Exception as error:  # readers of damaged bags fail in any way: struct, sqlite3, yaml, ...
                reader = _open_damaged(
                    path, lambda files: DamagedBag(files, store, get_types_from_msg), error
                )
            yield reader
    except (LcorppError, MemoryError):
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"[:300]
        raise DataError(f"{path}: cannot be read as a bag: {reason}") from error


def _find_folder(path: Path) -> Path:
    """Return the bag of a path: for the only file of a ROS 2 bag its folder, and else the path itself."""
    if not path.is_dir() and path.suffix.lower() in BAG_SUFFIXES[1:]:
        return path.parent if _list_files(path.parent) == [path] else path
    if path.is_dir() and (path / METADATA).exists():
        check_regular(path / METADATA)
    return path


def _warn_of_journal(path: Path) -> None:
    """Warn of messages that SQLite has not yet written to a file of a bag."""
    for file in path.glob("*.db3-wal") if path.is_dir() else ():
        if file.stat().st_size:
            warn_once(
                f"{path}: its recorder was killed: messages in {file.name} are not read; open and close"
                f" {file.name.removesuffix('-wal')} with sqlite3 first"
            )


def _open_damaged(path: Path, read: Callable[[list[Path]], DamagedBag], error: Exception) -> DamagedBag:
    """Return a reader of what is readable of a bag; raise the error if nothing is."""
    files = _list_files(path) if path.is_dir() else [path]
    files = [file for file in files if file.suffix.lower() == DAMAGED_SUFFIX]
    if not files:
        raise error
    try:
        found = read(files)
    except Exception:  # the first error states more
        raise error from None
    count = sum(topic.msgcount for topic in found.connections)
    if not count:
        raise error
    what = f"is damaged: {found.fault}" if found.fault else f"is read without its description ({error})"
    warn_once(f"{path}: {what}; {count} messages are read")
    return found


def _choose(topics: dict[str, BagTopic], topic: str | None, path: Path) -> str:
    """Return the name of the topic with images."""
    if topic is not None and topic in topics:
        return topic
    if topic is None and len(topics) == 1:
        return next(iter(topics))
    if not topics:
        raise DataError(f"{path}: has no images; expected a topic of {IMAGE}")
    fault = f"has {len(topics)} topics with images" if topic is None else f"has no images in {topic!r}"
    raise DataError(f"{path}: {fault}; {expected_one_of(sorted(topics))}")


def _read_time(message: Any, recorded: int) -> float:
    """Return the time of a message in seconds."""
    stamp = message.header.stamp
    time = int(stamp.sec) + int(stamp.nanosec) * NANOSECOND
    return time if time > 0 else recorded * NANOSECOND


def _read_pixels(message: Any, place: str) -> npt.NDArray[Any]:
    """Return the pixels of a message as `make_frame` takes them."""
    if message.encoding not in ENCODINGS:
        raise DataError(f"{place}: encoding {message.encoding!r}; {expected_one_of(list(ENCODINGS))}")
    kind, channels, order = ENCODINGS[message.encoding]
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.asarray(message.data, dtype=np.uint8)
    row = width * channels * dtype.itemsize
    if not height or not width or step < row or data.size < height * step:
        raise DataError(
            f"{place}: {data.size} bytes for {width} x {height} pixels, {step} a row; expected {row} or more"
        )
    rows = np.ascontiguousarray(data[: height * step].reshape(height, step)[:, :row])
    pixels = rows.view(dtype).reshape(height, width, channels)[..., list(order)]
    return np.asarray(pixels.astype(dtype.newbyteorder("="), copy=False))
