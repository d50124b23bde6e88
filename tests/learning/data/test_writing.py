"""Written recordings are read again: to four decimals from CSV, exactly from Parquet."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import DataError, FileError
from lcorpp.learning import Recording, Track, read_recording, write_recording

from .texts import crowd, walk

words = st.text(
    st.characters(
        codec="utf-8", exclude_characters="\r\n\0\x85\u2028\u2029", exclude_categories=("Cc", "Cs")
    ),
    min_size=1,
    max_size=50,
).filter(lambda word: word == word.strip())
numbers = st.floats(-1e3, 1e3)


@st.composite
def recordings(draw):
    names = draw(st.lists(words, min_size=1, max_size=4, unique=True))
    facing, grouped, labelled = draw(st.booleans()), draw(st.booleans()), draw(st.booleans())
    tracks = []
    for name in names:
        samples = draw(st.integers(2, 6))
        columns = {"x": np.arange(samples) + draw(numbers), "y": np.full(samples, draw(numbers))}
        if facing:
            columns["facing"] = np.full(samples, draw(st.floats(-3, 3)))
        times = draw(st.sampled_from([0.0, 1.35e9])) + np.arange(samples) * 0.4
        label = draw(words) if labelled else None
        tracks.append(Track(name, times, columns, label, draw(words) if grouped else ""))
    return Recording(tuple(tracks))


@settings(max_examples=40)
@given(recording=recordings())
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_written_and_read_is_the_same(tmp_path_factory, suffix, recording):
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    file = tmp_path_factory.mktemp("written") / f"tracks{suffix}"
    write_recording(recording, file)
    back = read_recording(file)
    for one, other in zip(recording.tracks, back.tracks, strict=True):
        assert (one.id, one.label, one.group) == (other.id, other.label, other.group)
        off = 5.1e-5 if suffix == ".csv" else 0  # half of the last decimal
        np.testing.assert_allclose(other.times, one.times, rtol=0, atol=off)
        for name in one.columns:
            np.testing.assert_allclose(other.columns[name], one.columns[name], rtol=0, atol=off)


def test_samples_closer_than_the_decimals_are_not_written_to_csv(tmp_path):
    track = Track("a", np.array([0, 1e-5, 1]), {"x": np.arange(3.0), "y": np.zeros(3)})
    with pytest.raises(DataError, match=r"track 'a' has samples within 0\.0001 s, which CSV"):
        write_recording(Recording((track,)), tmp_path / "a.csv")
    assert list(tmp_path.iterdir()) == []


def test_columns_and_labels_that_some_tracks_lack_are_not_written(tmp_path):
    recording = Recording((walk("a", facing=np.zeros(361)), walk("b", None)))
    write_recording(recording, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().startswith("track,time,x,y\na,5.0000,0.0000,2.0000\n")


def test_what_cannot_be_written(tmp_path):
    with pytest.raises(FileError, match=r"a\.txt: not the name of a recording; expected one of \.csv"):
        write_recording(crowd(4), tmp_path / "a.txt")
    with pytest.raises(DataError, match="there are no tracks to write"):
        write_recording(Recording(()), tmp_path / "a.csv")
    with pytest.raises(FileError, match="cannot be written"):
        write_recording(crowd(4), tmp_path / "no" / "a.csv")


@pytest.fixture
def arrow():
    return pytest.importorskip("pyarrow", reason="pyarrow is not installed (lcorpp[parquet])")


def table(arrow, folder, **changed):
    columns = {"track": ["a"] * 3, "time": [0.0, 0.1, 0.2], "x": [0.0, 0.1, 0.2], "y": [0, 0, 0]} | changed
    file = folder / "a.parquet"
    arrow.parquet.write_table(arrow.table({k: v for k, v in columns.items() if v is not None}), file)
    return file


def test_parquet_of_other_types(arrow, tmp_path):
    import pyarrow.parquet

    file = table(pyarrow, tmp_path, track=[7, 7, 7], label=pyarrow.array(["in"] * 3).dictionary_encode())
    (track,) = read_recording(file).tracks
    assert (track.id, track.label) == ("7", "in")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"y": None}, r"a\.parquet: no column 'y'"),
        ({"x": ["0", "1", "2"]}, "column 'x': the column is of type string; expected numbers"),
        ({"x": [0.0, None, 1.0]}, "row 2, column 'x': track 'a': the x is missing or NaN"),
        ({"track": ["a", None, "a"]}, "row 2, column 'track': no track"),
        ({"track": [1.5, 1.5, 1.5]}, "column 'track': the column is of type double"),
        ({"time": [0.0, 0.2, 0.1]}, "row 3, column 'time': track 'a': time 0.1 s after 0.2 s"),
        ({"X": [0, 1, 2]}, "a column appears twice"),
    ],
)
def test_parquet_that_is_wrong(arrow, tmp_path, changed, words):
    import pyarrow.parquet

    with pytest.raises(DataError, match=words):
        read_recording(table(pyarrow, tmp_path, **changed))


def test_parquet_that_is_damaged(arrow, tmp_path):
    write_recording(crowd(4), tmp_path / "a.parquet")
    content = (tmp_path / "a.parquet").read_bytes()
    for damaged in (b"", content[:100], content[:-20]):
        (tmp_path / "a.parquet").write_bytes(damaged)
        with pytest.raises(DataError, match="not a Parquet file, or a damaged one"):
            read_recording(tmp_path / "a.parquet")
    with pytest.raises(FileError, match="cannot be read: No such file"):
        read_recording(tmp_path / "no.parquet")
