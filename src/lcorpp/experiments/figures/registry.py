"""The table of the paper's figures; their code is imported when they are made."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING

from lcorpp.errors import DecisionError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.assembly.progress import ProgressDisplay
    from lcorpp.experiments.figures.result import FigureOptions, FigureResult


@dataclass(frozen=True)
class PaperFigure:
    """A row of the table.

    make: computes the figure; `progress` displays its steps. It raises KeyboardInterrupt at an interrupt.
    seconds, fast_seconds: measured on two cores of 2.5 GHz, by default and with --fast; only their ratios
        matter: the run measures how fast its machine is.
    """

    make: Callable[[FigureOptions, ProgressDisplay], FigureResult]
    seconds: float
    fast_seconds: float


def _make(module: str, options: FigureOptions, progress: ProgressDisplay) -> FigureResult:
    """Call `make_figure` of a module of this folder."""
    result: FigureResult = import_module(f"lcorpp.experiments.figures.{module}").make_figure(
        options, progress
    )
    return result


FIGURES: Mapping[str, PaperFigure] = {
    name: PaperFigure(partial(_make, name), *seconds)
    for name, seconds in {
        "strategies": (2, 1),
        "knowledge": (4, 1),
        "trust": (28, 8),
        "partial": (38, 6),
        "augmentation": (40, 10),
        "confusion": (6, 1),
        "trial": (1, 1),
    }.items()
}
"""Name, also of the module, -> figure, in the order of the report."""


def find_figures(names: Sequence[str]) -> list[str]:
    """Return the names in the order of the table; all without a name.

    Raises:
        DecisionError: an unknown name.
    """
    for name in names:
        if name not in FIGURES:
            raise DecisionError(f"unknown figure {name!r}; {expected_one_of(FIGURES)}")
    return [name for name in FIGURES if not names or name in names]
