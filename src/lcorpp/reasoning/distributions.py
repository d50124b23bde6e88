"""A distribution that was estimated from worlds drawn at random."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.values import Array, Distribution, freeze


@dataclass(frozen=True, eq=False)
class EstimatedDistribution(Distribution):
    """A distribution with error bars.

    errors: (n,) the standard error of each probability.
    samples: how many worlds were drawn.
    """

    errors: Array
    samples: int

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "errors", freeze(self.errors))
