"""Simulated trials of several strategies, in chunks that any number of processes may share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from joblib import Parallel, delayed

from lcorpp.errors import DecisionError, check_type
from lcorpp.experiments.decision_log import DecisionLog
from lcorpp.experiments.scoring.decision_scores import score_decisions
from lcorpp.experiments.scoring.experiment import CHUNK_SIZE, Experiment
from lcorpp.experiments.scoring.metrics import Scores
from lcorpp.experiments.scoring.trial_chunks import (
    ChunkWork,
    Trials,
    make_results,
    run_chunks,
    run_in_worker,
    simulates_at_once,
)
from lcorpp.log_output import find_log_level
from lcorpp.workers import delay_sigint, ignore_sigint

MAX_GROUP = 10
"""Maximum number of chunks whose people are simulated at once."""


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
        after an interrupt (Ctrl-C), which keeps every trial that a process has completed; people who are
        simulated at once are completed together.

    Raises:
        DecisionError: as of `check_numbers`; and whatever the robot's parts raise.
        KeyboardInterrupt: an interrupt before the first trial was complete.
    """
    check_type(experiment, Experiment, "the experiment", DecisionError)
    check_numbers(trials, jobs, experiment.seed)
    if log is not None and experiment.parts is None:
        raise DecisionError("a log of an experiment needs its `parts`, which determine the decisions")
    results = make_results(trials, len(experiment.strategies))
    with TemporaryDirectory(prefix="lcorpp-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        if jobs > 1 and trials > CHUNK_SIZE:  # the processes write into one file
            results.tofile(file := folder / "trials")
            results = np.memmap(file, results.dtype, "r+")
        chunks = [results[first : first + CHUNK_SIZE] for first in range(0, trials, CHUNK_SIZE)]
        work = [
            ChunkWork(number, chunk, None if log is None else folder / f"{number}.jsonl")
            for number, chunk in enumerate(chunks)
        ]
        size, waiting, done = 1, iter(work), 0
        if log is None and all(simulates_at_once(experiment, row) for row in experiment.strategies):
            size = min(MAX_GROUP, -(-len(chunks) // (4 * jobs)))
        groups = [work[first : first + size] for first in range(0, len(work), size)]
        try:
            with _run_groups(experiment, groups, jobs) as counts:
                for count in counts:
                    if log is not None:
                        with delay_sigint():
                            _append_lines(log, next(waiting))
                    done += count
                    progress(done, trials)
        except KeyboardInterrupt:
            if (results["truth"] < 0).all():
                raise
        finally:
            if log is not None:
                for chunk in waiting:  # after an interrupt or an error
                    _append_lines(log, chunk)
        completed = np.array(results[results["truth"] >= 0])
    return _score_trials(experiment, completed), len(completed)


def check_numbers(trials: int, jobs: int, seed: int) -> None:
    """Check the numbers of a simulation.

    Raises:
        DecisionError: one is no integer, `trials` or `jobs` is less than 1, or `seed` is negative.
    """
    for name, number, least in (("trials", trials, 1), ("jobs", jobs, 1), ("seed", seed, 0)):
        check_type(number, (int, np.integer), f"`{name}`", DecisionError)
        if number < least:
            raise DecisionError(f"`{name}` must be at least {least}, not {number}")


@contextmanager
def _run_groups(
    experiment: Experiment, groups: Sequence[Sequence[ChunkWork]], jobs: int
) -> Iterator[Iterator[int]]:
    """Run groups of chunks in some processes; yield an iterator of the number of trials of each, in order."""
    if jobs == 1 or len(groups) == 1:
        yield (run_chunks(experiment, group) for group in groups)
        return
    calls = (delayed(run_in_worker)(find_log_level(), experiment, group) for group in groups)
    with ignore_sigint():
        started = Parallel(n_jobs=jobs, return_as="generator")(calls)
    with closing(started):
        yield started


def _append_lines(log: DecisionLog, work: ChunkWork) -> None:
    """Append the lines of the completed trials of a chunk to a log, one for each strategy."""
    _, results, file = work
    if file is not None and file.exists():
        completed = np.count_nonzero(results["truth"] >= 0) * results["reported"].shape[1]
        lines = file.read_bytes().splitlines(keepends=True)[:completed]
        log.append_lines([b"".join(lines)])
        file.unlink()


def _score_trials(experiment: Experiment, results: Trials) -> list[Scores]:
    """Return the scores of each strategy, in the order of the experiment."""
    domain, truth = experiment.domain, np.array(results["truth"])
    reported, cost, return_ = (results[name].T.copy() for name in ("reported", "cost", "return_"))  # (k, n)
    return [
        score_decisions(
            strategy.name,
            truth,
            reported[k],
            cost[k],
            return_[k],
            values=domain.values,
            positive=domain.positive,
            variables=domain.reasoning.shared,
        )
        for k, strategy in enumerate(experiment.strategies)
    ]
