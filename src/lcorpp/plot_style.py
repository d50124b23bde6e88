"""Style of all figures: matplotlib settings, a colour-blind safe palette, atomic saving."""

from __future__ import annotations

import functools
import io
import textwrap
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lcorpp.errors import FileError, expected_one_of
from lcorpp.files import FIGURE_SUFFIXES, write_atomically

INK, MUTED, PALE = "#1f2933", "#7b8794", "#e4e7eb"
BLUE, ORANGE = "#2f6db5", "#d9822b"

COLOURS = ("#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#f0e442", "#0072b2", "#d55e00")
"""Palette for all kinds of colour vision; Okabe and Ito, "Color universal design", 2008."""

HATCHES = ("", "//", "..", "\\\\", "xx", "++", "oo", "**")
"""Hatches that distinguish fills of the same colour."""

RC_PARAMS = {
    "font.size": 10,
    "text.parse_math": False,  # a dollar in a name is a dollar
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "hatch.color": INK,
    "hatch.linewidth": 0.4,
    "svg.hashsalt": "lcorpp",  # equal figures give equal files
    "svg.fonttype": "path",
}

DPI = 150
"""Resolution of .png files, in which texts are measured for the layout of all formats."""

P = ParamSpec("P")
R = TypeVar("R")


class Fill(NamedTuple):
    """Colour and hatch of one category."""

    colour: str
    hatch: str

    @classmethod
    def of(cls, number: int) -> Fill:
        """Return the fill of category `number`: 7 colours, then the same with hatches; repeats after 56."""
        return cls(COLOURS[number % len(COLOURS)], HATCHES[number // len(COLOURS) % len(HATCHES)])

    @property
    def text_colour(self) -> str:
        """Text colour that is readable on this fill."""
        red, green, blue = (int(self.colour[i : i + 2], 16) for i in (1, 3, 5))
        return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 110 else "white"

    @property
    def text_background(self) -> dict[str, Any] | None:
        """Background of a text on this fill (`bbox` of matplotlib): its colour if it is hatched."""
        return {"facecolor": self.colour, "linewidth": 0, "pad": 1.5} if self.hatch else None


def with_style(draw: Callable[P, R]) -> Callable[P, R]:
    """Decorate a drawing function: apply `RC_PARAMS`, whatever the user's matplotlib settings are."""

    @functools.wraps(draw)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        with mpl.rc_context(RC_PARAMS):
            return draw(*args, **kwargs)

    return wrapped


def despine(axes: Axes) -> None:
    """Remove the top and right spines and draw a pale grid behind the data."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color=PALE, linewidth=0.8)
    axes.set_axisbelow(True)


def wrap_text(words: str, width: int) -> str:
    """Break a text into lines of at most `width` characters; long names break after commas."""
    if len(words) <= width:
        return words
    return "\n".join(textwrap.wrap(words.replace(",", ", "), width, break_long_words=False)).replace(
        ", ", ","
    )


def check_suffix(path: str | Path) -> None:
    """Check the suffix of a figure file before the figure is computed.

    Raises:
        FileError: the suffix is not among `FIGURE_SUFFIXES`.
    """
    if Path(path).suffix.lower() not in FIGURE_SUFFIXES:
        raise FileError(f"{path}: not a figure file; {expected_one_of(FIGURE_SUFFIXES)} as its suffix")


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure completely or not at all, in the format of the suffix.

    Raises:
        FileError: the suffix is not among `FIGURE_SUFFIXES`, or the file cannot be written.
    """
    check_suffix(path)
    write_atomically(path, _render(figure, Path(path).suffix.lower()[1:]))


def _render(figure: Figure, kind: str) -> bytes:
    FigureCanvasAgg(figure)
    image = io.BytesIO()
    dateless = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
    with mpl.rc_context(RC_PARAMS):
        _fix_layout(figure)
        figure.savefig(image, format=kind, dpi=DPI, metadata=dateless[kind])
    return image.getvalue()


def _fix_layout(figure: Figure) -> None:
    """Lay a figure out for good: matplotlib would do it again, and draw twice, for each file."""
    layout = figure.get_layout_engine()
    if layout is not None:
        figure.set_dpi(DPI)
        layout.execute(figure)
        figure.set_layout_engine(None)


def save_figures(figure: Figure, stem: Path, formats: Iterable[str]) -> list[Path]:
    """Write a figure in each format ("png", "svg", "pdf"), as STEM.FORMAT, and return the paths.

    Raises:
        FileError: as of `save_figure`.
    """
    paths = [Path(f"{stem}.{suffix}") for suffix in formats]
    for path in paths:
        save_figure(figure, path)
    return paths
