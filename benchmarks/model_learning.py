"""Models learnt from episodes: what the learnt policy earns, as a share of what the true model's policy does.

    python benchmarks/model_learning.py [--seeds 5] [--jobs 2]

Beside it plain Baum-Welch with the true number of states: the best of five random starts, all numbers free.
The share is (return - always report) / (return of the true model's policy - always report), where "always
report" is the best of the actions that end or reward at once. Returns are of 10,000 simulated episodes. The
return's 95 % interval is that of `lcorpp model`; an observation that was never recorded leaves a policy
without a belief: such a data set has the share -inf, and is not counted for the interval.
"""

from __future__ import annotations

import os
import platform
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from datetime import date
from functools import cache
from pathlib import Path
from time import process_time
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from lcorpp import load_domain
from lcorpp.domains.shopping.interaction import make_model
from lcorpp.files import make_folder, write_atomically
from lcorpp.model_learning import Episodes, LearntModel, Step, estimate_return, learn_model
from lcorpp.model_learning.baum_welch import Parameters, Prior
from lcorpp.model_learning.spaces import Space
from lcorpp.model_learning.structure import MOVES, Model, Structure, fit
from lcorpp.planning import Policy, Pomdp, SparseTables, parse_pomdp, simulate, solve
from lcorpp.planning.belief import update
from lcorpp.planning.evaluation.mdp import zero_reward_states

REPORTS = {
    "intention": "report_{intention}",
    "museum": "wish: give_tour=tour, give_directions=directions, stay_away=nothing",
}
"""Reports of domains, as of `lcorpp model --reports`."""

MAX_STEPS = 20
"""Steps of an episode that does not end before."""

EXPLORATION = 0.2
"""Share of random actions in episodes of the shipped policy."""

TIGER = """
discount: 0.95
values: reward
states: left right
actions: listen open_left open_right
observations: hear_left hear_right
T: listen identity
T: open_left uniform
T: open_right uniform
O: listen
0.85 0.15
0.15 0.85
O: open_left uniform
O: open_right uniform
R: listen : * : * : * -1
R: open_left : left : * : * -100
R: open_left : right : * : * 10
R: open_right : left : * : * 10
R: open_right : right : * : * -100
"""


def make_light_maze() -> Pomdp:
    """Return the maze of Littman, A tutorial on partially observable Markov decision processes, 2009."""
    places = ("start", "branch", "left", "right")
    states = (*(f"{place}_{side}" for side in ("left", "right") for place in places), "done")
    actions, observations = ("forward", "left", "right", "lookup"), (*places, "red", "green")
    transition = np.tile(np.eye(9), (4, 1, 1))
    observation, reward = np.zeros((4, 9, 6)), np.zeros((4, 9))
    for s in range(8):
        observation[:, s, s % 4] = 1
    observation[:, 8, 0] = 1
    for side, first in enumerate((0, 4)):
        for action, before, after in ((0, 0, 1), (1, 1, 2), (2, 1, 3)):
            transition[action, first + before] = np.eye(9)[first + after]
        transition[0, first + 2 : first + 4] = np.eye(9)[8]
        reward[0, first + 2 : first + 4] = (1, -1) if side == 0 else (-1, 1)
        observation[3, first] = np.eye(6)[4 + side]
    start = np.zeros(9)
    start[[0, 4]] = 0.5
    return Pomdp(
        states,
        actions,
        observations,
        SparseTables.of(transition),
        SparseTables.of(observation),
        reward,
        0.95,
        start,
    )


@dataclass(frozen=True)
class Case:
    """A true model with its policy, what always reporting earns, and the pattern of its reports."""

    pomdp: Pomdp
    policy: Policy
    value: float
    floor: float
    reports: str | None


@cache
def make_case(name: str) -> Case:
    """Return a model by its name."""
    reports = None
    if name == "tiger":
        pomdp = parse_pomdp(TIGER)
    elif name == "light maze":
        pomdp = make_light_maze()
    elif name == "shopping 2x2x2":
        values = {variable: [f"{variable}{i}" for i in range(2)] for variable in ("item", "person", "room")}
        pomdp, reports = make_model(values), "deliver_{item}_{person}_{room}"
    else:
        pomdp, reports = load_domain(name).pomdp, REPORTS[name]
    solution = solve(pomdp, time_limit=10, precision=0.01)
    at_once = (pomdp.reward @ pomdp.start)[pomdp.reward.min(axis=1) < pomdp.reward.min(axis=1).max()]
    floor = 0.0 if name == "light maze" else float(at_once.max())
    return Case(pomdp, solution.policy, earn(pomdp, solution.policy, pomdp), floor, reports)


def earn(model: Pomdp, policy: Policy, world: Pomdp) -> float:
    """Return what a policy for a model earns in a world."""
    return float(simulate(model, policy, world=world, trials=10_000, steps=200, seed=0).mean)


def record(case: Case, count: int, seed: int, exploration: float) -> Episodes:
    """Return recorded episodes."""
    pomdp, rng = case.pomdp, np.random.default_rng(seed)
    over, episodes, ended = zero_reward_states(pomdp), list[list[Step]](), list[bool]()
    while len(episodes) < count:
        state, belief, steps = int(rng.choice(len(pomdp.states), p=pomdp.start)), pomdp.start, list[Step]()
        while len(steps) < MAX_STEPS and not over[state]:
            is_random = rng.random() < exploration
            action = int(rng.integers(len(pomdp.actions))) if is_random else case.policy.action(belief)
            reward = float(pomdp.reward[action, state])
            state = int(rng.choice(len(pomdp.states), p=pomdp.transition[action][state]))
            seen = int(rng.choice(len(pomdp.observations), p=pomdp.observation[action][state]))
            steps.append(Step(pomdp.actions[action], pomdp.observations[seen], reward))
            belief = update(pomdp, belief, action, seen)
        episodes.append(steps)
        ended.append(bool(over[state]))
    return Episodes.of(episodes, ended)


