"""A report on a classifier as a figure: what it calls whom, ROC, calibration and the scores themselves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.learning.evaluation.metrics import Bin
from lcorpp.learning.evaluation.report import Report
from lcorpp.learning.evaluation.thresholds import Threshold
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

PAIR = (BLUE, ORANGE)


@with_style
def plot_report(report: Report, path: str | Path) -> None:
    """Draw a report to a .png, .svg or .pdf file.

    Raises:
        FileError: it cannot be written, or the suffix is another.
    """
    figure = Figure(figsize=(11, 8), layout="constrained")
    (left, right), (low_left, low_right) = figure.subplots(2, 2)
    _confusion(left, report)
    _roc(right, report)
    _reliability(low_left, report)
    _scores(low_right, report)
    about = f"{report.cases} cases of {report.people} people, {report.folds} folds"
    figure.suptitle(f"{report.learner or 'classifier'}: {about}", fontsize=12)
    save_figure(figure, path)


def _confusion(axes: Axes, report: Report) -> None:
    shares = np.array([[rate.value for rate in row] for row in report.rates])
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1.3, aspect="auto")
    for i, row in enumerate(report.rates):
        for j, rate in enumerate(row):
            words = f"{rate.count}\n{rate.value:.2f} [{rate.low:.2f}, {rate.high:.2f}]"
            dark = rate.value > 0.8
            axes.text(j, i, words, ha="center", va="center", color="white" if dark else INK)
    names = [row[0].given for row in report.rates]
    axes.set_xticks(range(len(names)), [wrap_text(name, 16) for name in names])
    axes.set_yticks(range(len(names)), [wrap_text(name, 16) for name in names])
    axes.set(xlabel="called", ylabel="is", title=f"accuracy {report.accuracy}")
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)


def _roc(axes: Axes, report: Report) -> None:
    axes.plot([0, 1], [0, 1], color=MUTED, linewidth=1, linestyle=":")
    for number, one in enumerate(report.classes):
        colour = BLUE if len(report.classes) == 1 else COLOURS[number % len(COLOURS)]
        axes.plot(one.roc[0], one.roc[1], color=colour, label=f"{one.name}: AUC {one.auc}")
        for place, words in _marks(one.thresholds).items() if len(report.classes) == 1 else ():
            axes.plot(*place, "o", color=ORANGE, markersize=5)
            axes.annotate(words, place, xytext=(6, -9), textcoords="offset points", fontsize=8)
    axes.set(xlabel="share of others called so", ylabel="share called so", xlim=(-0.01, 1.01))
    axes.set(ylim=(-0.01, 1.01), title="ROC")
    axes.legend(loc="lower right", frameon=False)
    despine(axes)


def _marks(thresholds: Sequence[Threshold]) -> dict[tuple[float, float], str]:
    """Where thresholds lie on the ROC curve, and the goals of those that lie there."""
    goals: dict[tuple[float, float], list[str]] = {}
    for threshold in thresholds:
        goals.setdefault((threshold.alarm, threshold.hit), []).append(threshold.goal)
    first = {(t.alarm, t.hit): t.probability for t in reversed(thresholds)}
    return {place: f"{', '.join(names)}: from {first[place]:.2f}" for place, names in goals.items()}


def _reliability(axes: Axes, report: Report) -> None:
    axes.plot([0, 1], [0, 1], color=MUTED, linewidth=1, linestyle=":")
    lines = []
    for number, one in enumerate(report.classes):
        if len(report.classes) == 1:
            lines.append((f"as said: error {one.said.error}", BLUE, one.said.reliability))
            lines.append((f"calibrated: {one.calibrated.error}", ORANGE, one.calibrated.reliability))
        else:
            colour = COLOURS[number % len(COLOURS)]
            lines.append((f"{one.name}: error {one.calibrated.error}", colour, one.calibrated.reliability))
    for label, colour, curve in lines:
        _curve(axes, label, colour, curve)
    title = "reliability" if len(report.classes) == 1 else "reliability, calibrated"
    axes.set(xlabel="probability said", ylabel="share that is so", title=title)
    axes.set(xlim=(-0.01, 1.01), ylim=(-0.01, 1.01))
    axes.legend(loc="upper left", frameon=False)
    despine(axes)


def _curve(axes: Axes, label: str, colour: str, curve: tuple[Bin, ...]) -> None:
    said, share = np.array([part.said for part in curve]), np.array([part.share for part in curve])
    ends = np.array([[part.low for part in curve], [part.high for part in curve]])
    whiskers = np.abs(ends - share)
    axes.errorbar(said, share, yerr=whiskers, color=colour, marker="o", markersize=4, capsize=2, label=label)


def _scores(axes: Axes, report: Report) -> None:
    if len(report.classes) == 1:
        one = report.classes[0]
        groups = [(one.name, ORANGE, one.positive), ("others", BLUE, ~one.positive)]
        for name, colour, rows in groups:
            _histogram(axes, one.said.scores[rows], name, colour)
        for threshold in one.thresholds:
            axes.axvline(threshold.probability, color=INK, linewidth=0.8, linestyle="--")
        axes.set(xlabel=f"probability of {one.name}, as said")
    else:
        for number, one in enumerate(report.classes):
            colour = COLOURS[number % len(COLOURS)]
            _histogram(axes, one.said.scores[one.positive], one.name, colour)
        axes.set(xlabel="probability of the true class, as said")
    axes.set(ylabel="share of the class", title="scores")
    axes.legend(frameon=False)
    despine(axes)
    axes.grid(axis="y", color=PALE)


def _histogram(axes: Axes, scores: Array, label: str, colour: str) -> None:
    edges, weights = np.linspace(0, 1, 26).tolist(), np.full(len(scores), 1 / max(len(scores), 1))
    axes.hist(scores, edges, weights=weights, histtype="stepfilled", alpha=0.35, color=colour, label=label)
    axes.hist(scores, edges, weights=weights, histtype="step", color=colour)
