"""The samples of one person: put in order, checked, and given a fixed rate as they come."""

from __future__ import annotations

from bisect import insort
from dataclasses import asdict, dataclass, fields
from math import hypot, isfinite, pi
from typing import Self

from lcorpp.errors import DataError
from lcorpp.learning.features.resampling import SIMULTANEOUS

Sample = tuple[float, ...]
"""What was measured at one time, in the order of the inputs."""

LARGEST = 1e9
"""No coordinate, in metres, is larger."""

SLACK = 0.1
"""Seconds by which a jump may be ahead of the fastest person: trackers are noisy, and correct themselves."""


@dataclass(frozen=True)
class Rules:
    """What to do with samples that are late, missing or impossible; see `Streams`, which says it in words."""

    rate: float
    patience: float
    longest_gap: float
    longest: float
    fastest: float
    forget: float

    def __post_init__(self) -> None:
        for name in ("longest_gap", "longest", "fastest", "forget"):
            if not getattr(self, name) > 0:
                raise DataError(f"{name} must be above 0, not {getattr(self, name)}")
        if not isfinite(self.longest_gap):
            raise DataError(f"longest_gap must be finite, not {self.longest_gap}")
        if not 0 <= self.patience <= self.longest_gap:
            raise DataError(
                f"patience must be at least 0 and at most longest_gap, {self.longest_gap:g} s,"
                f" not {self.patience}"
            )
        if self.forget < self.longest_gap:
            raise DataError(
                f"forget must be at least longest_gap, {self.longest_gap:g} s, not {self.forget}:"
                " a track that may go on must not be forgotten"
            )
        if self.longest * self.rate < 2:
            raise DataError(f"longest must be at least two points, {2 / self.rate:g} s, not {self.longest}")


@dataclass
class Repairs:
    """What became of the samples of one person, or of many.

    samples: that came.
    refused: not finite, or beyond `LARGEST`; first_refused says where the first was.
    duplicates: of a time that was there already; the first is kept.
    late: older than one that had been used; dropped.
    bridged: gaps longer than the time between two points, crossed in a straight line.
    gaps, jumps, turned_back, too_long: tracks that ended and began anew, since the person was silent too
        long, moved as nobody can, had a clock that went back, or had been followed long enough.
    """

    samples: int = 0
    refused: int = 0
    first_refused: str = ""
    duplicates: int = 0
    late: int = 0
    bridged: int = 0
    gaps: int = 0
    jumps: int = 0
    turned_back: int = 0
    too_long: int = 0

    def add(self, other: Repairs) -> None:
        """Count those of `other` as well."""
        for field in fields(self):
            if field.name != "first_refused":
                setattr(self, field.name, getattr(self, field.name) + getattr(other, field.name))
        self.first_refused = self.first_refused or other.first_refused

    def copy(self) -> Self:
        """The counts as they are now."""
        return type(self)(**asdict(self))

    def __str__(self) -> str:
        words = [f"{self.samples} samples"]
        if self.refused:
            words.append(f"refused: {self.refused} (the first: {self.first_refused})")
        for what, count in (
            ("duplicates dropped", self.duplicates),
            ("late ones dropped", self.late),
            ("gaps bridged", self.bridged),
            ("begun anew after a long gap", self.gaps),
            ("begun anew after a jump", self.jumps),
            ("begun anew since the clock went back", self.turned_back),
            ("begun anew after the longest time", self.too_long),
        ):
            if count:
                words.append(f"{what}: {count}")
        return "; ".join(words)


