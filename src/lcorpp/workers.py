"""Worker processes: they leave Ctrl-C to their parent process, and end with it, however it ends."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import threading
import time
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from joblib import Parallel
from joblib._parallel_backends import LokyBackend
from joblib.externals.loky import ProcessPoolExecutor
from joblib.parallel import get_active_backend

from lcorpp.interrupts import ignore_sigint

try:  # joblib's own copy, if it has one
    from joblib.externals.cloudpickle import dumps
except ImportError:
    from cloudpickle import dumps

PARENT_SECONDS = 0.5
"""Seconds between two looks of a worker at its parent process."""

IDLE_SECONDS = 60
"""Seconds without work after which the worker of `start_worker` ends; the next work starts another one."""


class WorkerBackend(LokyBackend):  # type: ignore[misc]
    """joblib's processes, each prepared by `begin_worker`."""

    def configure(self, *arguments: Any, **options: Any) -> Any:
        return super().configure(*arguments, initializer=begin_worker, initargs=(os.getpid(),), **options)


@contextmanager
def run_in_workers(
    calls: Iterable[Any],
    *,
    jobs: int | None = None,
    ordered: bool = False,
    threads: int | None = None,
    **options: Any,
) -> Iterator[Iterator[Any]]:
    """Evaluate joblib's calls in worker processes; yield an iterator of their results.

    At the end of the block, calls without a result are cancelled and their workers are killed.

    Args:
        calls: of `joblib.delayed`.
        jobs: processes; None takes joblib's active configuration (`joblib.parallel_config`), by default this
            process alone. A configured backend other than joblib's processes takes their place.
        ordered: whether the results come in the order of the calls, not as they are done.
        threads: of numerical libraries in each process; None lets joblib divide the cores.
        options: of `joblib.Parallel`.
    """
    active, n_active = get_active_backend()
    if type(active) is LokyBackend:
        threads = threads or active.inner_max_num_threads
        options["backend"] = WorkerBackend(nesting_level=active.nesting_level, inner_max_num_threads=threads)
    return_as = "generator" if ordered else "generator_unordered"
    with ignore_sigint():  # what is started here inherits it
        results = Parallel(n_active if jobs is None else jobs, return_as=return_as, **options)(calls)
    try:
        yield results
    finally:
        with warnings.catch_warnings():  # joblib warns of calls that are cancelled
            warnings.simplefilter("ignore", UserWarning)
            results.close()


def pickle_for_workers(value: Any) -> npt.NDArray[np.uint8]:
    """Return a value as joblib pickles it, at once, for several calls; `pickle.loads` reads it.

    A thread pickles the arguments of calls later, when other code may change the values that they cache.
    As an array, joblib copies a large one to the memory that all workers share, instead of to each call.
    """
    return np.frombuffer(dumps(value), np.uint8)


def start_worker() -> ProcessPoolExecutor:
    """Return an executor with one worker process; `shutdown(kill_workers=True)` ends it during its work."""
    return ProcessPoolExecutor(1, timeout=IDLE_SECONDS, initializer=begin_worker, initargs=(os.getpid(),))


def end_with_thread(command: Sequence[str]) -> list[str]:
    """Return a command that runs a program, and kills it when the thread that started it has ended.

    That is for threads that wait for the program, so that it ends with this process. On Linux, by util-linux'
    setpriv; elsewhere, and if the program is missing, the command itself.
    """
    if not _has_setpriv() or shutil.which(command[0]) is None:
        return list(command)
    return ["setpriv", "--pdeathsig", "KILL", "--", *command]


@cache
def _has_setpriv() -> bool:
    """Whether there is a setpriv that can do it; BusyBox' cannot."""
    command = ["setpriv", "--pdeathsig", "KILL", "--", "true"]
    try:
        return subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def begin_worker(parent: int) -> None:
    """Prepare this worker process: it ignores Ctrl-C, and ends when its parent process has ended.

    On Windows it does not notice the end of its parent process.

    Args:
        parent: id of the process that started it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if os.name == "posix":
        threading.Thread(target=_end_with, args=(parent,), name="parent", daemon=True).start()


def _end_with(parent: int) -> None:
    """End this process when another process has become its parent, because its own parent has ended."""
    while os.getppid() == parent:
        time.sleep(PARENT_SECONDS)
    os._exit(1)
