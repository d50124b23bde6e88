"""A thread that calls functions one after another, beside the event loop."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any, TypeVar

Result = TypeVar("Result")

CLOSE_SECONDS = 1.0
"""Seconds to wait for the current call at the end."""


class SerialThread:
    """Calls functions in their order. A call that still runs does not keep the process from ending."""

    def __init__(self, name: str) -> None:
        self._calls: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    async def call(self, function: Callable[..., Result], *arguments: Any) -> Result:
        """Return what the function returns, or raise what it raises."""
        future: Future[Result] = Future()

        def call() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                future.set_result(function(*arguments))
            except BaseException as error:
                future.set_exception(error)

        self._calls.put(call)
        return await asyncio.wrap_future(future)

    def close(self) -> None:
        """End the thread after its calls; wait at most `CLOSE_SECONDS`."""
        self._calls.put(None)
        self._thread.join(CLOSE_SECONDS)

    def _run(self) -> None:
        while (call := self._calls.get()) is not None:
            call()
