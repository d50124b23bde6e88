"""The figure of one run of Algorithm 1: F1 score and change of the confusion matrix over the batches."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from lcorpp.plot_style import BLUE, ORANGE, despine, with_style
from lcorpp.values import Interval


@with_style
def plot_batches(batches: Sequence[int], f1: Sequence[float], changes: Sequence[Interval]) -> Figure:
    """Draw the F1 score of each batch's decisions and the change of the confusion matrix.

    Args:
        batches, f1, changes: one for each batch; the changes are SSUB of Algorithm 1.
    """
    estimates = [change.estimate for change in changes]
    low, high = ([getattr(change, end) for change in changes] for end in ("low", "high"))
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes, heights, label, colour, top in (
        (left, f1, "F1 score of the batch's decisions", BLUE, 1.0),
        (right, estimates, "change of the confusion matrix (SSUB)", ORANGE, 1.1 * max(high) or 1.0),
    ):
        axes.plot(batches, heights, marker="o", color=colour)
        axes.set(xlabel="batch", ylabel=label, ylim=(0, top))
        axes.xaxis.get_major_locator().set_params(integer=True)
        despine(axes)
    right.fill_between(batches, low, high, color=ORANGE, alpha=0.2, linewidth=0)
    return figure
