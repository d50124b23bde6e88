"""The growing data set: what goes in comes out, what does not fit is refused before anything is written."""

import os
import zlib
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import DataError, FileError
from lcorpp.learning.store import NewTrack, Store, TrackSchema, is_store, read_store
from lcorpp.values import Distribution
from tests.learning.stores import CLASSES, SCHEMA, filled, track, walk


@pytest.fixture
def path(tmp_path):
    return tmp_path / "robot.tracks"


def test_what_was_stored_is_read_again(path):
    before = datetime.now(UTC)
    belief = Distribution(CLASSES, np.array([0.9, 0.1]))
    with Store(path, SCHEMA) as store:
        id = store.append(
            NewTrack(walk(3), "interested", belief=belief, context={"time": "noon"}, extra={"batch": 2})
        )
        assert (store.notes, len(store), id in store, "other" in store) == ((), 1, True, False)
        (own,) = store.snapshot()
    reading = read_store(path)
    (stored,) = reading
    assert (reading.schema, reading.damage, reading.tail, reading.records) == (SCHEMA, (), 0, 1)
    assert (stored.id, stored.number, stored.label, stored.source) == (id, 1, "interested", "robot")
    assert before <= stored.time <= datetime.now(UTC)
    assert dict(stored.belief) == dict(belief)
    assert (dict(stored.context), dict(stored.extra), stored.points) == ({"time": "noon"}, {"batch": 2}, 4)
    assert own.label_history[0].time == stored.time
    assert np.array_equal(reading.trajectories(), [walk(3)])


texts = st.text(max_size=8)
names = st.text(min_size=1, max_size=8)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | texts,
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(texts, inner, max_size=2),
    max_leaves=4,
)
zones = st.sampled_from([UTC, timezone(timedelta(hours=-3, minutes=-30)), timezone(timedelta(seconds=1))])
tracks = st.builds(
    lambda points, numbers, share, **facts: NewTrack(
        np.resize(numbers, (2, points)),
        belief=share and Distribution(CLASSES, np.array([share, 1 - share])),
        **facts,
    ),
    points=st.integers(2, 6),
    numbers=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=12),
    share=st.none() | st.floats(0.001, 1),
    label=st.sampled_from([*CLASSES, None]),
    source=st.sampled_from(["robot", "person"]),
    context=st.dictionaries(texts, texts, max_size=3),
    group=st.none() | names,
    time=st.datetimes(timezones=zones),
    extra=st.dictionaries(texts, json_values, max_size=3),
)


@settings(max_examples=50, deadline=None)
@given(st.lists(tracks, max_size=4))
def test_any_track_that_is_taken_is_read_as_it_was(tmp_path_factory, given):
    path = tmp_path_factory.mktemp("any") / "s"
    with Store(path, SCHEMA) as store:
        ids = store.extend(given, durable=False)
        written = store.snapshot()
    reading = read_store(path)
    assert (reading.damage, reading.tail, [stored.id for stored in reading]) == ((), 0, ids)
    for own, stored, one in zip(written, reading, given, strict=True):
        assert (own.label_history[0].time, own.context, own.extra) == (
            stored.time,
            stored.context,
            stored.extra,
        )
        assert (stored.label, stored.source, stored.time) == (one.label, one.source, one.time)
        assert (dict(stored.context), dict(stored.extra)) == (one.context, one.extra)
        assert one.group in (None, stored.group)
        assert (stored.belief and dict(stored.belief)) == (one.belief and dict(one.belief))
        assert np.array_equal(reading.trajectories([stored])[0], one.trajectory)


