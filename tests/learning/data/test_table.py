"""Tables of features: recognised by their columns, read from CSV and Parquet, faults located or repaired."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import DataError, LcorppError, ParseError
from lcorpp.learning import load_dataset, read_data, read_recording, save_dataset
from lcorpp.learning.data.formats.detection import detect_format
from lcorpp.learning.data.reading import read_features
from lcorpp.learning.data.repairs import RepairLog
from lcorpp.values import Dataset

HEADING = "Yaw,pitch,person,label\n"
GOOD = HEADING + "-1,0.5,ann,tea\n2,1e3,bob,coffee\n0,.25,ann,tea\n"


def written(folder, text, name="gaze.csv"):
    (folder / name).write_text(text)
    return folder / name


def test_a_table_is_recognised_and_read(tmp_path):
    file = written(tmp_path, GOOD)
    assert detect_format(file).kind == "table"
    data = read_data(file)
    assert (data.kind, data.unit, data.channels) == ("table", "cases", ("yaw", "pitch"))
    np.testing.assert_array_equal(data.trajectories, [[-1, 0.5], [2, 1e3], [0, 0.25]])
    assert (data.labels, data.groups) == (("tea", "coffee", "tea"), ("ann", "bob", "ann"))
    assert repr(data) == (
        "Dataset(3 cases (tea: 2, coffee: 1), features yaw, pitch, 2 groups, source='gaze.csv')"
    )


def test_labels_become_classes_and_rows_without_a_group_are_their_own(tmp_path):
    file = written(tmp_path, "a,label,group\n1,1,g\n2,0,\n3,1,\n")
    data = read_data(file, labels={"1": "yes", "0": "no"})
    assert data.labels == ("yes", "no", "yes")
    assert data.groups == ("g", "row 3", "row 4")


@settings(max_examples=40, deadline=None)
@given(
    st.integers(1, 30).flatmap(
        lambda width: st.lists(
            st.lists(st.floats(-1e9, 1e9), min_size=width, max_size=width), min_size=1, max_size=8
        )
    )
)
def test_csv_parquet_and_npz_have_the_same_numbers(tmp_path_factory, table):
    arrow = pytest.importorskip("pyarrow")
    import pyarrow.parquet

    folder, names = tmp_path_factory.mktemp("table"), [f"f{i}" for i in range(len(table[0]))]
    labels = [f"c{i % 2}" for i in range(len(table))]
    lines = [",".join([*names, "label"])] + [
        ",".join([*map(repr, row), label]) for row, label in zip(table, labels, strict=True)
    ]
    csv = read_data(written(folder, "\n".join(lines) + "\n"))
    columns = {name: [row[i] for row in table] for i, name in enumerate(names)}
    pyarrow.parquet.write_table(arrow.table({**columns, "label": labels}), folder / "gaze.parquet")
    assert detect_format(folder / "gaze.parquet").kind == "table"
    save_dataset(csv, folder / "gaze.npz")
    for data in (csv, read_data(folder / "gaze.parquet"), load_dataset(folder / "gaze.npz")):
        assert data.trajectories.tolist() == np.array(table).tolist()
        assert (data.labels, data.channels, data.kind) == (tuple(labels), tuple(names), "table")


FAULTS = [
    (HEADING + "-1,tall,ann,tea\n", r":2:4: 'tall' is not a number; expected the pitch; repair 'rows'"),
    (HEADING + "-1,,ann,tea\n", ":2:4: the pitch is missing or NaN; expected a finite number; repair 'nonf"),
    (HEADING + "1,2,ann,tea\nnan,2,ann,tea\n", ":3:1: the yaw is missing or NaN"),
    (HEADING + "1,inf,ann,tea\n", ":2:3: the pitch is infinite"),
    (HEADING + "1,2,ann,\n", ":2:9: no label; expected the name of a class; repair 'labels'"),
    (HEADING + "1,2,ann\n", ":2:1: 3 columns; expected 4, with"),
    (HEADING + "1,2,ann,tea\n1,2,ann,tea,9\n", ":3:1: 5 columns; expected 4, with .*; repair 'rows'"),
    (
        HEADING + "1,2,ann,bob,tea\n",
        ":1:1: 4 columns, yaw, pitch, person, label, but the first row has 5: 'tea' has no name; expected a"
        " name for each column",
    ),
    (HEADING, ":2:.*: no rows; expected a row for each case"),
    (
        "a,b,height\n1,2,3\n",
        ":1:1: no column 'track', and no column 'label'; .* for a table of features, a column 'label'",
    ),
    ("label,group\nx,y\n", ":1:1: no features; expected columns of numbers beside label, group"),
    ("a,,label\n1,2,x\n", ":1:1: column 2 has no name"),
    ("a,A,label\n1,2,x\n", ":1:3: column 'a' for the second time"),
    ("a,group,person,label\n1,2,3,x\n", ":1:.*: columns group and person; expected one of them"),
]


@pytest.mark.parametrize(("text", "words"), FAULTS, ids=range(len(FAULTS)))
def test_faults_are_located(tmp_path, text, words):
    with pytest.raises(ParseError, match=words):
        read_data(written(tmp_path, text))


def test_an_unknown_label_is_located(tmp_path):
    with pytest.raises(ParseError, match=r":3:11: unknown label 'coffee'; expected one of tea, water"):
        read_data(written(tmp_path, GOOD), labels={"tea": "tea", "water": "water"})


def test_faults_are_repaired_on_request(tmp_path):
    file = written(tmp_path, GOOD + "nan,1,cy,tea\n1,tall,cy,tea\n1,1,cy,\n4,4,cy,tea\n")
    log = RepairLog(["nonfinite", "rows", "labels"])
    data = read_features(file, labels=None, repair_log=log)
    assert data.trajectories[:, 0].tolist() == [-1, 2, 0, 4]
    assert [(repair.reason, repair.line) for repair in log.repairs] == [
        *[("rows", 6), ("nonfinite", 5), ("labels", 7)]
    ]
    with pytest.raises(DataError, match="no row remains"):
        read_data(written(tmp_path, HEADING + "nan,1,a,b\n"), repair="all")


def test_rows_without_features_are_people_whom_the_sense_did_not_perceive(tmp_path):
    data = read_data(written(tmp_path, GOOD + ",,cy,tea\n"))
    assert data.trajectories.tolist() == read_data(written(tmp_path, GOOD)).trajectories.tolist()
    (note,) = data.notes
    count = len(data) + 1
    assert note.startswith(f"1 of {count} rows have no features, as of people whom the sense did not")
    assert note.endswith(f"[simulation.present] may state {len(data) / count:.2g}")


def test_a_table_has_no_time(tmp_path):
    file = written(tmp_path, GOOD)
    for changes in ({"seconds": 2}, {"interval": 0.1}, {"robot": (0, 0, 0)}, {"channels": ("yaw",)}):
        with pytest.raises(DataError, match="has no tracks of motion, but yaw, pitch; durations"):
            read_data(file, **changes)
    with pytest.raises(DataError, match=r"gaze\.csv: has no tracks of motion, but yaw, pitch"):
        read_recording(file)


def test_a_wide_heading_and_text_that_is_cut(tmp_path):
    names = [f"embedding_{i:04}" for i in range(2000)]
    file = written(tmp_path, ",".join([*names, "label"]) + "\n" + ",".join(["1"] * 2000) + ",x")
    data = read_data(file)
    assert data.trajectories.shape == (1, 2000)
    assert data.notes[0] == "the last line has no line end: its last number may have been cut"


def test_own_channels_over_time_come_back_and_are_no_motion(tmp_path):
    voice = Dataset(
        np.arange(24.0).reshape(2, 2, 6), ("a", "b"), channels=("pitch", "loudness"), interval=0.1
    )
    save_dataset(voice, tmp_path / "voice.npz")
    again = read_data(tmp_path / "voice.npz")
    assert (again.kind, again.channels, again.interval) == ("series", ("pitch", "loudness"), 0.1)
    assert read_features(tmp_path / "voice.npz", labels=None, repair_log=RepairLog()).kind == "series"
    with pytest.raises(LcorppError, match="no tracks of motion, but pitch, loudness"):
        read_recording(tmp_path / "voice.npz")


def test_an_index_of_a_data_frame_is_no_feature(tmp_path):
    for number, head in enumerate((",speed,label", "Unnamed: 0,speed,label")):
        path = tmp_path / f"{number}.csv"
        path.write_text(f"{head}\n0,1.5,a\n1,0.5,b\n2,1.0,a\n")
        data = read_data(path)
        assert data.channels == ("speed",)
        assert data.notes[0] == "columns that are not used, as they number the rows: unnamed: 0"
