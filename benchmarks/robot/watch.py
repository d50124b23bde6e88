"""`watch` as an action: exact returns of the policy that decides when enough is seen, and of other rules.

    OMP_NUM_THREADS=1 python benchmarks/robot/watch.py [--seeds 3] [--people 500] [--preset paper]
        [--cost .25 --cost 1 --cost 4] [--out TABLE.md] [--picture FILE.svg]

Each seed trains a classifier on simulated people and scores all rules on others. See
`lcorpp.early_decision.comparison` for the rules.
"""

from __future__ import annotations

import platform
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path
from time import perf_counter
from typing import Annotated

import numpy as np
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console

from lcorpp.assembly.solving import solve_domain
from lcorpp.domains import Domain, load_domain
from lcorpp.early_decision.comparison import (
    choose_best,
    score_rules,
    score_watching,
    simulate_study,
)
from lcorpp.early_decision.extension import WATCH, extend_domain
from lcorpp.early_decision.stream_model import StreamModel, fit_stream_model
from lcorpp.files import make_folder, write_atomically
from lcorpp.planning import Planner, SparseTables
from lcorpp.plot_style import BLUE, COLOURS, INK, MUTED, ORANGE, despine, save_figure, with_style
from lcorpp.values import Array, Distribution

SIZES = ((2, 2), (2, 4), (4, 4), (6, 3), (6, 4), (6, 6), (8, 4))
"""Numbers of stages and bins of the sensitivity."""

PRIORS = (0.5, 0.27)
"""Of the figure: a probability of interest without facts, and one with an unlikely person."""

DRAWN_COST = 0.25
"""Cost of a second in the figure's plans."""

MEASURED_COSTS = (1.0, 2.0, 4.0)
"""Costs with the true answers; at lower ones the policy takes a minute to solve, as long dialogues pay."""

RULES = ("never", "quarter", "whole", "one age", "trigger")


def main(
    seeds: Annotated[int, typer.Option(help="Number of seeds.")] = 3,
    first: Annotated[int, typer.Option(help="The first seed.")] = 1,
    people: Annotated[int, typer.Option(help="Held-out people of each seed.")] = 500,
    preset: Annotated[list[str], typer.Option(help="Presets of the domain.")] = ["paper", "authors"],  # noqa: B006
    cost: Annotated[list[float], typer.Option(help="Of a second.")] = [0.25, 0.5, 1.0, 2.0, 4.0],  # noqa: B006
    out: Annotated[Path | None, typer.Option(help="Write the tables there, in Markdown.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Draw the figure there.")] = None,
) -> None:
    """Measure, print the tables and write them to `--out`."""
    console, lines = Console(width=160), list[str]()

    def show(*rows: str) -> None:
        lines.extend(rows)
        for row in rows:
            console.print(row, markup=False)

    curves: dict[str, dict[float, float]] = defaultdict(dict)
    settings = [(name, False) for name in preset] + [(preset[0], True)]
    for number, (name, is_measured) in enumerate(settings):
        domain = load_domain("intention", preset=name)
        if is_measured:  # the planner's model of the answers is the true one
            pomdp = replace(domain.pomdp, observation=SparseTables.of(domain.simulation.feedback_model))
            domain = replace(domain, planning=replace(domain.planning, model=pomdp))
        is_first = number == 0
        studies = [simulate_study(domain, seed, people=people) for seed in range(first, first + seeds)]
        rules = [score_rules(study) for study in studies]
        show(
            "",
            f"## Preset {name}{', with the true answers in the planner model' * is_measured}",
            "",
            "| cost of a second | policy | seconds watched | "
            + " | ".join(f"minus {rule}" for rule in RULES)
            + " |",
            "|" + "---|" * (len(RULES) + 3),
        )
        for each in [own for own in cost if not is_measured or own in MEASURED_COSTS]:
            scored = [score_watching(study, each) for study in studies]
            own = np.concatenate([one.subtract_cost(each) for one in scored])
            seconds = np.concatenate([one.seconds for one in scored]).mean()
            cells = [f"{each:g}", f"{own.mean():.2f}", f"{seconds:.2f}"]
            for rule in RULES:
                other = np.concatenate([choose_best(one[rule], each) for one in rules])
                cells.append(format_difference(own - other))
                if is_first:
                    curves[rule][each] = float(other.mean())
            if is_first:
                curves["policy"][each] = float(own.mean())
            show("| " + " | ".join(cells) + " |")
        if is_first:
            study = studies[0]
            show("", "Seed by seed, cost 1, policy minus quarter, minus whole:", "")
            for seed, (one, found) in enumerate(zip(studies, rules, strict=True), first):
                own = score_watching(one, 1.0).subtract_cost(1.0)
                parts = [
                    format_difference(own - choose_best(found[key], 1.0)) for key in ("quarter", "whole")
                ]
                show(f"- seed {seed}: {parts[0]}, {parts[1]}")
            show(
                "",
                "| stages | bins | states | seconds | return, cost 1 | cost .25 |",
                "|" + "---|" * 6,
            )
            for stages, bins in SIZES:
                began = perf_counter()
                returns = score_watching(study, 1.0, stages=stages, bins=bins).subtract_cost(1.0).mean()
                spent = perf_counter() - began
                cheap = score_watching(study, 0.25, stages=stages, bins=bins).subtract_cost(0.25).mean()
                states = len(domain.pomdp.states) + 2 * (1 + stages * bins)
                show(f"| {stages} | {bins} | {states} | {spent:.2f} | {returns:.2f} | {cheap:.2f} |")
            kept = score_rules(study, discount=None)
            returns = score_watching(study, 1.0, discount=None).subtract_cost(1.0)
            parts = [f"{rule} {choose_best(kept[rule], 1.0).mean():.2f}" for rule in RULES]
            show(
                "",
                f"With the domain's discount, {domain.pomdp.discount:g}, for all (seed {first}, cost 1):"
                f" policy {returns.mean():.2f}, {', '.join(parts)}.",
            )
            if picture is not None:
                make_folder(picture.parent)
                save_figure(draw(domain, fit_stream_model(study.timeline), curves), picture)
    if out is not None:
        head = (
            "# `watch` as an action\n\n"
            f"`python benchmarks/robot/watch.py --seeds {seeds} --first {first} --people {people}`,"
            f" {date.today()}, {platform.machine()}, Python {platform.python_version()}, one core."
            f" {seeds * people} held-out simulated people a preset; returns are exact over their answers;"
            " paired differences with 95 % intervals over people. `summaries` in a prefix ensemble, 1600"
            " training tracks. Every rule but the policy is the best of its variants in hindsight.\n"
        )
        make_folder(out.parent)
        write_atomically(out, head + "\n".join(lines) + "\n")


