"""Limits of work and memory; a computation that reaches one returns its result so far."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from time import thread_time
from types import FrameType

from lcorpp.interrupts import handle_sigint


class Budget:
    """Time and memory of a computation, which checks `is_spent` between its steps.

    The time is the CPU time of the thread that makes the budget: neither other processes nor other threads
    spend it, so that a busy machine changes how long a computation takes, not how far it gets.

    Args:
        seconds: of CPU time from now. size: bytes of the computation's own arrays.

    Attributes:
        reason: "time limit", "memory limit" or "interrupted"; "" while no limit was reached.
    """

    def __init__(self, seconds: float = inf, size: float = inf) -> None:
        self._began, self._seconds, self._size = thread_time(), seconds, size
        self._is_interrupted = False
        self.reason = ""

    def __repr__(self) -> str:
        return f"<Budget: {self.reason or f'{self.seconds:.3g} of {self._seconds:.3g} s'}>"

    @property
    def is_limited(self) -> bool:
        """Whether the time has a limit."""
        return self._seconds < inf

    @property
    def seconds(self) -> float:
        """CPU time since the start."""
        return thread_time() - self._began

    def is_spent(self, size: float = 0.0, *, share: float = 1.0, at_minimum: bool = True) -> bool:
        """Return whether a limit is reached, and set the reason.

        Args:
            size: bytes in use.
            share: of the time that this part of the computation may have used at most; it sets no reason.
            at_minimum: whether the computation has done its minimal work, before which time has no limit.
        """
        limits = {
            "interrupted": self._is_interrupted,
            "memory limit": size > self._size,
            "time limit": at_minimum and self.seconds >= self._seconds,
        }
        reached = next((name for name, is_reached in limits.items() if is_reached), "")
        self.reason = reached or self.reason
        return bool(reached) or (at_minimum and self.seconds >= share * self._seconds)

    @contextmanager
    def catch_interrupt(self) -> Iterator[None]:
        """Let the first Ctrl-C spend the budget; a second one raises KeyboardInterrupt."""

        def interrupt(number: int, frame: FrameType | None) -> None:
            if self._is_interrupted:
                raise KeyboardInterrupt
            self._is_interrupted = True

        with handle_sigint(interrupt):
            yield
