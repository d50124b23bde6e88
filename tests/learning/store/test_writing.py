"""Writing a store: stored tracks are read unchanged; tracks that do not fit are refused before any write."""

import os
import sqlite3
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import DataError, FileError
from lcorpp.learning.store import NewTrack, Store, TrackSchema, is_store, read_store
from lcorpp.values import Dataset, Distribution, track_hash
from tests.learning.store.stores import CLASSES, SCHEMA, filled, track, walk


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
    assert (reading.schema, reading.damage, reading.records) == (SCHEMA, (), 1)
    assert (stored.id, stored.record, stored.label, stored.source) == (id, 1, "interested", "robot")
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


@settings(max_examples=25)
@given(st.lists(tracks, max_size=4))
def test_any_track_that_is_taken_is_read_as_it_was(tmp_path_factory, given):
    path = tmp_path_factory.mktemp("any") / "s"
    with Store(path, SCHEMA) as store:
        ids = store.extend(given, durable=False)
        written = store.snapshot()
    reading = read_store(path)
    assert (reading.damage, [stored.id for stored in reading]) == ((), ids)
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
    """A track that is recorded twice must not be in both sides of a fold."""
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
        ({"id": "taken"}, "there is already a track 'taken'"),
        ({"id": ""}, "the id of a track is text, not ''"),
        ({"id": "\ud800"}, "the id of a track is text"),
        ({"group": ""}, "the group of a track is text"),
        ({"context": {"time": 3}}, "the context has 'time': 3; expected text"),
        ({"extra": {"a": float("nan")}}, "JSON cannot represent"),
        ({"extra": {"a": object()}}, "JSON cannot represent"),
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
        content = read_store(path).tracks
        bad = NewTrack(**{"trajectory": walk(1), "label": None, **changed})
        with pytest.raises(DataError, match=words):
            store.append(bad)
        with pytest.raises(DataError, match="track 1 of 2"):
            store.extend([track(1), bad])
        assert [stored.id for stored in read_store(path)] == [stored.id for stored in content]
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
        ((("x",), 0, CLASSES), "interval is 0 s"),
        ((("x",), float("nan"), CLASSES), "interval is nan s"),
        ((("x",), "1", CLASSES), "interval is '1' s"),
        ((("x",), 1, ()), "classes"),
        ((("x",), 1, ("a", "")), "not a name"),
        ((("x",), 1, CLASSES, 0), "tracks of 0 time points"),
    ],
)
def test_layouts_that_make_no_sense(arguments, words):
    with pytest.raises(DataError, match=words):
        TrackSchema(*arguments)


def test_a_closed_store_takes_nothing(path):
    with Store(path, SCHEMA) as store:
        store.append(track(0))
    for act in (lambda: store.append(track(1)), store.sync):
        with pytest.raises(FileError, match="closed"):
            act()
    assert len(store.snapshot().dataset()) == 1


def test_a_closed_store_is_one_file(path):
    """The main file has everything; the only other file is the empty one for the writer's lock."""
    content = filled(path, 30)
    assert {file.name for file in path.parent.iterdir()} == {"robot.tracks", "robot.tracks-lock"}
    assert path.with_name("robot.tracks-lock").read_bytes() == b""
    copy = path.with_name("copy")
    copy.write_bytes(content)
    assert len(read_store(copy)) == 30
    assert {file.name for file in path.parent.iterdir()} == {"copy", "robot.tracks", "robot.tracks-lock"}


def test_a_file_that_another_program_deletes_is_noticed(path):
    with Store(path, SCHEMA) as store:
        store.append(track(0))
        path.unlink()
        with pytest.raises(FileError, match="was deleted or replaced by another program"):
            store.append(track(1))
    with Store(path, SCHEMA) as store:  # the log of the deleted file does no harm
        store.append(track(2))
        path.rename(path.with_name("moved"))
        path.write_bytes(b"")
        with pytest.raises(FileError, match="was deleted or replaced by another program"):
            store.append(track(1))


def test_a_full_disk_leaves_the_store_as_it_was(path):
    with Store(path, SCHEMA) as store:
        store.append(track(0))
        (pages,) = store._connection.execute("PRAGMA page_count").fetchone()
        store._connection.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(FileError, match="cannot be written: database or disk is full"):
            store.extend([track(1), track(3, points=4000)])
        store._connection.execute("PRAGMA max_page_count = 100000")
        store.append(track(2))
        assert (len(store), store.last_record) == (2, 2)
    assert [stored.id for stored in read_store(path)] == ["t0", "t2"]


def test_a_disk_that_fails_closes_the_store(path):
    """A limit on the size of files makes the write itself fail, with another error than a full disk."""
    resource = pytest.importorskip("resource")
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    with Store(path, SCHEMA) as store:
        store.append(track(0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limit[1]))
        try:
            with pytest.raises(FileError, match="cannot be written: disk I/O error"):
                store.append(track(1, points=4000))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        with pytest.raises(FileError, match="closed"):
            store.append(track(1))
    assert [stored.id for stored in read_store(path)] == ["t0"]


def test_an_interrupted_write_leaves_the_store_as_it_was(path):
    with Store(path, SCHEMA) as store:
        store.append(track(0))
        connection = store._connection

        def interrupt(statement):
            if statement.startswith("BEGIN"):
                connection.set_progress_handler(lambda: 1, 1)

        connection.set_trace_callback(interrupt)
        with pytest.raises(FileError, match="interrupted"):
            store.append(track(1))
    assert [stored.id for stored in read_store(path)] == ["t0"]


