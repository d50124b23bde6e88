from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import FileError, ParseError
from lcorpp.learning import (
    cross_validate,
    format_leakage_warning,
    measure_leakage,
    paper_pipeline,
    read_authors,
    read_data,
)

LABELS = {"1": "interested", "0": "not_interested"}
REAL = Path(__file__).parents[4] / "shared" / "data" / "authors"
real = pytest.mark.skipif(not REAL.is_dir(), reason="the authors' data is not here (shared/data/authors)")


def line(name: str, first: float, label: str) -> str:
    return ",".join([name, *(str(first + i) for i in range(304)), label])


def folder(path: Path, x: str | None = None, y: str | None = None) -> Path:
    """A well-formed folder of two rows, except for what is given."""
    good = f"{line('7', 1000, '1')}\n{line('8', -500, '0')}\n"
    (path / "interposx.csv").write_text(good if x is None else x)
    (path / "interposy.csv").write_text(good if y is None else y)
    return path


def test_a_small_folder(tmp_path):
    data = read_authors(folder(tmp_path), labels=LABELS)
    assert data.trajectories.shape == (2, 2, 304)
    assert data.labels == ("interested", "not_interested")
    assert data.groups == ("7", "8")
    np.testing.assert_allclose(data.trajectories[0, :, 0], [1, 1])  # millimetres became metres
    np.testing.assert_allclose(data.trajectories[1, :, -1], [-0.197, -0.197])
    assert "leaks its label" in data.notes[0]


def test_line_ends_of_windows_are_read(tmp_path):
    text = f"{line('7', 0, '1')}\r\n{line('8', 0, '0')}\r\n\r\n"
    assert len(read_authors(folder(tmp_path, text, text), labels=LABELS)) == 2


ROW = line("7", 0, "1")
TOP = "7,0,1"
BAD = [
    ("", 1, 1, "the file is empty; expected rows of 306 columns"),
    ("7,1,2,1\n", 1, 1, "4 columns; expected 306"),
    (f"{ROW}\n\n{ROW}", 2, 1, "1 columns; expected 306"),
    (ROW.replace(TOP, "7,zero,1"), 1, 3, "'zero' is not a number"),
    (ROW.replace(TOP, "7,,1"), 1, 3, "'' is not a number"),
    (f"{ROW}\n" + ROW.replace(f"{TOP},", "8,0,nan,"), 2, 5, "'nan' is not finite"),
    (ROW.replace(f"{TOP},", "7,0,inf,"), 1, 5, "'inf' is not finite"),
    (ROW.replace("7,0,", ",0,"), 1, 1, "no id"),
    (ROW[:-1] + "2", 1, len(ROW), "unknown label '2'; expected one of 1, 0"),
]


OTHERS = [
    (f"{line('9', 0, '1')}\n{line('8', 0, '0')}", 1, 1, "'9'; expected '7' as in line 1 of interposx.csv"),
    (f"{line('7', 0, '1')}\n{line('8', 0, '1')}", 2, len(line("8", 0, "1")), "label '1'; expected '0'"),
    (line("7", 0, "1"), 1, 1, "ends after 1 rows; expected 2"),
]
"""Files of y that do not belong to that of x."""


@pytest.mark.parametrize(
    ("name", "text", "row", "column", "words"),
    [*(("x", *bad) for bad in BAD), *(("y", *bad) for bad in [*BAD, *OTHERS])],
)
def test_malformed_files_are_located(tmp_path, name, text, row, column, words):
    with pytest.raises(ParseError) as caught:
        read_authors(folder(tmp_path, **{name: text}), labels=LABELS)
    assert (caught.value.line, caught.value.column) == (row, column)
    assert words in str(caught.value)
    assert caught.value.file.endswith(f"interpos{name}.csv")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileError, match=r"interposx\.csv: cannot be read"):
        read_authors(tmp_path, labels=LABELS)
    folder(tmp_path)
    (tmp_path / "interposy.csv").unlink()
    with pytest.raises(FileError, match=r"interposy\.csv: cannot be read"):
        read_authors(tmp_path, labels=LABELS)


@real
def test_the_authors_data_have_their_known_properties():
    data = read_authors(REAL, labels=LABELS)
    assert data.trajectories.shape == (123, 2, 304)
    assert data.labels == ("interested",) * 63 + ("not_interested",) * 60
    assert len(set(data.groups)) == 109
    ends = data.trajectories[:63, :, -1]
    np.testing.assert_allclose(np.median(ends, axis=0), [-0.04, -1.05], atol=0.25)  # LEARNING.md
    away = np.hypot(*(data.trajectories[:, :, -1] - [-0.04, -1.05]).T)
    assert np.mean((away < 8.37) == (np.array(data.labels) == "interested")) > 0.98


@real
def test_a_warning_reports_the_leak_of_the_authors_data():
    data = read_data(REAL, labels=LABELS)
    start, end, duration, sampling = measure_leakage(data, n_splits=2)
    assert 0.85 < start.auc.estimate < 0.97
    assert end.auc.estimate >= 0.98
    assert duration.auc.estimate == 0.5  # the true ones are lost
    assert 0.82 < sampling.auc.estimate < 0.92
    assert [leak.is_suspicious for leak in (start, end, duration, sampling)] == [True, True, False, True]
    note = format_leakage_warning(data) or ""
    assert "end position alone (AUC 0.99) and sampling alone (AUC 0.86)" in note


@real
@pytest.mark.slow
def test_the_papers_lstm_on_relative_motion_has_its_known_auc():
    """Every tenth sample of motion relative to the first point, five grouped folds, 300 epochs."""
    pytest.importorskip("torch", reason="torch is not installed (lcorpp[torch])")
    data = read_data(REAL, labels=LABELS)
    areas = [
        cross_validate(paper_pipeline(random_state=seed, interval=data.interval), data, seed=seed).auc
        for seed in range(10)
    ]
    assert np.std(areas) < 0.05  # .029 measured: 123 tracks are few
    assert 0.78 < np.mean(areas) < 0.85  # .79 to .84 is what is known; .799 measured, its standard error .009
