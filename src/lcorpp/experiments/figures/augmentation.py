"""The supplement's figure "active data augmentation": Algorithm 1 from no data, beside no learning."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lcorpp.domains import load_domain
from lcorpp.experiments.active_learning.from_no_data import (
    HARD,
    NONE,
    RUNS,
    SOFT,
    BatchOutcome,
    run_from_no_data,
)
from lcorpp.experiments.figures import published
from lcorpp.experiments.figures.panels import PUBLISHED, make_panels
from lcorpp.experiments.figures.published import Deviation, compute_standard_error
from lcorpp.experiments.figures.result import (
    FigureOptions,
    FigureResult,
    Finding,
    Layout,
    Row,
    judge,
)
from lcorpp.experiments.figures.seeds import compute_seed_interval, run_seeds, subtract
from lcorpp.experiments.scoring.metrics import make_cells
from lcorpp.experiments.setup import ProgressDisplay, solve_domain
from lcorpp.planning import Planner
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.plot_style import BLUE, INK, MUTED, ORANGE, despine, with_style
from lcorpp.values import Z95, ConfusionMatrix, Interval

LEARNER = "summaries"
"""The learner: better than the LSTM on some hundred simulated tracks, and it takes a tenth of a second."""

BATCHES = 4
SEEDS, FAST_SEEDS = 10, 8
BATCH_SIZE, FAST_BATCH_SIZE = 500, 200
"""Batches; seeds, and people in a batch, which are the paper's; with --fast."""

OVERCONFIDENCE = 0.05
"""Belief in the reports above their accuracy that is worth a note."""

TITLES: Mapping[str, str] = {NONE: "no new data", HARD: "hard labels", SOFT: "soft labels"}
COLOURS: Mapping[str, str] = {NONE: MUTED, HARD: BLUE, SOFT: ORANGE}

REASONS: Mapping[str, str] = {
    "f1": "the published run is another, of three batches; of the answers 30 % are wrong here, 25 % in other"
    " published figures",
    "cost": "the published costs are of another run, four times those of all other published figures",
}
"""Metric -> why it differs from the published numbers, as far as it is known."""

Result = Mapping[str, Sequence[BatchOutcome]]
"""Run -> its batches; of one seed."""


def make_figure(options: FigureOptions, progress: ProgressDisplay) -> FigureResult:
    """Run Algorithm 1 from no data with hard and soft labels, and without learning, on the same people."""
    domain = load_domain("intention", preset="paper")
    with progress("solving the POMDP") as advance:
        planner = Planner(solve_domain(domain, cache=find_cache_folder(), advance=advance))
    n, size = (FAST_SEEDS, FAST_BATCH_SIZE) if options.fast else (SEEDS, BATCH_SIZE)
    sizes = {"batches": BATCHES, "batch_size": size}
    unit = partial(run_from_no_data, domain, planner, learner=LEARNER, **sizes)
    with progress(f"{BATCHES} batches of {size} people", n) as advance:
        seeds = range(options.seed, options.seed + n)
        return make_result(run_seeds(unit, seeds, options.jobs, advance), domain.positive or "")


def make_result(results: Sequence[Result], positive: str) -> FigureResult:
    """Return the figure of the results, one for each seed."""
    classes = results[0][HARD][0].rules.classes
    size = int(results[0][HARD][0].scores.counts.sum())
    return FigureResult(
        name="augmentation",
        title="Active data augmentation",
        table=[row for run in RUNS for row in _make_rows(results, run, classes)],
        findings=_judge(results),
        draw=partial(_draw, results, positive),
        deviations=_deviate(results),
        notes=[
            f"{len(results)} seeds of {BATCHES} batches of {size} people; intervals are Student's over the"
            " seeds, differences are paired. In the first batch the classifier is random, and its rules are"
            " uniform.",
            *(note for run in (HARD, SOFT) for note in _describe_labels(results, run, classes)),
        ],
        configuration={
            "domain": "intention",
            "preset": "paper",
            "learner": LEARNER,
            "seeds": len(results),
            "batch size": size,
        },
    )


