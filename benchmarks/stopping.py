"""When Algorithm 1 stops, and how accurate the rates of the classifier are then: several rules, many seeds.

    OMP_NUM_THREADS=1 python benchmarks/stopping.py [--seeds 50] [--batches 20] [--out TABLE.md]

Each seed runs all batches, and the rules are applied to its confusion matrices afterwards. The limit of the
rates is their mean over the seeds after the last batch.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from lcorpp.assembly import TrainingOptions
from lcorpp.assembly.solving import solve_domain
from lcorpp.decision.stopping import choose_epsilon, compute_change
from lcorpp.domains import load_domain
from lcorpp.files import make_folder, write_atomically
from lcorpp.planning import Planner
from lcorpp.runs import ActiveLearningOptions, run_active_learning, set_up_learning
from lcorpp.values import ConfusionMatrix

RULES = ((0.0, 0.05), (0.0, 0.18), (0.95, 0.25), (0.95, 0.2), (0.95, None), (0.95, 0.15))
"""Confidence and epsilon; with confidence 0 the estimates are compared, as in the paper."""

MAX_RATE_ERROR = 0.05
"""Largest error of a rate that counts as accurate."""

HEADER = """| confidence | epsilon | runs that stop | batch | its CV | both rates within .05 |
|---|---|---|---|---|---|
"""


def main(
    seeds: Annotated[int, typer.Option(min=2)] = 50,
    batches: Annotated[int, typer.Option(min=1)] = 20,
    batch_size: Annotated[int, typer.Option(min=1)] = 100,
    out: Annotated[Path | None, typer.Option(metavar="FILE")] = None,
) -> None:
    """Run the seeds, and print or write a row for each rule."""
    domain = load_domain("intention")
    planner = Planner(solve_domain(domain))

    def learn(seed: int) -> Iterator[ConfusionMatrix]:
        options = ActiveLearningOptions(
            {"motion": TrainingOptions(learner="summaries", tracks=100)},
            batch_size=batch_size,
            epsilon=0,
            max_batches=batches,
            seed=seed,
        )
        for result in run_active_learning(domain, set_up_learning(domain, options), planner, options):
            yield result.batch.senses["motion"].confusion

    table = describe_rules([list(learn(seed)) for seed in range(seeds)])
    if out is None:
        Console().print(table, markup=False, soft_wrap=True)
    else:
        make_folder(out.parent)
        write_atomically(out, table)


def describe_rules(runs: list[list[ConfusionMatrix]]) -> str:
    """Return a Markdown table of the rules. runs: the confusion matrix of each batch, for each seed."""
    limit = np.mean([np.diag(run[-1].probabilities) for run in runs], axis=0)
    rows = []
    for confidence, epsilon in RULES:
        stops = [find_stop(run, confidence, choose_epsilon(epsilon, 2)) for run in runs]
        batches = np.array([stop for stop in stops if stop is not None])
        row = f"| {confidence:g} | {choose_epsilon(epsilon, 2):g} | {len(batches)} of {len(runs)} |"
        if len(batches) < 2:
            rows.append(f"{row} | | |\n")
            continue
        rates = [
            np.diag(run[stop].probabilities)
            for run, stop in zip(runs, stops, strict=True)
            if stop is not None
        ]
        precise = np.mean([np.abs(rate - limit).max() <= MAX_RATE_ERROR for rate in rates])
        variation = batches.std(ddof=1) / batches.mean()
        extent = f"{batches.mean():.1f} ({batches.min()} to {batches.max()})"
        rows.append(f"{row} {extent} | {variation:.2f} | {precise:.2f} |\n")
    return HEADER + "".join(rows)


def find_stop(run: list[ConfusionMatrix], confidence: float, epsilon: float) -> int | None:
    """Return the batch after which a run would have stopped; None if it would not."""
    untrained = ConfusionMatrix(run[0].classes, np.zeros_like(run[0].counts))
    for number, (before, after) in enumerate(zip([untrained, *run], run, strict=False)):
        if compute_change(before, after, confidence).high <= epsilon:
            return number
    return None


if __name__ == "__main__":
    typer.run(main)
