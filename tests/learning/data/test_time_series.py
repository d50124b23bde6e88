"""Labelled time series in .ts files."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import DataError, ParseError
from lcorpp.learning import read_data, read_recording

HEADER = """#Toy
@problemName Toy
@timeStamps false
@missing true
@univariate false
@dimensions 2
@equalLength false
@classLabel true up down
@data
"""


def read(folder, text, name="a.ts", **options):
    (folder / name).write_text(text)
    return read_data(folder / name, **options)


def test_series_of_unequal_length_with_missing_values(tmp_path):
    data = read(tmp_path, HEADER + "1,2,3,?,5:2,3,4,5,6:up\n\n-1,2.5e0,?:?,3,?:down\n", "a.txt", fps=4)
    assert (data.labels, data.channels, data.source) == (("up", "down"), ("dim_0", "dim_1"), "Toy")
    assert (data.interval, data.lengths.tolist(), data.kind) == (0.25, [5, 2], "series")
    np.testing.assert_array_equal(data.trajectories[0], [[1, 2, 3, 4, 5], [2, 3, 4, 5, 6]])
    np.testing.assert_array_equal(data.trajectories[1, :, :2], [[-1, 2.5], [3, 3]])
    assert data.notes[0] == "2 missing values inside of series are interpolated linearly"
    assert (
        read(tmp_path, HEADER + "1,2:1,2:0\n".replace("0", "up")).notes[0].startswith("no interval between")
    )


def test_univariate_series_of_equal_length_without_listed_classes(tmp_path):
    header = (
        "@problemname Beat\n@univariate true\n@equallength true\n@serieslength 3\n@classlabel true\n@data\n"
    )
    data = read(tmp_path, header + "1,2,3:1\n4,5,6:2\n")
    assert (data.trajectories.shape, data.labels) == ((2, 1, 3), ("1", "2"))
    with pytest.raises(ParseError, match=r"a\.ts:7:1: 2 time points; expected 3 \(@equalLength true\)"):
        read(tmp_path, header + "1,2:1\n")
    (tmp_path / "b.ts").write_text(header + "1,2,3:1\n")
    with pytest.raises(DataError, match="has no tracks of motion, but dim_0"):
        read_recording(tmp_path / "b.ts")


def test_series_that_are_not_of_the_stated_equal_length(tmp_path):
    header = "@problemName\tBeat\n@univariate\ttrue\n@equalLength true\n@classLabel true\ta b\n@data\n"
    assert read(tmp_path, header + "1,2,3:a\n4,5,6:b\n").labels == ("a", "b")
    with pytest.raises(ParseError, match=r"a\.ts:7:1: 2 time points; expected 3"):
        read(tmp_path, header + "1,2,3:a\n4,5:b\n")
    data = read(tmp_path, header + "1,2,?:a\n4,5,6:b\n")
    assert data.lengths.tolist() == [2, 3]
    assert data.notes[0] == "1 missing values at the end of series end them"


def test_an_arff_file_is_named(tmp_path):
    with pytest.raises(ParseError, match=r"an ARFF file; expected the \.ts file"):
        read(tmp_path, "@relation toy\n@attribute a numeric\n@data\n1,2\n")


CLASSES = "@classLabel true up down"


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        (CLASSES, "@targetLabel true", 8, "a regression set (@targetLabel true); expected classes"),
        (CLASSES, "@classLabel false", 8, "no classes (@classLabel false), as in a regression set"),
        (
            "Stamps false",
            "Stamps true",
            3,
            "series with time stamps (@timeStamps true); expected a fixed interval",
        ),
        (
            "@problemName",
            "@problem",
            2,
            "unknown line before @data; expected a line that begins with @ and one of",
        ),
        ("sions 2", "sions two", 6, "'two' is not a whole number"),
        ("@data", "", 10, "unknown line before @data"),
        ("1,2:3,4:up", "1,2:up", 10, "1 channels and a class; expected 2 channels and the class"),
        ("1,2:3,4:up", "1,2:3,4:left", 10, "class 'left'; expected one of up, down"),
        (
            "1,2:3,4:up",
            "1,b:3,4:up",
            10,
            "'b' in channel dim_0 is not a finite number; expected numbers, or ?",
        ),
        ("1,2:3,4:up", "1,inf:3,4:up", 10, "'inf' in channel dim_0 is not a finite number"),
        ("1,2:3,4:up", "1,2:3,4,5:up", 10, "dim_1 has 3 time points and dim_0 has 2; expected as many"),
        ("1,2:3,4:up", "1,2:?,?:up", 10, "channel dim_1 has no value"),
        ("1,2:3,4:up", "1:3:up", 10, "1 time points; expected at least 2"),
        ("1,2:3,4:up", "", 10, "no cases after @data"),
    ],
)
def test_faults_are_located(tmp_path, old, new, line, words):
    with pytest.raises(ParseError) as caught:
        read(tmp_path, (HEADER + "1,2:3,4:up\n").replace(old, new))
    assert caught.value.line == line
    assert words in str(caught.value)


def test_series_have_no_unit_of_length(tmp_path):
    with pytest.raises(DataError, match="time series have no unit of length; expected no --unit"):
        read(tmp_path, HEADER + "1,2:3,4:up\n", unit="mm")
