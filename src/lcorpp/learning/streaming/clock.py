"""How much time has passed, told by stamps of which some are wrong."""

from __future__ import annotations


class Clock:
    """Seconds that passed while samples came, by their stamps.

    A stamp that is up to `step` ahead of the latest moves the clock. One that is further away, ahead or
    behind, is taken for an error, unless the next is as far away: then everybody was silent, or a recording
    begins again, and the clock goes on by one `step`. So a few wrong stamps do not make time pass.
    """

    def __init__(self, step: float) -> None:
        self.passed = 0.0
        self._step = step
        self._latest: float | None = None
        self._astray = False

    def tell(self, time: float) -> None:
        """Hear one more stamp, finite."""
        if self._latest is None:
            self._latest = time
        ahead = time - self._latest
        if abs(ahead) <= self._step:
            self._astray = False
            if ahead > 0:
                self.passed += ahead
                self._latest = time
        elif self._astray:
            self._astray = False
            self.passed += self._step
            self._latest = time
        else:
            self._astray = True
