"""Simulated decisions by the strategies, in chunks that any number of processes may share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed

from lcorpp.decision import Robot, Strategy, dt_control
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError
from lcorpp.experiments.metrics import Scores, scores
from lcorpp.simulation.population import Appearance, Population, Reader
from lcorpp.simulation.world import Stage
from lcorpp.values import Array, Instance, Label
from lcorpp.workers import ignore_sigint

CHUNK = 100
"""Decisions per chunk. A chunk is what one seed makes, so this number is part of every result."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """What a trial needs: the full robot, the people it meets and the strategies to compare.

    seed: of the people and their answers. All strategies meet the same people with the same moods, so
        that differences between strategies are not differences between crowds.
    """

    domain: Domain
    robot: Robot
    reader: Reader
    appearance: Appearance
    strategies: tuple[Strategy, ...]
    seed: int


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What came of n decisions by k strategies.

    truth: (n,) index of the true value. reported: (k, n) index of the value reported, V for none.
    cost, earned: (k, n) as in `Scores`.
    """

    truth: np.ndarray
    reported: np.ndarray
    cost: Array
    earned: Array


def run_trials(
    experiment: Experiment, trials: int, *, jobs: int = 1, progress: Callable[[int], None] = lambda _: None
) -> tuple[list[Scores], int]:
    """Simulate decisions and score them.

    Args:
        trials: how many people are met.
        jobs: processes; the result is the same for any number.
        progress: called with the number of decisions done so far.

    Returns:
        The scores in the order of the strategies and the number of people met: fewer than `trials` when the
        user interrupted (Ctrl-C), as what is done is kept.

    Raises:
        DecisionError: fewer than one trial or job; and whatever the parts raise.
        KeyboardInterrupt: interrupted before the first chunk was done.
    """
    if trials < 1 or jobs < 1:
        raise DecisionError(f"trials and jobs must be at least 1, not {trials} and {jobs}")
    sizes = [min(CHUNK, trials - first) for first in range(0, trials, CHUNK)]
    done: list[Outcomes] = []
    try:
        if jobs == 1 or len(sizes) == 1:
            for number, size in enumerate(sizes):
                done.append(run_chunk(experiment, number, size))
                progress(sum(len(chunk.truth) for chunk in done))
        else:
            work = (delayed(run_chunk)(experiment, number, size) for number, size in enumerate(sizes))
            with ignore_sigint():
                started = Parallel(n_jobs=jobs, return_as="generator")(work)
            with closing(started) as chunks:
                for chunk in chunks:
                    done.append(chunk)
                    progress(sum(len(chunk.truth) for chunk in done))
    except KeyboardInterrupt:
        if not done:
            raise
    outcomes = Outcomes(
        np.concatenate([chunk.truth for chunk in done]),
        np.concatenate([chunk.reported for chunk in done], axis=1),
        np.concatenate([chunk.cost for chunk in done], axis=1),
        np.concatenate([chunk.earned for chunk in done], axis=1),
    )
    return score(experiment, outcomes), len(outcomes.truth)


def run_chunk(experiment: Experiment, number: int, size: int) -> Outcomes:
    """Decide about `size` people; everything drawn follows from the seed and the chunk's number."""
    domain, rows, stage = experiment.domain, experiment.strategies, Stage(experiment.domain)
    rng = np.random.default_rng([experiment.seed, number])
    people = Population(domain).people(size, rng)
    tracks = experiment.appearance.trajectories(people, rng)
    labels: Sequence[Label | None] = [None] * size
    if any(row.learns for row in rows):
        labels = experiment.reader.classify_many(tracks)
    truth = np.array([domain.values.index(person[domain.target]) for person in people])
    reported = np.empty((len(rows), size), dtype=np.intp)
    cost, earned = np.empty((len(rows), size)), np.empty((len(rows), size))
    for i, (person, track, label) in enumerate(zip(people, tracks, labels, strict=True)):
        instance = Instance(track, {name: person[name] for name in domain.observed})
        full = Robot(Said(label), experiment.robot.reasoner, experiment.robot.planner, domain)
        for k, row in enumerate(rows):
            # the same answers for every strategy: their generator is made anew, not carried on
            world = stage.world(person, np.random.default_rng([experiment.seed, number, i]))
            report = dt_control(row.robot(full), instance, world).report
            reported[k, i] = len(domain.values) if report is None else domain.values.index(report)
            cost[k, i], earned[k, i] = world.cost, world.earned
    return Outcomes(truth, reported, cost, earned)


def score(experiment: Experiment, outcomes: Outcomes) -> list[Scores]:
    """The scores of all strategies."""
    domain, results = experiment.domain, []
    for k, row in enumerate(experiment.strategies):
        counts = np.zeros((len(domain.values), len(domain.values) + 1))
        np.add.at(counts, (outcomes.truth, outcomes.reported[k]), 1)
        results.append(
            scores(
                row.name,
                counts,
                outcomes.cost[k],
                outcomes.earned[k],
                values=domain.values,
                positive=domain.positive,
            )
        )
    return results


@dataclass(frozen=True)
class Said:
    """A classifier that has already been asked about this person."""

    label: Label | None

    def classify(self, instance: Instance) -> Label | None:
        return self.label
