"""Each fault is an error with its place, and is repaired only if its repair is requested."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.csv_text import format_csv
from lcorpp.errors import DataError, LcorppError, ParseError
from lcorpp.learning import read_recording
from lcorpp.learning.data.repairs import REPAIRS
from lcorpp.learning.data.tracks import Repair, count_repairs

from .texts import GOOD, HEADING, rows

A4 = "a,0.2,0.20,2.00,in\n"
"""Line 4."""
LAST = "b,1.1,0.55,2.00,out\n"
"""Line 25."""


def read(tmp_path, text, **options):
    (tmp_path / "p.csv").write_text(text)
    return read_recording(tmp_path / "p.csv", **options)


# repair, text, line and column, words, rows changed, (track, samples) that are left
ALL_OF = [("a", 12), ("b", 12)]
LESS_ONE = [("a", 11), ("b", 12)]
FAULTS = [
    ("rows", GOOD.replace(A4, "a,0.2,0.20,in\n"), 4, 1, "4 columns; expected 5", 1, LESS_ONE),
    (
        "rows",
        GOOD.replace(A4, "a,0.2,two,2.00,in\n"),
        4,
        7,
        "'two' is not a number; expected the x",
        1,
        LESS_ONE,
    ),
    ("rows", GOOD.replace(A4, "a,0.2,1_0,2.00,in\n"), 4, 7, "'1_0' is not a number", 1, LESS_ONE),
    ("rows", GOOD.replace(A4, ",0.2,0.20,2.00,in\n"), 4, 1, "no track", 1, LESS_ONE),
    ("rows", GOOD.replace(A4, 'a,0.2,0.20,2.00,"in\n'), 4, 1, "not a row of CSV", 1, LESS_ONE),
    ("cut", GOOD[:-12], 25, 1, "the file ends in the middle of its last line", 1, [("a", 12), ("b", 11)]),
    ("cut", GOOD[:-2], 25, 17, "label 'ou' after 'out'", 1, [("a", 12), ("b", 11)]),
    ("nonfinite", GOOD.replace(A4, "a,0.2,nan,2.00,in\n"), 4, 7, "the x is missing or NaN", 1, LESS_ONE),
    ("nonfinite", GOOD.replace(A4, "a,0.2,0.2,,in\n"), 4, 11, "the y is missing or NaN", 1, LESS_ONE),
    ("nonfinite", GOOD.replace(A4, "a,0.2,0.2,-inf,in\n"), 4, 11, "the y is infinite", 1, LESS_ONE),
    ("nonfinite", GOOD.replace(A4, "a,1e999,0.2,2,in\n"), 4, 3, "the time is infinite", 1, LESS_ONE),
    (
        "order",
        GOOD.replace(A4, "").replace("b,0.0", A4 + "b,0.0"),
        13,
        3,
        "time 0.2 s after 1.1 s; expected times that rise",
        1,
        ALL_OF,
    ),
    ("duplicates", GOOD.replace(A4, A4 + A4), 5, 3, "the same sample at time 0.2 s as in line 4", 1, ALL_OF),
    (
        "duplicates",
        GOOD.replace(A4, A4 + A4.replace("2.00", "2.05")),
        5,
        3,
        "another sample at time 0.2 s as in line 4",
        1,
        ALL_OF,
    ),
    (
        "gaps",
        GOOD + rows("a", "in", start=60.0),
        26,
        3,
        "silent for 58.900 s before; expected at most 5 s of one person",
        12,
        [("a", 12), ("a#2", 12), ("b", 12)],
    ),
    (
        "gaps",
        HEADING + rows("a", "in", samples=99) + rows("b", "out") + rows("a", "in", samples=99),
        113,
        3,
        "its times start again at 0 s; expected one person for each id",
        99,
        [("a", 99), ("a#2", 99), ("b", 12)],
    ),
    ("short", GOOD + "c,0,1,1,in\n", 26, 1, "1 samples show no motion; expected at least 2", 1, ALL_OF),
    (
        "constant",
        GOOD + rows("c", "in", speed=0),
        26,
        7,
        "all 12 samples are at (0, 2) m; expected motion",
        12,
        ALL_OF,
    ),
    (
        "units",
        GOOD + rows("c", "in", speed=1300),
        26,
        7,
        "1.3e+03 m/s, which no human has; it looks like millimetres taken for metres",
        12,
        [*ALL_OF, ("c", 12)],
    ),
    ("labels", GOOD + rows("c", ""), 26, 17, "no label; expected one of in, out", 12, ALL_OF),
    (
        "labels",
        GOOD + rows("c", "maybe"),
        26,
        17,
        "unknown label 'maybe'; expected one of in, out",
        12,
        ALL_OF,
    ),
    (
        "labels",
        GOOD.replace(A4, A4.replace("in", "out")),
        4,
        17,
        "label 'out' after 'in' in line 2; expected one label for a track",
        12,
        [("b", 12)],
    ),
]
LABELS = {"in": "in", "out": "out"}


@pytest.mark.parametrize(
    ("repair", "text", "line", "column", "words", "changed", "left"),
    FAULTS,
    ids=[f"{fault[0]}-{number}" for number, fault in enumerate(FAULTS)],
)
def test_a_fault_is_located_or_repaired(tmp_path, repair, text, line, column, words, changed, left):
    others = set(REPAIRS) - {repair}
    for allowed in ((), others):
        with pytest.raises(ParseError) as caught:
            read(tmp_path, text, repair=allowed, labels=LABELS)
        assert (caught.value.line, caught.value.column) == (line, column)
        assert words in str(caught.value)
        assert f"repair '{repair}' would {REPAIRS[repair]}" in str(caught.value)
    recording = read(tmp_path, text, repair=[repair], labels=LABELS)
    assert [(track.id, len(track)) for track in recording.tracks] == left
    assert count_repairs(recording.repairs) == {repair: (changed, 1)}
    (entry,) = recording.repairs
    assert entry.line == line
    assert words in entry.done
    assert [len(t) for t in read(tmp_path, text, repair=["all"], labels=LABELS).tracks] == [
        n for _, n in left
    ]


def test_repaired_values_are_correct(tmp_path):
    shuffled = GOOD.splitlines(keepends=True)
    body = [shuffled[1 + i] for i in np.random.default_rng(3).permutation(24)]
    recording = read(tmp_path, HEADING + "".join(body), repair=["order"])
    for track in recording.tracks:
        np.testing.assert_allclose(track.times, np.arange(12) / 10)
        np.testing.assert_allclose(
            track.columns["x"], track.times * (1 if track.id == "a" else 0.5), atol=0.006
        )
    mixed = read(tmp_path, GOOD + rows("c", "in", speed=1300), repair=["units"])
    np.testing.assert_allclose(mixed.tracks[2].columns["x"], 1.3 * np.arange(12) / 10)
    np.testing.assert_allclose(mixed.tracks[2].columns["y"], 0.002)


def test_silence_within_the_limit_is_no_gap(tmp_path):
    text = HEADING + rows("a", "in") + rows("a", "in", start=5.5)
    assert len(read(tmp_path, text)) == 1
    with pytest.raises(ParseError, match=r"silent for 4\.400 s"):
        read(tmp_path, text, gap=4.0)


def test_parts_of_a_track_in_another_order_are_disorder_not_another_person(tmp_path):
    walk = rows("a", "in", samples=160).splitlines(keepends=True)
    text = HEADING + "".join(walk[100:] + walk[:100])
    with pytest.raises(ParseError, match="repair 'order' would sort"):
        read(tmp_path, text)
    assert [len(track) for track in read(tmp_path, text, repair=["order"]).tracks] == [160]


def test_a_line_without_an_end_that_is_whole_is_read_with_a_note(tmp_path):
    recording = read(tmp_path, GOOD[:-1])
    assert [len(track) for track in recording.tracks] == [12, 12]
    assert recording.notes == ("the last line has no line end: its last number may have been cut",)


def test_several_faults_at_once_are_counted_and_named(tmp_path):
    text = GOOD.replace(A4, "a,0.2,nan,2.00,in\na,0.2,x,2,in\n") + "c,0,1,1,in\n" + rows("d", "") + "e,1"
    recording = read(tmp_path, text, repair=["all"])
    assert [(track.id, len(track)) for track in recording.tracks] == [("a", 11), ("b", 12)]
    assert count_repairs(recording.repairs) == {
        "rows": (1, 1),
        "cut": (1, 1),
        "nonfinite": (1, 1),
        "short": (1, 1),
        "labels": (12, 1),
    }
    table = format_csv([Repair._fields, *recording.repairs]).splitlines()
    assert table[0] == "reason,file,line,track,rows,done"
    assert [line.split(",")[2] for line in table[1:]] == [str(repair.line) for repair in recording.repairs]


def test_a_file_without_remaining_tracks_is_an_error(tmp_path):
    assert len(read(tmp_path, HEADING + "c,0,1,1,in\n", repair=["all"])) == 0


@settings(max_examples=120)
@given(
    edits=st.lists(
        st.tuples(
            st.integers(0, 600), st.sampled_from(["", ",", "\n", '"', "-", "9", "nan", "\t", "é", "\r"])
        ),
        max_size=6,
    ),
    cut=st.integers(0, 600),
    repairs=st.sets(st.sampled_from(sorted(REPAIRS))),
)
def test_any_text_gives_tracks_or_a_typed_error(tmp_path_factory, edits, cut, repairs):
    text = GOOD
    for at, letters in edits:
        text = text[:at] + letters + text[at + 1 :]
    text = text[:cut] if cut < 550 else text
    folder = tmp_path_factory.mktemp("fuzz", numbered=True)
    try:
        recording = read(folder, text, repair=repairs)
    except LcorppError:
        return
    assert {repair.reason for repair in recording.repairs} <= repairs
    for track in recording.tracks:
        assert np.isfinite(track.positions).all()
        assert np.all(np.diff(track.times) > 0)


def test_malformed_tracks_are_rejected_at_construction():
    from lcorpp.learning import Recording, Track

    times = np.arange(3.0)
    good = {"x": times, "y": times}
    for columns, at, words in [
        ({"x": times}, times, "no column x or y"),
        (good | {"mood": times}, times, "unknown column 'mood'"),
        (good | {"x": times[:2]}, times, r"x of shape \(2,\), times of shape \(3,\)"),
        (good | {"x": times * np.nan}, times, "x is not finite"),
        (good, times[::-1], "not finite and rising"),
        ({"x": times[:1], "y": times[:1]}, times[:1], "1 samples show no motion"),
    ]:
        with pytest.raises(DataError, match=words):
            Track("a", at, columns)
    with pytest.raises(DataError, match="two tracks have the id 'a'"):
        Recording((Track("a", times, good), Track("a", times, good)))


def test_a_file_of_which_no_row_can_be_read_is_an_error(tmp_path):
    text = "track;time;x;y\n" + "".join(f"a;{i};1,{i:03}.5;2\n" for i in range(9))
    with pytest.raises(ParseError, match=r":2:1: no row can be read; '1,000.5' is not a number"):
        read(tmp_path, text, repair=["all"])
