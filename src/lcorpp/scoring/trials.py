"""Simulated trials of several strategies, in chunks that any number of processes may share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments
from lcorpp.errors import DecisionError
from lcorpp.interrupts import delay_sigint
from lcorpp.logs.decision_log import DecisionLog
from lcorpp.scoring.batch_simulation import simulates_at_once
from lcorpp.scoring.decision_scores import score_decisions
from lcorpp.scoring.experiment import CHUNK_SIZE, Experiment
from lcorpp.scoring.gaps import take_gap
from lcorpp.scoring.limit_costs import summarise_limits
from lcorpp.scoring.metrics import Scores
from lcorpp.scoring.trial_chunks import (
    ChunkWork,
    Trials,
    make_results,
    run_chunks,
    run_groups,
    start_sessions,
)

MAX_GROUP = 10
"""Maximum number of chunks whose people are simulated at once."""


@check_arguments
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
        jobs: processes; the result is the same for any number. Strategies that learn from earlier people take
            them in the order of the trials, in this process.
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

    Examples:
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import strategies
        >>> from lcorpp.scoring import Experiment, run_trials
        >>> full = load_robot("intention", cache=False)
        >>> channels, chosen = {"motion": full.senses["motion"].classifier}, strategies(["R", "LCORPP"])
        >>> experiment = Experiment(full.domain, full.robot, channels, channels, chosen, seed=1)
        >>> (reasoning, lcorpp), completed = run_trials(experiment, 500)
        >>> lcorpp.accuracy.low > reasoning.accuracy.high, completed
        (True, 500)
    """
    check_numbers(trials, jobs, experiment.seed)
    if log is not None and experiment.parts is None:
        raise DecisionError("a log of an experiment needs its `parts`, which determine the decisions")
    if jobs == 1 or trials <= CHUNK_SIZE:  # all strategies decide about a person before the next one
        parallel, sequential = experiment, replace(experiment, strategies=())
    else:
        parallel, sequential = _split(experiment)
    alone = [row for row in parallel.strategies if row.start is None]
    are_grouped = log is None and all(simulates_at_once(experiment, row) for row in alone)
    n_limits = len(experiment.domain.planning.limits)
    results = make_results(trials, len(parallel.strategies), n_limits)
    sequential_results = make_results(trials, len(sequential.strategies), n_limits)
    sessions = start_sessions(sequential)
    with TemporaryDirectory(prefix="lcorpp-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        if jobs > 1 and trials > CHUNK_SIZE:  # the processes write into one file
            results.tofile(file := folder / "trials")
            results = np.memmap(file, results.dtype, "r+")
        work = _divide(results, None if log is None else folder / "parallel")
        later = _divide(sequential_results, None if log is None else folder / "sequential")
        waiting, done = iter(zip(work, later, strict=True)), 0
        size = min(MAX_GROUP, -(-len(work) // (4 * jobs))) if are_grouped else 1
        groups = [work[first : first + size] for first in range(0, len(work), size)]
        try:
            with run_groups(parallel, groups, jobs) as counts:
                for number, count in enumerate(counts):
                    if sessions:
                        run_chunks(sequential, later[number * size : (number + 1) * size], sessions)
                    if log is not None:
                        with delay_sigint():
                            _append_lines(log, experiment, sequential, *next(waiting))
                    done += count
                    progress(done, trials)
        except KeyboardInterrupt:
            if not _find_complete(results, sequential_results).any():
                raise
        finally:
            if log is not None:
                for chunks in waiting:  # after an interrupt or an error
                    _append_lines(log, experiment, sequential, *chunks)
        complete = _find_complete(results, sequential_results)
        scores = iter(_score_trials(parallel, np.array(results[complete])))
        others = iter(_score_trials(sequential, sequential_results[complete]))
    ordered = [next(others if row in sequential.strategies else scores) for row in experiment.strategies]
    return ordered, int(np.count_nonzero(complete))


def _divide(results: Trials, folder: Path | None) -> list[ChunkWork]:
    """Return the chunks of some trials, with files for their logs in a folder if there is one."""
    if folder is not None:
        folder.mkdir()
    return [
        ChunkWork(
            number, results[first : first + CHUNK_SIZE], None if folder is None else folder / f"{number}"
        )
        for number, first in enumerate(range(0, len(results), CHUNK_SIZE))
    ]


def _split(experiment: Experiment) -> tuple[Experiment, Experiment]:
    """Return the experiments of the strategies that decide about each person alone, and of the others."""
    rows = experiment.strategies
    parallel = replace(experiment, strategies=tuple(row for row in rows if row.start is None))
    return parallel, replace(experiment, strategies=tuple(row for row in rows if row.start is not None))


def _find_complete(results: Trials, sequential_results: Trials) -> npt.NDArray[np.bool_]:
    """Return (n,) whether all strategies have decided about a person."""
    complete: npt.NDArray[np.bool_] = results["truth"] >= 0
    if sequential_results["reported"].shape[1]:
        complete = complete & (sequential_results["truth"] >= 0)
    return complete


def check_numbers(trials: int, jobs: int, seed: int) -> None:
    """Check the numbers of a simulation.

    Raises:
        DecisionError: `trials` or `jobs` is less than 1, or `seed` is negative.
    """
    for name, number, least in (("trials", trials, 1), ("jobs", jobs, 1), ("seed", seed, 0)):
        if number < least:
            raise DecisionError(f"`{name}` must be at least {least}, not {number}")


def _append_lines(
    log: DecisionLog,
    experiment: Experiment,
    sequential: Experiment,
    work: ChunkWork,
    sequential_work: ChunkWork,
) -> None:
    """Append the lines of the completed trials of a chunk to a log, one for each strategy in their order."""
    count = np.count_nonzero(_find_complete(work.results, sequential_work.results))
    lines, others = _take_lines(work), _take_lines(sequential_work)
    ordered = [
        next(others if row in sequential.strategies else lines)
        for _ in range(count)
        for row in experiment.strategies
    ]
    log.append_lines([b"".join(ordered)])


def _take_lines(work: ChunkWork) -> Iterator[bytes]:
    """Return the lines of a chunk's file, and remove it."""
    if work.file is None or not work.file.exists():
        return iter(())
    lines = work.file.read_bytes().splitlines(keepends=True)
    work.file.unlink()
    return iter(lines)


def _score_trials(experiment: Experiment, results: Trials) -> list[Scores]:
    """Return the scores of each strategy, in the order of the experiment."""
    domain, truth = experiment.domain, np.array(results["truth"])
    fields = ("reported", "cost", "return_", "gap")
    reported, cost, return_, gap = (results[name].T.copy() for name in fields)  # (k, n)
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
            gap=take_gap(gap[k]),
            limits=summarise_limits(domain.planning.limits, results["limits"][:, k]),
        )
        for k, strategy in enumerate(experiment.strategies)
    ]
