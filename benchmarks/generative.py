"""Simulated models: LightDark, LaserTag and RockSample 15x15, by the planner of `[planning] model`.

    python benchmarks/generative.py [--models lightdark,lasertag,rocksample] [--episodes 1000,1000,1000]

Each model is a class as in the file of a domain. The searches are of as many simulations, or expansions of
beliefs, as one core does in about a second.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from math import ceil, exp, sqrt
from pathlib import Path
from time import process_time
from typing import Annotated, Any, ClassVar

import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from scipy.stats import norm

from lcorpp.files import make_folder, write_atomically
from lcorpp.planning import GenerativeModel, GenerativePlanner, SearchOptions, Widening
from lcorpp.values import Array

MAX_STEPS = 90
"""Longer episodes end."""

ICAPS = "Sunberg and Kochenderfer, ICAPS 2018, 1 s a step: means of the 1,000 returns in their repository"


class LightDark:
    """LightDark on a line (Sunberg and Kochenderfer 2018): find 0 with a noise of the distance to the light.

    States are (position, whether it is over).
    """

    moves: ClassVar = {"left_10": -10, "left": -1, "stop": 0, "right": 1, "right_10": 10}
    actions, discount = tuple(moves), 0.95
    light, radius = 10, 60

    def start(self, value: str, rng: np.random.Generator) -> tuple[int, bool]:
        """Start within 30 of 0."""
        return int(rng.integers(-self.radius // 2, self.radius // 2 + 1)), False

    def step(
        self, state: tuple[int, bool], action: str, rng: np.random.Generator
    ) -> tuple[tuple[int, bool], float, float]:
        """Move, or stop: 100 at 0, otherwise -100."""
        place, _ = state
        if action == "stop":
            return (place, True), 0.0, 100.0 if place == 0 else -100.0
        after = max(-self.radius, min(self.radius, place + self.moves[action]))
        return (after, False), after + rng.standard_normal() * self._deviation(after), -1.0

    def likelihood(
        self, observation: float, state: tuple[int, bool], action: str, after: tuple[int, bool]
    ) -> float:
        """Return the normal density of the measured position."""
        if action == "stop":
            return 1.0
        deviation = self._deviation(after[0])
        return exp(-0.5 * ((observation - after[0]) / deviation) ** 2) / deviation

    def shared(self, state: tuple[int, bool]) -> str | None:
        """Return the only value."""
        return None if state[1] else "only"

    def value(self, state: tuple[int, bool]) -> float:
        """Return the value of the state if it were known."""
        place, over = state
        if over:
            return 0.0
        tens, ones = divmod(abs(place), 10)
        steps = tens + min(ones, 11 - ones)
        weight = self.discount**steps
        return 100 * weight - (1 - weight) / (1 - self.discount)

    def _deviation(self, place: int) -> float:
        return abs(place - self.light) + 1e-4


class LaserTag:
    """LaserTag (Somani and others 2013): tag an opponent that evades, located by eight laser beams.

    States are (robot's cell, opponent's cell, whether it is over); the robot does not know where it is. Cells
    are numbered by rows, eight obstacles are at random places. A beam measures the distance to what it meets,
    less the absolute value of a normal error, rounded down.
    """

    moves: ClassVar = {"north": (0, 1), "south": (0, -1), "east": (1, 0), "west": (-1, 0)}
    beams: ClassVar = [*moves.values(), (1, 1), (1, -1), (-1, 1), (-1, -1)]
    actions, discount = (*moves, "tag"), 0.95
    columns, rows, obstacles, deviation = 11, 7, 8, 2.5
    same_cell = (-1,) * 8

    def __init__(self, seed: int = 0) -> None:
        count = self.columns * self.rows
        rng = np.random.default_rng(seed)
        self._blocked = {int(cell) for cell in rng.choice(count, self.obstacles, replace=False)}
        self._moved = [{a: self._move(cell, *self.moves[a]) for a in self.moves} for cell in range(count)]
        pairs = [(robot, opponent) for robot in range(count) for opponent in range(count)]
        self._evasions = {pair: self._evade(*pair) for pair in pairs}
        self._distances = {pair: [self._measure(*pair, *beam) for beam in self.beams] for pair in pairs}
        known = {distance for distances in self._distances.values() for distance in distances}
        self._chances = {distance: self._find_chances(distance) for distance in known}
        self._values = self._find_values(count)

    def start(self, value: str, rng: np.random.Generator) -> tuple[int, int, bool]:
        """Start with both anywhere."""
        return int(rng.integers(len(self._moved))), int(rng.integers(len(self._moved))), False

    def step(
        self, state: tuple[int, int, bool], action: str, rng: np.random.Generator
    ) -> tuple[tuple[int, int, bool], tuple[int, ...], float]:
        """Move or tag; the opponent moves away."""
        robot, opponent, _ = state
        if action == "tag" and robot == opponent:
            return (robot, opponent, True), self.same_cell, 10.0
        evasion = self._evasions[robot, opponent]
        opponent = evasion[int(rng.random() * len(evasion))]
        robot = robot if action == "tag" else self._moved[robot][action]
        seen: tuple[int, ...] = self.same_cell
        if robot != opponent:
            errors = rng.standard_normal(8).tolist()
            seen = tuple(
                max(0, int(distance - abs(self.deviation * error)))
                for distance, error in zip(self._distances[robot, opponent], errors, strict=True)
            )
        return (robot, opponent, False), seen, -10.0 if action == "tag" else -1.0

    def likelihood(
        self, seen: tuple[int, ...], state: tuple[int, int, bool], action: str, after: tuple[int, int, bool]
    ) -> float:
        """Return the probability of the eight readings."""
        robot, opponent, _ = after
        if robot == opponent or seen == self.same_cell:
            return float(robot == opponent and seen == self.same_cell)
        probability, chances = 1.0, self._chances
        for distance, reading in zip(self._distances[robot, opponent], seen, strict=True):
            own = chances[distance]
            probability *= own[reading] if reading < len(own) else 0.0
        return probability

    def shared(self, state: tuple[int, int, bool]) -> str | None:
        """Return the only value."""
        return None if state[2] else "only"

    def value(self, state: tuple[int, int, bool]) -> float:
        """Return the value of the state if it were known."""
        return 0.0 if state[2] else self._values[state[0]][state[1]]

    def _move(self, cell: int, dx: int, dy: int) -> int:
        """Return the next cell, or the same where an obstacle or the wall is."""
        x, y = cell % self.columns + dx, cell // self.columns + dy
        after = y * self.columns + x
        is_free = 0 <= x < self.columns and 0 <= y < self.rows and after not in self._blocked
        return after if is_free else cell

    def _evade(self, robot: int, opponent: int) -> list[int]:
        """Return ten equally probable next cells of the opponent: 4 by column, 4 by row, 2 here."""
        columns, cells = self.columns, [opponent] * 2
        for difference, step in (
            (opponent % columns - robot % columns, (1, 0)),
            (opponent // columns - robot // columns, (0, 1)),
        ):
            signs = [1, -1] if difference == 0 else [1 if difference > 0 else -1] * 2
            cells += [self._move(opponent, sign * step[0], sign * step[1]) for sign in signs for _ in "12"]
        return cells

    def _measure(self, robot: int, opponent: int, dx: int, dy: int) -> float:
        """Return the length of a beam."""
        count, cell = 1, robot
        while (after := self._move(cell, dx, dy)) not in (cell, opponent):
            count, cell = count + 1, after
        return count * sqrt(dx * dx + dy * dy)

    def _find_chances(self, distance: float) -> list[float]:
        """Return the probability of each reading, from 0."""
        errors = distance - np.arange(ceil(distance) + 1)  # that lead to at least this reading
        at_least = 2 * norm.cdf(np.maximum(errors, 0) / self.deviation) - 1
        at_least[0] = 1.0
        chances: list[float] = (at_least[:-1] - at_least[1:]).tolist()
        return chances

    def _find_values(self, count: int) -> list[list[float]]:
        """Return the values (robot, opponent) of known states, by value iteration."""
        evasions = np.array([[self._evasions[r, o] for o in range(count)] for r in range(count)])
        moved = np.array([[self._moved[r][a] for a in self.moves] for r in range(count)])
        values = np.where(np.eye(count, dtype=bool), 10.0, 0.0)
        for _ in range(200):
            later = values[moved[:, :, None, None], evasions[:, None]].mean(axis=3)
            values = -1 + self.discount * later.max(axis=1)
            values[np.diag_indices(count)] = 10.0
        found: list[list[float]] = values.tolist()
        return found


class RockSample:
    """RockSample (Smith and Simmons 2004): sample good rocks and leave to the right; rocks at random places.

    States are (x, y, qualities as bits); x is the size after the exit.
    """

    vectorised = True
    discount, half_distance = 0.95, 20.0
    observations = ("none", "good", "bad")
    moves: ClassVar = {"north": (0, 1), "south": (0, -1), "east": (1, 0), "west": (-1, 0)}
    sample = len(moves)

    def __init__(self, size: int = 15, rocks: int = 15, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        places = rng.choice(size * size, rocks, replace=False)
        self.size, self.rocks = size, np.stack([places % size, places // size])
        self.actions = (*self.moves, "sample", *(f"check_{r}" for r in range(rocks)))
        self._steps = np.array([*self.moves.values(), *[(0, 0)] * (rocks + 1)]).T
        cells = np.stack(np.meshgrid(np.arange(size + 1), np.arange(size), indexing="ij"))
        away = cells[..., None] - self.rocks[:, None, None, :]  # (2, size + 1, size, rocks)
        self._rock_at = np.where((away == 0).all(axis=0), np.arange(rocks), -1).max(axis=2)
        self._accuracy = 0.5 * (1 + 2 ** (-np.sqrt((away**2).sum(axis=0)) / self.half_distance))
        self._weights = self.discount ** np.abs(away).sum(axis=0)  # of rewards at the rocks
        self._exit = 10 * self.discount ** (size - 1.0 - np.arange(size + 1))
        self._tours = self._find_tours()

    def start(self, value: str, count: int, rng: np.random.Generator) -> Array:
        """Start at the left; each rock is good with probability .5."""
        good = rng.integers(1 << self.rocks.shape[1], size=count)
        return np.stack([np.zeros_like(good), np.full_like(good, self.size // 2), good], axis=1)

    def step(self, states: Array, actions: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """Move, sample or check a rock."""
        x, y, good = states.T
        dx, dy = self._steps[:, actions]
        after = np.maximum(0, x + dx)
        is_sample, rock = actions == self.sample, self._rock_at[x, y]
        bit = np.where(is_sample & (rock >= 0), 1 << np.maximum(rock, 0), 0)
        sampled = np.where(rock < 0, -100.0, np.where(good & bit, 10.0, -10.0))
        rewards = np.where(is_sample, sampled, np.where(after == self.size, 10.0, 0.0))
        is_right = rng.random(len(states)) < self._find_accuracy(states, actions)
        seen = np.where(actions > self.sample, 1 + (is_right != self._is_good(states, actions)), 0)
        return np.stack([after, np.clip(y + dy, 0, self.size - 1), good & ~bit], axis=1), seen, rewards

    def likelihood(self, observations: Array, states: Array, actions: Array, after: Array) -> Array:
        """Return the probability of the sensor's reading."""
        accuracy, is_check = self._find_accuracy(states, actions), actions > self.sample
        read = np.where(self._is_good(states, actions) == (observations == 1), accuracy, 1 - accuracy)
        found: Array = np.where(is_check, read * (observations > 0), observations == 0)
        return found

    def shared(self, states: Array) -> Array:
        """Return the only value."""
        return np.where(states[:, 0] == self.size, -1, 0)

    def lower(self, states: Array) -> Array:
        """Return what leaving at once is worth."""
        values: Array = self._exit[states[:, 0]]
        return values

    def upper(self, states: Array) -> Array:
        """Return the value of known rocks."""
        x, y, good = states.T
        values: Array = np.maximum(self._exit[x], (self._weights[x, y] * self._tours[good]).max(axis=1))
        return values

    def _is_good(self, states: Array, actions: Array) -> Array:
        """Return whether the rocks that are checked are good."""
        good: Array = (states[:, 2] >> np.maximum(0, actions - self.sample - 1) & 1) == 1
        return good

    def _find_accuracy(self, states: Array, actions: Array) -> Array:
        """Return the probability that the sensor is right about the rock of a check."""
        accuracy: Array = self._accuracy[states[:, 0], states[:, 1], np.maximum(0, actions - self.sample - 1)]
        return accuracy

    def _find_tours(self) -> Array:
        """Return the values (set of good rocks, rock) at each of these rocks, before it is sampled."""
        count = self.rocks.shape[1]
        sets = np.arange(1 << count)
        sizes = (sets[:, None] >> np.arange(count) & 1).sum(axis=1)
        between = self._weights[self.rocks[0], self.rocks[1]]  # (rock, rock)
        later = np.tile(self._exit[self.rocks[0]], (len(sets), 1))  # values at a rock that is bad
        values = np.full((len(sets), count), -np.inf)
        for size in range(1, count + 1):
            for rock in range(count):
                own = np.flatnonzero((sizes == size) & (sets >> rock & 1 == 1))
                values[own, rock] = 10 + self.discount * later[own & ~(1 << rock), rock]
                later[own] = np.maximum(later[own], between[:, rock] * values[own, rock, None])
        return values


