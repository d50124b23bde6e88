"""Evaluation report as a figure: confusion matrix, ROC curve, reliability diagram and score histogram."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.arguments import check_arguments
from lcorpp.learning.evaluation.metrics import ReliabilityBin
from lcorpp.learning.evaluation.report import EvaluationReport
from lcorpp.learning.evaluation.thresholds import ThresholdChoice
from lcorpp.plot_style import (
    BLUE,
    COLOURS,
    INK,
    MUTED,
    ORANGE,
    PALE,
    despine,
    save_figure,
    with_style,
    wrap_text,
)
from lcorpp.values import Array


@with_style
@check_arguments
def plot_report(report: EvaluationReport, path: str | Path) -> None:
    """Draw a report to a .png, .svg or .pdf file.

    Raises:
        FileError: the file cannot be written, or has another suffix.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, build_report, cross_validate, plot_report
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> plot_report(build_report(cross_validate(QuadraticLogistic(), data)), "report.svg")
        >>> Path("report.svg").read_text()[:5]
        '<?xml'
    """
    figure = Figure(figsize=(11, 8), layout="constrained")
    (left, right), (low_left, low_right) = figure.subplots(2, 2)
    _draw_confusion(left, report)
    _draw_roc(right, report)
    _draw_reliability(low_left, report)
    _draw_scores(low_right, report)
    figure.suptitle(report.title, fontsize=12)
    save_figure(figure, path)


def _draw_confusion(axes: Axes, report: EvaluationReport) -> None:
    values = np.array([[rate.value for rate in row] for row in report.rates])
    axes.imshow(values, cmap="Blues", vmin=0, vmax=1.3, aspect="auto")  # never so dark as to hide the text
    for i, row in enumerate(report.rates):
        for j, rate in enumerate(row):
            colour = "white" if rate.value > 0.8 else INK
            axes.text(j, i, f"{rate.count}\n{rate.interval:.2f}", ha="center", va="center", color=colour)
    names = [wrap_text(row[0].true, 16) for row in report.rates]
    axes.set_xticks(range(len(names)), names)
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel="predicted class", ylabel="true class", title=f"accuracy {report.accuracy}")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _draw_unit_square(axes: Axes, *, xlabel: str, ylabel: str, title: str) -> None:
    """Draw the axes of two numbers between 0 and 1, and the diagonal."""
    axes.plot([0, 1], [0, 1], color=MUTED, linewidth=1, linestyle=":")
    axes.set(xlabel=xlabel, ylabel=ylabel, title=title, xlim=(-0.01, 1.01), ylim=(-0.01, 1.01))
    despine(axes)


def _draw_roc(axes: Axes, report: EvaluationReport) -> None:
    _draw_unit_square(axes, xlabel="false positive rate", ylabel="true positive rate", title="ROC curve")
    colours = cycle([BLUE] if report.is_binary else COLOURS)
    for evaluation, colour in zip(report.classes, colours, strict=False):
        axes.plot(*evaluation.roc, color=colour, label=f"{evaluation.name}: AUC {evaluation.auc}")
    if report.is_binary:
        _mark_thresholds(axes, report.classes[0].thresholds)
    axes.legend(loc="lower right", frameon=False)


def _mark_thresholds(axes: Axes, choices: Sequence[ThresholdChoice]) -> None:
    """Mark each chosen point of the ROC curve with the goals whose threshold lies there."""
    choices_at: dict[tuple[float, float], list[ThresholdChoice]] = {}
    for choice in choices:
        choices_at.setdefault((choice.fpr, choice.tpr), []).append(choice)
    marked: list[tuple[float, float]] = []
    for point, chosen in sorted(choices_at.items(), key=lambda item: -item[0][1]):
        near = sum(abs(point[0] - x) < 0.4 and y - point[1] < 0.06 for x, y in marked)
        text = f"{', '.join(choice.goal for choice in chosen)}: threshold {chosen[0].probability:.2f}"
        axes.plot(*point, "o", color=ORANGE, markersize=5)
        below = (6, -9 - 11 * near)  # labels of near points are in lines of their own
        axes.annotate(text, point, xytext=below, textcoords="offset points", fontsize=8)
        marked.append(point)


def _draw_reliability(axes: Axes, report: EvaluationReport) -> None:
    title = "reliability diagram" if report.is_binary else "reliability diagram, calibrated"
    _draw_unit_square(axes, xlabel="mean predicted probability", ylabel="observed frequency", title=title)
    if report.is_binary:
        raw, calibrated = report.classes[0].raw, report.classes[0].calibrated
        _draw_bins(axes, f"raw: ECE {raw.ece}", BLUE, raw.reliability)
        _draw_bins(axes, f"calibrated: ECE {calibrated.ece}", ORANGE, calibrated.reliability)
    else:
        for evaluation, colour in zip(report.classes, cycle(COLOURS), strict=False):
            quality = evaluation.calibrated
            _draw_bins(axes, f"{evaluation.name}: ECE {quality.ece}", colour, quality.reliability)
    axes.legend(loc="upper left", frameon=False)


def _draw_bins(axes: Axes, label: str, colour: str, bins: tuple[ReliabilityBin, ...]) -> None:
    predicted, intervals = [each.predicted for each in bins], [each.observed for each in bins]
    observed = np.array([interval.estimate for interval in intervals])
    ends = np.array([[interval.low for interval in intervals], [interval.high for interval in intervals]])
    errors = np.abs(ends - observed)
    axes.errorbar(
        predicted, observed, yerr=errors, color=colour, marker="o", markersize=4, capsize=2, label=label
    )


def _draw_scores(axes: Axes, report: EvaluationReport) -> None:
    if report.is_binary:
        (evaluation,) = report.classes
        scores, positive, name = evaluation.raw.scores, evaluation.positive, evaluation.name
        _draw_histogram(axes, scores[positive], name, ORANGE)
        _draw_histogram(axes, scores[~positive], "others", BLUE)
        for choice in evaluation.thresholds:
            axes.axvline(choice.probability, color=INK, linewidth=0.8, linestyle="--")
        axes.set(xlabel=f"predicted probability of {name}, raw")
    else:
        for each, colour in zip(report.classes, cycle(COLOURS), strict=False):
            _draw_histogram(axes, each.raw.scores[each.positive], each.name, colour)
        axes.set(xlabel="predicted probability of the true class, raw")
    axes.set(ylabel="fraction of the true class", title="scores")
    axes.legend(frameon=False)
    despine(axes)
    axes.grid(axis="y", color=PALE)


def _draw_histogram(axes: Axes, scores: Array, label: str, colour: str) -> None:
    edges = np.linspace(0, 1, 26).tolist()
    weights = np.full(len(scores), 1 / max(len(scores), 1))
    axes.hist(scores, edges, weights=weights, histtype="stepfilled", alpha=0.35, color=colour, label=label)
    axes.hist(scores, edges, weights=weights, histtype="step", color=colour)
