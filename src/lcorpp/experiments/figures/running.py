"""Make figures one after another; finished ones are kept for the next run with the same options."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from lcorpp.assembly.progress import Advance, ProgressDisplay
from lcorpp.errors import DataError, FileError
from lcorpp.experiments.figures.registry import FIGURES
from lcorpp.experiments.figures.report import write_report
from lcorpp.experiments.figures.result import FigureOptions
from lcorpp.experiments.figures.storage import StoredFigure, load_figure, store_figure
from lcorpp.files import make_folder

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


@dataclass(frozen=True)
class MadeFigure:
    """A figure of a run. reused: whether an earlier run made it. seconds: of its computation."""

    name: str
    reused: bool
    seconds: float


class FigureRun:
    """A run that makes figures and the report in a folder.

    remaining: the remaining time of the run.
    """

    def __init__(
        self,
        folder: Path,
        names: Sequence[str],
        options: FigureOptions,
        *,
        again: bool = False,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        """Look which figures are finished.

        Args:
            names: of `FIGURES`.
            again: replace the figures in the folder that other options or another version made, or of which a
                file is damaged or missing.

        Raises:
            DataError: the folder has a figure of other options or of another version, or a damaged one.
            FileError: a file of a figure is missing or cannot be read.
        """
        self._folder, self._names, self._options, self._clock = folder, names, options, clock
        self._finished = _find_finished(folder, options, again)
        todo = {name: FIGURES[name] for name in names if name not in self._finished}
        costs = {name: row.fast_seconds if options.fast else row.seconds for name, row in todo.items()}
        self.remaining = RemainingTime(costs, clock)

    def make(self, progress: ProgressDisplay) -> Iterator[MadeFigure]:
        """Make the figures; each is on the disk, and in the report, before it is yielded.

        Args:
            progress: displays the steps of each figure.

        Raises:
            FileError: a file cannot be written.
            KeyboardInterrupt: an interrupt; the message names the figures that are kept.
        """
        make_folder(self._folder)
        for name in self._names:
            reused = name in self._finished
            if not reused:
                self._make(name, progress)
            finished = [self._finished[key] for key in FIGURES if key in self._finished]
            write_report(self._folder / "report.html", finished)
            yield MadeFigure(name, reused, self._finished[name].seconds)

    def _make(self, name: str, progress: ProgressDisplay) -> None:
        began = self._clock()
        try:
            with self.remaining.measure(name):
                result = FIGURES[name].make(self._options, self._display(name, progress))
                store_figure(self._folder, result, self._options, self._clock() - began)
        except KeyboardInterrupt:
            names = ", ".join(self._finished)
            kept = f"kept in {self._folder}: {names}" if names else "no figure is finished"
            message = f"interrupted while making {name}; {kept}; the same command continues"
            raise KeyboardInterrupt(message) from None
        stored = load_figure(self._folder, name, self._options)
        if stored is None:
            raise DataError(f"{self._folder}: the figure {name} was removed while it was written")
        self._finished[name] = stored

    def _display(self, name: str, progress: ProgressDisplay) -> ProgressDisplay:
        """Return a display that also measures, with the figure's name in the titles."""

        @contextmanager
        def show(title: str, total: int | None = None, /) -> Iterator[Advance]:
            with self.remaining.measure_step(), progress(f"{name}: {title}", total) as advance:

                def advance_both(done: int, total: int) -> None:
                    self.remaining.advance(done, total)
                    advance(done, total)

                yield advance_both

        return show


def _find_finished(folder: Path, options: FigureOptions, again: bool) -> dict[str, StoredFigure]:
    """Return the figures of a folder that can be reused.

    Raises:
        DataError, FileError: one cannot, see `load_figure`, unless it is to be made again.
    """
    finished = {}
    for name in FIGURES:
        try:
            stored = load_figure(folder, name, options)
        except (DataError, FileError):
            if not again:
                raise
        else:
            if stored is not None:
                finished[name] = stored
    return finished
