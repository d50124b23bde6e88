"""The paper's figure "confusion matrix of the LSTM classifier", cross-validated on unseen people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from decimal import Decimal
from functools import partial
from math import hypot, sqrt
from time import perf_counter

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.assembly.classifier_training import train_classifier
from lcorpp.assembly.options import TrainingOptions
from lcorpp.assembly.progress import ProgressDisplay
from lcorpp.domains import load_domain
from lcorpp.experiments.figures import published
from lcorpp.experiments.figures.panels import make_panels
from lcorpp.experiments.figures.published import Deviation, deviate
from lcorpp.experiments.figures.result import (
    FigureOptions,
    FigureResult,
    Finding,
    Layout,
    judge,
    judge_exactly,
)
from lcorpp.learning import Rate
from lcorpp.plot_style import INK, with_style
from lcorpp.scoring.metrics import make_cells
from lcorpp.values import Interval

FAST = TrainingOptions(learner="lstm-fast", tracks=600)
"""The classifier with `FigureOptions.fast`; by default it is the domain's, the paper's LSTM."""

CASES: Mapping[str, int] = {"interested": 63, "not_interested": 2223}
"""True class -> recorded people of the paper, whose rates are taken for binomial proportions of them."""

POSITIVE = "interested"

MAX_TRAINING = 600.0
"""Seconds of the training that the paper states."""

REASON = "our tracks are simulated, the recorded ones of the paper are not public"


def make_figure(options: FigureOptions, progress: ProgressDisplay) -> FigureResult:
    """Train the classifier on simulated tracks and cross-validate it."""
    domain, began = load_domain("intention"), perf_counter()
    setup = train_classifier(
        domain,
        domain.senses[0],
        FAST if options.fast else TrainingOptions(),
        seed=options.seed,
        jobs=options.jobs,
        progress=progress,
    )
    return make_result(
        setup.intervals,
        {"domain": "intention", "learner": setup.source, "seed": options.seed},
        perf_counter() - began,
    )


def make_result(
    rates: Sequence[Sequence[Rate]], configuration: Mapping[str, str | int | float], seconds: float
) -> FigureResult:
    """Return the result of a cross-validation that took some seconds: a row of rates for each true class."""
    positive = {row[0].true: next(rate for rate in row if rate.predicted == POSITIVE) for row in rates}
    gain = subtract_rates(*[positive[true].interval for true in CASES])
    return FigureResult(
        name="confusion",
        title="The classifier's confusion matrix",
        table=[
            {
                "true": rate.true,
                "predicted": rate.predicted,
                "tracks": rate.count,
                "of": rate.cases,
                **make_cells({"rate": rate.interval}),
                "published": _find_published(rate),
            }
            for row in rates
            for rate in row
        ],
        findings=[
            Finding(
                f"The classifier predicts {POSITIVE} more often for people who are interested",
                judge([gain]),
                f"rates {positive['interested'].interval:.3f} and {positive['not_interested'].interval:.3f},"
                f" difference {gain:.3f}",
            ),
            Finding(
                "The classifier is trained within about ten minutes, before the robot acts",
                judge_exactly([MAX_TRAINING - seconds]),
                f"on this machine {seconds:.1f} s, {configuration['learner']}, cross-validation included",
            ),
        ],
        draw=partial(_draw, rates),
        deviations=[_deviate(rate) for rate in positive.values()],
        notes=[
            "Each track is classified by a classifier that has not seen its person; intervals are Jeffreys'.",
            f"The standard errors of the published rates are those of {CASES['interested']} and"
            f" {CASES['not_interested']} recorded people.",
        ],
        configuration=configuration,
    )


def subtract_rates(a: Interval, b: Interval) -> Interval:
    """Return the difference a - b of two independent proportions.

    Source: Newcombe, "Interval estimation for the difference between independent proportions", Statistics in
    Medicine 17, 1998, method 10, here with the given intervals in place of Wilson's.
    """
    middle = a.estimate - b.estimate
    low = middle - hypot(a.estimate - a.low, b.high - b.estimate)
    return Interval(middle, low, middle + hypot(a.high - a.estimate, b.estimate - b.low))


def _find_published(rate: Rate) -> float:
    """Return the published rate; the two of a true class sum to 1."""
    positive = Decimal(published.CONFUSION[rate.true])
    return float(positive if rate.predicted == POSITIVE else 1 - positive)


def _deviate(rate: Rate) -> Deviation:
    number = published.CONFUSION[rate.true]
    p = float(number)
    error = sqrt(p * (1 - p) / CASES[rate.true])
    what = f"{POSITIVE} predicted of {rate.true}"
    return deviate("cross-validation", what, rate.interval, number, error, REASON)


@with_style
def _draw(rates: Sequence[Sequence[Rate]], layout: Layout) -> Figure:
    figure, (left, right) = make_panels(layout, (1, 1))
    ours = [[rate.interval for rate in row] for row in rates]
    theirs = [[Interval.exact(_find_published(rate)) for rate in row] for row in rates]
    names = [row[0].true.replace("_", " ") for row in rates]
    _draw_matrix(left, ours, names, "cross-validated")
    _draw_matrix(right, theirs, names, "published")
    return figure


def _draw_matrix(axes: Axes, rows: Sequence[Sequence[Interval]], names: Sequence[str], title: str) -> None:
    """Draw rates as shades of blue, each with its number and interval."""
    axes.imshow([[cell.estimate for cell in row] for row in rows], cmap="Blues", vmin=0, vmax=1)
    for y, row in enumerate(rows):
        for x, cell in enumerate(row):
            interval = f"\n[{cell.low:.2f}, {cell.high:.2f}]" if cell.low < cell.high else ""
            colour = "white" if cell.estimate > 0.55 else INK
            text = f"{cell.estimate:.2f}{interval}"
            axes.text(x, y, text, ha="center", va="center", color=colour, fontsize=9)
    axes.set_xticks(range(len(names)), names, fontsize=8)
    axes.set_yticks(range(len(names)), names, fontsize=8, rotation=90, va="center")
    axes.set_xlabel("predicted", fontsize=8)
    axes.set_ylabel("true", fontsize=8)
    axes.set_title(title, fontsize=9)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
