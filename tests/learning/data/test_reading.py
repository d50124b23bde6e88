"""Every format is detected by its content, and the same walk is read from each."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from lcorpp.errors import DataError, FileError, LcorppError, ParseError
from lcorpp.learning import Recording, read_data, read_recording, save_dataset, write_recording
from lcorpp.learning.data.csv_reader import CsvFile
from lcorpp.learning.data.formats.detection import detect_format
from lcorpp.learning.data.repairs import RepairLog
from lcorpp.values import Dataset, stack_signals, strip_padding

from .texts import GOOD, HEADING, atc_rows, rows, walk


def written(folder, text, name="people.csv"):
    (folder / name).write_text(text)
    return folder / name


def test_a_long_csv(tmp_path):
    recording = read_recording(written(tmp_path, GOOD))
    assert [(t.id, t.group, t.label, len(t)) for t in recording.tracks] == [
        ("a", "a", "in", 12),
        ("b", "b", "out", 12),
    ]
    np.testing.assert_allclose(recording.tracks[1].columns["x"], np.arange(12) / 20, atol=0.005)
    np.testing.assert_allclose(recording.tracks[0].times, np.arange(12) / 10)
    assert recording.repairs == ()
    assert recording.notes == ()


def test_columns_in_any_order_rows_of_people_in_turn_and_what_is_not_used(tmp_path):
    lines = ["Facing, label ,time,group,y,x,mood,track"]
    for i in range(12):
        lines += [f'0.5,in,{i / 10},one,2,{i / 10},"gay, glad",a', f"0.5,out,{i / 10},two,2,{i / 10},sad,b"]
    recording = read_recording(written(tmp_path, "\r\n".join(lines) + "\r\n\r\n"))
    assert [(t.id, t.group, t.label) for t in recording.tracks] == [("a", "one", "in"), ("b", "two", "out")]
    assert recording.channels == ("x", "y", "facing")
    assert recording.notes == ("columns that are not used: mood",)


def test_atc_data_in_metres(tmp_path):
    file = written(tmp_path, atc_rows(7) + atc_rows(9, speed=0.5))
    recording = read_recording(file)
    assert detect_format(file).name == "ATC tracking data"
    assert [(t.id, t.label) for t in recording.tracks] == [("7", None), ("9", None)]
    track = recording.tracks[0]
    np.testing.assert_allclose(track.columns["x"], np.arange(12) / 10)
    assert [float(track.columns[name][3]) for name in ("y", "z", "velocity", "heading", "facing")] == [
        *(2.0, 1.5, 1.0),
        *(0.0, 3.1),
    ]
    assert track.times[0] == 1350867600


def test_atc_data_with_labels_in_a_file_of_their_own(tmp_path):
    file = written(tmp_path, atc_rows(7) + atc_rows(8) + atc_rows(9))
    labels = written(tmp_path, "id,label\n9,1\n\n7,0\n12,1\n", "labels.csv")
    recording = read_recording(file, label_file=labels, labels={"1": "in", "0": "out"})
    assert [(t.id, t.label) for t in recording.tracks] == [("7", "out"), ("9", "in")]
    assert recording.notes == (f"1 of 3 ids of {labels} have no tracks",)


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ("", 1, 1, "the file is empty; expected rows of an id and its label"),
        ("7,1,2\n", 1, 1, "3 columns; expected 2"),
        ("7,1\n9,maybe\n", 2, 3, "unknown label 'maybe'; expected one of 1, 0, in, out"),
        ("7,1\n7,0\n", 2, 1, "id '7' is out here and in before"),
        ('7,"1\n', 1, 1, "not a row of CSV"),
    ],
)
def test_malformed_label_files_are_located(tmp_path, text, line, column, words):
    labels = written(tmp_path, text, "labels.csv")
    with pytest.raises(ParseError) as caught:
        read_recording(written(tmp_path, atc_rows(7)), label_file=labels, labels={"1": "in", "0": "out"})
    assert (caught.value.file, caught.value.line, caught.value.column) == (str(labels), line, column)
    assert words in str(caught.value)


def test_labels_from_two_places_are_refused(tmp_path):
    labels = written(tmp_path, "a,in\nb,out\n", "labels.csv")
    with pytest.raises(DataError, match="has labels of its own"):
        read_recording(written(tmp_path, GOOD), label_file=labels)


def test_a_label_for_an_id_of_two_people_is_an_error_or_left_out(tmp_path):
    file = written(tmp_path, atc_rows(7) + atc_rows(7, start=1350869000.0) + atc_rows(8))
    labels = written(tmp_path, "7,in\n8,out\n", "labels.csv")
    with pytest.raises(DataError, match=r"track '7': its id was given to 2 people; the label 'in' may be"):
        read_recording(file, label_file=labels, repair=["gaps"])
    assert [t.id for t in read_recording(file, label_file=labels, repair=["gaps", "labels"]).tracks] == ["8"]


def test_labels_are_converted_to_classes(tmp_path):
    file = written(tmp_path, GOOD.replace("in", "1"))
    recording = read_recording(file, labels={"1": "in", "0": "out"})  # "out" is a class
    assert recording.labels == ("in", "out")


@pytest.mark.parametrize("lengths", [(5, 5, 5), (5, 3, 4)])
def test_a_data_set_stays_as_it_was_stored(tmp_path, lengths):
    rng = np.random.default_rng(0)
    data = Dataset(
        stack_signals([rng.normal(scale=0.2, size=(3, points)) for points in lengths]),
        ("in", "out", "in"),
        ("p", "q", "p"),
        "a source",
        ("a note",),
        0.4,
        ("x", "y", "heading"),
    )
    save_dataset(data, tmp_path / "d.npz")
    back = read_data(tmp_path / "d.npz")
    np.testing.assert_array_equal(back.trajectories, data.trajectories)
    for name in ("labels", "groups", "source", "notes", "interval", "channels"):
        assert getattr(back, name) == getattr(data, name)
    fewer = read_data(tmp_path / "d.npz", points=3, channels=("x", "y"))
    expected = [strip_padding(track)[:2, -3:] for track in data.trajectories]
    np.testing.assert_allclose(fewer.trajectories, expected, atol=1e-12)
    assert [t.id for t in read_recording(tmp_path / "d.npz").tracks] == ["p", "q", "p#2"]


@pytest.mark.parametrize("cut", [0, 0.01, 0.3, 0.8, 0.99])
def test_a_damaged_data_set(tmp_path, cut):
    save_dataset(Dataset(np.zeros((2, 2, 5)), ("a", "b")), tmp_path / "d.npz")
    content = (tmp_path / "d.npz").read_bytes()
    (tmp_path / "d.npz").write_bytes(content[: int(cut * len(content))])
    with pytest.raises(DataError, match=r"d\.npz: not a stored data set, or a damaged one"):
        read_data(tmp_path / "d.npz")


def test_read_data_uses_the_last_seconds_and_notes_short_tracks(tmp_path):
    text = HEADING + rows("a", "in", samples=40) + rows("b", "out", samples=12) + rows("c", "out", samples=45)
    data = read_data(written(tmp_path, text), interval=0.1, points=31)
    assert data.labels == ("in", "out", "out")
    assert data.lengths.tolist() == [31, 12, 31]
    assert (data.interval, data.channels) == (0.1, ("x", "y"))
    np.testing.assert_allclose(data.trajectories[0, 0], np.arange(9, 40) / 10)
    assert data.notes == ("1 of 3 tracks are shorter than 3 s and used whole: 1 out",)
    with pytest.raises(
        DataError, match=r"people\.csv: every track is shorter than 1 s; the longest lasts 0\.9"
    ):
        read_data(written(tmp_path, HEADING + rows("a", "in", samples=10)))


def test_in_the_frame_of_a_robot(tmp_path):
    columns = {"heading": np.zeros(361), "velocity": np.ones(361)}
    write_recording(Recording((walk("a", **columns),)), tmp_path / "a.csv")
    track = read_recording(tmp_path / "a.csv", robot=(4.0, 1.0, np.pi / 2)).tracks[0]
    np.testing.assert_allclose(track.columns["x"], 1.0, atol=1e-9)  # ahead of a robot that looks along y
    np.testing.assert_allclose(track.columns["y"][[0, -1]], [4.0, -8.0], atol=1e-9)
    np.testing.assert_allclose(track.columns["heading"], -np.pi / 2)
    np.testing.assert_allclose(track.columns["velocity"], 1.0)


WRONG = [
    ("", "the file is empty; expected a line that names track, time, x, y", 1, 1),
    ("\n \n", "the file is empty", 1, 1),
    (
        "1,2,3\n",
        "3 columns of numbers; expected a line that names track, time, x, y, the number of each",
        1,
        1,
    ),
    ("track,time,x\n", "no column 'y'; expected track, time, x, y among", 1, 1),
    ("track;time;x\n", "no column 'y'; expected track, time, x, y among", 1, 1),
    ("track time x y\n", "no rows after the heading; expected rows of track, time, x, y", 2, 1),
    ("track_time_x_y\n", "no column 'track', and no column 'label'", 1, 1),
    ("track;time;x;y\na;0;1;0\na;0.1;1,5;0\n", "'1,5' is not a number; expected the x, with a decimal", 3, 7),
    ("track,time,x,y\na,0,1,5,2,5\n", "expected a name for each column, and decimal points", 1, 1),
    ("track,time,x,y,x\n", "column 'x' for the second time", 1, 16),
    ("track,time,x,y\n", "no rows after the heading", 2, 1),
    ('track,"time,x,y\n', "not a row of CSV", 1, 1),
    ("\x1b[31m\n", "no column 'track'", 1, 1),
]


@pytest.mark.parametrize(("text", "words", "line", "column"), WRONG, ids=range(len(WRONG)))
def test_files_of_unknown_format_are_located(tmp_path, text, words, line, column):
    with pytest.raises(ParseError) as caught:
        read_recording(written(tmp_path, text))
    assert (caught.value.line, caught.value.column) == (line, column)
    assert words in str(caught.value)


def test_missing_and_binary_files_are_errors(tmp_path):
    with pytest.raises(FileError, match=r"no\.csv: cannot be read: No such file"):
        read_recording(tmp_path / "no.csv")
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\0\0\0")
    with pytest.raises(FileError, match=r"picture\.csv:1: not UTF-8 text: a NUL byte; expected a text file"):
        read_recording(tmp_path / "picture.csv")
    (tmp_path / "latin.csv").write_bytes(GOOD.encode() + b"a,2,\xe9,1,in\n")
    with pytest.raises(
        FileError, match=r"latin\.csv:26: not UTF-8 text: byte 0xe9, 'é' in Latin-1; expected a"
    ):
        read_recording(tmp_path / "latin.csv")
    far = HEADING + rows("a", "in", samples=2000)
    (tmp_path / "far.csv").write_bytes(far.encode() + b"a,9999,\xe9,1,in\n")
    with pytest.raises(FileError, match=r"far\.csv:2002: not UTF-8 text: byte 0xe9"):
        read_recording(tmp_path / "far.csv")
    with pytest.raises(FileError, match="a: cannot be read: File name too long"):
        read_recording("a" * 5000)
    with pytest.raises(FileError, match="interposx"):
        read_recording(tmp_path)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"points": 0}, "a data set needs at least 2 time points, not 0"),
        ({"interval": 0.0}, "the interval is 0.0 s; expected a finite number above 0"),
        ({"interval": 0.0, "seconds": 1.0}, "the interval is 0.0 s; expected a finite number above 0"),
        ({"seconds": float("nan")}, "the window is nan s; expected a finite number above 0"),
        ({"robot": (0.0, float("nan"), 0.0)}, "the robot's pose is 0 nan 0; expected finite numbers"),
    ],
)
def test_zero_and_nan_are_no_defaults(tmp_path, options, words):
    with pytest.raises(DataError, match=words):
        read_data(written(tmp_path, GOOD), **options)


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_delimiters_and_encodings(tmp_path, delimiter, encoding):
    """Tracks, tables, tracking data and files of labels are the same with each delimiter and encoding."""
    texts = {
        "long": GOOD.replace("a,", "Jürgen,"),
        "table": 'lean,"x, m",label,person\n0.5,1,in,a\n0.25,2,out,b\n',
        "atc": atc_rows(7) + atc_rows(8, speed=0.5),
        "labels": "7,in\n8,out\n",
    }
    files = {}
    for name, text in texts.items():
        quoted = text.replace('"x, m"', "QUOTED").replace(",", delimiter).replace("QUOTED", '"x, m"')
        files[name] = tmp_path / f"{name}.csv"
        files[name].write_bytes(quoted.encode(encoding))
    assert [(track.id, track.label) for track in read_recording(files["long"]).tracks] == [
        ("Jürgen", "in"),
        ("b", "out"),
    ]
    table = read_data(files["table"])
    assert (table.channels, table.groups) == (("lean", "x, m"), ("a", "b"))
    assert table.trajectories.tolist() == [[0.5, 1], [0.25, 2]]
    labelled = read_recording(files["atc"], label_file=files["labels"])
    assert [(track.id, track.label) for track in labelled.tracks] == [("7", "in"), ("8", "out")]
    np.testing.assert_allclose(labelled.tracks[1].columns["x"], np.arange(12) / 20, rtol=1e-12)


def test_a_decimal_comma_is_no_row_to_leave_out(tmp_path):
    file = written(tmp_path, GOOD.replace(",", ";").replace(".", ","))
    with pytest.raises(ParseError, match=r"people\.csv:2:3: '0,0' is not a number; .* instead of the comma"):
        read_recording(file, repair="all")


def test_arguments_out_of_range(tmp_path):
    file = written(tmp_path, GOOD)
    with pytest.raises(DataError, match="unknown repair 'magic'; expected one of rows, cut"):
        read_recording(file, repair=["magic"])
    with pytest.raises(DataError, match="the longest silence is 0 s"):
        read_recording(file, gap=0)


def test_the_size_of_batches_does_not_affect_the_result(tmp_path, monkeypatch):
    whole = read_recording(written(tmp_path, GOOD + rows("a", "in", start=2.0)))
    monkeypatch.setattr("lcorpp.learning.data.csv_reader.BATCH_LINES", 5)
    reports = []
    parts = read_recording(
        tmp_path / "people.csv", progress=lambda done, total: reports.append((done, total))
    )
    for one, other in zip(whole.tracks, parts.tracks, strict=True):
        assert (one.id, one.label) == (other.id, other.label)
        np.testing.assert_array_equal(one.times, other.times)
        np.testing.assert_array_equal(one.positions, other.positions)
    size = (tmp_path / "people.csv").stat().st_size
    assert reports[-1] == (size, size)
    assert sorted(reports) == reports


cells = st.one_of(
    st.floats(-1e6, 1e6).map(repr),
    st.integers(-(10**6), 10**6).map(str),
    st.decimals(-1000, 1000, places=3).map(lambda number: f" {number} "),
    st.sampled_from(["-0", "1e-7", ".5", "3.", "+2"]),
)


@settings(max_examples=60)
@given(rows=st.lists(st.tuples(cells, cells), min_size=1, max_size=8), quoted=st.booleans())
def test_parsing_at_once_and_by_row_agree(tmp_path_factory, rows, quoted):
    file = tmp_path_factory.mktemp("rows") / "a.csv"
    name = '"a, b"' if quoted else "a"
    file.write_text("".join(f"{name},{number},{x},{y}\n" for number, (x, y) in enumerate(rows)))
    quick, careful = (
        CsvFile(file, ("track", "time", "x", "y"), ("time", "x", "y"), (), RepairLog()) for _ in "ab"
    )
    careful._at_once = lambda lines, number: None
    (one,), (other,) = (list(reader.batches()) for reader in (quick, careful))
    assert one.lines.tolist() == other.lines.tolist() == list(range(1, len(rows) + 1))
    assert one.texts == other.texts
    for column in ("time", "x", "y"):
        assert one.numbers[column].tobytes() == other.numbers[column].tobytes()


@settings(max_examples=60)
@given(edits=st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), min_size=1, max_size=5))
def test_a_data_set_whose_bytes_are_changed_is_refused_or_whole(tmp_path_factory, edits):
    file = tmp_path_factory.mktemp("bytes") / "d.npz"
    save_dataset(Dataset(np.ones((2, 2, 5)), ("a", "b")), file)
    content = bytearray(file.read_bytes())
    for at, value in edits:
        content[at % len(content)] = value
    file.write_bytes(content)
    try:
        data = read_data(file)
    except DataError:
        return
    assert data.trajectories.shape[0] == len(data.labels) == len(data.groups)


@settings(max_examples=80)
@given(
    edits=st.lists(
        st.tuples(st.integers(0, 900), st.sampled_from(["", ",", "\n", '"', "-", "nan", "1e400", "é"])),
        max_size=5,
    ),
    repairs=st.sampled_from([(), ("all",), ("rows", "cut"), ("gaps", "order", "nonfinite")]),
)
@example(edits=[(23, ""), (10, "1e400")], repairs=())  # an infinite number in a row of another format
def test_any_tracking_data_give_tracks_or_a_typed_error(tmp_path_factory, edits, repairs):
    text = atc_rows(7) + atc_rows(9, speed=0.5)
    for at, letters in edits:
        text = text[:at] + letters + text[at + 1 :]
    file = written(tmp_path_factory.mktemp("fuzz"), text)
    try:
        recording = read_recording(file, repair=repairs)
    except LcorppError:
        return
    assert all(
        np.isfinite(track.positions).all() and np.diff(track.times).min() > 0 for track in recording.tracks
    )
