"""Panels of the figures, and bars in groups with intervals, exact values and published numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from lcorpp.experiments.figures.result import Layout
from lcorpp.plot_style import INK, despine
from lcorpp.values import Interval

PAGE_WIDTH, COLUMN_WIDTH, PANEL_HEIGHT, LEGEND_HEIGHT = 7.2, 3.5, 2.7, 0.4
"""Inches of a page and of a column in print, of a panel and of the legend above the panels."""

LABELS: Mapping[str, str] = {"f1": "F1 score", "cost": "mean action cost", "return": "mean return"}
"""Metric -> label of its axis."""

EXACT: dict[str, Any] = {
    "marker": "D",
    "color": "white",
    "markeredgecolor": INK,
    "markersize": 3,
    "linestyle": "",
}
PUBLISHED: dict[str, Any] = {
    "marker": "o",
    "color": "none",
    "markeredgecolor": "#b3261e",
    "markersize": 5.5,
    "linestyle": "",
}


@dataclass(frozen=True)
class Bars:
    """A series of bars, one in each group.

    label: for the legend. colour: of all bars, or one for each.
    intervals: the height and the error bar of each.
    exact, published: () or a number for each bar, None for those without.
    digits: the format of the height, which is written above the bar; "" writes none.
    """

    label: str
    colour: str | Sequence[str]
    intervals: Sequence[Interval]
    exact: Sequence[float | None] = ()
    published: Sequence[float | None] = ()
    digits: str = ""


def make_panels(layout: Layout, widths: Sequence[float], rows: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure with rows of panels of these relative widths, or with all panels in a column."""
    panels = rows * len(widths)
    if layout == "wide":
        figure = Figure(figsize=(PAGE_WIDTH, PANEL_HEIGHT * rows + LEGEND_HEIGHT), layout="constrained")
        axes = figure.subplots(rows, len(widths), width_ratios=list(widths), squeeze=False)
    else:
        figure = Figure(figsize=(COLUMN_WIDTH, PANEL_HEIGHT * panels + LEGEND_HEIGHT), layout="constrained")
        axes = figure.subplots(panels, 1, squeeze=False)
    return figure, list(axes.flat)


def draw_bars(axes: Axes, groups: Sequence[str], series: Sequence[Bars], label: str) -> None:
    """Draw the bars of each group side by side; a diamond is an exact value, a ring a published number."""
    width = 0.8 / len(series)
    for number, bars in enumerate(series):
        colours = [bars.colour] * len(groups) if isinstance(bars.colour, str) else bars.colour
        for group, (interval, colour) in enumerate(zip(bars.intervals, colours, strict=True)):
            x = group + (number - (len(series) - 1) / 2) * width
            errors = [[interval.estimate - interval.low], [interval.high - interval.estimate]]
            axes.bar(x, interval.estimate, color=colour, width=width, edgecolor="white", linewidth=0.5)
            axes.errorbar(x, interval.estimate, yerr=errors, color=INK, capsize=1.5, linewidth=0.8)
            if bars.digits:
                top = max(interval.high, 0.0)  # above the axis, not on a bar below it
                _write_above(axes, x, top, format(interval.estimate, bars.digits))
            for values, marker in ((bars.exact, EXACT), (bars.published, PUBLISHED)):
                value = values[group] if values else None
                if value is not None:
                    axes.plot(x, value, **marker)
    axes.set_xticks(range(len(groups)), groups, fontsize=7)
    axes.axhline(0, color=INK, linewidth=0.6)
    axes.set_ylabel(label)
    axes.tick_params(axis="y", labelsize=8)
    despine(axes)


def _write_above(axes: Axes, x: float, y: float, text: str) -> None:
    axes.annotate(text, (x, y), xytext=(0, 3), textcoords="offset points", ha="center", fontsize=8.5)


def draw_line(axes: Axes, x: npt.ArrayLike, intervals: Sequence[Interval], **style: Any) -> None:
    """Draw a line through estimates, with their intervals as error bars; `style` as of matplotlib."""
    middle, low, high = zip(*((each.estimate, each.low, each.high) for each in intervals), strict=True)
    errors = np.subtract(middle, low), np.subtract(high, middle)
    look: dict[str, Any] = {"ecolor": INK, "elinewidth": 0.8, "marker": "o", "markersize": 4, "capsize": 2}
    axes.errorbar(x, middle, yerr=errors, **look | style)
    despine(axes)


def add_bar_legend(
    figure: Figure, series: Sequence[Bars], *, layout: Layout, lines: Sequence[Line2D] = ()
) -> None:
    """Draw one legend above all panels: series of one colour, further lines, and markers in use."""
    handles: list[Any] = [
        Patch(color=bars.colour, label=bars.label) for bars in series if isinstance(bars.colour, str)
    ]
    handles += lines
    if any(value is not None for bars in series for value in bars.exact):
        handles.append(Line2D([], [], label="exact value", **EXACT))
    if any(value is not None for bars in series for value in bars.published):
        handles.append(Line2D([], [], label="published", **PUBLISHED))
    add_legend(figure, handles, layout)


def add_legend(figure: Figure, handles: Sequence[Any], layout: Layout) -> None:
    """Draw a legend above all panels, of labelled artists."""
    figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=len(handles) if layout == "wide" else 2,
        fontsize=8,
        frameon=False,
        columnspacing=1.2,
        handletextpad=0.5,
    )
