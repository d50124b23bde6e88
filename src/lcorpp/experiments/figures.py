"""The paper's figures: "comparison with five baselines" and "active data augmentation" (supplement)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.experiments.metrics import Scores
from lcorpp.plot_style import BLUE, INK, ORANGE, despine, save_figure, with_style
from lcorpp.values import Interval


@with_style
def plot_strategies(scores: Sequence[Scores], title: str) -> Figure:
    """Draw F1 score, return and cost of each strategy, with 95 % confidence intervals as error bars.

    The cost panel leaves out strategies that do not plan, as the paper does.
    """
    planning = [result for result in scores if result.cost.estimate > 0]
    widths = [len(scores), len(scores)] + ([max(len(planning), 2)] if planning else [])
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    axes = figure.subplots(1, len(widths), width_ratios=widths)
    names = [result.strategy for result in scores]
    _draw_bars(axes[0], names, [result.f1 for result in scores], "F1 score", "{:.3f}")
    axes[0].set_ylim(0, 1)
    _draw_bars(axes[1], names, [result.return_ for result in scores], "mean return", "{:.1f}")
    if planning:
        names = [result.strategy for result in planning]
        _draw_bars(axes[2], names, [result.cost for result in planning], "mean action cost", "{:.1f}")
    figure.suptitle(title, fontsize=11)
    return figure


@with_style
def plot_augmentation(batches: Sequence[int], f1: Sequence[float], change: Sequence[float]) -> Figure:
    """Draw the F1 score of each batch's decisions and the change of the confusion matrix.

    Args:
        batches, f1, change: one number per batch; `change` is SSUB of Algorithm 1.
    """
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes, heights, label, colour, top in (
        (left, f1, "F1 score of the batch's decisions", BLUE, 1.0),
        (right, change, "change of the confusion matrix (SSUB)", ORANGE, 1.1 * max(change) or 1.0),
    ):
        axes.plot(batches, heights, marker="o", color=colour)
        axes.set(xlabel="batch", ylabel=label, ylim=(0, top))
        axes.xaxis.get_major_locator().set_params(integer=True)
        despine(axes)
    return figure


def write_figure(figure: Figure, folder: Path, name: str, formats: Sequence[str]) -> list[Path]:
    """Write a figure in each format ("png", "svg", "pdf") and return the paths."""
    paths = [folder / f"{name}.{suffix}" for suffix in formats]
    for path in paths:
        save_figure(figure, path)
    return paths


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
