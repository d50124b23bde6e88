"""Work that is divided between kinds of trials by what they gain."""

from __future__ import annotations

from math import log

DECAY = 0.9
"""Factor of earlier gains and work after every record."""


class WorkShares:
    """The recent gains and work of some kinds of trials, by number.

    Args:
        count: number of kinds. min_share: smallest share of the recent work of each.
    """

    def __init__(self, count: int, min_share: float) -> None:
        self._min_share = min_share
        self._gains, self.work = [0.0] * count, [0.0] * count

    def record(self, kind: int, gap_before: float, gap: float, work: float) -> None:
        """Record trials of a kind, which narrowed a gap between bounds; the gain is the log of the ratio."""
        for numbers in (self._gains, self.work):
            numbers[:] = [DECAY * number for number in numbers]
        self._gains[kind] += log(gap_before / gap) if 0 < gap < gap_before else 0.0
        self.work[kind] += work

    def choose(self) -> int:
        """Return the kind that gains most by its work, or one whose share is too small."""
        kinds = range(len(self.work))
        least = min(kinds, key=self.work.__getitem__)
        if self.work[least] <= self._min_share * sum(self.work):
            return least
        return max(kinds, key=lambda kind: self._gains[kind] / self.work[kind])
