"""Figure "comparison with five baselines": F1 score, return and cost of each strategy."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.experiments.metrics import Estimate, Scores
from lcorpp.plot_style import BLUE, INK, ORANGE, drawn, tidy


@drawn
def plot_strategies(scores: Sequence[Scores], title: str) -> Figure:
    """Draw one panel for each metric, with 95 % confidence intervals as error bars.

    The cost panel leaves out strategies that do not plan, as the paper does.
    """
    planning = [result for result in scores if result.cost.value > 0]
    widths = [len(scores), len(scores)] + ([max(len(planning), 2)] if planning else [])
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    axes = figure.subplots(1, len(widths), width_ratios=widths)
    names = [result.strategy for result in scores]
    _draw_bars(axes[0], names, [result.f1 for result in scores], "F1 score", "{:.3f}")
    axes[0].set_ylim(0, 1)
    _draw_bars(axes[1], names, [result.return_ for result in scores], "mean return", "{:.1f}")
    if planning:
        _draw_bars(
            axes[2], [r.strategy for r in planning], [r.cost for r in planning], "mean action cost", "{:.1f}"
        )
    figure.suptitle(title, fontsize=11)
    return figure


def _draw_bars(
    axes: Axes, names: Sequence[str], estimates: Sequence[Estimate], label: str, number_format: str
) -> None:
    for position, (name, estimate) in enumerate(zip(names, estimates, strict=True)):
        colour = ORANGE if name == "LCORPP" else BLUE
        axes.bar(position, estimate.value, color=colour, width=0.66)
        errors = [[estimate.value - estimate.low], [estimate.high - estimate.value]]
        axes.errorbar(position, estimate.value, yerr=errors, color=INK, capsize=3, linewidth=1)
        axes.annotate(
            number_format.format(estimate.value),
            (position, estimate.high),
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
            fontsize=8.5,
        )
    axes.set_xticks(range(len(names)), names)
    axes.set(xlabel="strategy", ylabel=label)
    axes.margins(y=0.12)
    tidy(axes)
