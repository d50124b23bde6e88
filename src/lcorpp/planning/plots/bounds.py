"""Figure of a search: both bounds and the number of vectors over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from lcorpp.errors import ModelError
from lcorpp.plot_style import BLUE, INK, MUTED, ORANGE, despine, with_style
from lcorpp.values import Array

LOG_SCALE_RATIO = 10.0
"""The time axis is logarithmic if the last time exceeds the first one by this factor."""


@with_style
def draw_bounds(history: Sequence[tuple[float, float, float, int]], *, title: str = "") -> Figure:
    """Draw the bounds at the start belief over time, with the gap shaded, and the number of vectors below.

    Args:
        history: (seconds, lower, upper, vectors) in temporal order, as `Solution.history`.
        title: of the figure.

    Raises:
        ModelError: `history` is empty.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> from lcorpp.planning import draw_bounds
        >>> figure = draw_bounds(solve(load_domain("intention").pomdp).history)
        >>> [axes.get_ylabel() for axes in figure.axes]
        ['value at the start', 'vectors']
    """
    if not len(history):
        raise ModelError("there is no history to draw")
    seconds, lower, upper, vectors = np.array(history, dtype=np.float64).T
    unit, times = ("seconds", seconds) if seconds[-1] >= 0.1 else ("milliseconds", 1000 * seconds)
    # extend the last values to the right
    times = np.append(times, max(1.04 * times[-1], times[-1] + 1e-3))
    low, high, count = (np.append(series, series[-1]) for series in (lower, upper, vectors))
    figure = Figure(figsize=(7, 4.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3.4, 1])
    above.fill_between(times, low, high, step="post", color=BLUE, alpha=0.13, linewidth=0)
    above.step(times, high, where="post", color=ORANGE, linewidth=1.6, label="upper bound")
    above.step(times, low, where="post", color=BLUE, linewidth=1.6, label="lower bound: the policy")
    above.set_ylabel("value at the start")
    above.legend(frameon=False)
    above.annotate(
        f"gap {upper[-1] - lower[-1]:.3g}",
        (1, (lower[-1] + upper[-1]) / 2),
        xycoords=("axes fraction", "data"),
        xytext=(6, 0),
        textcoords="offset points",
        va="center",
        color=INK,
        annotation_clip=False,
    )
    below.step(times, count, where="post", color=MUTED, linewidth=1.2)
    below.set(xlabel=unit, ylabel="vectors")
    below.set_ylim(bottom=0)
    below.yaxis.set_major_locator(MaxNLocator(3, integer=True))
    _scale(below, times)
    for axes in (above, below):
        despine(axes)
    figure.align_ylabels()
    if title:
        figure.suptitle(title, fontsize=11)
    return figure


def _scale(axes: Axes, times: Array) -> None:
    """Scale the time axis, logarithmically for a long search."""
    first = float(times[times > 0][0])
    if times[-1] <= LOG_SCALE_RATIO * first:
        axes.set_xlim(times[0], times[-1])
        return
    axes.set_xscale("log")
    axes.set_xlim(first, times[-1])
    wide = times[-1] > 100 * first
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda time, _: f"{time:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