def match_world(world: Pomdp, learnt: Pomdp) -> Pomdp | None:
    """Return the world in the learnt order of names, without actions that were never recorded.

    None if an observation was never recorded, as a policy has no belief after it.
    """
    if set(world.observations) != set(learnt.observations):
        return None
    actions = [world.actions.index(name) for name in learnt.actions]
    observations = [world.observations.index(name) for name in learnt.observations]
    return Pomdp(
        world.states,
        learnt.actions,
        learnt.observations,
        SparseTables.of(np.array([world.transition[a] for a in actions])),
        SparseTables.of(np.array([world.observation[a][:, observations] for a in actions])),
        world.reward[actions],
        world.discount,
        world.start,
    )


def learn_plainly(episodes: Episodes, case: Case, seed: int) -> LearntModel:
    """Return the best of five runs of Baum-Welch from random numbers."""
    rng = np.random.default_rng(seed)
    A, K = len(episodes.action_names), int((~zero_reward_states(case.pomdp)).sum())
    space = Space.unknown(episodes)
    pseudo = Prior.of(episodes, steps=(0.01, 0.01, 0.01)).pseudo_counts(K, space)
    structure = Structure.free(
        space, np.zeros(K, dtype=np.intp), np.full(A, MOVES), len(episodes.observation_names)
    )

    def start() -> Model:
        tables = (pseudo.start, pseudo.transition, pseudo.observation, pseudo.reward)
        drawn = [rng.dirichlet(np.ones(table.shape[-1]), size=table.shape[:-1]) for table in tables]
        return fit(episodes, Parameters(*drawn), structure, pseudo)

    best = max((start() for _ in range(5)), key=lambda own: own.log_likelihood)
    return LearntModel(
        episodes, space, best, tuple(f"s{k}" for k in range(K)), case.pomdp.discount, (best.parameters,), None
    )


@dataclass(frozen=True)
class Measured:
    """The shares of the learnt model and of plain Baum-Welch, and the CPU seconds of learning and evaluating.

    covers: whether the interval contains the return; None if the policy has no belief after an observation.
    """

    share: float
    plain: float
    seconds: float
    covers: bool | None


def measure(name: str, count: int, exploration: float, seed: int) -> Measured:
    """Learn from recorded episodes, and plan, evaluate and simulate the policy."""
    case = make_case(name)
    episodes = record(case, count, seed, exploration)
    began = process_time()
    learnt = learn_model(episodes, reports=case.reports, discount=case.pomdp.discount, seed=seed)
    found = estimate_return(learnt, seconds=5)
    seconds = process_time() - began
    plain = learn_plainly(episodes, case, seed)
    shares, covers = list[float](), None
    for own, policy in ((learnt, found.solution.policy), (plain, solve(plain.pomdp, time_limit=5).policy)):
        world = match_world(case.pomdp, own.pomdp)
        earned = -np.inf if world is None else earn(own.pomdp, policy, world)
        shares.append((earned - case.floor) / (case.value - case.floor))
        if own is learnt and world is not None:
            covers = bool(found.low <= earned <= found.high)
    return Measured(shares[0], shares[1], seconds, covers)


def main(
    names: Annotated[
        str, typer.Option("--models", help="Names.")
    ] = "tiger,light maze,intention,shopping 2x2x2,museum",
    counts: Annotated[str, typer.Option(help="Numbers of episodes.")] = "50,200,1000",
    seeds: Annotated[int, typer.Option(help="Number of seeds.")] = 5,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
    out: Annotated[Path, typer.Option(help="The table.")] = Path("benchmarks/results/model-learning.md"),
) -> None:
    """Measure, then write a table."""
    console = Console(stderr=True)
    lines = [
        "# Models learnt from episodes",
        "",
        f"`python benchmarks/model_learning.py --models '{names}' --counts {counts} --seeds {seeds}`,"
        f" {date.today()}, {platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}."
        f" Medians of {seeds} seeds; in brackets the smallest share. Episodes have at most"
        f" {MAX_STEPS} steps.",
        "",
        "| model | episodes | actions | share | plain Baum-Welch | interval has the return | CPU seconds |",
        "|---|---|---|---|---|---|---|",
    ]
    with ProcessPoolExecutor(jobs) as pool:
        for name in names.split(","):
            for exploration, kind in ((1.0, "random"), (EXPLORATION, "shipped policy")):
                for count in map(int, counts.split(",")):
                    work = [pool.submit(measure, name, count, exploration, seed) for seed in range(seeds)]
                    found = [own.result() for own in work]
                    share, plain, seconds = (
                        np.array([getattr(own, column) for own in found])
                        for column in ("share", "plain", "seconds")
                    )
                    covers = [own.covers for own in found if own.covers is not None]
                    line = (
                        f"| {name} | {count} | {kind} | {np.median(share):.3f} [{share.min():.3f}]"
                        f" | {np.median(plain):.3f} [{plain.min():.3f}] | {sum(covers)} of {len(covers)}"
                        f" | {np.median(seconds):.1f} |"
                    )
                    console.print(line, markup=False)
                    lines.append(line)
    make_folder(out.parent)
    write_atomically(out, "\n".join(lines) + "\n")


if __name__ == "__main__":
    typer.run(main)