def summarise(
    results: Sequence[Result], run: str, batch: int, measure: Callable[[BatchOutcome], float]
) -> list[float]:
    """Return a number of a batch, counted from 1, for each seed."""
    return [measure(result[run][batch - 1]) for result in results]


def find_score(metric: str) -> Callable[[BatchOutcome], float]:
    """Return the function from a batch to one of its scores."""
    return lambda outcome: outcome.scores.metrics[metric].estimate


def find_label_error(name: str) -> Callable[[BatchOutcome], float]:
    """Return the function from a batch to the share of people reported as of a class who are not."""

    def measure(outcome: BatchOutcome) -> float:
        column = outcome.rules.classes.index(name)
        reported = outcome.scores.counts[:, column]
        return float(1 - reported[column] / max(reported.sum(), 1))

    return measure


def find_recall(matrix: str, name: str) -> Callable[[BatchOutcome], float]:
    """Return the function from a batch to the recall of a class by its matrix `rules` or `true`."""

    def measure(outcome: BatchOutcome) -> float:
        confusion: ConfusionMatrix = getattr(outcome, matrix)
        index = confusion.classes.index(name)
        return float(confusion.probabilities[index, index])

    return measure


def _make_rows(results: Sequence[Result], run: str, classes: Sequence[str]) -> list[Row]:
    measures = {metric: find_score(metric) for metric in ("f1", "accuracy", "cost", "return")}
    measures["belief_in_reports"] = lambda outcome: outcome.belief
    for name in classes:
        measures[f"label_error_{name}"] = find_label_error(name)
        measures[f"recall_in_rules_{name}"] = find_recall("rules", name)
        measures[f"true_recall_{name}"] = find_recall("true", name)
    return [
        {
            "run": run,
            "batch": batch,
            "seeds": len(results),
            **make_cells(
                {
                    column: compute_seed_interval(summarise(results, run, batch, measure))
                    for column, measure in measures.items()
                }
            ),
        }
        for batch in range(1, BATCHES + 1)
    ]


def _judge(results: Sequence[Result]) -> list[Finding]:
    """Decide hypothesis IV, against the first batch and against the same people without new data."""

    def find(run: str, batch: int, metric: str) -> list[float]:
        return summarise(results, run, batch, find_score(metric))

    findings = []
    for run in (HARD, SOFT):
        rise = subtract(find(run, BATCHES, "f1"), find(run, 1, "f1"))
        claim = f"Hypothesis IV, F1 rises from the first to the last batch, {TITLES[run]}"
        findings.append(Finding(claim, judge([rise]), f"by {rise:.3f}"))
        gains = {
            metric: subtract(find(run, BATCHES, metric), find(NONE, BATCHES, metric))
            for metric in ("f1", "return", "cost")
        }
        cost = gains["cost"]
        better = [gains["f1"], gains["return"], Interval(-cost.estimate, -cost.high, -cost.low)]
        claim = (
            f"In the last batch F1 and return are higher and the cost is lower than without new data, {run}"
        )
        evidence = f"F1 {gains['f1']:.3f}, return {gains['return']:.2f}, cost {cost:.2f}"
        findings.append(Finding(f"{claim} labels", judge(better), evidence))
    soft = [subtract(find(SOFT, BATCHES, metric), find(HARD, BATCHES, metric)) for metric in ("f1", "return")]
    claim = "In the last batch F1 and return are higher with soft labels than with hard ones"
    return [*findings, Finding(claim, judge(soft), f"F1 {soft[0]:.3f}, return {soft[1]:.2f}")]


