"""People in bags that rosbags wrote, of ROS 1 and 2, as tracks."""

from dataclasses import dataclass

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lcorpp.errors import DataError, FileError
from lcorpp.learning import read_recording
from lcorpp.worlds.ros.people.people_bag import list_people_topics, read_people_bag
from tests.worlds.ros.test_laser_scan import HALF, RADIUS, scan

PEOPLE_MSGS = {
    "people_msgs/msg/Person": "string name\ngeometry_msgs/Point position\nfloat64 reliability\n",
    "people_msgs/msg/People": "std_msgs/Header header\npeople_msgs/Person[] people\n",
}


@dataclass
class Walk:
    """Two people who walk for two seconds, ten samples a second, from t = 100 s."""

    count: int = 20

    def messages(self, store):
        types = store.types
        for k in range(self.count):
            now = 100 + k / 10
            stamp = types["builtin_interfaces/msg/Time"](int(now), round(now % 1 * 1e9))
            fields = {"seq": k} if "seq" in types["std_msgs/msg/Header"].__dataclass_fields__ else {}
            header = types["std_msgs/msg/Header"](**fields, stamp=stamp, frame_id="map")
            people = [
                types["people_msgs/msg/Person"](name, types["geometry_msgs/msg/Point"](x, y, 0.0), 1.0)
                for name, x, y in (("a", 5 - k / 10, 0.0), ("b", 1.0, k / 10))
            ]
            yield types["people_msgs/msg/People"](header, people), int(now * 1e9)


def make_store(kind):
    store = get_typestore(kind)
    for name, text in PEOPLE_MSGS.items():
        store.register(get_types_from_msg(text, name))
    return store


def write(path, version, topic="/people"):
    store = make_store(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    kind = "people_msgs/msg/People"
    if version == 1:
        with Writer1(path) as writer:
            connection = writer.add_connection(topic, kind, typestore=store)
            for message, stamp in Walk().messages(store):
                writer.write(connection, stamp, store.serialize_ros1(message, kind))
    else:
        with Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(topic, kind, typestore=store)
            for message, stamp in Walk().messages(store):
                writer.write(connection, stamp, store.serialize_cdr(message, kind))
    return path


@pytest.fixture(params=[1, 2], ids=["ros1", "ros2"])
def bag(request, tmp_path):
    return write(tmp_path / ("walk.bag" if request.param == 1 else "walk"), request.param)


def test_a_bag_has_the_samples_of_its_people(bag):
    assert list_people_topics(bag) == {"/people": "people_msgs/People"}
    samples = read_people_bag(bag)
    assert len(samples) == 40
    times, names, x, y, _ = zip(*samples[:2], strict=True)
    assert times == pytest.approx((100.0, 100.0))
    assert (names, x, y) == (("a", "b"), (5.0, 1.0), (0.0, 0.0))
    assert read_people_bag(bag, "/people") == samples


def test_lcorpp_track_writes_its_tracks(bag, lcorpp, tmp_path):
    ended = lcorpp("track", bag, "-o", tmp_path / "tracks.csv")
    assert (ended.code, ended.err) == (0, "")
    assert "2 tracks, 40 samples" in ended.out
    tracks = {track.id: track for track in read_recording(tmp_path / "tracks.csv").tracks}
    np.testing.assert_allclose(tracks["a"].columns["x"], 5 - np.arange(20) / 10, atol=1e-6)


def test_topics_that_are_missing_or_unknown_are_errors(bag, tmp_path):
    with pytest.raises(DataError, match="has no people in '/faces'; expected one of /people"):
        read_people_bag(bag, "/faces")
    with pytest.raises(FileError, match="No such file or directory"):
        read_people_bag(tmp_path / "nowhere.bag")
    (tmp_path / "broken.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    with pytest.raises(DataError, match="cannot be read as a bag"):
        read_people_bag(tmp_path / "broken.bag")


def test_people_are_tracked_in_the_scans_of_a_bag(tmp_path):
    store, kind = get_typestore(Stores.ROS2_HUMBLE), "sensor_msgs/msg/LaserScan"
    types, path = store.types, tmp_path / "scans"
    with Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/scan", kind, typestore=store)
        for k in range(30):
            now = 100 + k / 10
            stamp = types["builtin_interfaces/msg/Time"](int(now), round(now % 1 * 1e9))
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="laser")
            x = 4.0 - k / 10
            ranges = scan([(x, 0.15, RADIUS), (x, -0.15, RADIUS)], noise=0.01, seed=k).astype(np.float32)
            limits = (HALF[0], HALF[-1], HALF[1] - HALF[0], 0.0, 0.1, 0.05, 20.0)
            message = types[kind](header, *map(float, limits), ranges, np.zeros(0, dtype=np.float32))
            writer.write(connection, int(now * 1e9), store.serialize_cdr(message, kind))
    assert list_people_topics(path) == {"/scan": "sensor_msgs/LaserScan"}
    samples = read_people_bag(path, "/scan")
    assert {sample.person for sample in samples} == {"1-1"}
    assert len(samples) > 25
    for time, _, x, y, _ in samples:
        assert abs(x - (104.0 - time)) < 0.2
        assert abs(y) < 0.15
    with pytest.raises(DataError, match="has 0 topics with people; expected one of /scan"):
        read_people_bag(path)
