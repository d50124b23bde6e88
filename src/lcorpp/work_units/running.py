"""Evaluate work units with joblib: in processes, on a Dask cluster, or with the caller's backend."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, closing
from typing import TypeVar

from joblib import delayed
from joblib.externals.loky.process_executor import BrokenProcessPool

from lcorpp.errors import LcorppError, WorkerError
from lcorpp.log_output import find_log_level, show_log
from lcorpp.workers import run_in_workers

LOG = logging.getLogger(__name__)

MAX_LOSSES = 3
"""Number of times in a row that worker processes may end before one of the units that were left is done."""

Unit = TypeVar("Unit")
Result = TypeVar("Result")


def evaluate_units(
    function: Callable[[Unit], Result],
    units: Mapping[str, Unit],
    *,
    jobs: int | None = None,
    cluster: str | None = None,
) -> Iterator[tuple[str, Result]]:
    """Evaluate a function on each unit, and yield its key and result as soon as it is done, in any order.

    A unit whose worker process is lost, e.g. killed, is evaluated again.

    Args:
        function: pure, and defined in a module, since other processes evaluate it.
        units: key -> argument.
        jobs: processes; None takes joblib's active configuration (`joblib.parallel_config`), by default this
            process alone.
        cluster: address of a Dask scheduler, whose workers take the place of processes.

    Raises:
        WorkerError: worker processes end again and again, the cluster cannot be reached, or it went away.
        LcorppError: the function raised it for a unit.
    """
    left, losses = dict(units), 0
    while left:
        calls = (delayed(_evaluate)(find_log_level(), function, *item) for item in list(left.items()))
        try:
            evaluation: AbstractContextManager[Iterator[tuple[str, Result | LcorppError]]]
            if cluster is not None:
                from lcorpp.work_units.cluster import evaluate_on_cluster  # imports Dask

                evaluation = closing(evaluate_on_cluster(calls, cluster))
            else:
                evaluation = run_in_workers(calls, jobs=jobs, batch_size=1)
            with evaluation as results:
                for key, result in results:
                    losses = 0
                    del left[key]
                    if isinstance(result, LcorppError):
                        raise result
                    yield key, result
        except BrokenProcessPool:
            losses += 1
            LOG.info("a worker process ended; its units are evaluated again")
            if losses == MAX_LOSSES:
                raise WorkerError(
                    f"worker processes ended {MAX_LOSSES} times in a row with {len(left)} units left,"
                    " perhaps for lack of memory; expected fewer processes"
                ) from None


def _evaluate(
    level: int, function: Callable[[Unit], Result], key: str, unit: Unit
) -> tuple[str, Result | LcorppError]:
    """Evaluate a unit; a typed error is a result, which every backend returns."""
    if level < logging.WARNING:
        show_log(level)
    try:
        return key, function(unit)
    except LcorppError as error:
        return key, error
