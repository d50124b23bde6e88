"""The paper's figure "comparison with five baselines": the scores of the strategies as bars."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.experiments.scoring.metrics import Scores
from lcorpp.plot_style import BLUE, INK, ORANGE, despine, with_style
from lcorpp.values import Interval


@with_style
def plot_strategies(scores: Sequence[Scores], title: str) -> Figure:
    """Draw F1 score, return and cost of each strategy, with 95 % confidence intervals as error bars.

    With several shared variables the accuracy of all together takes the place of the F1 score.
    The cost panel leaves out strategies that do not plan, as the paper does.
    """
    planning = [result for result in scores if result.cost.estimate > 0]
    widths = [len(scores), len(scores)] + ([max(len(planning), 2)] if planning else [])
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    axes = figure.subplots(1, len(widths), width_ratios=widths)
    names = [result.strategy for result in scores]
    if any(result.variables for result in scores):
        _draw_bars(axes[0], names, [result.accuracy for result in scores], "accuracy", "{:.3f}")
    else:
        _draw_bars(axes[0], names, [result.f1 for result in scores], "F1 score", "{:.3f}")
    axes[0].set_ylim(0, 1)
    _draw_bars(axes[1], names, [result.return_ for result in scores], "mean return", "{:.1f}")
    if planning:
        names = [result.strategy for result in planning]
        _draw_bars(axes[2], names, [result.cost for result in planning], "mean action cost", "{:.1f}")
    figure.suptitle(title, fontsize=11)
    return figure


def _draw_bars(
    axes: Axes, names: Sequence[str], intervals: Sequence[Interval], label: str, number_format: str
) -> None:
    for position, (name, interval) in enumerate(zip(names, intervals, strict=True)):
        colour = ORANGE if name == "LCORPP" else BLUE
        axes.bar(position, interval.estimate, color=colour, width=0.66)
        errors = [[interval.estimate - interval.low], [interval.high - interval.estimate]]
        axes.errorbar(position, interval.estimate, yerr=errors, color=INK, capsize=3, linewidth=1)
        axes.annotate(
            number_format.format(interval.estimate),
            (position, interval.high),
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
            fontsize=8.5,
        )
    axes.set_xticks(range(len(names)), names)
    axes.set(xlabel="strategy", ylabel=label)
    axes.margins(y=0.12)
    despine(axes)
