"""Simulated trials of several strategies, in chunks that any number of processes may share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed

from lcorpp.decision import Robot, Strategy, dt_control
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError
from lcorpp.experiments.metrics import Scores, score_decisions
from lcorpp.simulation.population import Population
from lcorpp.simulation.simulated_classifier import BatchClassifier
from lcorpp.simulation.trajectories import TrajectorySource
from lcorpp.simulation.world import SimulationModel
from lcorpp.values import Array, Instance, Label
from lcorpp.workers import ignore_sigint

CHUNK_SIZE = 100
"""Trials per chunk. Each chunk has its own random generator, so this number is part of every result."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """The full robot, the source of the trajectories and the strategies to compare.

    seed: of the people and their answers. All strategies get the same people and the same random numbers, so
        that differences between strategies are not differences between samples.
    """

    domain: Domain
    robot: Robot
    classifier: BatchClassifier
    trajectories: TrajectorySource
    strategies: tuple[Strategy, ...]
    seed: int


@dataclass(frozen=True, eq=False)
class TrialResults:
    """The results of n trials of k strategies.

    truth: (n,) index of the true value. reported: (k, n) index of the reported value, V for no report.
    cost, return_: (k, n) as in `Scores`.
    """

    truth: np.ndarray
    reported: np.ndarray
    cost: Array
    return_: Array


def run_trials(
    experiment: Experiment,
    trials: int,
    *,
    jobs: int = 1,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> tuple[list[Scores], int]:
    """Simulate trials and score them.

    Args:
        trials: the number of people.
        jobs: processes; the result is the same for any number.
        progress: called with the number of completed trials and of all trials.

    Returns:
        The scores in the order of the strategies and the number of completed trials: fewer than `trials`
        after an interrupt (Ctrl-C), which keeps the completed chunks.

    Raises:
        DecisionError: `trials` or `jobs` is less than one; and whatever the robot's parts raise.
        KeyboardInterrupt: an interrupt before the first chunk was complete.
    """
    if trials < 1 or jobs < 1:
        raise DecisionError(f"trials and jobs must be at least 1, not {trials} and {jobs}")
    sizes = [min(CHUNK_SIZE, trials - first) for first in range(0, trials, CHUNK_SIZE)]
    completed: list[TrialResults] = []
    try:
        if jobs == 1 or len(sizes) == 1:
            for number, size in enumerate(sizes):
                completed.append(run_chunk(experiment, number, size))
                progress(sum(len(chunk.truth) for chunk in completed), trials)
        else:
            work = (delayed(run_chunk)(experiment, number, size) for number, size in enumerate(sizes))
            with ignore_sigint():
                started = Parallel(n_jobs=jobs, return_as="generator")(work)
            with closing(started) as chunks:
                for chunk in chunks:
                    completed.append(chunk)
                    progress(sum(len(chunk.truth) for chunk in completed), trials)
    except KeyboardInterrupt:
        if not completed:
            raise
    results = TrialResults(
        np.concatenate([chunk.truth for chunk in completed]),
        np.concatenate([chunk.reported for chunk in completed], axis=1),
        np.concatenate([chunk.cost for chunk in completed], axis=1),
        np.concatenate([chunk.return_ for chunk in completed], axis=1),
    )
    return score_trials(experiment, results), len(results.truth)


def run_chunk(experiment: Experiment, number: int, size: int) -> TrialResults:
    """Simulate `size` trials; the experiment's seed and the chunk's number determine every random draw."""
    domain, strategies, model = experiment.domain, experiment.strategies, SimulationModel(experiment.domain)
    rng = np.random.default_rng([experiment.seed, number])
    people = Population(domain).sample(size, rng)
    tracks = experiment.trajectories.trajectories(people, rng)
    labels: Sequence[Label | None] = [None] * size
    if any(strategy.learns for strategy in strategies):
        labels = experiment.classifier.classify_many(tracks)
    truth = np.array([domain.values.index(person[domain.target]) for person in people])
    reported = np.empty((len(strategies), size), dtype=np.intp)
    cost, return_ = np.empty((len(strategies), size)), np.empty((len(strategies), size))
    for i, (person, track, label) in enumerate(zip(people, tracks, labels, strict=True)):
        instance = Instance(track, {name: person[name] for name in domain.observed})
        full = Robot(FixedLabel(label), experiment.robot.reasoner, experiment.robot.planner, domain)
        for k, strategy in enumerate(strategies):
            # every strategy gets the same answers: each has a new generator with the same seed
            world = model.make_world(person, np.random.default_rng([experiment.seed, number, i]))
            report = dt_control(strategy.robot(full), instance, world).report
            reported[k, i] = len(domain.values) if report is None else domain.values.index(report)
            cost[k, i], return_[k, i] = world.cost, world.return_
    return TrialResults(truth, reported, cost, return_)


def score_trials(experiment: Experiment, results: TrialResults) -> list[Scores]:
    """Return the scores of each strategy, in the order of the experiment."""
    domain, scores = experiment.domain, []
    for k, strategy in enumerate(experiment.strategies):
        counts = np.zeros((len(domain.values), len(domain.values) + 1))
        np.add.at(counts, (results.truth, results.reported[k]), 1)
        scores.append(
            score_decisions(
                strategy.name,
                counts,
                results.cost[k],
                results.return_[k],
                values=domain.values,
                positive=domain.learning.positive,
            )
        )
    return scores


@dataclass(frozen=True)
class FixedLabel:
    """A classifier that returns one precomputed label for every instance."""

    label: Label | None

    def classify(self, instance: Instance) -> Label | None:
        return self.label
