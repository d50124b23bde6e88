"""Damaged stores: intact records are read, every loss is reported, nothing crashes."""

import shutil
import sqlite3
from contextlib import closing, suppress

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import DataError, FileError, LcorppError
from lcorpp.learning.store import Store, read_store
from tests.learning.store.stores import SCHEMA, crash, filled, track, walk

ROWS, POINTS, PAGE = 15, 40, 4096
HEADER = 5 * PAGE
"""Bytes of SQLite's header, the tables' definitions, the store's header and the roots of the tables."""


FLIPS = [1, *(pytest.param(flip, marks=pytest.mark.slow) for flip in (0x80, 0xFF))]
"""Bits to flip in each of many bytes."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of a store of `ROWS` tracks on several pages."""
    return filled(tmp_path_factory.mktemp("whole") / "s", ROWS, points=POINTS)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("damaged") / "s"


def write_file(path, content):
    for file in path.parent.iterdir():
        file.unlink()
    path.write_bytes(content)


def edit(path, *statements):
    """Change a store as another program might; nothing checks it."""
    with closing(sqlite3.connect(path)) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()


def read_rows(path):
    """Read the store, check that each row is unchanged or reported; return the rows and the snapshot."""
    snapshot = read_store(path)
    rows = [stored.extra["row"] for stored in snapshot]
    assert rows == sorted(set(rows))
    for row, numbers in zip(rows, snapshot.trajectories(), strict=True):
        assert np.array_equal(numbers, walk(row, POINTS))
    for stored in snapshot:
        assert (stored.label, stored.source) == (
            track(stored.extra["row"]).label,
            track(stored.extra["row"]).source,
        )
    lost = set(range(ROWS)) - set(rows)
    assert sum(damage.lost for damage in snapshot.damage) >= len(lost)
    return rows, snapshot


def append_anew(path, rows):
    """Open the store for writing and add a track; all readable records remain."""
    with Store(path, SCHEMA) as store:
        store.append(track(99, POINTS), durable=False)
    snapshot = read_store(path)
    assert [stored.extra["row"] for stored in snapshot] == [*rows, 99]
    assert not any(damage.structural for damage in snapshot.damage)
    return store.notes


def check_flipped(whole, path, at, flip):
    """Flip bits of a byte: few records are lost, which is reported, and the store can be written to."""
    write_file(path, whole[:at] + bytes([whole[at] ^ flip]) + whole[at + 1 :])
    try:
        rows, snapshot = read_rows(path)
    except LcorppError:
        assert at < HEADER
        return
    assert at < HEADER or len(rows) >= ROWS - 5  # a damaged page costs its records
    notes = append_anew(path, rows)
    assert bool(notes) == bool(snapshot.damage)


@settings(max_examples=20)
@given(at=st.integers(0, 2**20), flip=st.integers(1, 255))
def test_any_flipped_byte_loses_few_records_and_is_reported(whole, path, at, flip):
    check_flipped(whole, path, at % len(whole), flip)


@pytest.mark.parametrize("flip", FLIPS)
def test_each_byte_of_the_header_may_be_flipped(whole, path, flip):
    for at in range(100):
        check_flipped(whole, path, at, flip)


@pytest.mark.parametrize("flip", FLIPS)
def test_any_byte_of_the_structure_may_be_flipped(whole, path, flip):
    """Every 61st byte of the tables' definitions, all of SQLite's counters, and the headers of pages."""
    definitions = range(100, PAGE, 61)
    counters = range(4 * PAGE, 5 * PAGE)
    headers = (page * PAGE + at for page in (2, 3, 6) for at in range(16))
    for at in (*definitions, *counters, *headers):
        if whole[at]:
            check_flipped(whole, path, at, flip)


def test_a_header_that_forbids_writing_is_replaced(whole, path):
    """SQLite reads a file with a higher write version, byte 18, and refuses to write to it."""
    write_file(path, whole[:18] + b"\3" + whole[19:])
    rows, snapshot = read_rows(path)
    assert rows == list(range(ROWS))
    assert [str(damage) for damage in snapshot.damage] == ["attempt to write a readonly database"]
    assert len(append_anew(path, rows)) == 2
    assert path.with_name("s.damaged").read_bytes()[18] == 3