def _describe_labels(results: Sequence[Result], run: str, classes: Sequence[str]) -> list[str]:
    """Return how noisy the labels are, and what that does to the confusion matrix in the rules."""

    def mean(batch: int, measure: Callable[[BatchOutcome], float]) -> float:
        return float(np.mean(summarise(results, run, batch, measure)))

    errors = "; ".join(
        f"of the people reported as {name} {mean(1, find_label_error(name)):.1%} are not in the first batch,"
        f" {mean(BATCHES, find_label_error(name)):.1%} in the last"
        for name in classes
    )
    recalls = ", ".join(
        f"{name} {mean(BATCHES, find_recall('rules', name)):.2f}"
        f" (true {mean(BATCHES, find_recall('true', name)):.2f})"
        for name in classes
    )
    belief, right = mean(BATCHES, lambda outcome: outcome.belief), mean(BATCHES, find_score("accuracy"))
    notes = [
        f"With {TITLES[run]}, {errors}. The rules of the last batch, estimated from the reports, state the"
        f" recall {recalls}. The mean belief in its reports is {belief:.3f}; {right:.3f} of them are right."
    ]
    if run == SOFT and belief > right + OVERCONFIDENCE:
        notes.append(
            "The robot believes its reports too firmly, as its model of answers has less noise than people"
            " have: soft labels are nearly hard."
        )
    return notes


def _deviate(results: Sequence[Result]) -> list[Deviation]:
    """Return the first batches with hard labels beside those of the published run."""
    found = []
    for metric, numbers in published.AUGMENTATION.items():
        for batch, number in enumerate(numbers, 1):
            ours = compute_seed_interval(summarise(results, HARD, batch, find_score(metric)))
            scores = results[0][HARD][batch - 1].scores
            theirs = compute_standard_error(scores, metric, number, trials=BATCH_SIZE)
            error = float(np.hypot((ours.high - ours.low) / (2 * Z95), theirs))
            far = abs(ours.estimate - float(number)) > 3 * error
            label = {"f1": "F1"}.get(metric, metric)
            reason = REASONS[metric] if far else ""
            found.append(Deviation("hard labels", f"batch {batch}, {label}", ours, number, error, reason))
    return found


@with_style
def _draw(results: Sequence[Result], positive: str, layout: Layout) -> Figure:
    figure, (f1, recall, cost, return_) = make_panels(layout, (1, 1), rows=2)
    for axes, metric, label in (
        (f1, "f1", "F1 score"),
        (cost, "cost", "mean action cost"),
        (return_, "return", "mean return"),
    ):
        for run in RUNS:
            _draw_line(axes, results, run, find_score(metric), label=TITLES[run])
        axes.set_ylabel(label)
    numbers = [float(number) for number in published.AUGMENTATION["f1"]]
    f1.plot(range(1, len(numbers) + 1), numbers, label="published, another run", **PUBLISHED)
    for matrix, style, label in (("rules", "-", "in the rules"), ("true", ":", "true")):
        for run in (HARD, SOFT):
            _draw_line(
                recall,
                results,
                run,
                find_recall(matrix, positive),
                label=f"{TITLES[run]}, {label}",
                linestyle=style,
            )
    recall.set_ylabel(f"recall of {positive}")
    recall.legend(fontsize=7, frameon=False, loc="lower right")
    figure.legend(
        *f1.get_legend_handles_labels(),
        loc="outside upper center",
        ncols=4 if layout == "wide" else 2,
        fontsize=8,
        frameon=False,
    )
    return figure


def _draw_line(
    axes: Axes,
    results: Sequence[Result],
    run: str,
    measure: Callable[[BatchOutcome], float],
    *,
    label: str,
    linestyle: str = "-",
) -> None:
    """Draw a number of each batch with its interval; the runs are a little apart."""
    batches = range(1, BATCHES + 1)
    intervals = [compute_seed_interval(summarise(results, run, batch, measure)) for batch in batches]
    errors = [
        [each.estimate - each.low for each in intervals],
        [each.high - each.estimate for each in intervals],
    ]
    axes.errorbar(
        [batch + 0.06 * (RUNS.index(run) - 1) for batch in batches],
        [each.estimate for each in intervals],
        yerr=errors,
        color=COLOURS[run],
        linestyle=linestyle,
        ecolor=INK,
        elinewidth=0.8,
        marker="o",
        markersize=4,
        capsize=2,
        label=label,
    )
    axes.set_xticks(batches)
    axes.set_xlabel("batch")
    despine(axes)