def test_not_every_append_has_to_wait_for_the_disk(path):
    """SQLite flushes the log at the end of a transaction whose setting is FULL, if it wrote a page."""
    with Store(path, SCHEMA) as store:
        statements, log = [], path.with_name(f"{path.name}-wal")
        store._connection.set_trace_callback(statements.append)
        store.append(track(0), durable=False)
        store.extend([track(1), track(2)], durable=False)
        assert "PRAGMA synchronous = FULL" not in statements
        for act in (lambda: store.append(track(3)), store.sync):
            statements.clear()
            size = log.stat().st_size
            act()
            assert "PRAGMA synchronous = FULL" in statements
            assert statements[-1] == "COMMIT"
            assert log.stat().st_size > size
    assert len(read_store(path)) == 4


def test_the_database_is_durable_and_checked(path):
    """The settings behind the guarantees; synchronous 2 is FULL: the log is on the disk at each commit."""
    with Store(path, SCHEMA) as store:
        store.append(track(0))
        values = {
            name: store._connection.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("journal_mode", "synchronous", "foreign_keys", "user_version", "application_id")
        }
        assert values == {
            "journal_mode": "wal",
            "synchronous": 2,
            "foreign_keys": 1,
            "user_version": 2,
            "application_id": int.from_bytes(b"lctr"),
        }
        for wrong in (
            "INSERT INTO later_label VALUES (9, 7, NULL, 'robot', NULL, '', 0)",
            "UPDATE track SET trajectory = NULL",
            "INSERT INTO track SELECT 9, id, '', '', '', '', '', '', '', x'', 0 FROM track",
        ):
            with pytest.raises(sqlite3.IntegrityError):
                store._connection.execute(wrong)


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


@pytest.mark.parametrize("content", [b"hello", b"lcorpp\ntracks", b"\x89PNG" * 99])
def test_a_file_of_another_kind_is_refused_and_left_alone(path, content):
    path.write_bytes(content)
    for act in (read_store, lambda path: Store(path, SCHEMA)):
        with pytest.raises(DataError, match=r"not a store of tracks|whose head is damaged"):
            act(path)
    assert path.read_bytes() == content


def test_a_newer_version_is_refused(path):
    filled(path, 1)
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA user_version = 3")
    connection.close()
    for act in (read_store, lambda path: Store(path, SCHEMA)):
        with pytest.raises(DataError, match="its version is 3; this lcorpp reads versions 1 and 2"):
            act(path)


def test_another_database_is_refused_and_left_alone(path):
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE track (x)")
    connection.close()
    content = path.read_bytes()
    for act in (read_store, lambda path: Store(path, SCHEMA)):
        with pytest.raises(DataError, match="an SQLite file, but not a store of tracks"):
            act(path)
    assert path.read_bytes() == content


def test_representations_are_short(path):
    filled(path, 8)
    with Store(path, SCHEMA) as store:
        assert repr(store) == f"Store({str(path)!r}, 8 tracks)"
    assert repr(store) == f"Store({str(path)!r}, closed)"
    snapshot = read_store(path)
    assert repr(snapshot) == f"Snapshot({str(path)!r}: {snapshot.summary()})"
    assert "<td>interested</td><td>robot</td><td>2</td>" in snapshot._repr_html_()
    assert repr(snapshot.tracks[1]) == "StoredTrack('t1', 4 points, 'not_interested' by robot)"
    label = "LabelRecord('not_interested' (0.400) by robot, 2026-01-01 12:00:01+0000)"
    assert repr(snapshot.tracks[1].label_record) == label
    assert repr(track(1)) == "NewTrack('t1', shape (2, 4), 'not_interested' by robot)"


FEATURES = TrackSchema(("pitch", "pace"), 0.033, CLASSES, 1)
SERIES = TrackSchema(("volume", "pitch"), 0.1, CLASSES)


def test_features_and_other_channels_are_stored(path, tmp_path):
    numbers = np.array([[0.1, -2.0], [3.5, 4.0]])
    with Store(path, FEATURES) as store:
        store.extend([NewTrack(row, label, "person") for row, label in zip(numbers, CLASSES, strict=True)])
    snapshot = read_store(path)
    assert np.array_equal(snapshot.trajectories(), numbers)
    dataset = snapshot.dataset()
    assert (dataset.kind, dataset.channels, dataset.labels) == ("table", ("pitch", "pace"), CLASSES)
    assert dataset.groups == tuple(track_hash(row) for row in numbers)
    assert str(snapshot.schema) == "features pitch, pace"
    assert snapshot.summary() == "2 cases (1 interested by a person, 1 not_interested by a person)"
    with pytest.raises(DataError, match="has features, which have no time points to cut"):
        snapshot.dataset(points=1)
    with Store(tmp_path / "series", SERIES) as store:
        store.append(NewTrack(numbers, CLASSES[0]))
    series = read_store(tmp_path / "series")
    assert series.dataset().kind == "series"
    assert str(series.schema) == "volume, pitch every 0.1 s"
    assert np.array_equal(series.dataset().trajectories, numbers[None])


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        (np.zeros((2, 3)), r"shape \(2, 3\); expected 2 features \(pitch, pace\)"),
        (np.zeros(3), r"shape \(3,\); expected 2 features"),
        ([1, np.nan], "pace is nan; expected a finite number"),
    ],
)
def test_features_that_do_not_fit_are_refused(path, signal, words):
    with Store(path, FEATURES) as store, pytest.raises(DataError, match=words):
        store.append(NewTrack(signal, CLASSES[0]))


def test_a_schema_of_a_data_set_keeps_its_kind():
    for shape, channels, schema in (
        ((1, 2), ("pitch", "pace"), FEATURES),
        ((1, 2, 4), ("x", "y"), TrackSchema(("x", "y"), 0.033, CLASSES, 4)),
    ):
        dataset = Dataset(np.zeros(shape), ("interested",), channels=channels)
        assert TrackSchema.from_dataset(dataset, CLASSES) == schema
