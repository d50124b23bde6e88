"""What a store gives back: data sets of those who may be trusted, weights, recordings, plain bytes."""

import json
import struct
import zlib

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import read_data, read_recording, write_recording
from lcorpp.learning.store import NewTrack, Store, TrackSchema, is_store, read_store
from lcorpp.values import Dataset, Distribution
from tests.learning.stores import CLASSES, SCHEMA, filled, track, walk


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
    with pytest.raises(DataError, match="'t1' has 4 time points and 't0' 3"):
        reading.dataset()
    dataset = reading.dataset(points=5)
    assert np.array_equal(dataset.trajectories, [walk(2, 5), walk(3, 6)[:, 1:]])
    assert dataset.notes == ("2 tracks of fewer than 5 time points left out",)
    with pytest.raises(DataError, match="at least 2"):
        reading.dataset(points=1)


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
    with Store(path, TrackSchema.of(data, ("a", "b"))) as store:
        store.extend(
            NewTrack(t, label, "person", group=g)
            for t, label, g in zip(data.trajectories, data.labels, data.groups, strict=True)
        )
    back = read_store(path).dataset()
    assert np.array_equal(back.trajectories, data.trajectories)
    assert (back.labels, back.groups, back.channels) == (data.labels, data.groups, data.channels)


def test_tracks_go_to_the_tools_for_recordings(path, tmp_path):
    filled(path, 8)
    recording = read_store(path).recording()
    assert [(t.id, t.label) for t in recording.tracks[5:7]] == [("t5", "not_interested"), ("t6", None)]
    assert recording.tracks[1].columns["y"].tolist() == walk(1)[1].tolist()
    assert np.allclose(recording.tracks[1].times, [0, 0.033, 0.066, 0.099])
    write_recording(recording, tmp_path / "long.csv")
    back = read_recording(tmp_path / "long.csv")
    assert [track.id for track in back.tracks] == [f"t{row}" for row in range(8)]


def test_the_file_can_be_read_by_what_is_documented(path):
    """The format in the words of the package, in a few lines without it."""
    filled(path, 3)
    content = path.read_bytes()
    line = content.split(b"\n")[0]
    assert line.startswith(b"lcorpp tracks ")
    checksum, rest = line[14:22], line[23:]
    assert int(checksum, 16) == zlib.crc32(rest)
    assert rest.startswith(b"1 ")
    head = json.loads(rest[2:])
    at, seen = 2 * len(line) + 2, []
    while at < len(content):
        assert content[at : at + 16] == bytes.fromhex(head["marker"])
        checksum, facts, numbers = struct.unpack_from("<III", content, at + 16)
        end = at + 28 + facts + numbers
        assert checksum == zlib.crc32(content[at + 20 : end])
        about = json.loads(content[at + 28 : at + 28 + facts])
        seen.append((about["id"], np.frombuffer(content[at + 28 + facts : end], "<f8").reshape(2, -1)))
        at = end
    assert [id for id, _ in seen] == ["t0", "t1", "t2"]
    assert np.array_equal(seen[2][1], walk(2))


def test_stores_are_recognised(path, tmp_path):
    filled(path, 1)
    path.rename(tmp_path / "s")
    (tmp_path / "other").write_text("x")
    assert is_store(tmp_path / "s")
    assert not is_store(tmp_path / "other")
    assert not is_store(tmp_path / "missing")


def test_a_store_is_data_like_any_other(path):
    content = bytearray(filled(path, 8))
    data = read_data(path, labels={"1": "interested", "0": "not_interested"})
    assert (len(data), data.labels[:2], data.interval) == (7, CLASSES, 0.033)
    assert [track.group for track in read_recording(path).tracks] == list(data.groups)
    with pytest.raises(DataError, match="unknown label 'interested'"):
        read_data(path, labels={"1": "curious"})
    content[-20] ^= 1
    content[read_store(path).tracks[0].place + 50] ^= 1
    path.write_bytes(content)
    assert len(read_data(path)) == 5
    assert "not a record (before record 2); 1 record lost" in read_data(path).notes[0]
