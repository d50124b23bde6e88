"""A Dask cluster as joblib's backend (extra `dask`)."""

from __future__ import annotations

import asyncio
import re
from asyncio import wait_for
from collections.abc import Generator, Iterable
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any

from joblib import Parallel, parallel_config
from joblib._dask import DaskDistributedBackend

from lcorpp.errors import WorkerError

if TYPE_CHECKING:
    from distributed import Client

CONNECT_SECONDS = 15
"""Seconds to wait for the scheduler, and for its first worker."""

IDLE_SECONDS = 30
"""Seconds without any worker after which the cluster is given up."""

STUCK_SECONDS = 5
"""Seconds without a result, and without a call that Dask has not evaluated, after which one was given up."""

QUEUED = 64
"""Minimum number of calls that wait for workers, so that those that join later get some."""

GONE = "its scheduler, or all of its workers, went away"


class ClusterBackend(DaskDistributedBackend):  # type: ignore[misc]
    """joblib's backend for Dask, without its shortcut to evaluate all here if there is a single worker."""

    def effective_n_jobs(self, n_jobs: int | None) -> int:
        return max(int(super().effective_n_jobs(n_jobs)), QUEUED // 2)  # joblib queues twice as many


def evaluate_on_cluster(calls: Iterable[Any], address: str) -> Generator[Any, None, None]:
    """Evaluate joblib's calls on the workers of a cluster, and yield the results as they are done.

    joblib would wait without end if no worker is left, since Dask waits for new ones, or if Dask gives up a
    call that ended several workers; so joblib waits in a thread, and this one watches the cluster.

    Args:
        address: of the scheduler, e.g. tcp://127.0.0.1:8786.

    Raises:
        WorkerError: Dask is not installed, or the cluster cannot be reached, has no worker or goes away.
    """
    client = _connect(address)
    results: SimpleQueue[tuple[Any] | BaseException | None] = SimpleQueue()

    def wait() -> None:
        """Put each result into the queue, then the error that ended joblib, or None."""
        try:
            backend = ClusterBackend(client=client, wait_for_workers_timeout=CONNECT_SECONDS)
            with parallel_config(backend=backend):
                for result in Parallel(return_as="generator_unordered", batch_size=1)(calls):
                    results.put((result,))
            results.put(None)
        except BaseException as error:
            results.put(error)

    Thread(target=wait, daemon=True).start()
    watch = _Watch(client, address)
    try:
        while True:
            try:
                found = results.get(timeout=1)
            except Empty:
                watch.count_second()
                continue
            if isinstance(found, BaseException):
                raise _explain(found, address)
            if found is None:
                return
            watch.reset()
            yield found[0]
    finally:
        with suppress(TimeoutError, OSError, CancelledError):
            client.close(timeout=1)


class _Watch:
    """Counts the seconds in which nothing can come of a cluster, once it has had a worker."""

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address
        self._idle = self._stuck = 0
        self._began = False

    def reset(self) -> None:
        """Begin again, as there is a result."""
        self._idle, self._stuck, self._began = 0, 0, True

    def count_second(self) -> None:
        """Count a second without a result. Raises `WorkerError` if the cluster is given up."""
        has_workers = _has_workers(self._client)
        self._began = self._began or has_workers
        if not self._began:
            return
        waiting = {"pending", "lost"} & {state.status for state in self._client.futures.copy().values()}
        self._idle = 0 if has_workers else self._idle + 1
        self._stuck = 0 if waiting else self._stuck + 1
        if self._idle >= IDLE_SECONDS:
            raise WorkerError(f"the cluster {self._address} is lost: {GONE}")
        if self._stuck >= STUCK_SECONDS:  # joblib waits, but not for Dask
            raise WorkerError(
                f"one unit ended several workers of the cluster {self._address}, perhaps for lack of memory"
            )


def _explain(error: BaseException, address: str) -> BaseException:
    """Return the error that ended joblib, one of the cluster as a `WorkerError`."""
    if isinstance(error, TimeoutError):
        return WorkerError(
            f"the cluster {address} has no worker after {CONNECT_SECONDS} seconds; expected"
            f" `dask worker {address} --nthreads 1`"
        )
    if isinstance(error, CancelledError | OSError):
        return WorkerError(f"the cluster {address} is lost: {GONE}")
    return error


def _connect(address: str) -> Client:
    """Return a client of a cluster."""
    try:
        from distributed import Client
        from distributed.comm import connect
        from distributed.security import Security
    except ImportError:
        raise WorkerError("a cluster needs Dask; install lcorpp[dask]") from None
    if not re.fullmatch(r"(\w+://)?\S+:\d+", address):
        raise WorkerError(
            f"{address!r} is not an address of a cluster; expected that of a Dask scheduler, e.g. tcp://127.0.0.1:8786"
        )

    async def greet() -> None:
        """Connect as the client will, but for a limited time: it would wait without end for an answer."""
        security = Security().get_connection_args("client")
        comm = await wait_for(connect(address, CONNECT_SECONDS, **security), CONNECT_SECONDS + 1)
        comm.abort()

    try:
        with ThreadPoolExecutor(1) as own:  # a notebook has a loop in this thread
            own.submit(asyncio.run, greet()).result()
        return Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = str(error) or f"no answer of a Dask scheduler in {CONNECT_SECONDS} seconds"
        raise WorkerError(f"the cluster {address} cannot be reached: {reason}") from None


def _has_workers(client: Client) -> bool:
    with suppress(TimeoutError, OSError, CancelledError):
        return bool(client.ncores())
    return False