@pytest.mark.parametrize("last", ["14", "0", "-5", "'x'", "NULL", "1e12"])
def test_a_wrong_number_of_the_last_record_is_corrected(whole, path, last):
    """Otherwise the next record would have the number of another one, or none would fit after it."""
    write_file(path, whole)
    edit(path, f"UPDATE sqlite_sequence SET seq = {last}")
    rows, snapshot = read_rows(path)
    assert str(snapshot.damage[0]) == "the number of its last record is changed"
    append_anew(path, rows)
    assert [stored.record for stored in read_store(path)] == list(range(1, ROWS + 2))


def test_a_renamed_column_is_reported_and_corrected(whole, path):
    write_file(path, whole.replace(b"group_id TEXT", b"group_iD TEXT"))
    rows, snapshot = read_rows(path)
    assert rows == list(range(ROWS))
    assert [str(damage) for damage in snapshot.damage] == ["a definition of its tables is changed"]
    append_anew(path, rows)


def test_a_store_can_be_read_during_a_transaction(whole, path):
    write_file(path, whole)
    with closing(sqlite3.connect(path, isolation_level=None)) as writer:
        writer.execute("BEGIN IMMEDIATE")
        assert not read_store(path).damage


@settings(max_examples=20)
@given(size=st.integers(0, 2**20))
def test_a_file_that_is_cut_off_keeps_its_readable_records(whole, path, size):
    size %= len(whole)
    write_file(path, whole[:size])
    try:
        rows, snapshot = read_rows(path)
    except LcorppError:
        assert size < HEADER + 2 * PAGE  # no page of tracks is left
        return
    assert snapshot.damage
    append_anew(path, rows)


@settings(max_examples=20)
@given(page=st.integers(0, 2**10), garbage=st.just(bytes(PAGE)) | st.binary(min_size=PAGE, max_size=PAGE))
def test_overwritten_pages_lose_only_their_records(whole, path, page, garbage):
    start = HEADER + page * PAGE % (len(whole) - HEADER)
    write_file(path, whole[:start] + garbage + whole[start + PAGE :])
    rows, snapshot = read_rows(path)
    assert len(rows) >= ROWS - 5
    assert snapshot.damage
    append_anew(path, rows)


@settings(max_examples=60)
@given(
    start=st.sampled_from([b"", b"lcorpp tracks ", 16, 100, PAGE]),
    garbage=st.binary(max_size=300) | st.text(alphabet="lcorp tracks1{}\n\0", max_size=60).map(str.encode),
)
def test_garbage_is_refused_or_empty(whole, path, start, garbage):
    write_file(path, (start if isinstance(start, bytes) else whole[:start]) + garbage)
    for act in (read_store, lambda path: Store(path, SCHEMA).close()):
        with suppress(DataError, FileError):  # any other exception fails
            act(path)


@settings(max_examples=25)
@given(end=st.integers(0, 2**20))
def test_any_prefix_of_the_log_opens_to_a_prefix_of_the_records(path, end):
    """A crash leaves the main file and a log that ends anywhere."""
    write_file(path, b"")
    with Store(path, SCHEMA) as store:
        for row in range(8):
            store.append(track(row), durable=False)
        log = path.with_name("s-wal").read_bytes()
        copy = path.with_name("copy")
        shutil.copy(path, copy)
    end %= len(log) + 1
    path.with_name("copy-wal").write_bytes(log[:end])
    snapshot = read_store(copy)
    assert not snapshot.damage
    rows = [stored.extra["row"] for stored in snapshot]
    assert rows == list(range(len(rows)))
    assert len(rows) == 8 or end < len(log)
    with Store(copy, SCHEMA) as store:
        assert (store.notes, store.last_record) == ((), len(rows))
        store.append(track(99))


