"""Simulated trials of several strategies, in chunks that any number of processes may share."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from lcorpp.decision import Robot, Strategy, dt_control
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, check_type
from lcorpp.experiments.decision_log import DecisionLog, format_decision
from lcorpp.experiments.robot_parts import RobotParts
from lcorpp.experiments.scoring.differences import add_differences
from lcorpp.experiments.scoring.metrics import Scores, score_decisions
from lcorpp.log_output import find_log_level, show_log
from lcorpp.simulation.people import Population, SignalSource
from lcorpp.simulation.simulated_classifier import BatchClassifier
from lcorpp.simulation.world import SimulationModel
from lcorpp.values import Array, Instance, Label
from lcorpp.workers import delay_sigint, ignore_sigint

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
    parts: what determines the robot's decisions, for a log.
    """

    domain: Domain
    robot: Robot
    classifiers: Mapping[str, BatchClassifier]
    signals: Mapping[str, SignalSource]
    strategies: tuple[Strategy, ...]
    seed: int
    parts: RobotParts | None = None

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
    log: DecisionLog | None = None,
) -> tuple[list[Scores], int]:
    """Simulate trials and score them.

    Args:
        trials: the number of people.
        jobs: processes; the result is the same for any number.
        progress: called with the number of completed trials and of all trials.
        log: receives the decisions of the completed trials, in their order for any number of processes; the
            experiment needs its `parts`.

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
    if log is not None and experiment.parts is None:
        raise DecisionError("a log of an experiment needs its `parts`, which determine the decisions")
    k = (len(experiment.strategies),)
    fields = [("truth", np.intp), ("reported", np.intp, k), ("cost", float, k), ("return_", float, k)]
    results: Trials = np.full(trials, -1, np.dtype(fields))
    with TemporaryDirectory(prefix="lcorpp-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        if jobs > 1 and trials > CHUNK_SIZE:  # the processes write into one file
            results.tofile(file := folder / "trials")
            results = np.memmap(file, results.dtype, "r+")
        chunks = [results[first : first + CHUNK_SIZE] for first in range(0, trials, CHUNK_SIZE)]
        waiting = None if log is None else WaitingLines(log, folder, chunks, len(experiment.strategies))
        work = [
            (number, chunk, waiting.find_file(number) if waiting else None)
            for number, chunk in enumerate(chunks)
        ]
        done = 0
        try:
            with _run_chunks(experiment, work, jobs) as sizes:
                for size in sizes:
                    done += size
                    if waiting is not None:
                        with delay_sigint():
                            waiting.append_next()
                    progress(done, trials)
        except KeyboardInterrupt:
            if (results["truth"] < 0).all():
                raise
        finally:
            if waiting is not None:
                waiting.append_rest()
        completed = np.array(results[results["truth"] >= 0])
    return _score_trials(experiment, completed), len(completed)


@contextmanager
def _run_chunks(
    experiment: Experiment, work: Sequence[tuple[int, Trials, Path | None]], jobs: int
) -> Iterator[Iterator[int]]:
    """Run chunks in some processes; yields an iterator of the number of trials of each, in their order.

    Args:
        work: the arguments of `run_chunk` for each chunk.
    """
    if jobs == 1 or len(work) == 1:
        yield (run_chunk(experiment, *arguments) for arguments in work)
        return
    calls = (delayed(_run_in_worker)(find_log_level(), experiment, *arguments) for arguments in work)
    with ignore_sigint():
        started = Parallel(n_jobs=jobs, return_as="generator")(calls)
    with closing(started):
        yield started


class WaitingLines:
    """The lines of the chunks, each in a file, that wait to be appended to a log in order."""

    def __init__(self, log: DecisionLog, folder: Path, chunks: Sequence[Trials], per_trial: int) -> None:
        self._log, self._folder, self._chunks, self._per_trial = log, folder, chunks, per_trial
        self._next = 0

    def find_file(self, number: int) -> Path:
        """Return the file of a chunk."""
        return self._folder / f"{number}.jsonl"

    def append_next(self) -> None:
        """Append the lines of the completed trials of the next chunk."""
        file, chunk = self.find_file(self._next), self._chunks[self._next]
        self._next += 1
        if file.exists():
            completed = int(np.sum(chunk["truth"] >= 0))
            lines = file.read_bytes().splitlines(keepends=True)[: completed * self._per_trial]
            self._log.append_lines([b"".join(lines)])
            file.unlink()

    def append_rest(self) -> None:
        """Append what is left after an interrupt or an error."""
        while self._next < len(self._chunks):
            self.append_next()


def _run_in_worker(level: int, *work: Any) -> int:
    """Run a chunk in another process, which shows messages of the same level."""
    if level < logging.WARNING:
        show_log(level)
    return run_chunk(*work)


def run_chunk(experiment: Experiment, number: int, results: Trials, file: Path | None = None) -> int:
    """Simulate trials, write each into `results` when it is complete, and return their number.

    The experiment's seed and the chunk's number determine every random draw.

    Args:
        file: receives the decisions, as lines of a log.
    """
    domain, strategies, model = experiment.domain, experiment.strategies, SimulationModel(experiment.domain)
    rng = np.random.default_rng([experiment.seed, number])
    people = Population(domain).sample(len(results), rng)
    signals = {sense: source.simulate(people, rng) for sense, source in experiment.signals.items()}
    began = perf_counter()
    labels = {
        sense: classifier.classify_many(signals[sense])
        for sense, classifier in experiment.classifiers.items()
    }
    classify_seconds = (perf_counter() - began) / len(people)
    classifiers = {sense: PrecomputedLabel() for sense in labels}
    full = replace(experiment.robot, classifiers=classifiers, domain=domain)
    # a strategy that changes the robot does so for each decision
    robots = [None if strategy.change else strategy.robot(full) for strategy in strategies]
    with ExitStack() as stack:
        log, parts = None, experiment.parts
        if file is not None:
            log = stack.enter_context(open(file, "wb", buffering=0))
        for i, person in enumerate(people):
            for sense, classifier in classifiers.items():
                classifier.label = labels[sense][i]
            perceived = {sense: own[i] for sense, own in signals.items()}
            instance = Instance(perceived, {name: person[name] for name in domain.observed})
            lines = []
            for k, strategy in enumerate(strategies):
                # every strategy gets the same answers: each has a new generator with the same seed
                seed = experiment.seed, number, i
                world = model.make_world(person, np.random.default_rng(seed))
                with strategy.locate_failures():
                    robot = robots[k] or strategy.robot(full, make_generator(*seed))
                    episode = dt_control(robot, instance, world)
                report = episode.report
                reported = len(domain.values) if report is None else domain.values.index(report)
                results["reported"][i, k] = reported
                results["cost"][i, k], results["return_"][i, k] = world.cost, world.return_
                if log is not None and parts is not None:
                    seconds = {**episode.seconds, "classify": classify_seconds if episode.labels else 0.0}
                    simulated = {"trial": number * CHUNK_SIZE + i, **world.describe_truth()}
                    timed = replace(episode, seconds=seconds)
                    lines.append(
                        format_decision(parts, strategy, instance.context, timed, simulated, seed=seed)
                    )
            if log is not None:
                log.write(b"".join(lines))
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