def test_equal_tracks_are_a_group_of_their_own(path):
    """A recorded track that is met twice must not stand on both sides of a fold."""
    with Store(path, SCHEMA) as store:
        store.extend([NewTrack(walk(1), None), NewTrack(walk(2), None), NewTrack(walk(1), None)])
        first, second, third = (stored.group for stored in store.snapshot())
    assert first == third != second


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"label": "bored"}, "unknown class 'bored'; expected one of interested, not_interested"),
        ({"source": "cat"}, "unknown source 'cat'; expected one of person, robot"),
        ({"belief": Distribution(("a", "b"), np.array([0.5, 0.5]))}, "a belief over a, b; the classes here"),
        ({"time": datetime(2026, 1, 1)}, "lacks a zone"),
        ({"id": "taken"}, "there is a track 'taken' already"),
        ({"id": ""}, "the id of a track is text, not ''"),
        ({"group": ""}, "the group of a track is text"),
        ({"context": {"time": 3}}, "the context has 'time': 3; expected text"),
        ({"extra": {"a": float("nan")}}, "JSON cannot hold"),
        ({"extra": {"a": object()}}, "JSON cannot hold"),
        ({"extra": {"a": "long" * 300_000}}, "at most 1048576 can be stored"),
        ({"trajectory": [[1, 2, 3]]}, r"shape \(1, 3\); expected 2 channels \(x, y\)"),
        ({"trajectory": [1, 2]}, r"shape \(2,\)"),
        ({"trajectory": [[1], [2]]}, "1 time points; expected at least 2"),
        ({"trajectory": [[1, 2], [3, float("inf")]]}, r"y at time point 1 \(counted from 0\) is inf"),
        ({"trajectory": [[1, 2], [3]]}, "an array of numbers"),
        ({"trajectory": np.zeros((2, 2**22 + 1))}, "at most 67108864 can be stored"),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_written(path, changed, words):
    with Store(path, SCHEMA) as store:
        store.append(track(0, id="taken"))
        content = path.read_bytes()
        bad = NewTrack(**{"trajectory": walk(1), "label": None, **changed})
        with pytest.raises(DataError, match=words):
            store.append(bad)
        with pytest.raises(DataError, match="track 1 of 2"):
            store.extend([track(1), bad])
        assert path.read_bytes() == content
        store.append(track(1))
    assert [stored.id for stored in read_store(path)] == ["taken", "t1"]


def test_the_number_of_points_may_be_fixed(path):
    with Store(path, TrackSchema(("x", "y"), 0.1, CLASSES, points=5)) as store:
        with pytest.raises(DataError, match="4 time points; expected 5"):
            store.append(track(0))
        store.append(track(0, points=5))


@pytest.mark.parametrize(
    ("schema", "words"),
    [
        (TrackSchema(("y", "x"), 0.033, CLASSES), "its channels: x, y; the tracks to be stored have: y, x"),
        (TrackSchema(("x", "y"), 0.1, CLASSES), "its interval: 0.033 s; the tracks to be stored have: 0.1 s"),
        (TrackSchema(("x", "y"), 0.033, ("a", "b")), "its classes: interested, not_interested; .* a, b"),
        (TrackSchema(("x", "y"), 0.033, CLASSES, 30), "its time points of a track: any number; .* 30"),
    ],
)
def test_another_layout_is_refused(path, schema, words):
    content = filled(path, 2)
    with pytest.raises(DataError, match=words):
        Store(path, schema)
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (((), 1, CLASSES), "channels"),
        (("xy", 1, CLASSES), "a sequence of names"),
        ((("x", "x"), 1, CLASSES), "every name once"),
        ((("x", "colour"), 1, CLASSES), "unknown channel 'colour'; expected one of x, y"),
        ((("x",), 0, CLASSES), "interval is 0 s"),
        ((("x",), float("nan"), CLASSES), "interval is nan s"),
        ((("x",), "1", CLASSES), "interval is '1' s"),
        ((("x",), 1, ()), "classes"),
        ((("x",), 1, ("a", "")), "no name"),
        ((("x",), 1, CLASSES, 1), "tracks of 1 time points"),
    ],
)
def test_layouts_that_make_no_sense(arguments, words):
    with pytest.raises(DataError, match=words):
        TrackSchema(*arguments)


