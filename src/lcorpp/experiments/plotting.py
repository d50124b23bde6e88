"""The figures of the experiments."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.experiments.metrics import Scores
from lcorpp.plot_style import BLUE, INK, ORANGE, despine, save_figure, with_style
from lcorpp.values import Interval


@with_style
def plot_comparison(results: Sequence[Scores], title: str, path: Path) -> None:
    """Figure "comparison with five baselines": F1 of every strategy, and what asking costs.

    Strategies that do not plan have no cost and are left out on the right, as in the paper.
    """
    asking = [result for result in results if result.cost.estimate > 0]
    widths = [len(results), len(results)] + ([max(len(asking), 2)] if asking else [])
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    axes = figure.subplots(1, len(widths), width_ratios=widths)
    names = [result.strategy for result in results]
    _bars(axes[0], names, [result.f1 for result in results], "F1 score", "{:.3f}")
    axes[0].set_ylim(0, 1)
    _bars(axes[1], names, [result.earned for result in results], "return", "{:.1f}")
    if asking:
        _bars(axes[2], [r.strategy for r in asking], [r.cost for r in asking], "cost of asking", "{:.1f}")
    figure.suptitle(title, fontsize=11)
    save_figure(figure, path)


@with_style
def plot_batches(numbers: Sequence[int], f1: Sequence[float], change: Sequence[float], path: Path) -> None:
    """Figure "active data augmentation": the quality of the classifier and its change, batch by batch."""
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes, heights, label, colour, top in (
        (left, f1, "F1 of the batch's decisions", BLUE, 1.0),
        (right, change, "change of the confusion matrix", ORANGE, 1.1 * max(change) or 1.0),
    ):
        axes.plot(numbers, heights, marker="o", color=colour)
        axes.set(xlabel="batch", ylabel=label)
        axes.set_ylim(0, top)
        axes.xaxis.get_major_locator().set_params(integer=True)
        despine(axes)
    save_figure(figure, path)


def _bars(axes: Axes, names: Sequence[str], intervals: Sequence[Interval], label: str, form: str) -> None:
    for position, (name, interval) in enumerate(zip(names, intervals, strict=True)):
        colour = ORANGE if name == "LCORPP" else BLUE
        axes.bar(position, interval.estimate, color=colour, width=0.66)
        whiskers = [[interval.estimate - interval.low], [interval.high - interval.estimate]]
        axes.errorbar(position, interval.estimate, yerr=whiskers, color=INK, capsize=3, linewidth=1)
        axes.annotate(
            form.format(interval.estimate),
            (position, interval.high),
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
            fontsize=8.5,
        )
    axes.set_xticks(range(len(names)), names)
    axes.set_ylabel(label)
    axes.margins(y=0.12)
    despine(axes)
