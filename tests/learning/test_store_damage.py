"""Whatever happens to the bytes of a store: whole records are found, the loss is told, nothing crashes."""

import io
import json
import re
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from lcorpp.errors import DataError
from lcorpp.learning.store import Store, read_store
from lcorpp.learning.store.frames import MARKER, Gap, framed, frames
from tests.learning.stores import SCHEMA, filled, track, walk

ROWS = 8


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of a store of `ROWS` tracks, and where each record begins, the end of the file last."""
    path = tmp_path_factory.mktemp("whole") / "s"
    content = filled(path, ROWS)
    return content, [stored.place for stored in read_store(path)] + [len(content)]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("damaged") / "s"


def opened_anew(path):
    """Open for writing and add a track, then read; what opening said, and the rows that are there."""
    for aside in path.parent.glob("s.cut-*"):
        aside.unlink()
    with Store(path, SCHEMA) as store:
        store.append(track(99), durable=False)
    reading = read_store(path)
    rows = [stored.extra["row"] for stored in reading]
    assert np.array_equal(reading.trajectories(), [walk(row) for row in rows])
    assert rows[-1] == 99
    return store.notes, rows[:-1]


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_any_prefix_opens_to_a_prefix_of_the_records(whole, path, data):
    content, places = whole
    end = data.draw(st.integers(0, places[0]) | st.integers(places[0], len(content)))
    path.write_bytes(content[:end])
    complete = sum(place <= end for place in places[1:])
    if end >= places[0]:
        reading = read_store(path)
        assert [stored.extra["row"] for stored in reading] == list(range(complete))
        assert (reading.damage, reading.tail) == ((), end - places[complete])
    elif end < places[0] // 2:
        with pytest.raises(DataError, match="head is not complete; it has no records"):
            read_store(path)
    else:
        assert len(read_store(path)) == 0
    notes, rows = opened_anew(path)
    assert rows == list(range(complete))
    torn = content[places[complete] if end >= places[0] else 0 : end]
    assert bool(notes) == bool(torn)
    if torn:
        assert "moved to s.cut-" in notes[0]
        (aside,) = path.parent.glob("s.cut-*")
        assert aside.read_bytes() == torn
    assert not read_store(path).damage


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_any_flipped_byte_loses_at_most_its_record_and_is_told(whole, path, data):
    content, places = whole
    at = data.draw(st.integers(0, places[0] - 1) | st.integers(places[0], len(content) - 1))
    flip = data.draw(st.integers(1, 255))
    path.write_bytes(content[:at] + bytes([content[at] ^ flip]) + content[at + 1 :])
    hit = sum(place <= at for place in places) - 1  # -1: the head
    left = [row for row in range(ROWS) if row != hit]
    reading = read_store(path)
    assert [stored.extra["row"] for stored in reading] == left
    assert np.array_equal(reading.trajectories(), [walk(row) for row in left])
    if hit == ROWS - 1:  # a record that is damaged at the end looks like one that was never finished
        assert (reading.damage, reading.tail) == ((), places[-1] - places[-2])
    else:
        (damage,) = reading.damage
        assert damage.start <= at < damage.stop
        assert damage.lost == (hit >= 0)
        assert f"bytes {damage.start} to {damage.stop}" in str(damage)
    notes, rows = opened_anew(path)
    assert rows == left
    assert len(notes) == 1
    assert ("moved to" in notes[0]) == (hit == ROWS - 1)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_bytes_cut_out_or_put_in_lose_only_what_they_touch(whole, path, data):
    content, places = whole
    start = data.draw(st.integers(places[0], len(content)))
    stop = data.draw(st.integers(start, min(start + 600, len(content))))
    put = data.draw(st.binary(max_size=40) | st.just(content[:700]) | st.just(content[places[1] : places[3]]))
    path.write_bytes(content[:start] + put + content[stop:])
    reading = read_store(path)
    rows = [stored.extra["row"] for stored in reading]
    untouched = {row for row in range(ROWS) if places[row + 1] <= start or places[row] >= stop}
    assert untouched <= set(rows)
    assert len(rows) == len(set(rows))  # records put in twice are taken once, where they come first
    assert np.array_equal(reading.trajectories(), [walk(row) for row in rows])
    assume(len(put) != stop - start or put != content[start:stop])
    assert reading.damage or reading.tail or rows == list(range(len(rows)))
    opened_anew(path)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_garbage_is_refused_or_empty(whole, path, data):
    content, places = whole
    garbage = data.draw(
        st.binary(max_size=300) | st.text(alphabet="lcorp tracks1{}\n\0", max_size=60).map(str.encode)
    )
    garbage = (
        data.draw(st.sampled_from([b"", b"lcorpp tracks ", content[: places[0]], content[: places[1]]]))
        + garbage
    )
    path.write_bytes(garbage)
    for act in (lambda: read_store(path), lambda: opened_anew(path)):
        with suppress(DataError):  # any other exception fails
            act()


@settings(max_examples=60, deadline=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
        max_leaves=5,
    ),
    st.sampled_from(
        ["number", "id", "group", "label", "source", "belief", "time", "context", "points", "of"]
    ),
)
def test_a_whole_frame_of_another_content_is_reported(whole, path, value, key):
    """As a newer program, or one with a mistake, might write it: the checksum is right."""
    content, places = whole
    reading_marker = bytes.fromhex(re.search(rb'"marker": "(\w+)"', content)[1].decode())
    (found,) = (f for f in _frames(content, places, reading_marker) if json.loads(f.facts)["id"] == "t3")
    facts = json.dumps({**json.loads(found.facts), key: value}).encode()
    changed = framed(reading_marker, facts, found.numbers)
    path.write_bytes(content[: found.start] + changed + content[found.stop :])
    reading = read_store(path)
    rows = [stored.extra["row"] for stored in reading]
    assert [row for row in rows if row != 3] == [0, 1, 2, 4, 5, 6, 7]
    if 3 not in rows:
        assert reading.damage
    opened_anew(path)


def _frames(content, places, marker):
    return frames(io.BytesIO(content), marker, places[0], len(content))


def test_what_is_lost_is_counted(whole, path):
    """Two records and a half cut out of the middle: the numbers of the others tell."""
    content, places = whole
    path.write_bytes(content[: places[2]] + content[places[4] + 40 :])
    (damage,) = read_store(path).damage
    assert str(damage).endswith("not a record (before record 6); 3 records lost")
    path.write_bytes(content[: places[2]] + content[places[5] :])
    (damage,) = read_store(path).damage
    assert str(damage).endswith("nothing where records before 6 were; 3 records lost")


def test_a_label_of_a_lost_track_is_told(tmp_path):
    path = tmp_path / "s"
    filled(path, 2)
    with Store(path, SCHEMA) as store:
        store.relabel("t0", "interested")
        place = store.snapshot().tracks[0].place
    content = bytearray(path.read_bytes())
    content[place + 60] ^= 1
    path.write_bytes(content)
    reading = read_store(path)
    assert [stored.id for stored in reading] == ["t1"]
    assert "record 3 labels 't0', which is lost" in str(reading.damage[1])


def test_damage_in_the_middle_stays_where_it_is(whole, path):
    """Append-only means that nobody tidies up: it is told at every opening."""
    content, places = whole
    damaged = content[: places[3] + 50] + b"?" + content[places[3] + 51 :]
    path.write_bytes(damaged)
    for _ in range(2):
        with Store(path, SCHEMA) as store:
            (note,) = store.notes
            assert note.endswith("(before record 5); 1 record lost")
    assert path.read_bytes() == damaged


def test_zeros_that_a_file_system_leaves_are_cut(whole, path):
    content, _ = whole
    path.write_bytes(content + bytes(5000))
    notes, rows = opened_anew(path)
    assert rows == list(range(ROWS))
    assert f"bytes {len(content)} to {len(content) + 5000} are no whole record" in notes[0]
    path.write_bytes(bytes(4096))
    notes, rows = opened_anew(path)
    assert rows == []


def test_a_crash_while_the_rest_is_moved_aside(whole, path, monkeypatch):
    """The rest is written beside the store first: whatever comes then, the next opening does it again."""
    content, places = whole
    path.write_bytes(content[:-5])

    def crash(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("os.ftruncate", crash)
    with pytest.raises(KeyboardInterrupt):
        Store(path, SCHEMA)
    monkeypatch.undo()
    assert path.read_bytes() == content[:-5]
    Store(path, SCHEMA).close()
    asides = [file for file in path.parent.glob("s.cut-*") if file.read_bytes() == content[places[-2] : -5]]
    assert len(asides) == 1
    assert path.read_bytes() == content[: places[-2]]


def test_data_damaged_after_reading_are_noticed(whole, path):
    content, places = whole
    path.write_bytes(content)
    reading = read_store(path)
    path.write_bytes(content[: places[4] + 200] + b"?" + content[places[4] + 201 :])
    with pytest.raises(Exception, match="track 't4' is no longer at byte"):
        reading.dataset()


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(["frame", "junk"]), st.binary(max_size=40)), max_size=8))
def test_frames_and_gaps_join_without_a_rest(parts):
    """Junk between frames, even with markers in it, never hides a frame."""
    marker = b"0123456789abcdef"
    assert len(marker) == MARKER
    content, expected = b"", []
    for kind, part in parts:
        if kind == "frame":
            expected.append(part)
            content += framed(marker, part, part * 3)
        else:
            content += part + marker[: len(part)] + (marker if len(part) % 2 else b"")
    pieces = list(frames(io.BytesIO(content), marker, 0, len(content)))
    assert [piece.facts for piece in pieces if not isinstance(piece, Gap)] == expected
    edges = [edge for piece in pieces for edge in (piece.start, piece.stop)]
    assert edges == sorted(edges)
    assert edges[:1] + edges[-1:] in ([], [0, len(content)])
    assert edges[1:-1:2] == edges[2::2]
