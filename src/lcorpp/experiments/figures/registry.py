"""The table of the paper's figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from lcorpp.errors import DecisionError, expected_one_of
from lcorpp.experiments.figures.augmentation import augment_from_no_data
from lcorpp.experiments.figures.confusion import cross_validate
from lcorpp.experiments.figures.knowledge import vary_knowledge
from lcorpp.experiments.figures.partial import compare_parts
from lcorpp.experiments.figures.result import FigureOptions, FigureResult
from lcorpp.experiments.figures.strategies import compare_six
from lcorpp.experiments.figures.trial import replay_trial
from lcorpp.experiments.setup import ProgressDisplay


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


FIGURES: Mapping[str, PaperFigure] = {
    "strategies": PaperFigure(compare_six, 3, 2),
    "knowledge": PaperFigure(vary_knowledge, 6, 4),
    "partial": PaperFigure(compare_parts, 38, 8),
    "augmentation": PaperFigure(augment_from_no_data, 65, 24),
    "confusion": PaperFigure(cross_validate, 6, 2),
    "trial": PaperFigure(replay_trial, 1, 1),
}
"""Name -> figure, in the order of the report."""


def find_figures(names: Sequence[str]) -> list[str]:
    """Return the names in the order of the table; all without a name.

    Raises:
        DecisionError: an unknown name.
    """
    for name in names:
        if name not in FIGURES:
            raise DecisionError(f"unknown figure {name!r}; {expected_one_of(FIGURES)}")
    return [name for name in FIGURES if not names or name in names]