def test_a_changed_record_is_reported_at_every_opening(tmp_path):
    path = tmp_path / "s"
    filled(path, 5)
    edit(path, "UPDATE track SET label = 'not_interested' WHERE record = 3")
    for _ in range(2):
        with Store(path, SCHEMA) as store:
            assert store.notes == (f"{path}: record 3: its checksum is wrong; 1 record lost",)
    assert [stored.id for stored in read_store(path)] == ["t0", "t1", "t3", "t4"]
    assert not list(tmp_path.glob("*.damaged"))


def test_a_changed_header_is_refused(tmp_path):
    path = tmp_path / "s"
    filled(path, 2)
    edit(path, "UPDATE store SET interval = 9")
    for act in (read_store, lambda path: Store(path, SCHEMA)):
        with pytest.raises(DataError, match="a store whose header is damaged: its checksum is wrong"):
            act(path)


def test_missing_records_are_counted(tmp_path):
    path = tmp_path / "s"
    filled(path, 8)
    edit(path, "DELETE FROM track WHERE record IN (3, 4, 8)")
    snapshot = read_store(path)
    assert [stored.record for stored in snapshot] == [1, 2, 5, 6, 7]
    assert [str(damage) for damage in snapshot.damage] == [
        "records 3 to 4 are missing; 2 records lost",
        "record 8 is missing; 1 record lost",
    ]


def test_a_label_of_a_lost_track_is_reported(tmp_path):
    path = tmp_path / "s"
    filled(path, 2)
    with Store(path, SCHEMA) as store:
        store.relabel("t0", "interested")
    edit(path, "UPDATE track SET context = '{}' WHERE record = 1")
    snapshot = read_store(path)
    assert [stored.id for stored in snapshot] == ["t1"]
    assert str(snapshot.damage[1]) == "record 3: it labels record 1, which is lost; 1 record lost"


def test_a_damaged_file_is_rebuilt_and_kept(whole, path):
    damaged = whole[: -2 * PAGE] + bytes(2 * PAGE)
    write_file(path, damaged)
    rows, snapshot = read_rows(path)
    notes = append_anew(path, rows)
    assert [note.removeprefix(f"{path}: ") for note in notes[:-1]] == [
        str(damage) for damage in snapshot.damage
    ]
    assert notes[-1].endswith("the readable records are in a new file; the damaged one is s.damaged")
    backup = path.with_name("s.damaged")
    assert backup.read_bytes() == damaged
    assert [stored.extra["row"] for stored in read_store(backup)] == rows
    with Store(path, SCHEMA) as store:  # what is missing is still missing
        assert all("missing" in note for note in store.notes)
        assert len(store) == len(rows) + 1


def test_a_damaged_file_is_not_rebuilt_while_it_is_read(whole, path):
    write_file(path, whole[: -2 * PAGE] + bytes(2 * PAGE))
    with closing(sqlite3.connect(path)) as reader:
        reader.execute("BEGIN")
        reader.execute("SELECT identity FROM store").fetchall()
        with pytest.raises(FileError, match="is damaged and cannot be rebuilt"):
            Store(path, SCHEMA)
    Store(path, SCHEMA).close()


@pytest.mark.parametrize("after", [0, 1])
def test_a_crash_while_a_file_is_rebuilt_loses_nothing(whole, path, monkeypatch, after):
    """While the copy or the new file is written."""
    write_file(path, whole[: -2 * PAGE] + bytes(2 * PAGE))
    rows, _ = read_rows(path)
    crash(lambda: Store(path, SCHEMA), after, monkeypatch)
    append_anew(path, rows)


def test_data_damaged_after_reading_are_noticed(whole, path):
    write_file(path, whole)
    snapshot = read_store(path)
    edit(path, "UPDATE track SET trajectory = zeroblob(640) WHERE record = 5")
    with pytest.raises(FileError, match="a track can no longer be read; the file was changed or damaged"):
        snapshot.dataset()
    assert len(snapshot.trajectories(snapshot.tracks[5:])) == ROWS - 5