def format_difference(difference: Array) -> str:
    """Return the mean with its 95 % interval."""
    radius = 1.96 * difference.std(ddof=1) / np.sqrt(len(difference))
    return f"{difference.mean():+.2f} ± {radius:.2f}"


@with_style
def draw(domain: Domain, stream: StreamModel, curves: Mapping[str, Mapping[float, float]]) -> Figure:
    """Draw when the policy stops watching, for two priors, and the return of all rules by the cost."""
    figure = Figure(figsize=(10, 3.4), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    extended = extend_domain(domain, stream, cost=DRAWN_COST)
    planner = Planner(solve_domain(extended, any_prior=True))
    for axes, prior in ((left, PRIORS[0]), (middle, PRIORS[1])):
        draw_plan(axes, extended, planner, stream, prior)
    left.set_ylabel("P(interested | bin), before the prior")
    left.legend(frameon=False, fontsize=7, loc="upper left")
    looks = zip(("policy", *RULES), (ORANGE, MUTED, BLUE, COLOURS[0], INK, COLOURS[3]), strict=True)
    for name, colour in looks:
        points = sorted(curves[name].items())
        right.plot(*zip(*points, strict=True), marker="o", markersize=3, color=colour, label=name)
    right.set(xscale="log", xlabel="cost of a second", ylabel="exact return", xticks=[0.25, 0.5, 1, 2, 4])
    right.set_xticklabels(["¼", "½", "1", "2", "4"])
    right.minorticks_off()
    right.set_ylim(bottom=max(right.get_ylim()[0], 35))
    right.legend(frameon=False, fontsize=7, loc="lower left")
    despine(right)
    return figure


def draw_plan(axes: Axes, extended: Domain, planner: Planner, stream: StreamModel, prior: float) -> None:
    """Draw each stage and bin that the policy reaches from a prior, and what it does there."""
    column = extended.values.index("interested")
    weights = np.full(2, 1 - prior)
    weights[column] = prior
    belief = extended.prior(Distribution(extended.values, weights))
    rates, waiting = stream.first, [(belief, -1)] if planner.action(belief) == WATCH else []
    interested = stream.classes.index("interested")
    seen: dict[tuple[float, float], set[bool]] = defaultdict(set)
    for stage, age in enumerate(stream.seconds):
        if stage:
            rates = np.einsum("cb,cbd->cd", rates, stream.steps[stage - 1])
        after = []
        for old, before in waiting:
            for number in range(stream.n_bins):
                if before >= 0 and stream.steps[stage - 1, :, before, number].max() < 0.01:
                    continue  # hardly ever
                new = planner.update(old, WATCH, f"bin_{number + 1}")
                goes_on = planner.action(new) == WATCH
                seen[age, rates[interested, number] / rates[:, number].sum()].add(goes_on)
                if goes_on:
                    after.append((new, number))
        waiting = after
    groups = (
        (({True}), "watches on", ORANGE),
        ({False}, "stops", BLUE),
        ({True, False}, "by the bins before", INK),
    )
    for kind, label, colour in groups:
        points = [point for point, kinds in seen.items() if kinds == kind]
        if points:
            axes.plot(*zip(*points, strict=True), "o", color=colour, markersize=6, label=label)
    if not seen:
        axes.text(0.5, 0.5, "never watches", transform=axes.transAxes, ha="center", color=MUTED)
    axes.set(xscale="log", xlabel="age of the track, s", xlim=(0.25, 14), ylim=(0, 1))
    axes.set_xticks(stream.seconds, [f"{age:.2g}" for age in stream.seconds])
    axes.minorticks_off()
    axes.set_title(f"prior {prior:.2f}, cost {DRAWN_COST:g} a second", fontsize=9)
    despine(axes)


if __name__ == "__main__":
    typer.run(main)
