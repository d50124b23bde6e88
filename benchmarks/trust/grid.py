"""LCORPP+trust with wrong knowledge, wrong rates and noisier answers than stated, in the domain `intention`.

    OMP_NUM_THREADS=1 python benchmarks/trust/grid.py [--streams 2] [--people 2000] [--cells N] [--seed 0]
        [--jobs 2] [--rates known|misstated] [--no-hearing] [--out FOLDER]

A cell of the grid is the knowledge (right, or wrong in seven ways), the rate of wrong answers, the classifier
and the costs of the actions; the planner's observation model stays as stated (noise .1 and .2). With --rates
known the program states the classifier's true rates; with --rates misstated it states .76 and .29, and the
true ones are others. Each cell gives the mean return over streams of people, one after another, beside the
exact returns of P, R+P, L+P and LCORPP and of the omniscient robot, LCORPP with the true program, rates and
noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from csv import DictWriter
from dataclasses import asdict, dataclass
from enum import StrEnum
from io import StringIO
from itertools import product
from pathlib import Path
from time import process_time
from typing import Annotated, Any

import matplotlib.pyplot as plt
import numpy as np
import typer
from joblib import Parallel, delayed

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import strategies
from lcorpp.files import make_folder, write_atomically
from lcorpp.reasoning import Reasoner
from worlds import (
    BASELINES,
    INTENTION_NUMBERS,
    LIBRARY_NUMBERS,
    RIGHT,
    STATED_RATES,
    TIME_NUMBERS,
    Numbers,
    World,
    make_domain,
    meet_people,
    score_exactly,
    solve_precisely,
)

KNOWN_RATES = ((0.5, 0.5), (0.6, 0.4), STATED_RATES, (0.9, 0.1))
"""True rates that are also the stated ones."""
MISSTATED_RATES = ((0.5, 0.5), (0.594, 0.119), (0.29, 0.76))
"""True rates while `STATED_RATES` are stated."""
NOISES = (0.1, 0.2, 0.3, 0.4)
COST_FACTORS = {"stated": 1.0, "half": 0.5, "double": 2.0}


def swap(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Exchange the numbers of professor and visitor."""
    return {**numbers, "professor": numbers["visitor"], "visitor": numbers["professor"]}


def invert(numbers: Mapping[str, float]) -> dict[str, float]:
    """Replace each probability by that of the contrary."""
    return {identity: 1 - p for identity, p in numbers.items()}


KNOWLEDGE: Mapping[str, Numbers] = {
    "right": RIGHT,
    "no locations": (TIME_NUMBERS, dict.fromkeys(LIBRARY_NUMBERS, 0.5), INTENTION_NUMBERS),
    "no times": (dict.fromkeys(TIME_NUMBERS, (1 / 3, 1 / 3)), LIBRARY_NUMBERS, INTENTION_NUMBERS),
    "vague": (
        TIME_NUMBERS,
        LIBRARY_NUMBERS,
        {identity: (p + 0.4) / 2 for identity, p in INTENTION_NUMBERS.items()},
    ),
    "swapped": (TIME_NUMBERS, LIBRARY_NUMBERS, swap(INTENTION_NUMBERS)),
    "inverted": (TIME_NUMBERS, LIBRARY_NUMBERS, invert(INTENTION_NUMBERS)),
    "times swapped": (swap(TIME_NUMBERS), LIBRARY_NUMBERS, INTENTION_NUMBERS),
    "locations inverted": (TIME_NUMBERS, invert(LIBRARY_NUMBERS), INTENTION_NUMBERS),
}


class Rates(StrEnum):
    """Whether the program states the classifier's true rates."""

    known = "known"
    misstated = "misstated"


@dataclass(frozen=True)
class Cell:
    """knowledge, costs: names. rates: the true ones of the classifier; stated: those in the program."""

    knowledge: str
    noise: float
    rates: tuple[float, float]
    stated: tuple[float, float]
    costs: str


