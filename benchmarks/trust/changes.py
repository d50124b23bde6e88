"""LCORPP+trust where an assumption fails: the world changes, or some people are always misheard.

The domain is `intention`, preset `paper`, with right knowledge and answers that are wrong with probability
.3. Either all probabilities of an interest are inverted in the middle of the stream, or visitors lose their
interest there, or some people are always misheard: their answers are understood as the contrary, and are
wrong with probability .7.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Annotated

import numpy as np
import typer
from grid import invert
from joblib import Parallel, delayed

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import strategies
from lcorpp.domains import Domain
from lcorpp.reasoning import Reasoner
from worlds import (
    INTENTION_NUMBERS,
    LIBRARY_NUMBERS,
    RIGHT,
    TIME_NUMBERS,
    World,
    make_domain,
    make_program,
    meet_people,
    score_exactly,
    solve_precisely,
)

NOISE, PEOPLE = 0.3, 2000
CHANGES = {
    "all interests inverted": invert(INTENTION_NUMBERS),
    "visitors lose their interest": {**INTENTION_NUMBERS, "visitor": 0.1},
}
MISHEARD_SHARES = (0.05, 0.1, 0.2)
PARTS = (0, 50, 100, 150, 200, 500, 1000)
"""Limits of the parts of a stream after the change, in people."""


def change_people(domain: Domain, interested: Mapping[str, float]) -> Domain:
    """Return the domain with other people; the robot's program and model remain."""
    text = (domain.folder / "knowledge.plog").read_text()
    truth = make_program(text, (TIME_NUMBERS, LIBRARY_NUMBERS, interested), World(RIGHT, NOISE).rates)
    return replace(domain, simulation=replace(domain.simulation, true_program=truth))


def run_changed(change: str, stream: int, seed: int) -> list[float]:
    """Return the returns of a stream whose people change after half of it."""
    domain = make_domain(World(RIGHT, NOISE))
    trust = set_up_trust(domain, Reasoner(domain.program), solve_precisely(domain))
    rng = np.random.default_rng([seed, list(CHANGES).index(change), stream])
    returns = list(meet_people(domain, trust, PEOPLE // 2, rng))
    return returns + list(meet_people(change_people(domain, CHANGES[change]), trust, PEOPLE // 2, rng))


def run_misheard(share: float, stream: int, seed: int) -> list[float]:
    """Return the returns of a stream in which a share of the people is always misheard."""
    domain = make_domain(World(RIGHT, NOISE))
    trust = set_up_trust(domain, Reasoner(domain.program), solve_precisely(domain))
    rng = np.random.default_rng([seed, len(CHANGES) + MISHEARD_SHARES.index(share), stream])
    return list(meet_people(domain, trust, PEOPLE, rng, make_domain(World(RIGHT, 1 - NOISE)), share))


def score_lcorpp(share: float) -> float:
    """Return the exact mean return of LCORPP if a share of the people is always misheard."""
    heard, misheard = (make_domain(World(RIGHT, noise)) for noise in (NOISE, 1 - NOISE))
    planner, rows = solve_precisely(heard), strategies(["LCORPP"])
    scores = [
        score_exactly(domain, Reasoner(domain.program), planner, rows)["LCORPP"]
        for domain in (heard, misheard)
    ]
    return float((1 - share) * scores[0] + share * scores[1])


def format_mean(returns: np.ndarray) -> str:
    """Return the mean of streams (n, people) with one standard error."""
    means = returns.mean(axis=1)
    return f"{means.mean():.1f} ± {means.std(ddof=1) / len(means) ** 0.5:.1f}"


def main(
    streams: Annotated[int, typer.Option(min=2, help="Streams of each kind.")] = 16,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    jobs: Annotated[int, typer.Option(min=1)] = 1,
) -> None:
    """Print the mean returns after a change, and with people who are always misheard."""
    pool = Parallel(n_jobs=jobs)
    ends = PEOPLE // 2
    print(f"{streams} streams of {PEOPLE} people, seed {seed}; ± is one standard error over the streams\n")
    print(
        "| change after person 1000 | " + " | ".join(f"people {a} to {b}" for a, b in pairwise(PARTS)) + " |"
    )
    print("|---" * len(PARTS) + "|")
    for change in CHANGES:
        returns = np.array(pool(delayed(run_changed)(change, k, seed) for k in range(streams)))
        parts = [returns[:, ends + a : ends + b] for a, b in pairwise(PARTS)]
        print(f"| {change} | " + " | ".join(map(format_mean, parts)) + " |", flush=True)
    print("\n| always misheard | LCORPP+trust | LCORPP (exact) |\n|---|---|---|")
    for share in MISHEARD_SHARES:
        returns = np.array(pool(delayed(run_misheard)(share, k, seed) for k in range(streams)))
        print(f"| {share:.0%} | {format_mean(returns)} | {score_lcorpp(share):.1f} |", flush=True)


if __name__ == "__main__":
    typer.run(main)
