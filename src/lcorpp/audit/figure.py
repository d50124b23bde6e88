"""The figure of an audit: stated and suggested numbers by rule."""

from __future__ import annotations

from collections.abc import Sequence, Set

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.audit.estimates import Audit, ProbabilityEstimate
from lcorpp.plot_style import BLUE, INK, MUTED, ORANGE, PALE, with_style

ROW_HEIGHT, MIN_FIGURE_HEIGHT = 0.27, 2.5
"""In inches."""


@with_style
def plot_audit(audit: Audit) -> Figure:
    """Draw each number with its interval beside what is stated; those that are refuted are coloured.

    The left panel has the numbers of the knowledge, the right one the rates of labels and answers.
    """
    height = max(MIN_FIGURE_HEIGHT, 1.3 + ROW_HEIGHT * max(len(audit.numbers), len(audit.rates)))
    figure = Figure(figsize=(13, height), layout="constrained")
    left, right = figure.subplots(1, 2)
    _plot(left, audit.numbers, {x.name for x in audit.changes})
    left.set_title("knowledge, each number alone", fontsize=10, loc="left")
    _plot(right, audit.rates, {x.name for x in audit.changed_rates})
    right.set_title("labels and answers", fontsize=10, loc="left")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def _plot(axes: Axes, estimates: Sequence[ProbabilityEstimate], refuted: Set[str]) -> None:
    names = [x.name for x in estimates]
    for colour, is_wrong, label in (
        (BLUE, False, "suggested, 95 % interval"),
        (ORANGE, True, "suggested; what is stated is refuted"),
    ):
        own = [
            (y, x.estimate, *x.interval)
            for y, x in enumerate(estimates)
            if x.interval is not None and (x.name in refuted) == is_wrong
        ]
        y, centre, low, high = np.array(own).reshape(-1, 4).T
        # empty or not, each panel has all entries of the legend
        axes.errorbar(
            centre, y, xerr=[centre - low, high - centre], fmt="o", ms=4, lw=1.6, color=colour, label=label
        )
    stated = [(y, x.stated) for y, x in enumerate(estimates) if x.stated is not None]
    y, values = np.array(stated).reshape(-1, 2).T
    axes.plot(values, y, "|", ms=12, mew=1.8, color=INK, label="stated")
    for place, x in enumerate(estimates):
        if x.interval is None:
            axes.text(0.5, place, "not determined", fontsize=8, color=MUTED, ha="center", va="center")
    places = range(len(estimates))
    axes.set_yticks(places, names, fontsize=8)
    axes.set_ylim(len(estimates) - 0.4, -0.6)
    axes.set_xlim(-0.02, 1.02)
    axes.set_xlabel("probability")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="both", color=PALE, linewidth=0.8)
    axes.set_axisbelow(True)
