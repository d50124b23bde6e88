"""The supplement's figure "partial motion trajectories": strategies that see the first part of each track."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from lcorpp.assembly.progress import ProgressDisplay
from lcorpp.assembly.robot import compose_robot
from lcorpp.assembly.senses import SenseSetup, nest_rates
from lcorpp.assembly.training_data import simulate_training_data
from lcorpp.decision.strategies import strategies
from lcorpp.domains import Domain, load_domain
from lcorpp.experiments.figures import published
from lcorpp.experiments.figures.evaluation import METRICS, make_planner
from lcorpp.experiments.figures.panels import LABELS, PUBLISHED, draw_line, make_panels
from lcorpp.experiments.figures.published import Deviation, compute_standard_error, deviate
from lcorpp.experiments.figures.result import (
    FigureOptions,
    FigureResult,
    Finding,
    Layout,
    judge,
)
from lcorpp.experiments.figures.seeds import (
    Numbers,
    collect,
    compute_seed_interval,
    make_cells_of_seeds,
    run_seeds,
    subtract,
)
from lcorpp.learning import learner, train_and_validate, truncate
from lcorpp.learning.evaluation.folds import FOLDS
from lcorpp.planning import Planner
from lcorpp.plot_style import BLUE, INK, MUTED, ORANGE, with_style
from lcorpp.scoring.experiment import Experiment
from lcorpp.scoring.metrics import Scores
from lcorpp.scoring.trials import run_trials
from lcorpp.simulation.people import CutSignals

PARTS: Mapping[str, float] = {"quarter": 0.25, "half": 0.5, "whole": 1.0}
"""Name -> the first part of each trajectory that classifiers are trained on and see."""

NAMES = ("L", "L+R", "LCORPP")
"""The strategies that learn."""

COLOURS: Mapping[str, str] = {"L": MUTED, "L+R": BLUE, "LCORPP": ORANGE}

LEARNER = "summaries"
"""The learner: as good as `lstm-fast` (docs/guides/learning/learners.md), without random weights."""

SEEDS, FAST_SEEDS = 10, 3
TRACKS, FAST_TRACKS = 1600, 600
"""Seeds, and training tracks of each; with --fast."""

Result = Mapping[str, "PartResult"]
"""Part -> what a seed found."""

SeedScores = Mapping[tuple[str, str], Numbers]
"""(part, strategy) -> metric -> a number of each seed."""


@dataclass(frozen=True, eq=False)
class PartResult:
    """What a seed found for one part. scores: strategy -> its scores. recalls: class -> its recall."""

    scores: Mapping[str, Scores]
    recalls: Mapping[str, float]


def make_figure(options: FigureOptions, progress: ProgressDisplay) -> FigureResult:
    """Train a classifier on each part of the trajectories and score the strategies with it."""
    domain = load_domain("intention", preset="paper")
    planner = make_planner(domain, progress)
    n, tracks = (FAST_SEEDS, FAST_TRACKS) if options.fast else (SEEDS, TRACKS)
    seeds = range(options.seed, options.seed + n)
    unit = partial(run_seed, domain, planner, tracks=tracks, trials=-(-options.n_trials // 2))
    with progress("training on parts of the trajectories", n) as advance:
        return make_result(run_seeds(unit, seeds, options.jobs, advance), tracks)


def run_seed(domain: Domain, planner: Planner, seed: int, *, tracks: int, trials: int) -> Result:
    """Return part -> result of one training set; all parts are of the same tracks and the same people."""
    sense = domain.senses[0]
    data, found = simulate_training_data(domain, sense, seed, tracks=tracks), {}
    for name, fraction in PARTS.items():
        dataset = truncate(data.dataset, fraction)
        estimator = learner(LEARNER, interval=dataset.interval, inputs=dataset.channels, seed=seed)
        classifier, validation = train_and_validate(estimator, dataset, folds=FOLDS, seed=seed)
        confusion = validation.confusion
        signals = CutSignals(data.signals, slice(dataset.trajectories.shape[2]))
        rates = nest_rates(confusion.classes, confusion.probabilities.tolist())
        setups = {sense.name: SenseSetup(classifier, signals, rates, confusion)}
        robot = compose_robot(domain, setups, policy=planner.policy).robot
        experiment = Experiment(
            domain, robot, {sense.name: classifier}, {sense.name: signals}, strategies(NAMES), seed
        )
        scores, _ = run_trials(experiment, trials)
        recalls = {label: rates[label][label] for label in confusion.classes}
        found[name] = PartResult({row.strategy: row for row in scores}, recalls)
    return found


def make_result(results: Sequence[Result], tracks: int) -> FigureResult:
    """Return the figure of the results, one for each seed."""
    trials = int(results[0]["whole"].scores["LCORPP"].counts.sum())
    scores = collect(
        [
            {
                (part, name): {metric: row.metrics[metric].estimate for metric in METRICS}
                for part in PARTS
                for name, row in result[part].scores.items()
            }
            for result in results
        ]
    )
    return FigureResult(
        name="partial",
        title="Partial motion trajectories",
        table=[
            {
                "part": part,
                "strategy": name,
                "seeds": len(results),
                "trials": trials,
                **make_cells_of_seeds(scores[part, name]),
            }
            for part in PARTS
            for name in NAMES
        ],
        findings=_judge(scores),
        draw=partial(_draw, scores),
        deviations=_deviate(scores, results),
        notes=[
            f"{len(results)} seeds, each with {tracks} simulated training tracks and {trials} people;"
            " intervals are Student's over the seeds, differences are paired.",
            f"Each classifier ({LEARNER}) is trained and cross-validated on the part that it sees; its own"
            " confusion matrix is in the rules."
            f" Recall: {'; '.join(f'{name} {_format_recalls(results, name)}' for name in PARTS)}.",
        ],
        configuration={"domain": "intention", "preset": "paper", "learner": LEARNER, "seeds": len(results)},
    )


def _judge(scores: SeedScores) -> list[Finding]:
    """Decide hypothesis III and the order of the strategies."""
    findings = []
    for part in PARTS:
        learning, both, all_three = (scores[part, name]["f1"] for name in NAMES)
        steps = [subtract(all_three, both), subtract(both, learning)]
        evidence = f"LCORPP - L+R {steps[0]:.3f}, L+R - L {steps[1]:.3f}"
        findings.append(Finding(f"LCORPP > L+R > L in F1, {part}", judge(steps), evidence))
    losses = {
        name: np.subtract(scores["whole", name]["f1"], scores["quarter", name]["f1"]).tolist()
        for name in NAMES
    }
    for name in NAMES:
        loss = compute_seed_interval(losses[name])
        claim = f"{name} has a higher F1 with whole trajectories than with a quarter"
        findings.append(Finding(claim, judge([loss]), f"difference {loss:.3f}"))
    saved = [subtract(losses[name], losses["LCORPP"]) for name in ("L", "L+R")]
    findings.append(
        Finding(
            "Hypothesis III, with a quarter LCORPP loses less F1 than L and L+R",
            judge(saved),
            f"less than L by {saved[0]:.3f}, than L+R by {saved[1]:.3f}",
        )
    )
    more = subtract(scores["quarter", "LCORPP"]["cost"], scores["whole", "LCORPP"]["cost"])
    claim = "LCORPP makes up for it by more actions, so a quarter costs more"
    return [*findings, Finding(claim, judge([more]), f"cost of a quarter - whole {more:.2f}")]


def _deviate(scores: SeedScores, results: Sequence[Result]) -> list[Deviation]:
    """Return our F1 scores beside the published ones."""
    return [
        deviate(
            part,
            f"{name}, F1",
            compute_seed_interval(scores[part, name]["f1"]),
            number,
            compute_standard_error(results[0][part].scores[name], "f1", number),
            "our trajectories are simulated, those of the authors recorded; recall of our classifier,"
            f" {part}: {_format_recalls(results, part)}",
        )
        for name, numbers in published.PARTIAL.items()
        for part, number in numbers.items()
    ]


def _format_recalls(results: Sequence[Result], part: str) -> str:
    means = {
        label: np.mean([result[part].recalls[label] for result in results])
        for label in results[0][part].recalls
    }
    return ", ".join(f"{label} {mean:.2f}" for label, mean in means.items())


@with_style
def _draw(scores: SeedScores, layout: Layout) -> Figure:
    figure, (left, right) = make_panels(layout, (3, 2))
    x = range(len(PARTS))
    for axes, metric, names in ((left, "f1", NAMES), (right, "cost", ("LCORPP",))):
        for name in names:
            intervals = [compute_seed_interval(scores[part, name][metric]) for part in PARTS]
            draw_line(axes, x, intervals, color=COLOURS[name], label=name)
        axes.set_xticks(x, [f"first {part}" if part != "whole" else part for part in PARTS], fontsize=8)
        axes.set_xlim(-0.3, len(PARTS) - 0.7)
        axes.set_ylabel(LABELS[metric])
    for name, numbers in published.PARTIAL.items():
        theirs = [float(numbers[part]) if part in numbers else np.nan for part in PARTS]
        left.plot(x, theirs, **PUBLISHED | {"markeredgecolor": COLOURS[name]})
    left.plot([], [], label="published", **PUBLISHED | {"markeredgecolor": INK})
    left.set_ylim(0.4, 1)
    left.legend(fontsize=8, frameon=False, ncols=2, loc="upper left")
    return figure
