"""Distributions estimated from sampled worlds."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.values import Array, Distribution, freeze


@dataclass(frozen=True, eq=False)
class EstimatedDistribution(Distribution):
    """A distribution with standard errors.

    errors: (n,) standard error of each probability.
    samples: number of sampled worlds.
    """

    errors: Array
    samples: int

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "errors", freeze(self.errors))
