"""Made-up scores and figures: findings and files must follow the numbers, whatever they are."""

from collections.abc import Mapping
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from lcorpp.assembly.progress import ProgressDisplay
from lcorpp.experiments.figures.evaluation import Evaluation
from lcorpp.experiments.figures.published import Deviation
from lcorpp.experiments.figures.result import FigureOptions, FigureResult, Finding, Layout, Verdict
from lcorpp.scoring.metrics import Scores
from lcorpp.values import Interval


def make_scores(strategy: str, f1: float, accuracy: float, cost: float, return_: float, half=0.0) -> Scores:
    def around(value: float, scale: float = 1.0) -> Interval:
        return Interval(value, value - half * scale, value + half * scale)

    return Scores(
        strategy,
        np.array([[40.0, 0, 0], [0, 60.0, 0]]),
        around(f1),
        around(f1),
        around(f1),
        around(accuracy),
        around(cost, 10),
        around(return_, 10),
        cost_sd=7.0,
    )


def make_evaluation(
    setting: str, scores: Mapping[str, tuple[float, float, float, float]], half: float = 0.01
) -> Evaluation:
    """Return an evaluation with the same exact and simulated scores: F1, accuracy, cost, return.

    half: half of the width of the intervals of differences in F1; those of cost and return are ten times as
    wide, those of the scores half as wide.
    """
    exact = {name: make_scores(name, *numbers) for name, numbers in scores.items()}
    simulated = {name: make_scores(name, *numbers, half / 2) for name, numbers in scores.items()}
    return Evaluation(setting, exact, simulated, 5000)


def make_figure(
    options: FigureOptions, progress: ProgressDisplay, *, name: str = "small", value: float = 0.5
) -> FigureResult:
    """Return a small figure with one step of two parts."""
    with progress("computing", 2) as advance:
        advance(1, 2)
        advance(2, 2)
    return FigureResult(
        name=name,
        title="A <small> figure & its title",
        table=[{"strategy": "L", "trials": None, "f1": value, "f1_low": value - 0.1, "f1_high": value + 0.1}],
        findings=[Finding("L < R", Verdict.FAILS, "paired: 1.00 [0.50, 1.50]")],
        draw=partial(_draw, value),
        deviations=[
            Deviation("paper", "L, F1", Interval.exact(value), "0.40", 0.01, "other data"),
            Deviation("paper", "R, F1", Interval.exact(value), "0.50", 0.01),
        ],
        notes=["A note."],
        configuration={"domain": "none"},
    )


def _draw(value: float, layout: Layout) -> Figure:
    figure = Figure(figsize=(4, 2) if layout == "wide" else (2, 2))
    figure.subplots().plot([0, 1], [0, value])
    return figure