@dataclass(frozen=True)
class Case:
    """A model, the work of a search, and the figures of others."""

    make: Callable[[int], Any]
    options: SearchOptions
    published: str


CASES = {
    "lightdark": Case(
        lambda _: LightDark(),
        SearchOptions(simulations=20_000, widening=Widening()),
        "POMCPOW 56.1 ± 0.6, PFT-DPW 57.2 ± 0.5, DESPOT -6.8 ± 1.0; with discretised observations"
        f" DESPOT 54.2 ± 1.1, POMCP 61.1 ± 0.4 ({ICAPS})",
    ),
    "lasertag": Case(
        LaserTag,
        SearchOptions(simulations=10_000, particles=10_000, widening=Widening()),
        f"POMCPOW -10.3 ± 0.2, PFT-DPW -11.1 ± 0.2, DESPOT -8.9 ± 0.2, POMCP -14.1 ± 0.2 ({ICAPS})",
    ),
    "rocksample": Case(
        lambda seed: RockSample(seed=seed),
        SearchOptions(particles=10_000, expansions=1000),
        "DESPOT 14.7 ± 0.8 (its authors' code on this machine, 1 s a step, 40 episodes, rocks at other random"
        " places)",
    ),
}


def simulate(case: Case, seed: int) -> tuple[float, int, float]:
    """Return the discounted return of an episode, its steps and the CPU seconds of a step."""
    model = GenerativeModel(case.make(seed), ("only",))
    planner = GenerativePlanner(model, case.options)
    rng = np.random.default_rng([1, seed])
    interaction = model.interaction
    state, belief, total, weight, began = (
        interaction.start("only", rng),
        model.start,
        0.0,
        1.0,
        process_time(),
    )
    steps = 0
    while steps < MAX_STEPS:
        steps += 1
        action = planner.action(belief)
        state, observation, reward = interaction.step(state, action, rng)
        total += weight * reward
        weight *= model.discount
        if interaction.shared(state) is None:
            break
        belief = planner.update(belief, action, model.format_observation(observation))
    return total, steps, (process_time() - began) / steps


