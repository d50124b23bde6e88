"""Stores of version 1, written by lcorpp before it used SQLite, are converted once; nothing is lost."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import DataError, FileError
from lcorpp.learning.store import NewTrack, Store, is_store, read_store
from tests.learning.store.stores import SCHEMA, crash, track, walk

OLD = Path(__file__).parent / "version1"

PLAIN = [
    *(track(row) for row in range(5)),
    track(6, points=6, context={"time": "naïve"}, extra={"row": 6, "x": [0.1 + 0.2, None, 1e300]}),
]
"""The tracks of plain.tracks; records 6 and 8 label the tracks t1 and t6 again."""


@pytest.fixture
def path(tmp_path):
    shutil.copy(OLD / "plain.tracks", tmp_path / "s")
    return tmp_path / "s"


def check_plain(snapshot, tracks):
    assert (snapshot.schema, snapshot.damage) == (SCHEMA, ())
    for stored, new in zip(snapshot, tracks, strict=True):
        assert (stored.id, stored.context, stored.extra) == (new.id, new.context, new.extra)
        first = stored.label_history[0]
        assert (first.label, first.source, first.time) == (new.label, new.source, new.time)
        assert dict(first.belief) == dict(new.belief)
        assert np.array_equal(snapshot.trajectories([stored])[0], new.trajectory)
    assert [stored.record for stored in snapshot] == [1, 2, 3, 4, 5, 7, 9][: len(tracks)]
    t1, t6 = snapshot.tracks[1], snapshot.tracks[5]
    assert (t1.label, t1.source, len(t1.label_history)) == ("interested", "person", 2)
    assert (t6.label, t6.source, dict(t6.belief)["interested"]) == ("not_interested", "robot", 0.25)


def test_a_store_is_converted_once(path, caplog):
    content = path.read_bytes()
    assert is_store(path)
    check_plain(read_store(path), PLAIN)
    assert caplog.messages == [
        f"{path}: converted from version 1 to SQLite, 8 records; the original is s.old"
    ]
    assert path.with_name("s.old").read_bytes() == content
    caplog.clear()
    check_plain(read_store(path), PLAIN)
    with Store(path, SCHEMA) as store:
        assert store.identity == "4d3a1fef1244a86dadb9daa6038c68c8"
        assert (store.notes, store.last_record) == ((), 8)
        store.append(track(20))
    assert not caplog.messages
    check_plain(read_store(path), [*PLAIN, track(20)])
    assert {file.name for file in path.parent.iterdir()} == {"s", "s.old", "s-lock"}


def test_a_writer_converts_a_store_too(path, caplog):
    with Store(path, SCHEMA) as store:
        store.append(track(20))
    check_plain(read_store(path), [*PLAIN, track(20)])
    assert len(caplog.messages) == 1


def test_an_original_of_the_same_name_is_not_replaced(path):
    path.with_name("s.old").write_text("mine")
    read_store(path)
    assert path.with_name("s.old").read_text() == "mine"
    assert path.with_name("s.old-2").read_bytes() == (OLD / "plain.tracks").read_bytes()


def test_intact_records_of_a_damaged_store_are_converted(path):
    """A byte of record 3 is wrong and the last record, a label, is cut off."""
    shutil.copy(OLD / "damaged.tracks", path)
    for _ in range(2):
        snapshot = read_store(path)
        assert [stored.id for stored in snapshot] == ["t0", "t1", "t3", "t4", "t6"]
        assert [str(damage) for damage in snapshot.damage] == ["record 3 is missing; 1 record lost"]
        assert snapshot.tracks[-1].label is None
    assert np.array_equal(snapshot.trajectories(snapshot.tracks[2:3])[0], walk(3))


def test_one_copy_of_the_header_is_enough(path):
    content = bytearray(path.read_bytes())
    content[30] ^= 1
    path.write_bytes(content)
    check_plain(read_store(path), PLAIN)
    end = content.index(b"\n")
    content[end + 50] ^= 1
    path.write_bytes(content)
    for act in (read_store, lambda path: Store(path, SCHEMA)):
        with pytest.raises(DataError, match="a store of version 1 whose header is damaged"):
            act(path)
    assert path.read_bytes() == content


@pytest.mark.parametrize("content", [b"lcorpp tr", b"lcorpp tracks 1234abcd 1 {", bytes(4096)])
def test_a_header_that_was_never_finished_is_an_empty_store(path, content):
    path.write_bytes(content)
    with pytest.raises(DataError, match="an empty file; expected a store of tracks"):
        read_store(path)
    with Store(path, SCHEMA) as store:
        store.append(NewTrack(walk(1), None))
        assert (store.notes, len(store)) == ((), 1)


@pytest.mark.parametrize("after", [0, 1])
def test_a_crash_during_the_conversion_leaves_the_original(path, monkeypatch, after):
    """While the copy or the new store is written."""
    content = path.read_bytes()
    crash(lambda: read_store(path), after, monkeypatch)
    assert path.read_bytes() == content
    check_plain(read_store(path), PLAIN)


def test_a_store_that_an_older_lcorpp_writes_to_is_left_alone(path):
    fcntl = pytest.importorskip("fcntl")
    with path.open("r+b") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(FileError, match="an older lcorpp is writing to it; end that process first"):
            read_store(path)
    check_plain(read_store(path), PLAIN)


def test_a_store_of_another_schema_is_refused(path):
    with pytest.raises(DataError, match="its classes: interested, not_interested"):
        Store(path, type(SCHEMA)(("x", "y"), 0.033, ("a", "b")))
