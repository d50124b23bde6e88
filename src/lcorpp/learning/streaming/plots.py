"""Plot of predictions over time by class, with the AUC at each time."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.arguments import check_arguments
from lcorpp.learning.streaming.timeline import PredictionTimeline
from lcorpp.plot_style import BLUE, COLOURS, INK, MUTED, ORANGE, despine, save_figure, with_style
from lcorpp.values import Array, measure_lengths

N_EXAMPLES = 6
"""People of each class drawn one by one."""


@with_style
def draw_timeline(
    timeline: PredictionTimeline, *, class_name: str | None = None, examples: int = N_EXAMPLES
) -> Figure:
    """Draw the figure of `plot_timeline`; arguments and errors are the same."""
    name = timeline.classes[0] if class_name is None else class_name
    probabilities, seconds = timeline.probability_of(name), timeline.seconds
    binary = len(timeline.classes) == 2
    figure = Figure(figsize=(7, 6 if binary else 4), layout="constrained")
    heights = (2, 1) if binary else (1,)
    axes = figure.subplots(len(heights), sharex=True, squeeze=False, height_ratios=heights)
    labels = np.array(timeline.labels)
    ordered = [name, *(other for other in timeline.classes if other != name)]
    for each, colour in zip(ordered, cycle((BLUE, ORANGE, *COLOURS[2:])), strict=False):
        _draw_class(axes[0, 0], seconds, probabilities[labels == each], each, colour, examples)
    axes[0, 0].set(ylim=(0, 1), ylabel=f"probability of {_format_name(name)}")
    axes[0, 0].legend(frameon=False, loc="upper left")
    despine(axes[0, 0])
    if binary:
        _draw_auc(axes[1, 0], timeline)
    axes[-1, 0].set(xlabel="seconds since the first sample of the person", xlim=(0, seconds[-1]))
    return figure


@check_arguments
def plot_timeline(
    timeline: PredictionTimeline,
    path: str | Path,
    *,
    class_name: str | None = None,
    examples: int = N_EXAMPLES,
) -> None:
    """Plot the probability of a class over time and, for two classes, the AUC below it, to a file.

    A band contains the middle half of a class, a thick line is its median, and thin lines are examples at
    equal distances in the order of the final prediction.

    Args:
        path: a .png, .svg or .pdf file.
        class_name: the class; None takes the first.
        examples: people of each class drawn one by one.

    Raises:
        FileError: the file cannot be written, or has no suffix of a picture.
        DataError: the class is unknown.

    Examples:
        >>> from pathlib import Path
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, plot_timeline
        >>> yes = np.array([[0.4, 0.6], [0.1, 0.9]])  # P(no), P(yes) after one point, after two
        >>> tracks, labels = [yes, yes, 1 - yes], ["yes", "no", "no"]  # the second one is misleading
        >>> plot_timeline(PredictionTimeline(tracks, (1, 2), labels, ("no", "yes"), 0.5), "timeline.svg")
        >>> Path("timeline.svg").read_text()[:5]
        '<?xml'
    """
    save_figure(draw_timeline(timeline, class_name=class_name, examples=examples), path)


def _draw_class(
    axes: Axes, seconds: Array, probabilities: Array, name: str, colour: str, examples: int
) -> None:
    known = np.isfinite(probabilities).any(axis=0)  # a shorter track ends before others
    if not len(probabilities) or not known.any():
        return
    low, median, high = np.nanquantile(probabilities[:, known], (0.25, 0.5, 0.75), axis=0)
    axes.fill_between(seconds[known], low, high, color=colour, alpha=0.18, linewidth=0, step="post")
    label = f"{_format_name(name)} ({len(probabilities)})"
    axes.plot(seconds[known], median, color=colour, linewidth=2.4, label=label, drawstyle="steps-post")
    last = np.maximum(measure_lengths(probabilities[:, None]), 1) - 1
    order = np.argsort(probabilities[np.arange(len(last)), last])
    for row in order[np.linspace(0, len(order) - 1, min(examples, len(order)) + 2).astype(int)[1:-1]]:
        axes.plot(seconds, probabilities[row], color=colour, linewidth=0.8, alpha=0.7, drawstyle="steps-post")


def _draw_auc(axes: Axes, timeline: PredictionTimeline) -> None:
    auc, seconds = timeline.auc, timeline.seconds
    axes.axhline(0.5, color=MUTED, linewidth=0.8, linestyle=":")
    axes.plot(seconds, auc, color=INK, linewidth=1.6, drawstyle="steps-post")
    for fraction in (0.25, 0.5, 1.0):
        sample = round(fraction * len(seconds)) - 1
        if np.isfinite(auc[sample]):
            axes.plot(seconds[sample], auc[sample], "o", color=INK, markersize=4, clip_on=False)
            point, text = (seconds[sample], auc[sample]), f"{auc[sample]:.2f}"
            axes.annotate(text, point, (0, 6), textcoords="offset points", ha="center")
    known = auc[np.isfinite(auc)]
    axes.set(ylim=(min(0.45, *known.tolist()), 1), ylabel="AUC so far")
    despine(axes)


def _format_name(name: str) -> str:
    return name.replace("_", " ")
