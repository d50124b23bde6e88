"""LCORPP+trust in the domain `shopping`: three shared variables, several values, confusable answers.

The robot's program is wrong about what people like or about their rooms, or right; answers are understood as
stated, or worse. All strategies meet the same people, who answer with the same random numbers, so that
differences are paired.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from time import process_time
from typing import Annotated

import numpy as np
import typer
from joblib import Parallel, delayed

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import Robot, dt_control, strategies
from lcorpp.domains import Domain, load_domain
from lcorpp.planning import Planner, solve
from lcorpp.reasoning import Program, Reasoner, parse_plog
from lcorpp.simulation.people import Population
from lcorpp.simulation.table_dynamics import SimulationModel
from lcorpp.values import Instance

STATED = ("P", "R+P")
WRONG = {
    "right": {},
    "likes wrong": {"sandwich": "coffee", "coffee": "notebook", "notebook": "sandwich"},
    "rooms wrong": {"office": "lab", "lab": "workshop", "workshop": "office"},
}
"""Values that are exchanged in the rules about what people like and where they are."""
SMALL_WRONG = {
    "right": {},
    "likes wrong": {"sandwich": "coffee", "coffee": "sandwich"},
    "rooms wrong": {"office": "lab", "lab": "office"},
}
NOISES = (0.0, 0.4)
"""Shares of the answers that are replaced by one that is independent of the request."""


def make_program(text: str, changes: dict[str, str]) -> Program:
    """Return the program with the values exchanged in the heads of its rules."""
    lines = []
    for line in text.splitlines():
        if line.startswith(("likes(", "own_room(", "expected(")) and "=R " not in line:
            for old, new in changes.items():
                line = line.replace(f"={old}", f"=@{new}")
        lines.append(line.replace("@", ""))
    return parse_plog("\n".join(lines))


def make_domain(preset: str, knowledge: str, noise: float) -> Domain:
    """Return the domain: the robot's program may be wrong; people are as the original one states."""
    domain = load_domain("shopping", preset=preset)
    text = (domain.folder / ("small.plog" if preset == "small" else "knowledge.plog")).read_text()
    program = make_program(text, (SMALL_WRONG if preset == "small" else WRONG)[knowledge])
    feedback = domain.simulation.feedback_model.copy()
    for rows in feedback:
        alive = rows[:, -1] < 1  # not after the delivery
        if alive.any():
            rows[alive] = (1 - noise) * rows[alive] + noise * rows[alive].mean(axis=0)
    return replace(
        domain,
        reasoning=replace(domain.reasoning, program=program),
        simulation=replace(
            domain.simulation, feedback_model=feedback, true_program=domain.simulation.true_program
        ),
    )


def meet_people(
    domain: Domain,
    make_robot: Callable[[], Robot],
    people: int,
    seed: list[int],
    learn: Callable[..., None] | None = None,
) -> list[float]:
    """Return the return of each person; person and answers depend on the seed and the number alone."""
    crowd = Population(domain).sample(people, np.random.default_rng(seed))
    model, returns = SimulationModel(domain), []
    for i, person in enumerate(crowd):
        world = model.make_world(person, np.random.default_rng([*seed, i]))
        episode = dt_control(
            make_robot(), Instance({}, {name: person[name] for name in domain.observed}), world
        )
        if learn is not None:
            learn(episode.evidence, episode.steps)
        returns.append(world.return_)
    return returns


def run_stream(
    planner: Planner, preset: str, knowledge: str, noise: float, people: int, seed: list[int]
) -> tuple[dict[str, list[float]], float]:
    """Return the returns of each strategy on the same people, and the CPU time of trust."""
    domain = make_domain(preset, knowledge, noise)
    reasoner, returns = Reasoner(domain.program), dict[str, list[float]]()
    full = Robot({}, reasoner, planner, domain)
    for strategy in strategies(STATED):
        returns[strategy.name] = meet_people(domain, partial(strategy.robot, full), people, seed)
    began = process_time()
    trust = set_up_trust(domain, reasoner, planner)
    returns["trust"] = meet_people(
        domain, lambda: Robot({}, trust, trust.make_planner(), domain), people, seed, trust.learn
    )
    return returns, process_time() - began


def main(
    streams: Annotated[int, typer.Option(min=2, help="Streams of each world.")] = 4,
    people: Annotated[int, typer.Option(min=10, help="People of a stream.")] = 600,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    jobs: Annotated[int, typer.Option(min=1)] = 1,
    preset: Annotated[
        str, typer.Option(help="small, office or both, separated by a comma.")
    ] = "small,office",
) -> None:
    """Print the mean returns and the paired differences to the better of P and R+P."""
    print(f"{streams} streams of {people} people, seed {seed}; ± is one standard error over all people")
    print("\n| preset | knowledge | noise | P | R+P | LCORPP+trust | minus the better | ms a person |")
    print("|---|---|---|---|---|---|---|---|")
    pool = Parallel(n_jobs=jobs)
    for name in preset.split(","):
        domain = load_domain("shopping", preset=name)
        planner = Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.1, time_limit=30))
        for number, (knowledge, noise) in enumerate(product(WRONG, NOISES)):
            runs = pool(
                delayed(run_stream)(planner, name, knowledge, noise, people, [seed, number, k])
                for k in range(streams)
            )
            returns = {row: np.concatenate([run[0][row] for run in runs]) for row in (*STATED, "trust")}
            means = {row: float(own.mean()) for row, own in returns.items()}
            better = max(STATED, key=lambda row: means[row])
            difference = returns["trust"] - returns[better]
            error = difference.std(ddof=1) / len(difference) ** 0.5
            cpu = 1e3 * sum(run[1] for run in runs) / (streams * people)
            print(
                f"| {name} | {knowledge} | {noise:g} | {means['P']:.2f} | {means['R+P']:.2f} |"
                f" {means['trust']:.2f} | {difference.mean():+.2f} ± {error:.2f} | {cpu:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    typer.run(main)
