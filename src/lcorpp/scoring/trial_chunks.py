"""Simulation of chunks of trials: the decisions of every strategy about each person."""

from __future__ import annotations

import logging
import pickle
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from joblib import delayed

from lcorpp.decision import dt_control
from lcorpp.decision.dt_control import LOG
from lcorpp.decision.strategies import Session
from lcorpp.log_output import find_log_level, show_log
from lcorpp.logs.decision_log import format_decision
from lcorpp.scoring.batch_simulation import simulate_at_once
from lcorpp.scoring.experiment import CHUNK_SIZE, Chunk, ChunkSource, Experiment
from lcorpp.scoring.gaps import find_gap
from lcorpp.scoring.limit_costs import measure_decision
from lcorpp.workers import pickle_for_workers, run_in_workers

Trials = np.ndarray[Any, np.dtype[np.void]]
"""(n,) trials, each with these fields, one number for each of the k strategies:

truth: index of the true value; -1 before the trial is complete. reported: (k,) index of the reported value,
V for no report. cost, return_: (k,) as in `Scores`. gap: (k,) see `find_gap`. limits: (k, K) costs of the
domain's limits, see `LimitCosts.finish`.
"""


class ChunkWork(NamedTuple):
    """A chunk to simulate: its number, where its trials are written, and the file for its log, if any."""

    number: int
    results: Trials
    file: Path | None = None


def make_results(trials: int, k: int, n_limits: int = 0) -> Trials:
    """Return the results of trials of k strategies, none of which is complete."""
    each = (k,)
    fields = [
        ("truth", np.intp),
        ("reported", np.intp, each),
        ("cost", float, each),
        ("return_", float, each),
        ("gap", float, each),
        ("limits", float, (k, n_limits)),
    ]
    return np.full(trials, -1, np.dtype(fields))


@contextmanager
def run_groups(
    experiment: Experiment, groups: Sequence[Sequence[ChunkWork]], jobs: int
) -> Iterator[Iterator[int]]:
    """Run groups of chunks in some processes; yield an iterator of the number of trials of each, in order."""
    if not experiment.strategies:
        yield (_skip_chunks(group) for group in groups)
        return
    if jobs == 1 or len(groups) == 1:
        sessions = start_sessions(experiment)
        yield (run_chunks(experiment, group, sessions) for group in groups)
        return
    # Once, before other strategies change cached values of the same robot in this process.
    pickled = pickle_for_workers(experiment)
    calls = (delayed(_run_in_worker)(find_log_level(), pickled, group) for group in groups)
    with run_in_workers(calls, jobs=jobs, ordered=True) as counts:
        yield counts


def _skip_chunks(work: Sequence[ChunkWork]) -> int:
    """Return the number of complete trials if no strategy is simulated."""
    for _, results, _ in work:
        results["truth"] = 0
    return sum(len(results) for _, results, _ in work)


def start_sessions(experiment: Experiment) -> list[Session | None]:
    """Return the session of each strategy, None for one that does not learn from earlier people."""
    return [
        None if row.start is None else row.start(row.select(experiment.robot), experiment.rates)
        for row in experiment.strategies
    ]


def _run_in_worker(level: int, pickled: npt.NDArray[np.uint8], work: Sequence[ChunkWork]) -> int:
    """Run chunks of a pickled experiment in another process, which shows messages of the same level."""
    if level < logging.WARNING:
        show_log(level)
    return run_chunks(pickle.loads(pickled.data), work)


def run_chunks(
    experiment: Experiment, work: Sequence[ChunkWork], sessions: Sequence[Session | None] | None = None
) -> int:
    """Simulate trials, write each into its results when it is complete, and return their number.

    Decisions that depend on the belief alone are simulated for all people of the chunks at once, the others
    one by one; both ways give the same results. Chunks with a log, and decisions that are shown
    (`lcorpp -v`), are simulated one by one.

    Args:
        sessions: of each strategy, None for one that does not learn from earlier people; by default of all.
    """
    source = ChunkSource(experiment)
    chunks = [source.draw(number, len(results)) for number, results, _ in work]
    single = set(range(len(experiment.strategies)))
    if all(file is None for _, _, file in work) and not LOG.isEnabledFor(logging.INFO):
        for k, simulated in simulate_at_once(experiment, chunks).items():
            single.remove(k)
            for name, numbers in simulated.items():
                parts = np.split(numbers, np.cumsum([len(chunk.people) for chunk in chunks])[:-1])
                for own, part in zip(work, parts, strict=True):
                    own.results[name][:, k] = part
    for own, chunk in zip(work, chunks, strict=True):
        _simulate_one_by_one(experiment, own, chunk, sorted(single), sessions)
    return sum(len(results) for _, results, _ in work)


def _simulate_one_by_one(
    experiment: Experiment,
    work: ChunkWork,
    chunk: Chunk,
    selected: Sequence[int],
    sessions: Sequence[Session | None] | None,
) -> None:
    """Simulate the decisions of the selected strategies about each person, and complete the trials."""
    number, results, file = work
    values, parts = experiment.domain.values, experiment.parts
    limits = experiment.domain.planning.limits
    if not selected:
        results["truth"] = chunk.index_values()
        return
    with nullcontext() if file is None else open(file, "wb", buffering=0) as log:
        for i, truth in enumerate(chunk.index_values()):
            trial, lines = chunk.find_trial(i), []
            for k in selected:
                strategy, world = experiment.strategies[k], trial.make_world()
                session = None if sessions is None else sessions[k]
                person = None if session is None else session.n_people
                with strategy.locate_failures():
                    episode = dt_control(trial.make_robot(strategy, session), trial.instance, world)
                    if session is not None:
                        session.learn(episode.evidence, episode.steps)
                report = episode.report
                results["reported"][i, k] = len(values) if report is None else values.index(report)
                results["cost"][i, k], results["return_"][i, k] = world.cost, world.return_
                if limits:
                    actions = [step.action for step in episode.steps]
                    results["limits"][i, k] = measure_decision(experiment.domain, chunk.people[i], actions)
                results["gap"][i, k] = find_gap(trial.robot, strategy, episode.prior)
                if log is not None and parts is not None:
                    seconds = {**episode.seconds, "classify": chunk.seconds if episode.labels else 0.0}
                    simulated = {"trial": number * CHUNK_SIZE + i, **world.describe_truth()}
                    timed, context = replace(episode, seconds=seconds), trial.instance.context
                    line = format_decision(
                        parts, strategy, context, timed, simulated, seed=trial.seed, person=person
                    )
                    lines.append(line)
            if log is not None:
                log.write(b"".join(lines))
            results["truth"][i] = truth