class Track:
    """One person's samples, arriving in any order, as points at a fixed rate since the first.

    A sample is used once one that is `patience` seconds younger has come; with patience 0 at once. Samples
    are used in the order of their times, and what comes later than that is dropped. So the points are those
    that `regular` makes of the samples that were used.

    Attributes:
        number: tracks begun so far.
        repairs: what was done.
    """

    def __init__(self, rules: Rules, inputs: tuple[str, ...], angles: tuple[int, ...]) -> None:
        self._rules, self._inputs, self._angles = rules, inputs, frozenset(angles)
        self._place = (inputs.index("x"), inputs.index("y")) if {"x", "y"} <= set(inputs) else None
        self._waiting: list[tuple[float, Sample]] = []
        self._latest = self._begin = self._elapsed = 0.0
        self._last: Sample | None = None
        self._next = 0
        self._points: list[Sample] = []
        self._anew = False
        self.number = 0
        self.repairs = Repairs()

    @property
    def time(self) -> float | None:
        """Seconds, the time of the last point; None before the first."""
        return self._begin + (self._next - 1) / self._rules.rate if self._last is not None else None

    @property
    def count(self) -> int:
        """Points of the present track so far."""
        return self._next if self._last is not None else 0

    def arrive(self, time: float, sample: Sample) -> None:
        """Take a sample; `drain` then gives the points that it made known."""
        repairs = self.repairs
        repairs.samples += 1
        if not self._possible(time, sample):
            return
        if self._last is None and not self._waiting:
            self._latest = time
        elif time < self._latest - self._rules.longest_gap:
            repairs.turned_back += 1
            self.finish()
            self._last, self._latest = None, time
        elif time > self._latest:
            self._latest = time
        ready = self._latest - self._rules.patience
        if self._last is not None and time - self._begin <= self._elapsed:
            if time - self._begin == self._elapsed:
                repairs.duplicates += 1
            else:
                repairs.late += 1
        elif not self._waiting and time <= ready:
            self._use(time, sample)
        elif any(time == other for other, _ in self._waiting):
            repairs.duplicates += 1
        else:
            insort(self._waiting, (time, sample))
            while self._waiting and self._waiting[0][0] <= ready:
                self._use(*self._waiting.pop(0))

    def finish(self) -> None:
        """Use the samples that still wait for younger ones."""
        for time, sample in self._waiting:
            self._use(time, sample)
        self._waiting.clear()

    def drain(self) -> tuple[list[Sample], bool]:
        """The points that became known since the last call, and whether a new track begins with them."""
        drained = self._points, self._anew
        self._points, self._anew = [], False
        return drained

    def _possible(self, time: float, sample: Sample) -> bool:
        if isfinite(time) and all(-LARGEST <= value <= LARGEST for value in sample):
            return True
        if not self.repairs.refused:
            if not isfinite(time):
                where = f"its time is {time}"
            else:
                bad = next(i for i, value in enumerate(sample) if not -LARGEST <= value <= LARGEST)
                where = f"{self._inputs[bad]} is {sample[bad]} at {time:.3f} s"
            self.repairs.first_refused = where
        self.repairs.refused += 1
        return False

    def _use(self, time: float, sample: Sample) -> None:
        """Go on to the next sample in time."""
        last, rules, repairs = self._last, self._rules, self.repairs
        elapsed = time - self._begin
        if last is None:
            self._start(time, sample)
            return
        gap = elapsed - self._elapsed
        if gap > rules.longest_gap:
            repairs.gaps += 1
            self._start(time, sample)
            return
        if self._place is not None:
            x, y = self._place
            if hypot(sample[x] - last[x], sample[y] - last[y]) > rules.fastest * (gap + SLACK):
                repairs.jumps += 1
                self._start(time, sample)
                return
        if elapsed > rules.longest:
            repairs.too_long += 1
            self._start(time, sample)
            return
        if gap > 1 / rules.rate + SIMULTANEOUS:
            repairs.bridged += 1
        at = self._next / rules.rate
        while elapsed >= at - SIMULTANEOUS:
            share = 1.0 if elapsed <= at else (at - self._elapsed) / gap
            self._points.append(self._between(last, sample, share))
            self._next += 1
            at = self._next / rules.rate
        self._last, self._elapsed = sample, elapsed

    def _start(self, time: float, sample: Sample) -> None:
        self.number += 1
        self._begin, self._elapsed, self._last, self._next = time, 0.0, sample, 1
        self._points, self._anew = [sample], True

    def _between(self, start: Sample, end: Sample, share: float) -> Sample:
        """As `resampling.between`, for one place."""
        rest = 1 - share
        return tuple(
            a + ((b - a + pi) % (2 * pi) - pi) * share if channel in self._angles else a * rest + b * share
            for channel, (a, b) in enumerate(zip(start, end, strict=True))
        )
