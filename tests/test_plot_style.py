"""Style of all figures: distinguishable colours, deterministic files, atomic saving."""

from __future__ import annotations

from itertools import combinations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from lcorpp.errors import FileError
from lcorpp.plot_style import COLOURS, Fill, despine, save_figure, with_style, wrap_text

# Linear RGB as seen with colour vision deficiencies (severity 1); Machado et al., IEEE TVCG 2009.
EYES = {
    "usual": np.eye(3),
    "protanopia": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deuteranopia": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritanopia": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}


@with_style
def draw_figure() -> Figure:
    """A line with a legend and hatched bands."""
    figure = Figure(figsize=(3, 2), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1, 2], [3, 1, 2], label="up and down")
    for number in range(9):
        fill = Fill.of(number)
        axes.axvspan(number / 5, (number + 1) / 5, facecolor=fill.colour, hatch=fill.hatch)
    axes.legend()
    despine(axes)
    return figure


@pytest.mark.parametrize("eyes", EYES)
def test_colours_are_distinguishable_for_all_colour_vision(eyes):
    seen = [_lab(np.array(EYES[eyes]) @ _linear(colour)) for colour in COLOURS]
    # a difference of 2.3 is just noticeable
    assert min(np.linalg.norm(a - b) for a, b in combinations(seen, 2)) > 15


def _linear(colour: str) -> np.ndarray:
    parts = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def _lab(linear: np.ndarray) -> np.ndarray:
    """CIELAB of linear sRGB, white D65."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    parts = xyz @ np.clip(linear, 0, 1) / np.array([0.9505, 1, 1.089])
    x, y, z = np.where(parts > 0.008856, np.cbrt(parts), 7.787 * parts + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize(("suffix", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_equal_figures_give_equal_files(tmp_path, suffix, magic):
    contents = []
    for name in ("a", "b"):
        path = tmp_path / f"{name}.{suffix}"
        save_figure(draw_figure(), path)
        contents.append(path.read_bytes())
    assert contents[0].startswith(magic)
    assert contents[0] == contents[1]


def test_figures_that_cannot_be_written(tmp_path):
    with pytest.raises(FileError, match=r"a.gif: not a figure file; expected one of .png, .svg, .pdf"):
        save_figure(draw_figure(), tmp_path / "a.gif")
    with pytest.raises(FileError, match="cannot be written"):
        save_figure(draw_figure(), tmp_path / "no" / "a.png")
    assert not list(tmp_path.iterdir())


def test_matplotlib_settings_are_unchanged(tmp_path):
    before = dict(mpl.rcParams)
    save_figure(draw_figure(), tmp_path / "a.png")
    assert dict(mpl.rcParams) == before


def test_56_fills_are_all_different():
    fills = [Fill.of(number) for number in range(56)]
    assert len(set(fills)) == 56
    assert {fill.text_colour for fill in fills} == {"white", "#1f2933"}


def test_long_names_break_after_commas():
    assert wrap_text("robot=s00,rock0=bad,rock1=good", 22) == "robot=s00,rock0=bad,\nrock1=good"
    assert wrap_text("a name, in one line", 20) == "a name, in one line"
