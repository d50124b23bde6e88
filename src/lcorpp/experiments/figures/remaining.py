"""The remaining time of a run of several figures, from the time that its parts have taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

MIN_SHARE = 0.02
"""The pace of a step is known once this share of it is done."""


class RemainingTime:
    """Estimates the remaining time from measurements of this run.

    Only the ratios of the figures' costs are known before: the seconds per unit of cost are those that the
    finished figures took. The pace of the current step is measured by itself.
    """

    def __init__(self, costs: Mapping[str, float], clock: Callable[[], float]) -> None:
        """Take the cost of each figure of the run, and a clock in seconds."""
        self._costs, self._clock = dict(costs), clock
        self._done_cost = self._done_seconds = 0.0
        self._current: tuple[float, float] | None = None  # cost of the current figure, and when it began
        self._step: tuple[float, float] | None = None  # when the current step began, and its completed share

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Measure a figure; one that fails or is interrupted does not count."""
        cost, began = self._costs.pop(name), self._clock()
        self._current = cost, began
        yield
        self._done_cost += cost
        self._done_seconds += self._clock() - began
        self._current = None

    @contextmanager
    def measure_step(self) -> Iterator[None]:
        """Measure a step of the current figure."""
        self._step = self._clock(), 0.0
        yield
        self._step = None

    def advance(self, done: int, total: int) -> None:
        """Take the completed and the total number of parts of the current step."""
        if self._step is not None and total:
            self._step = self._step[0], done / total

    @property
    def step_seconds(self) -> float | None:
        """The remaining seconds of the current step; None without one, or before its pace is known."""
        if self._step is None or self._step[1] < MIN_SHARE:
            return None
        began, share = self._step
        return (self._clock() - began) * (1 - share) / share

    @property
    def seconds(self) -> float | None:
        """The remaining seconds of all figures; None before the first is finished."""
        if not self._costs and self._current is None:
            return 0.0
        if not self._done_cost:
            return None
        pace = self._done_seconds / self._done_cost
        current = self.step_seconds or 0.0
        if self._current is not None:
            cost, began = self._current
            current = max(current, pace * cost - (self._clock() - began))
        return current + pace * sum(self._costs.values())
