"""Snapshots of a store: selected data sets, weights, recordings, plain SQL."""

import json
import os
import sqlite3
import tempfile
import traceback
import zlib
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import convert_snapshot, read_data, read_recording, write_recording
from lcorpp.learning.store import NewTrack, Store, TrackSchema, is_store, read_store
from lcorpp.values import Dataset, Distribution, stack_signals, strip_padding, track_hash
from tests.learning.store.stores import CLASSES, SCHEMA, filled, track, walk


@pytest.fixture
def path(tmp_path):
    return tmp_path / "robot.tracks"


def test_data_sets_of_those_that_are_trusted(path):
    filled(path, 21)
    reading = read_store(path)
    dataset = reading.dataset()
    rows = [row for row in range(21) if row % 7 != 6]
    assert dataset.labels == tuple(CLASSES[row % 2] for row in rows)
    assert np.array_equal(dataset.trajectories, [walk(row) for row in rows])
    assert (dataset.interval, dataset.channels, dataset.source) == (0.033, ("x", "y"), str(path))

    persons = reading.select(sources=("person",))
    assert [stored.extra["row"] for stored in persons] == [row for row in rows if row % 3 == 2]
    sure = reading.select(min_confidence=0.8, labels=("interested",))
    assert [stored.extra["row"] for stored in sure] == [r for r in rows if r % 2 == 0 and r % 5 >= 3]
    assert np.allclose(reading.weights(sure), [0.5 + row % 5 / 10 for row in (4, 8, 14, 18)])
    assert reading.dataset(sure).labels == ("interested",) * 4
    assert len(reading.dataset(())) == 0
    with pytest.raises(DataError, match="no label"):
        reading.dataset(reading.tracks)
    for wrong, words in (
        ({"sources": ["me"]}, "source"),
        ({"labels": ["a"]}, "class"),
        ({"min_confidence": 2}, "0 to 1"),
    ):
        with pytest.raises(DataError, match=words):
            reading.select(**wrong)


def test_a_label_without_a_belief(path):
    with Store(path, SCHEMA) as store:
        store.extend([NewTrack(walk(1), "interested"), NewTrack(walk(2), "interested", source="person")])
        reading = store.snapshot()
    assert [stored.source for stored in reading.select(min_confidence=0.5)] == ["person"]
    assert reading.weights().tolist() == [1, 1]


def test_tracks_of_different_length(path):
    with Store(path, SCHEMA) as store:
        store.extend([track(row, points=3 + row) for row in range(4)])
        reading = store.snapshot()
    whole, cut = reading.dataset(), reading.dataset(points=5)
    assert (whole.lengths.tolist(), cut.lengths.tolist()) == ([3, 4, 5, 6], [3, 4, 5, 5])
    for row in range(4):
        assert np.array_equal(strip_padding(whole.trajectories[row]), walk(row, 3 + row))
        assert np.array_equal(strip_padding(cut.trajectories[row]), walk(row, 3 + row)[:, -5:])
    assert reading.dataset(points=9).trajectories.shape == (4, 2, 6)
    with pytest.raises(DataError, match="at least 2"):
        reading.dataset(points=1)


def test_a_data_set_of_tracks_of_different_length_is_stored_without_padding(path):
    data = Dataset(stack_signals([walk(row, 3 + row) for row in range(4)]), (*CLASSES, *CLASSES))
    schema = TrackSchema.from_dataset(data, CLASSES)
    assert schema.points is None
    assert TrackSchema.from_dataset(data.take([1]), CLASSES).points is None
    assert TrackSchema.from_dataset(data.take([3]), CLASSES).points == 6
    with Store(path, schema) as store:
        pairs = zip(data.trajectories, data.labels, strict=True)
        store.extend([NewTrack(track, label) for track, label in pairs])
    snapshot = read_store(path)
    assert [stored.points for stored in snapshot] == [3, 4, 5, 6]
    assert [stored.group for stored in snapshot] == [track_hash(walk(row, 3 + row)) for row in range(4)]
    assert np.array_equal(snapshot.dataset().trajectories, data.trajectories, equal_nan=True)
    assert [len(track) for track in convert_snapshot(snapshot).tracks] == [3, 4, 5, 6]
    assert read_data(path, seconds=0.1).lengths.tolist() == [4, 4, 4]


def test_a_persons_word_holds_over_the_robots(path):
    with Store(path, SCHEMA) as store:
        store.append(NewTrack(walk(1), "interested", id="a"))
        store.relabel("a", "not_interested")
        store.relabel("a", "interested", source="robot", belief=Distribution(CLASSES, np.array([0.7, 0.3])))
        for bad in ({"id": "b", "label": None}, {"id": "a", "label": "bored"}):
            with pytest.raises(DataError, match=r"no track 'b'|'a' not labelled: unknown class"):
                store.relabel(**bad)
        own = store.snapshot()
    for reading in (own, read_store(path)):
        (stored,) = reading
        assert (stored.label, stored.source, reading.records) == ("not_interested", "person", 3)
        assert [j.label for j in stored.label_history] == ["interested", "not_interested", "interested"]
        assert reading.dataset().labels == ("not_interested",)
        assert reading.counts() == {("not_interested", "person"): 1}