def main(
    models: Annotated[str, typer.Option(help="Which models.")] = ",".join(CASES),
    episodes: Annotated[str, typer.Option(help="Number of episodes of each.")] = "1000,1000,1000",
    out: Annotated[Path, typer.Option(help="The table.")] = Path("benchmarks/results/generative.md"),
) -> None:
    """Measure, then write a table."""
    console = Console(stderr=True)
    lines = [
        "# Simulated models",
        "",
        f"`python benchmarks/generative.py --models {models} --episodes {episodes}`, {date.today()},"
        f" {platform.machine()}, one of {os.cpu_count()} cores, Python {platform.python_version()}."
        " Mean discounted return ± its standard error.",
        "",
        "| model | episodes | lcorpp | steps | CPU seconds a step | others |",
        "|---|---|---|---|---|---|",
    ]
    for name, count in zip(models.split(","), map(int, episodes.split(",")), strict=True):
        seeds = track(range(count), name, console=console)
        found = np.array([simulate(CASES[name], seed) for seed in seeds])
        mean, error = found[:, 0].mean(), found[:, 0].std(ddof=1) / sqrt(count)
        steps, seconds = found[:, 1].mean(), found[:, 2].mean()
        line = (
            f"| {name} | {count} | {mean:.1f} ± {error:.1f} | {steps:.0f} | {seconds:.2f}"
            f" | {CASES[name].published} |"
        )
        console.print(line, markup=False)
        lines.append(line)
    make_folder(out.parent)
    write_atomically(out, "\n".join(lines) + "\n")


if __name__ == "__main__":
    typer.run(main)
