"""A Dask cluster as joblib's backend (extra `dask`)."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import Any

from joblib import parallel_config
from joblib._dask import DaskDistributedBackend

from lcorpp.errors import WorkerError

CONNECT_SECONDS = 15
"""Seconds to wait for the scheduler, and for its first worker."""

IDLE_SECONDS = 30
"""Seconds without any worker after which the cluster is given up."""

QUEUED = 64
"""Minimum number of calls that wait for workers, so that those that join later get some."""

GONE = "its scheduler, or all of its workers, went away"


class ClusterBackend(DaskDistributedBackend):  # type: ignore[misc]
    """joblib's backend for Dask, without its shortcut to evaluate all here if there is a single worker."""

    def effective_n_jobs(self, n_jobs: int | None) -> int:
        return max(int(super().effective_n_jobs(n_jobs)), QUEUED // 2)  # joblib queues twice as many


@contextmanager
def connect(address: str) -> Iterator[None]:
    """Make the workers of a cluster evaluate joblib's calls.

    Args:
        address: of the scheduler, e.g. tcp://127.0.0.1:8786.

    Raises:
        WorkerError: Dask is not installed, or the cluster cannot be reached, has no worker or goes away.
    """
    try:
        from distributed import Client
    except ImportError:
        raise WorkerError("a cluster needs Dask; install lcorpp[dask]") from None
    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise WorkerError(f"the cluster {address} cannot be reached: {error}") from None
    ended, reasons = Event(), list[str]()
    Thread(target=_watch, args=(client, ended, reasons), daemon=True).start()
    try:
        backend = ClusterBackend(client=client, wait_for_workers_timeout=CONNECT_SECONDS)
        with parallel_config(backend=backend):
            yield
    except TimeoutError:
        raise WorkerError(
            f"the cluster {address} has no worker after {CONNECT_SECONDS} seconds; expected"
            f" `dask worker {address} --nthreads 1`"
        ) from None
    except (CancelledError, OSError):
        reason = reasons[0] if reasons else GONE
        raise WorkerError(f"the cluster {address} is lost: {reason}") from None
    finally:
        ended.set()
        with suppress(TimeoutError, OSError):
            client.close(timeout=1)


def _watch(client: Any, ended: Event, reasons: list[str]) -> None:
    """Close the client, which cancels all calls, if no worker is left or a call ends worker after worker.

    joblib waits for ever in both cases: Dask waits for new workers, and joblib misses calls that Dask
    gave up.
    """
    idle, began = 0, False
    while not reasons and not ended.wait(1):
        with suppress(TimeoutError, OSError, CancelledError):
            present = bool(client.ncores())
            began = began or present
            idle = idle + 1 if began and not present else 0
        if any(state.status == "error" for state in client.futures.copy().values()):
            reasons.append("one unit ended several workers, perhaps for lack of memory")
        elif idle >= IDLE_SECONDS:
            reasons.append(GONE)
    if reasons:
        client.close()
