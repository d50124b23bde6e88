"""What all pictures share: their look, colours that colour-blind people tell apart, and saving them whole."""

from __future__ import annotations

import functools
import io
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, ParamSpec, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lcorpp.errors import FileError, expected
from lcorpp.files import write_atomically

INK, MUTED, PALE = "#1f2933", "#7b8794", "#e4e7eb"
BLUE, ORANGE = "#2f6db5", "#d9822b"

COLOURS = ("#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#f0e442", "#0072b2", "#d55e00")
"""Colours that stay apart for all kinds of colour vision; Okabe and Ito, "Color universal design", 2008."""

HATCHES = ("", "//", "..", "\\\\", "xx", "++", "oo", "**")
"""What tells apart those that share a colour."""

LOOK = {
    "font.size": 10,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "hatch.color": INK,
    "hatch.linewidth": 0.4,
    "svg.hashsalt": "lcorpp",  # the same picture is the same file
    "svg.fonttype": "path",
}

SUFFIXES = (".png", ".svg", ".pdf")
"""The kinds of pictures that are written."""

P = ParamSpec("P")
R = TypeVar("R")


class Fill(NamedTuple):
    """How one of many is painted."""

    colour: str
    hatch: str

    @classmethod
    def of(cls, number: int) -> Fill:
        """The colour of a number, and a hatch where it has had its turn already; both begin anew after 56."""
        return cls(COLOURS[number % len(COLOURS)], HATCHES[number // len(COLOURS) % len(HATCHES)])

    @property
    def on_top(self) -> str:
        """The colour of words on it."""
        red, green, blue = (int(self.colour[i : i + 2], 16) for i in (1, 3, 5))
        return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 110 else "white"


def drawn(draw: Callable[P, R]) -> Callable[P, R]:
    """Make a function draw in the house's look, whatever matplotlib is set to elsewhere."""

    @functools.wraps(draw)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        with mpl.rc_context(LOOK):
            return draw(*args, **kwargs)

    return wrapped


def tidy(axes: Axes) -> None:
    """No frame but the axes themselves, and a pale grid behind."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", color=PALE, linewidth=0.8)
    axes.set_axisbelow(True)


def wrapped(words: str, width: int) -> str:
    """Words over as many lines as it takes; a long name is broken after its commas."""
    if len(words) <= width:
        return words
    return "\n".join(textwrap.wrap(words.replace(",", ", "), width, break_long_words=False)).replace(
        ", ", ","
    )


def check_suffix(path: str | Path) -> None:
    """Refuse a picture that cannot be written, before work is put into it.

    Raises:
        FileError: the name of the file does not end as that of a picture.
    """
    if Path(path).suffix.lower() not in SUFFIXES:
        raise FileError(f"{path}: not the name of a picture; {expected(SUFFIXES)} at its end")


def save(figure: Figure, path: str | Path) -> None:
    """Write a picture whole or not at all, in the format of its suffix.

    Raises:
        FileError: the suffix is not among `SUFFIXES`, or the file cannot be written.
    """
    check_suffix(path)
    kind = Path(path).suffix.lower()[1:]
    FigureCanvasAgg(figure)
    image = io.BytesIO()
    dateless = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
    with mpl.rc_context(LOOK):
        figure.savefig(image, format=kind, dpi=150, metadata=dateless[kind])
    write_atomically(path, image.getvalue())