def run_cell(
    cell: Cell, number: int, streams: int, people: int, seed: int, hearing: bool
) -> dict[str, float]:
    """Return the mean returns of the strategies in a cell, of trust also its standard error."""
    began = process_time()
    world = World(KNOWLEDGE[cell.knowledge], cell.noise, cell.rates, cell.stated, COST_FACTORS[cell.costs])
    domain, omniscient = make_domain(world), make_domain(world, omniscient=True)
    planner, reasoner = solve_precisely(domain), Reasoner(domain.program)
    result = score_exactly(domain, reasoner, planner, strategies(BASELINES))
    best = score_exactly(
        omniscient, Reasoner(omniscient.program), solve_precisely(omniscient), strategies(["LCORPP"])
    )
    result["omniscient"] = best["LCORPP"]
    returns = np.array(
        [
            list(
                meet_people(
                    domain,
                    set_up_trust(domain, Reasoner(domain.program), planner, hearing=hearing),
                    people,
                    np.random.default_rng([seed, number, k]),
                )
            )
            for k in range(streams)
        ]
    )
    result |= {"trust": returns.mean(), "se": returns.std() / returns.size**0.5}
    return result | {"late": returns[:, -people // 5 :].mean(), "cpu": process_time() - began}


def describe(cells: Sequence[Cell], results: Sequence[Mapping[str, float]], options: str) -> str:
    """Return the table: margins over the best of the four strategies, and regret to the omniscient robot."""
    trust, se = (np.array([result[name] for result in results]) for name in ("trust", "se"))
    best = np.array([max(result[name] for name in BASELINES) for result in results])
    regret = trust - np.array([result["omniscient"] for result in results])
    noise = np.array([cell.noise for cell in cells])
    lines = [
        f"{options}; {sum(result['cpu'] for result in results):.0f} s of CPU",
        "",
        "| noise | cells | worst margin over the best of four | mean margin | cells below 0 | by two s.e."
        " | worst regret | mean regret |",
        "|---|---|---|---|---|---|---|---|",
    ]
    margin = trust - best
    for name, chosen in [(f"{n:g}", noise == n) for n in NOISES] + [("all", noise > 0)]:
        if chosen.any():
            own = margin[chosen]
            certain = (own < -2 * se[chosen]).sum()
            lines.append(
                f"| {name} | {chosen.sum()} | {own.min():+.2f} | {own.mean():+.2f} | {(own < 0).sum()} |"
                f" {certain} | {regret[chosen].min():+.2f} | {regret[chosen].mean():+.2f} |"
            )
    worst = [int(i) for i in np.argsort(margin)[:5]]
    lines += ["", "The five smallest margins:", ""]
    lines += [f"- {margin[i]:+.2f} ± {se[i]:.2f}: {cells[i]}" for i in worst]
    return "\n".join(lines) + "\n"


def write_csv(cells: Sequence[Cell], results: Sequence[Mapping[str, float]], file: Path) -> None:
    """Write a row for each cell, so that streams of several runs can be pooled."""
    rows = [{**asdict(cell), **result} for cell, result in zip(cells, results, strict=True)]
    text = StringIO()
    writer = DictWriter(text, list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(file, text.getvalue().encode())


def draw(cells: Sequence[Cell], results: Sequence[Mapping[str, float]], file: Path) -> None:
    """Draw heat maps by knowledge and noise: smallest margin over the best of four, and largest regret."""
    margin = {cell: r["trust"] - max(r[n] for n in BASELINES) for cell, r in zip(cells, results, strict=True)}
    regret = {cell: r["trust"] - r["omniscient"] for cell, r in zip(cells, results, strict=True)}
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, layout="constrained")
    titles = ("Smallest return minus\nthe best of P, R+P, L+P, LCORPP", "Smallest return minus\nomniscient")
    for axis, values, title, limit in zip(axes, (margin, regret), titles, (20, 20), strict=True):
        table = np.full((len(KNOWLEDGE), len(NOISES)), np.nan)
        for cell, value in values.items():
            place = list(KNOWLEDGE).index(cell.knowledge), NOISES.index(cell.noise)
            table[place] = np.fmin(table[place], value)
        image = axis.imshow(table, cmap="RdBu", vmin=-limit, vmax=limit, aspect="auto")
        for (i, k), value in np.ndenumerate(table):
            colour = "white" if abs(value) > limit / 2 else "black"
            text = "" if np.isnan(value) else f"{value:+.1f}"
            axis.text(k, i, text, ha="center", va="center", fontsize=8, color=colour)
        axis.set(title=title, xlabel="rate of wrong answers")
        axis.set_xticks(range(len(NOISES)), [f"{noise:g}" for noise in NOISES])
        axis.set_yticks(range(len(KNOWLEDGE)), list(KNOWLEDGE))
        figure.colorbar(image, ax=axis, label="return")
    axes[0].set_ylabel("knowledge")
    figure.savefig(file, dpi=150)


def main(
    streams: Annotated[int, typer.Option(min=1, help="Streams a cell.")] = 2,
    people: Annotated[int, typer.Option(min=5, help="People a stream.")] = 2000,
    cells: Annotated[int, typer.Option(min=0, help="Cells, drawn at random; 0 takes all.")] = 0,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    jobs: Annotated[int, typer.Option(min=1)] = 1,
    rates: Annotated[Rates, typer.Option(help="The program's rates of the classifier.")] = Rates.known,
    hearing: Annotated[bool, typer.Option(help="Policies for the estimated noise.")] = True,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER")] = None,
) -> None:
    """Run the grid; print the table, and write it with heat maps."""
    pairs = (
        [(r, r) for r in KNOWN_RATES]
        if rates == Rates.known
        else [(r, STATED_RATES) for r in MISSTATED_RATES]
    )
    grid = [Cell(k, n, *r, c) for k, n, r, c in product(KNOWLEDGE, NOISES, pairs, COST_FACTORS)]
    if cells:
        chosen = np.random.default_rng([seed, 1]).permutation(len(grid))[:cells]
        grid = [grid[i] for i in sorted(chosen)]
    calls = (delayed(run_cell)(cell, i, streams, people, seed, hearing) for i, cell in enumerate(grid))
    results = list(Parallel(n_jobs=jobs, verbose=5)(calls))
    options = f"{len(grid)} cells, {rates} rates, {streams} streams of {people} people, seed {seed}"
    table = describe(grid, results, options + ("" if hearing else ", the stated policy"))
    print(table)
    if out is not None:
        make_folder(out)
        write_atomically(out / "trust.md", table.encode())
        write_csv(grid, results, out / "trust.csv")
        draw(grid, results, out / "trust.png")


if __name__ == "__main__":
    typer.run(main)
