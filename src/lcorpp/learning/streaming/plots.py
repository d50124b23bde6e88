"""A classifier's answers over time, by class, and how well the classes are told apart by then."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.learning.streaming.prefix_predictions import OverTime
from lcorpp.plot_style import BLUE, COLOURS, INK, MUTED, ORANGE, despine, save_figure, with_style
from lcorpp.values import Array

SHOWN = 6
"""People of each class whose answers are drawn one by one."""


@with_style
def over_time_figure(said: OverTime, *, of: str | None = None, shown: int = SHOWN) -> Figure:
    """The probability of a class while people are seen, and below it the AUC by then where there are two.

    A band holds the middle half of a class, a thick line is its median, and thin lines are some people: every
    so many of them when sorted by the last answer, so that they stand for all.

    Args:
        of: the class; the first if none is given.
        shown: people of each class drawn one by one.

    Raises:
        DataError: there is no such class.
    """
    name = said.classes[0] if of is None else of
    probabilities, seconds = said.of(name), said.seconds
    two = len(said.classes) == 2
    figure = Figure(figsize=(7, 6 if two else 4), layout="constrained")
    axes = figure.subplots(2 if two else 1, sharex=True, squeeze=False, height_ratios=(2, 1) if two else None)
    labels = np.array(said.labels)
    first = [name, *(other for other in said.classes if other != name)]
    for number, each in enumerate(first):
        colour = (BLUE, ORANGE)[number] if number < 2 else COLOURS[number]
        _class(axes[0, 0], seconds, probabilities[labels == each], each, colour, shown)
    axes[0, 0].set(ylim=(0, 1), ylabel=f"probability of {_words(name)}")
    axes[0, 0].legend(frameon=False, loc="upper left")
    despine(axes[0, 0])
    if two:
        _auc(axes[1, 0], seconds, said)
    axes[-1, 0].set(xlabel="seconds since the person was first seen", xlim=(0, seconds[-1]))
    return figure


def save_over_time(said: OverTime, path: str | Path, *, of: str | None = None, shown: int = SHOWN) -> None:
    """Draw `over_time_figure` into a file.

    Raises:
        FileError: the file cannot be written, or its name is not that of a picture.
        DataError: there is no such class.
    """
    save_figure(over_time_figure(said, of=of, shown=shown), path)


def _class(axes: Axes, seconds: Array, said: Array, name: str, colour: str, shown: int) -> None:
    known = np.isfinite(said).all(axis=0)
    if not len(said) or not known.any():
        return
    low, median, high = np.quantile(said[:, known], (0.25, 0.5, 0.75), axis=0)
    axes.fill_between(seconds[known], low, high, color=colour, alpha=0.18, linewidth=0, step="post")
    label = f"{_words(name)} ({len(said)})"
    axes.plot(seconds[known], median, color=colour, linewidth=2.4, label=label, drawstyle="steps-post")
    order = np.argsort(said[:, -1])
    for row in order[np.linspace(0, len(order) - 1, min(shown, len(order)) + 2).astype(int)[1:-1]]:
        axes.plot(seconds, said[row], color=colour, linewidth=0.8, alpha=0.7, drawstyle="steps-post")


def _auc(axes: Axes, seconds: Array, said: OverTime) -> None:
    auc = said.auc
    axes.axhline(0.5, color=MUTED, linewidth=0.8, linestyle=":")
    axes.plot(seconds, auc, color=INK, linewidth=1.6, drawstyle="steps-post")
    for share in (0.25, 0.5, 1.0):
        at = round(share * len(seconds)) - 1
        if np.isfinite(auc[at]):
            axes.plot(seconds[at], auc[at], "o", color=INK, markersize=4, clip_on=False)
            axes.annotate(
                f"{auc[at]:.2f}", (seconds[at], auc[at]), (0, 6), textcoords="offset points", ha="center"
            )
    known = auc[np.isfinite(auc)]
    axes.set(ylim=(min(0.45, *known.tolist()), 1), ylabel="AUC by then")
    despine(axes)


def _words(name: str) -> str:
    return name.replace("_", " ")