def test_a_head_that_would_be_too_long(path):
    with pytest.raises(DataError, match="too long"):
        Store(path, TrackSchema(("x",), 1, tuple("c" * 1000 + str(i) for i in range(600))))


def test_a_closed_store_takes_nothing(path):
    with Store(path, SCHEMA) as store:
        store.append(track(0))
    for act in (lambda: store.append(track(1)), store.sync):
        with pytest.raises(FileError, match="closed"):
            act()
    assert len(store.snapshot().dataset()) == 1


def test_a_file_that_another_program_touches_is_noticed(path):
    with Store(path, SCHEMA) as store:
        store.append(track(0))
        with path.open("ab") as file:
            file.write(b"hello")
        with pytest.raises(FileError, match="has been changed"):
            store.append(track(1))
    with Store(path, SCHEMA) as store:
        assert "moved to robot.tracks.cut-" in store.notes[0]
        path.unlink()
        with pytest.raises(FileError, match="has been deleted by another program"):
            store.append(track(1))


def test_a_full_disk_leaves_the_store_as_it_was(path, monkeypatch):
    write = os.write

    def full(file, content):
        if len(content) < 200:
            raise OSError(28, "No space left on device")
        return write(file, content[:150])

    with Store(path, SCHEMA) as store:
        store.append(track(0))
        content = path.read_bytes()
        monkeypatch.setattr("os.write", full)
        with pytest.raises(FileError, match="No space left"):
            store.append(track(1))
        monkeypatch.undo()
        assert path.read_bytes() == content
        store.append(track(2))
    assert [stored.id for stored in read_store(path)] == ["t0", "t2"]


def test_a_disk_that_fails_closes_the_store(path, monkeypatch):
    with Store(path, SCHEMA) as store:

        def broken(file):
            raise OSError(5, "Input/output error")

        monkeypatch.setattr("os.fsync", broken)
        with pytest.raises(FileError, match="Input/output error"):
            store.append(track(0))
        with pytest.raises(FileError, match="closed"):
            store.append(track(1))


def test_not_every_append_has_to_wait_for_the_disk(path, monkeypatch):
    waited, fsync = [], os.fsync
    with Store(path, SCHEMA) as store:
        monkeypatch.setattr("os.fsync", lambda file: waited.append(file) or fsync(file))
        store.append(track(0), durable=False)
        store.extend([track(1), track(2)], durable=False)
        assert not waited
        store.extend([track(3), track(4)])
        store.sync()
        assert len(waited) == 2


def test_paths_that_cannot_be_a_store(tmp_path):
    for path, words in ((tmp_path, "is not a file"), (tmp_path / "no" / "s", "No such file")):
        with pytest.raises(FileError, match=words):
            Store(path, SCHEMA)
        with pytest.raises(FileError, match=words):
            read_store(path)
    os.mkfifo(tmp_path / "pipe")
    for act in (read_store, lambda path: Store(path, SCHEMA)):
        with pytest.raises(FileError, match="is not a file"):
            act(tmp_path / "pipe")
    assert not is_store(tmp_path / "pipe")


@pytest.mark.parametrize("content", [b"hello", b"lcorpp\ntracks", b"lcorpp tracks 0\n", b"\x89PNG" * 99])
def test_a_file_of_another_kind_is_refused_and_left_alone(path, content):
    path.write_bytes(content)
    for act in (read_store, lambda path: Store(path, SCHEMA)):
        with pytest.raises(DataError, match=r"not a store of tracks|whose head is damaged"):
            act(path)
    assert path.read_bytes() == content


def test_a_newer_version_is_refused(path):
    content = filled(path, 1)
    for line in content.split(b"\n")[:2]:
        newer = b"2" + line[24:]
        content = content.replace(line, b"lcorpp tracks %08x " % zlib.crc32(newer) + newer)
    path.write_bytes(content)
    with pytest.raises(DataError, match="its version is 2; this lcorpp reads version 1"):
        read_store(path)
