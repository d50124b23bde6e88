"""A cache of predictions by evidence."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from lcorpp.values import Array, Label, Likelihood

MAX_CACHED_PREDICTIONS = 10_000
"""Maximum number of evidences in a cache; then it is cleared."""


class EvidenceCache:
    """Arrays computed from evidence, each once.

    Evidence with a likelihood is not cached, as it hardly ever occurs twice. The order of evidence counts.
    """

    def __init__(self) -> None:
        self._arrays: dict[tuple[tuple[str, Label], ...], Array] = {}

    def find(self, evidence: Mapping[str, Label], compute: Callable[[Mapping[str, Label]], Array]) -> Array:
        """Return ``compute(evidence)``, from the cache if possible.

        Args:
            compute: the same function in each call. If it raises an error, nothing is cached.
        """
        if any(isinstance(value, Likelihood) for value in evidence.values()):
            return compute(evidence)
        key = tuple(evidence.items())
        known = self._arrays.get(key)
        if known is None:
            known = compute(evidence)
            if len(self._arrays) == MAX_CACHED_PREDICTIONS:
                self._arrays.clear()
            self._arrays[key] = known
        return known
