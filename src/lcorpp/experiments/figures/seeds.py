"""Experiments that are repeated with several seeds: run in processes, and summarised over the seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np
from scipy.stats import t

from lcorpp.assembly.progress import Advance
from lcorpp.experiments.figures.result import Row
from lcorpp.scoring.metrics import make_cells
from lcorpp.values import Interval
from lcorpp.work_units.running import evaluate_units

T = TypeVar("T")
Key = TypeVar("Key")

Numbers = Mapping[str, Sequence[float]]
"""Quantity -> a number of each seed; all in the same order, so that numbers are paired."""


def run_seeds(unit: Callable[[int], T], seeds: Sequence[int], jobs: int, advance: Advance) -> list[T]:
    """Return the results of a unit of work for each seed, in their order.

    Args:
        unit: a picklable function of the seed alone, so that the results are the same for any `jobs`.
        jobs: processes. advance: receives the number of completed and of all seeds.

    Raises:
        KeyboardInterrupt: an interrupt; no seed is kept. Also whatever the unit raises.
    """
    units, results = {str(seed): seed for seed in seeds}, dict[str, T]()
    for key, result in evaluate_units(unit, units, jobs=min(jobs, len(seeds))):
        results[key] = result
        advance(len(results), len(seeds))
    return [results[key] for key in units]


def collect(measured: Sequence[Mapping[Key, Mapping[str, float]]]) -> dict[Key, dict[str, list[float]]]:
    """Return setting -> quantity -> its number with each seed, from setting -> quantity -> number of each."""
    return {
        setting: {name: [one[setting][name] for one in measured] for name in quantities}
        for setting, quantities in measured[0].items()
    }


def make_cells_of_seeds(numbers: Numbers) -> Row:
    """Return the cells of a row: the mean over the seeds of each quantity with its interval."""
    return make_cells({name: compute_seed_interval(values) for name, values in numbers.items()})


def compute_seed_interval(numbers: Sequence[float]) -> Interval:
    """Return the mean over the seeds with Student's 95 % interval.

    A seed draws its training data and its people anew, so the interval covers both. Numbers of two settings
    with the same seeds are paired: pass their differences.

    Raises:
        ValueError: fewer than two seeds.
    """
    if len(numbers) < 2:
        raise ValueError("an interval over seeds needs at least two of them")
    mean, deviation = float(np.mean(numbers)), float(np.std(numbers, ddof=1))
    half = float(t.ppf(0.975, len(numbers) - 1)) * deviation / len(numbers) ** 0.5
    return Interval(mean, mean - half, mean + half)


def subtract(first: Sequence[float], second: Sequence[float]) -> Interval:
    """Return the mean paired difference, first minus second, with its interval over the seeds."""
    return compute_seed_interval(np.subtract(first, second).tolist())