def test_a_data_set_can_be_taken_in_and_given_back(path):
    data = Dataset(np.random.default_rng(0).normal(size=(5, 2, 7)), ("a", "b", "a", "a", "b"), tuple("12345"))
    with Store(path, TrackSchema.from_dataset(data, ("a", "b"))) as store:
        store.extend(
            NewTrack(t, label, "person", group=g)
            for t, label, g in zip(data.trajectories, data.labels, data.groups, strict=True)
        )
    back = read_store(path).dataset()
    assert np.array_equal(back.trajectories, data.trajectories)
    assert (back.labels, back.groups, back.channels) == (data.labels, data.groups, data.channels)


def test_tracks_go_to_the_tools_for_recordings(path, tmp_path):
    filled(path, 8)
    recording = convert_snapshot(read_store(path))
    assert [(t.id, t.label) for t in recording.tracks[5:7]] == [("t5", "not_interested"), ("t6", None)]
    assert recording.tracks[1].columns["y"].tolist() == walk(1)[1].tolist()
    assert np.allclose(recording.tracks[1].times, [0, 0.033, 0.066, 0.099])
    write_recording(recording, tmp_path / "long.csv")
    back = read_recording(tmp_path / "long.csv")
    assert [track.id for track in back.tracks] == [f"t{row}" for row in range(8)]


def test_the_file_can_be_read_by_what_is_documented(path):
    """The format in the words of the package, in a few lines without it."""
    filled(path, 3)
    connection = sqlite3.connect(path)
    ((channels, interval),) = connection.execute("SELECT channels, interval FROM store")
    assert (json.loads(channels), interval) == (["x", "y"], 0.033)
    rows = connection.execute("SELECT * FROM track ORDER BY record").fetchall()
    connection.close()
    assert [(row[0], row[1]) for row in rows] == [(1, "t0"), (2, "t1"), (3, "t2")]
    *cells, trajectory, checksum = rows[2]
    assert np.array_equal(np.frombuffer(trajectory, "<f8").reshape(2, -1), walk(2))
    text = json.dumps(cells, separators=(",", ":")).encode()
    assert zlib.crc32(text + trajectory) == checksum


def test_stores_are_recognised(path, tmp_path):
    filled(path, 1)
    path.rename(tmp_path / "s")
    (tmp_path / "other").write_text("x")
    assert is_store(tmp_path / "s")
    assert not is_store(tmp_path / "other")
    assert not is_store(tmp_path / "missing")


def test_a_store_is_data_like_any_other(path):
    filled(path, 8)
    data = read_data(path, labels={"1": "interested", "0": "not_interested"})
    assert (len(data), data.labels[:2], data.interval) == (7, CLASSES, 0.033)
    assert [track.group for track in read_recording(path).tracks] == list(data.groups)
    with pytest.raises(DataError, match="unknown label 'interested'"):
        read_data(path, labels={"1": "curious"})
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE track SET context = '{}' WHERE record = 2")
    connection.close()
    data = read_data(path)
    assert (len(data), data.notes) == (6, ("record 2: its checksum is wrong; 1 record lost",))


def test_a_snapshot_can_be_read_from_a_read_only_folder():
    """By another user, who may not write there."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "s"
        filled(path, 3)
        os.chmod(path, 0o644)
        os.chmod(name, 0o555)
        child = os.fork()
        if child == 0:
            try:
                if os.getuid() == 0:
                    os.setuid(65534)
                snapshot = read_store(path)
                os._exit(len(snapshot.dataset()) if not snapshot.damage else 98)
            except BaseException:
                traceback.print_exc()
                os._exit(99)
        _, status = os.waitpid(child, 0)
        os.chmod(name, 0o755)
    assert os.waitstatus_to_exitcode(status) == 3


@pytest.mark.parametrize(("channels", "points"), [(["x", "y"], None), (["share", "turns"], 1)])
def test_a_track_without_a_signal_has_no_label(tmp_path, channels, points):
    path = tmp_path / "s.tracks"
    signal = [1.0, 2.0] if points else [[0.0, 1.0], [2.0, 3.0]]
    with Store(path, TrackSchema(channels, 0.1, ["no", "yes"], points)) as store:
        store.append(NewTrack(signal, "no", id="seen"))
        store.append(NewTrack(None, None, id="heard"))
        with pytest.raises(DataError, match="a track without a signal is labelled 'no'; expected no label"):
            store.append(NewTrack(None, "no"))
        store.relabel("heard", "yes")  # a person knows better, but there is nothing to learn from
        snapshot = store.snapshot()
    assert snapshot.dataset().labels == ("no",)
    assert [array.size for array in snapshot.iterate_trajectories(snapshot.tracks)] == [np.size(signal), 0]
    every = snapshot.trajectories()
    assert every[0].tolist() == signal
    assert np.isnan(every[1]).all()
    assert read_store(path).damage == ()
