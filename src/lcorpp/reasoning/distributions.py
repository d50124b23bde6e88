"""Distributions estimated from sampled worlds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lcorpp.reasoning.answers import make_no_value_error
from lcorpp.reasoning.transitions.likelihood_weighting import estimate
from lcorpp.reasoning.transitions.transition_system import TransitionSystem
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


def estimate_marginal(
    system: TransitionSystem, term: str, facts: Mapping[str, str], samples: int
) -> EstimatedDistribution:
    """Estimate the marginal of a term by likelihood weighting.

    Raises:
        ProgramError: the term may have no value.
        UndefinedError: no sampled world has the facts.
    """
    estimates = estimate(system, term, facts, samples)
    if estimates.values[""][0]:
        raise make_no_value_error(system.program.source, term, estimates.values[""][0])
    values = tuple(value for value in estimates.values if value)
    p, errors = np.array([estimates.values[value] for value in values]).T
    return EstimatedDistribution(values, p / p.sum(), errors, estimates.samples)
