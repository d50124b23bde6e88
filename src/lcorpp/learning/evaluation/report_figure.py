"""Evaluation report as a figure: confusion matrix, ROC curve, reliability diagram and score histogram."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
def plot_report(report: EvaluationReport, path: str | Path) -> None:
    """Draw a report to a .png, .svg or .pdf file.

    Raises:
        FileError: the file cannot be written, or has another suffix.
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
    axes.imshow(values, cmap="Blues", vmin=0, vmax=1.3, aspect="auto")
    for i, row in enumerate(report.rates):
        for j, rate in enumerate(row):
            text = f"{rate.count}\n{rate.interval:.2f}"
            colour = "white" if rate.value > 0.8 else INK
            axes.text(j, i, text, ha="center", va="center", color=colour)
    names = [row[0].true for row in report.rates]
    axes.set_xticks(range(len(names)), [wrap_text(name, 16) for name in names])
    axes.set_yticks(range(len(names)), [wrap_text(name, 16) for name in names])
    axes.set(xlabel="predicted class", ylabel="true class", title=f"accuracy {report.accuracy}")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _draw_roc(axes: Axes, report: EvaluationReport) -> None:
    axes.plot([0, 1], [0, 1], color=MUTED, linewidth=1, linestyle=":")
    for number, one in enumerate(report.classes):
        colour = BLUE if len(report.classes) == 1 else COLOURS[number % len(COLOURS)]
        axes.plot(one.roc[0], one.roc[1], color=colour, label=f"{one.name}: AUC {one.auc}")
        for point, text in _threshold_marks(one.thresholds).items() if len(report.classes) == 1 else ():
            axes.plot(*point, "o", color=ORANGE, markersize=5)
            axes.annotate(text, point, xytext=(6, -9), textcoords="offset points", fontsize=8)
    axes.set(xlabel="false positive rate", ylabel="true positive rate", title="ROC curve")
    axes.set(xlim=(-0.01, 1.01), ylim=(-0.01, 1.01))
    axes.legend(loc="lower right", frameon=False)
    despine(axes)


def _threshold_marks(choices: Sequence[ThresholdChoice]) -> dict[tuple[float, float], str]:
    """Point of the ROC curve -> text with the goals whose threshold lies there."""
    goals: dict[tuple[float, float], list[str]] = {}
    for choice in choices:
        goals.setdefault((choice.fpr, choice.tpr), []).append(choice.goal)
    first = {(choice.fpr, choice.tpr): choice.probability for choice in reversed(choices)}
    return {point: f"{', '.join(names)}: threshold {first[point]:.2f}" for point, names in goals.items()}


def _draw_reliability(axes: Axes, report: EvaluationReport) -> None:
    axes.plot([0, 1], [0, 1], color=MUTED, linewidth=1, linestyle=":")
    single = len(report.classes) == 1
    for number, one in enumerate(report.classes):
        if single:
            _draw_bins(axes, f"raw: ECE {one.raw.ece}", BLUE, one.raw.reliability)
            _draw_bins(axes, f"calibrated: ECE {one.calibrated.ece}", ORANGE, one.calibrated.reliability)
        else:
            label = f"{one.name}: ECE {one.calibrated.ece}"
            _draw_bins(axes, label, COLOURS[number % len(COLOURS)], one.calibrated.reliability)
    title = "reliability diagram" if single else "reliability diagram, calibrated"
    axes.set(xlabel="mean predicted probability", ylabel="observed frequency", title=title)
    axes.set(xlim=(-0.01, 1.01), ylim=(-0.01, 1.01))
    axes.legend(loc="upper left", frameon=False)
    despine(axes)


def _draw_bins(axes: Axes, label: str, colour: str, bins: tuple[ReliabilityBin, ...]) -> None:
    predicted = np.array([part.predicted for part in bins])
    observed = np.array([part.observed.estimate for part in bins])
    ends = np.array([[part.observed.low for part in bins], [part.observed.high for part in bins]])
    errors = np.abs(ends - observed)
    axes.errorbar(
        predicted, observed, yerr=errors, color=colour, marker="o", markersize=4, capsize=2, label=label
    )


def _draw_scores(axes: Axes, report: EvaluationReport) -> None:
    if len(report.classes) == 1:
        one = report.classes[0]
        groups = [(one.name, ORANGE, one.positive), ("others", BLUE, ~one.positive)]
        for name, colour, rows in groups:
            _draw_histogram(axes, one.raw.scores[rows], name, colour)
        for choice in one.thresholds:
            axes.axvline(choice.probability, color=INK, linewidth=0.8, linestyle="--")
        axes.set(xlabel=f"predicted probability of {one.name}, raw")
    else:
        for number, one in enumerate(report.classes):
            _draw_histogram(axes, one.raw.scores[one.positive], one.name, COLOURS[number % len(COLOURS)])
        axes.set(xlabel="predicted probability of the true class, raw")
    axes.set(ylabel="fraction of the true class", title="scores")
    axes.legend(frameon=False)
    despine(axes)
    axes.grid(axis="y", color=PALE)


def _draw_histogram(axes: Axes, scores: Array, label: str, colour: str) -> None:
    edges, weights = np.linspace(0, 1, 26).tolist(), np.full(len(scores), 1 / max(len(scores), 1))
    axes.hist(scores, edges, weights=weights, histtype="stepfilled", alpha=0.35, color=colour, label=label)
    axes.hist(scores, edges, weights=weights, histtype="step", color=colour)
