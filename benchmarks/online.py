"""A search at each step against the policy that it begins with, on shopping dialogues of some size.

    python benchmarks/online.py [--sizes 5x5x5,8x8x8] [--dialogues 300] [--seconds 60] [--step-seconds 0.1]

The simulated people are the same for both: the request, and the random number of each answer. Returns are
discounted.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from datetime import date
from pathlib import Path
from time import monotonic
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track

from lcorpp.domains.shopping.interaction import make_model
from lcorpp.files import make_folder, write_atomically
from lcorpp.planning import Pomdp, SolverOptions, solve
from lcorpp.planning.belief import update
from lcorpp.values import Belief

MAX_STEPS = 60
"""Longer dialogues end without a delivery."""


PEERS = """\
Others at 0.1 s a step, mean discounted return ± its standard error, on the same model as POMDPX: DESPOT (its
authors' code; for POMDPX it has trivial bounds alone) earns -16.9 ± 0.3 for 5, 5, 5 (with 5,000 particles
-16.4 ± 0.3) and -17.9 ± 0.2 for 8, 8, 8, in 300 dialogues each, 2026-12-01. pomdp-py 1.3.5.1 with exact
beliefs and uniform rollouts, for 5, 5, 5 in 400 dialogues, 2026-11-30: POMCP -16.9 ± 0.4, POUCT -16.6 ± 0.5.
All of them deliver at once."""


def simulate(pomdp: Pomdp, act: Callable[[Belief], str], seed: int) -> tuple[float, int]:
    """Return the return of a dialogue, and its number of actions."""
    rng = np.random.default_rng(seed)
    state, answers = int(rng.choice(len(pomdp.states), p=pomdp.start)), rng.random(MAX_STEPS)
    belief, total, weight = pomdp.start, 0.0, 1.0
    for step, random in enumerate(answers.tolist(), start=1):
        action = pomdp.action_index(act(belief))
        total += weight * float(pomdp.reward[action, state])
        weight *= pomdp.discount
        if pomdp.actions[action].startswith("deliver"):
            return total, step
        sums = np.cumsum(pomdp.observation[action][state])
        belief = update(pomdp, belief, action, min(int(np.searchsorted(sums, random)), len(sums) - 1))
    return total, MAX_STEPS


def main(
    sizes: Annotated[str, typer.Option(help="Numbers of items, persons and rooms.")] = "5x5x5,8x8x8",
    dialogues: Annotated[int, typer.Option(help="Number of dialogues.")] = 300,
    seconds: Annotated[float, typer.Option(help="Time limit of SARSOP.")] = 60.0,
    step_seconds: Annotated[float, typer.Option(help="As of lcorpp run.")] = 0.1,
    out: Annotated[Path, typer.Option(help="The table.")] = Path("benchmarks/results/online.md"),
) -> None:
    """Measure, then write a table."""
    console = Console(stderr=True)
    lines = [
        "# A search at each step",
        "",
        f"`python benchmarks/online.py --sizes {sizes} --dialogues {dialogues} --seconds {seconds:g}"
        f" --step-seconds {step_seconds:g}`, {date.today()}, {platform.machine()}, {os.cpu_count()} cores,"
        f" Python {platform.python_version()}. Mean discounted return; the difference with its 95 % interval,"
        " paired.",
        "",
        "| items, persons, rooms | states, actions | bounds after SARSOP | its policy"
        " | with a search at each step | difference | seconds a step |",
        "|---|---|---|---|---|---|---|",
    ]
    for size in sizes.split(","):
        counts = [int(count) for count in size.split("x")]
        names = ("item", "person", "room")
        pomdp = make_model({n: [f"{n}{i}" for i in range(k)] for n, k in zip(names, counts, strict=True)})
        solution = solve(pomdp, time_limit=seconds)
        policy = SolverOptions("sarsop").make_planner(solution.policy, pomdp)
        online = SolverOptions("online", step_seconds=step_seconds).make_planner(solution.policy, pomdp)
        returns, steps, began = [], 0, monotonic()
        for seed in track(range(dialogues), size, console=console):
            found, count = simulate(pomdp, online.action, seed)
            returns.append((found, simulate(pomdp, policy.action, seed)[0]))
            steps += count
        table = np.array(returns)
        gains = table[:, 0] - table[:, 1]
        interval = 1.96 * gains.std(ddof=1) / len(gains) ** 0.5
        cells = [
            ", ".join(map(str, counts)),
            f"{len(pomdp.states)}, {len(pomdp.actions)}",
            f"{solution.lower:.2f}, {solution.upper:.2f}",
            f"{table[:, 1].mean():.2f}",
            f"{table[:, 0].mean():.2f}",
            f"{gains.mean():+.2f} ± {interval:.2f}",
            f"{(monotonic() - began) / steps:.2f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
        console.print(lines[-1])
    lines += ["", PEERS.replace("\n", " ")]
    make_folder(out.parent)
    write_atomically(out, "\n".join(lines) + "\n")


if __name__ == "__main__":
    typer.run(main)
