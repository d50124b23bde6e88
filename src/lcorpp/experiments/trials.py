"""Simulated trials of several strategies, in chunks that any number of processes may share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from lcorpp.decision import Robot, Strategy, dt_control
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, check_type
from lcorpp.experiments.differences import add_differences
from lcorpp.experiments.metrics import Scores, score_decisions
from lcorpp.simulation.people import Population, SignalSource
from lcorpp.simulation.simulated_classifier import BatchClassifier
from lcorpp.simulation.world import SimulationModel
from lcorpp.values import Array, Instance, Label
from lcorpp.workers import ignore_sigint

CHUNK_SIZE = 100
"""Trials per chunk. Each chunk has its own random generator, so this number is part of every result."""

Trials = np.ndarray[Any, np.dtype[np.void]]
"""(n,) trials, each with these fields, one number for each of the k strategies:

truth: index of the true value; -1 before the trial is complete. reported: (k,) index of the reported value,
V for no report. cost, return_: (k,) as in `Scores`.
"""


@dataclass(frozen=True, eq=False)
class Experiment:
    """The full robot, the sources of its signals and the strategies to compare.

    classifiers, signals: sense -> its classifier for many people at once, and the source of its signals.
    seed: of the people and their answers. All strategies get the same people and the same random numbers, so
        that differences between strategies are not differences between samples.
    """

    domain: Domain
    robot: Robot
    classifiers: Mapping[str, BatchClassifier]
    signals: Mapping[str, SignalSource]
    strategies: tuple[Strategy, ...]
    seed: int

    def __post_init__(self) -> None:
        check_type(self.domain, Domain, "the domain of an experiment", DecisionError)
        check_type(self.robot, Robot, "the robot of an experiment", DecisionError)
        for strategy in self.strategies:
            check_type(strategy, Strategy, "a strategy of an experiment", DecisionError)


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
        after an interrupt (Ctrl-C), which keeps every trial that a process has completed.

    Raises:
        DecisionError: `trials` or `jobs` is less than one; and whatever the robot's parts raise.
        KeyboardInterrupt: an interrupt before the first trial was complete.
    """
    check_type(experiment, Experiment, "the experiment", DecisionError)
    if trials < 1 or jobs < 1:
        raise DecisionError(f"trials and jobs must be at least 1, not {trials} and {jobs}")
    k = (len(experiment.strategies),)
    fields = [("truth", np.intp), ("reported", np.intp, k), ("cost", float, k), ("return_", float, k)]
    results: Trials = np.full(trials, -1, np.dtype(fields))
    with TemporaryDirectory(prefix="lcorpp-", ignore_cleanup_errors=True) as folder:
        if jobs > 1 and trials > CHUNK_SIZE:  # the processes write into one file
            results.tofile(file := Path(folder) / "trials")
            results = np.memmap(file, results.dtype, "r+")
        chunks = [results[first : first + CHUNK_SIZE] for first in range(0, trials, CHUNK_SIZE)]
        done = 0
        try:
            if jobs == 1 or len(chunks) == 1:
                for number, chunk in enumerate(chunks):
                    done += run_chunk(experiment, number, chunk)
                    progress(done, trials)
            else:
                work = (delayed(run_chunk)(experiment, number, chunk) for number, chunk in enumerate(chunks))
                with ignore_sigint():
                    started = Parallel(n_jobs=jobs, return_as="generator")(work)
                with closing(started) as sizes:
                    for size in sizes:
                        done += size
                        progress(done, trials)
        except KeyboardInterrupt:
            if (results["truth"] < 0).all():
                raise
        completed = np.array(results[results["truth"] >= 0])
    return _score_trials(experiment, completed), len(completed)


def run_chunk(experiment: Experiment, number: int, results: Trials) -> int:
    """Simulate trials, write each into `results` when it is complete, and return their number.

    The experiment's seed and the chunk's number determine every random draw.
    """
    domain, strategies, model = experiment.domain, experiment.strategies, SimulationModel(experiment.domain)
    rng = np.random.default_rng([experiment.seed, number])
    people = Population(domain).sample(len(results), rng)
    signals = {sense: source.simulate(people, rng) for sense, source in experiment.signals.items()}
    labels = {
        sense: classifier.classify_many(signals[sense])
        for sense, classifier in experiment.classifiers.items()
    }
    recall = {sense: PrecomputedLabel() for sense in labels}
    full = replace(experiment.robot, classifiers=recall, domain=domain)
    robots = [None if strategy.change else strategy.robot(full) for strategy in strategies]
    for i, person in enumerate(people):
        for sense, precomputed in recall.items():
            precomputed.label = labels[sense][i]
        perceived = {sense: own[i] for sense, own in signals.items()}
        instance = Instance(perceived, {name: person[name] for name in domain.observed})
        for k, strategy in enumerate(strategies):
            # every strategy gets the same answers: each has a new generator with the same seed
            world = model.make_world(person, np.random.default_rng([experiment.seed, number, i]))
            with strategy.locate_failures():
                robot = robots[k] or strategy.robot(full, make_generator(experiment.seed, number, i))
                report = dt_control(robot, instance, world).report
            results["reported"][i, k] = len(domain.values) if report is None else domain.values.index(report)
            results["cost"][i, k], results["return_"][i, k] = world.cost, world.return_
        results["truth"][i] = domain.values.index(domain.reasoning.join(person))
    return len(people)


def make_generator(*seed: int) -> np.random.Generator:
    """Return the generator of a strategy that draws its actions, independent of the world's answers."""
    return np.random.default_rng([*seed, 1])


def _score_trials(experiment: Experiment, results: Trials) -> list[Scores]:
    """Return the scores of each strategy, in the order of the experiment."""
    domain, scores = experiment.domain, []
    cost, return_ = (np.asfortranarray(results[name]) for name in ("cost", "return_"))
    for k, strategy in enumerate(experiment.strategies):
        counts = np.zeros((len(domain.values), len(domain.values) + 1))
        np.add.at(counts, (results["truth"], results["reported"][:, k]), 1)
        scores.append(
            score_decisions(
                strategy.name,
                counts,
                cost[:, k],
                return_[:, k],
                values=domain.values,
                positive=domain.positive,
                variables=domain.reasoning.shared,
            )
        )
    return add_differences(scores, cost, return_)


@dataclass
class PrecomputedLabel:
    """A classifier that returns the label of the current person, computed before with many others."""

    label: Label | None = None

    def classify(self, signal: Array) -> Label | None:
        return self.label
