"""Time by the stamps of many people, of which some are wrong, and a check for stamps that stand still."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

MAX_BASES = 8
"""Time bases that a clock keeps: the latest ones used."""
BLOCK = 20
"""Samples of a person after which `StampCheck` looks at the share that is too late to be used."""


@dataclass(slots=True)
class _TimeBase:
    """Stamps that continue each other.

    latest: the latest stamp. time: the clock's time at it. begin: the clock's time at the first stamp; NaN
        for the first base of a clock.
    """

    latest: float
    time: float
    begin: float


class Clock:
    """A clock that is robust to wrong time stamps, to offsets between people, and to clocks that are reset.

    Stamps at most `step` seconds apart form a time base, and the base that is ahead drives the clock. A stamp
    far from all bases begins a base, which changes nothing before it advances. So wrong stamps, of a person
    or of a whole message, have no effect, and people whose stamps differ by an offset have their own bases.
    If all stamps jump, because the clock was reset or all were silent, the clock advances by one `step` and
    continues from the new stamps. It also advances by one `step` after `MAX_BASES` stamps that begin bases:
    time passes, however far the stamps are apart.

    Attributes:
        elapsed: seconds since the first stamp.
    """

    def __init__(self, step: float) -> None:
        self.elapsed = 0.0
        self._step = step
        self._bases: list[_TimeBase] = []  # the one used last comes last
        self._begun = 0  # bases begun since the clock last advanced

    def observe(self, time: float) -> None:
        """Process one finite stamp."""
        near = [base for base in self._bases if abs(time - base.latest) <= self._step]
        if not near:
            self._begin(time)
            return
        base = max(near, key=lambda base: (base.time, -abs(time - base.latest)))
        self._bases.remove(base)
        self._bases.append(base)
        ahead = time - base.latest
        if ahead <= 0:
            return
        is_jump = base.time == base.begin == self.elapsed
        base.latest, base.time = time, base.time + (self._step if is_jump else ahead)
        if base.time > self.elapsed:
            self.elapsed, self._begun = base.time, 0

    def _begin(self, time: float) -> None:
        """Begin a time base."""
        self._begun += bool(self._bases)
        if self._begun >= MAX_BASES:
            self.elapsed, self._begun = self.elapsed + self._step, 0
        self._bases.append(_TimeBase(time, self.elapsed, self.elapsed if self._bases else nan))
        del self._bases[:-MAX_BASES]


class StampCheck:
    """Find a person whose stamps stand still, e.g. because they are float32 numbers of seconds since 1970."""

    def __init__(self) -> None:
        self._samples = self._unused = 0

    def observe(self, is_used: bool) -> bool:
        """Count a sample; return whether more than half of the last `BLOCK` samples are too late to be used.

        It returns False between the ends of two blocks.
        """
        self._samples += 1
        self._unused += not is_used
        if self._samples < BLOCK:
            return False
        is_doubtful = self._unused > BLOCK / 2
        self._samples = self._unused = 0
        return is_doubtful


def describe_doubtful_stamps(person: object, time: float) -> str:
    """Return the warning about stamps that `StampCheck` has found."""
    return (
        f"most of the last {BLOCK} samples of {person!r} have no later time stamp than the one before, the"
        f" last is at {time:.15g}; expected stamps that advance: are they frozen, rounded or float32 numbers?"
    )
