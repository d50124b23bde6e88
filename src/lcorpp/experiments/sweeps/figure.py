"""The figure of a sweep: heat maps over two axes, or curves over one, with the region of each hypothesis."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise, product
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from lcorpp.experiments.figures.result import Verdict
from lcorpp.experiments.sweeps.evaluation import Rows
from lcorpp.experiments.sweeps.hypotheses import METRICS, Hypothesis, list_hypotheses
from lcorpp.plot_style import COLOURS, INK, PALE, despine, with_style
from lcorpp.values import Array

MAX_TICKS = 6
"""Maximum number of labels of an axis."""

LIMIT_PREFIX = "limit."
"""Of the axes that are bounds of limits."""

LINE_STYLES = ("-", "--", ":")
"""Of curves of the same colour."""

PANEL = 3.0
"""Width of a panel in inches."""


@with_style
def plot_sweep(rows: Rows, axes: Sequence[str], n_axes: int) -> Figure:
    """Draw return and cost, one row of panels each.

    Over two axes: the mean of the fullest strategy, then the advantage of each strategy over the next, and
    an outline around the configurations in which the hypothesis holds. Over one axis: a curve for each
    strategy, and a shade where the hypothesis holds. Over the values of other axes the scores are means, and
    a hypothesis holds if it does for all of them.

    Args:
        rows: as in `SweepResult`. axes: one or two columns. n_axes: the number of all axes of the sweep.
    """
    hypotheses = list_hypotheses(list(dict.fromkeys(row["strategy"] for row in rows)))
    if len(axes) == 1 and axes[0].startswith(LIMIT_PREFIX):
        return _plot_frontier(rows, axes[0])
    draw = _plot_curves if len(axes) == 1 else _plot_maps
    figure = draw(rows, axes, hypotheses)
    others = " for all values of the other axes" if n_axes > len(axes) else ""
    where = "outlined, not hatched" if len(axes) == 2 else "shaded"
    notes = ["means over the other axes"] if others else []
    notes += [f"{where}: the hypothesis holds{others}"] if hypotheses else []
    figure.supxlabel("; ".join(notes), fontsize=8)
    return figure


def _plot_frontier(rows: Rows, axis: str) -> Figure:
    """Draw what a robot earns within a limit over its bound, and how much of the bound it uses.

    Left the planned return with its upper bound, in the middle the measured return, right the measured share.
    """
    values, positions = _list_values(rows, axis)
    by_strategy = _group(rows, (axis, "strategy"))
    strategies = list(dict.fromkeys(row["strategy"] for row in rows))
    figure = Figure(figsize=(3 * PANEL + 1.6, PANEL + 0.4), layout="constrained")
    planned, measured, shares = figure.subplots(1, 3)
    share = f"limit_{axis.removeprefix(LIMIT_PREFIX)}"
    for number, strategy in enumerate(strategies):
        colour = COLOURS[number % len(COLOURS)]

        def collect(column: str, of: str = strategy) -> list[float]:
            return [_average(by_strategy[value, of], column) for value in values]

        for panel, name in ((measured, "return"), (shares, share)):
            panel.plot(positions, collect(name), color=colour, marker="o", markersize=3, label=strategy)
            low, high = collect(f"{name}_low"), collect(f"{name}_high")
            panel.fill_between(positions, low, high, color=colour, alpha=0.25, linewidth=0)
        if all(row.get("planned_return") is not None for row in rows if row["strategy"] == strategy):
            value, upper = collect("planned_return"), collect("planned_return_upper")
            planned.plot(positions, value, color=colour, marker="o", markersize=3, label=strategy)
            planned.plot(positions, upper, "--", color=INK, linewidth=0.8, label="upper bound")
    shares.plot(positions, positions, "--", color=INK, linewidth=0.8, label="the bound")
    planned.set(ylabel="planned return, discounted")
    measured.set(ylabel="mean return, measured")
    shares.set(ylabel="share, measured")
    for panel in (planned, measured, shares):
        panel.set(xlabel=axis)
        _label(panel.set_xticks, values, positions)
        despine(panel)
    handles = {
        label: handle
        for panel in (planned, shares)
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=4, frameon=False, fontsize=8
    )
    return figure


def _plot_curves(rows: Rows, axes: Sequence[str], hypotheses: Sequence[Hypothesis]) -> Figure:
    """Draw the scores of all strategies over one axis."""
    (axis,) = axes
    values, positions = _list_values(rows, axis)
    by_value, by_strategy = _group(rows, axes), _group(rows, (axis, "strategy"))
    strategies = list(dict.fromkeys(row["strategy"] for row in rows))
    figure = Figure(figsize=(2 * PANEL + 2.4, PANEL + 0.4), layout="constrained")
    for panel, metric in zip(figure.subplots(1, 2), METRICS, strict=True):
        for number, strategy in enumerate(strategies):
            colour = COLOURS[number % len(COLOURS)]
            style = LINE_STYLES[number // len(COLOURS) % len(LINE_STYLES)]
            ends = [
                [_average(by_strategy[value, strategy], f"{metric}{end}") for value in values]
                for end in ("", "_low", "_high")
            ]
            panel.plot(positions, ends[0], style, color=colour, marker="o", markersize=3, label=strategy)
            panel.fill_between(positions, ends[1], ends[2], color=colour, alpha=0.25, linewidth=0)
        for hypothesis in hypotheses:
            if hypothesis.metric == metric:
                panel.set_title(str(hypothesis), fontsize=9)
                _shade(panel, positions, [_holds(by_value[value,], hypothesis) for value in values])
        panel.set(xlabel=axis, ylabel=f"mean {metric}")
        _label(panel.set_xticks, values, positions)
        despine(panel)
    figure.legend(*panel.get_legend_handles_labels(), loc="outside right upper", frameon=False, fontsize=8)
    return figure


def _shade(panel: Axes, positions: Array, holds: Sequence[bool]) -> None:
    """Shade the intervals around the positions at which a hypothesis holds."""
    edges = np.concatenate([positions[:1], (positions[1:] + positions[:-1]) / 2, positions[-1:]])
    for number, held in enumerate(holds):
        if held:
            panel.axvspan(edges[number], edges[number + 1], color=PALE, linewidth=0, zorder=0)


def _plot_maps(rows: Rows, axes: Sequence[str], hypotheses: Sequence[Hypothesis]) -> Figure:
    """Draw heat maps over two axes."""
    (columns, x), (lines, y) = (_list_values(rows, axis, evenly=True) for axis in axes)
    cells = [[*product(columns, [line])] for line in lines]
    by_cell, by_strategy = _group(rows, axes), _group(rows, (*axes, "strategy"))
    strategies = list(dict.fromkeys(row["strategy"] for row in rows))
    order = hypotheses[0].strategies if hypotheses else tuple(reversed(strategies))
    figure = Figure(figsize=(PANEL * len(order) + 0.6, 2 * PANEL), layout="constrained")
    for panels, metric in zip(figure.subplots(2, len(order), squeeze=False), METRICS, strict=True):
        # (len(lines), len(columns)) means; NaN for a combination that the sweep does not have
        means = [
            np.array([[_average(by_strategy[*cell, name], metric) for cell in line] for line in cells])
            for name in order
        ]
        _draw_map(figure, panels[0], means[0], f"{metric} of {order[0]}", "viridis")
        colours = "RdBu" if metric == "return" else "RdBu_r"  # blue is better
        for panel, names, (better, worse) in zip(panels[1:], pairwise(order), pairwise(means), strict=True):
            difference = better - worse
            limit = float(np.nanmax(np.abs(difference))) or 1.0
            title = f"{metric}: {names[0]} \N{MINUS SIGN} {names[1]}"
            _draw_map(figure, panel, difference, title, colours, (-limit, limit))
        for hypothesis in hypotheses:
            if hypothesis.metric == metric:
                panels[0].set_title(f"{metric} of {order[0]}\n{hypothesis}", fontsize=9)
                region = np.array([[_holds(by_cell[cell], hypothesis) for cell in line] for line in cells])
                for panel in panels:
                    _outline(panel, region)
        for panel in panels:
            panel.set(xlabel=axes[0], ylabel=axes[1])
            _label(panel.set_xticks, columns, x)
            _label(panel.set_yticks, lines, y)
    return figure


def _draw_map(
    figure: Figure,
    panel: Axes,
    grid: Array,
    title: str,
    colours: str,
    limits: tuple[float | None, float | None] = (None, None),
) -> None:
    image = panel.imshow(
        np.ma.masked_invalid(grid),
        origin="lower",
        aspect="auto",
        cmap=colours,
        vmin=limits[0],
        vmax=limits[1],
    )
    figure.colorbar(image, ax=panel, shrink=0.9)
    panel.set_title(title, fontsize=9)


def _outline(panel: Axes, region: npt.NDArray[np.bool_]) -> None:
    """Draw the border of a region, and hatch the cells outside."""
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    outside = np.argwhere(~region)[:, None, ::-1] + corners  # (n, 4, 2) x and y
    panel.add_collection(PolyCollection(outside, facecolors="none", hatch="///", linewidths=0, alpha=0.5))
    padded = np.pad(region, 1)
    below = np.argwhere(padded[1:, 1:-1] != padded[:-1, 1:-1])[:, None, ::-1] + corners[:2]
    left = np.argwhere(padded[1:-1, 1:] != padded[1:-1, :-1])[:, None, ::-1] + corners[[0, 3]]
    border = np.concatenate([below, left])
    panel.add_collection(LineCollection(list(border), colors=INK, linewidths=2, clip_on=False))


def _list_values(rows: Rows, axis: str, *, evenly: bool = False) -> tuple[list[Any], Array]:
    """Return the values of an axis, numbers in ascending order, and their positions in a plot."""
    values = list(dict.fromkeys(row[axis] for row in rows))
    numbers = not any(isinstance(value, str) for value in values)
    values = sorted(values) if numbers else values
    return values, np.array(values if numbers and not evenly else range(len(values)), dtype=float)


def _label(set_ticks: Callable[..., Any], values: Sequence[Any], positions: Array) -> None:
    """Label at most `MAX_TICKS` of the values."""
    step = -(-len(values) // MAX_TICKS)
    texts = [f"{value:.3g}" if isinstance(value, int | float) else value for value in values]
    set_ticks(positions[::step], texts[::step], fontsize=8)


def _group(rows: Rows, columns: Sequence[str]) -> defaultdict[tuple[Any, ...], Rows]:
    """Return the rows by their cells in some columns."""
    groups = defaultdict[tuple[Any, ...], Rows](list)
    for row in rows:
        groups[tuple([row[column] for column in columns])].append(row)
    return groups


def _average(rows: Rows, column: str) -> float:
    """Return the mean of a column; NaN without rows."""
    return sum(row[column] for row in rows) / len(rows) if rows else float("nan")


def _holds(rows: Rows, hypothesis: Hypothesis) -> bool:
    """Whether a hypothesis holds in all of some rows, at least one."""
    return bool(rows) and all(row[hypothesis.column] == Verdict.HOLDS for row in rows)
