"""Estimates from sampled worlds, for programs that are too large to be compiled."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lcorpp.errors import TooLargeError
from lcorpp.notebook import html_table, join_some
from lcorpp.reasoning.answers import make_no_value_error, make_no_world_error
from lcorpp.reasoning.grounding.ground_program import GroundProgram
from lcorpp.reasoning.transitions.rejection_sampling import MIN_EFFECTIVE_SAMPLES, SampleCounts
from lcorpp.values import Distribution, Interval
from lcorpp.values.distribution import format_value


class ReasoningWarning(UserWarning):
    """An answer is an estimate, as the program is too large to be compiled."""


class Estimate(float):
    """An estimated probability.

    interval: the probability with its 95 % confidence interval.
    effective: the effective sample size.
    """

    interval: Interval
    effective: int

    def __new__(cls, interval: Interval, effective: int) -> Estimate:
        estimate = super().__new__(cls, interval.estimate)
        estimate.interval, estimate.effective = interval, effective
        return estimate

    def __reduce__(self) -> tuple[type[Estimate], tuple[Interval, int]]:
        return Estimate, (self.interval, self.effective)

    def __repr__(self) -> str:
        return f"Estimate({self.interval:.4g}; effective sample size {self.effective})"


@dataclass(frozen=True, eq=False, repr=False)
class EstimatedDistribution(Distribution):
    """A distribution estimated from sampled worlds.

    intervals: (n,) each probability with its 95 % confidence interval.
    effective: the effective sample size.
    """

    intervals: tuple[Interval, ...]
    effective: int

    @classmethod
    def from_estimates(cls, estimates: Mapping[str, Estimate]) -> EstimatedDistribution:
        """Return the distribution of estimates of all values: value -> estimate."""
        p = np.array(list(estimates.values()), dtype=np.float64)
        intervals = tuple(estimate.interval for estimate in estimates.values())
        return cls(tuple(estimates), p / p.sum(), intervals, next(iter(estimates.values())).effective)

    def __repr__(self) -> str:
        shown = [
            f"{format_value(value)}: {interval:.4g}"
            for value, interval in zip(self.values, self.intervals, strict=True)
        ]
        return f"EstimatedDistribution({join_some(shown)}; effective sample size {self.effective})"

    def _repr_html_(self) -> str:
        rows = [
            (format_value(value), f"{interval:.4g}")
            for value, interval in zip(self.values, self.intervals, strict=True)
        ]
        return html_table(("value", "probability"), rows)


def estimate_probabilities(
    ground: GroundProgram, found: SampleCounts, reason: TooLargeError, conditions: str, stacklevel: int
) -> dict[str, Estimate]:
    """Estimate the probability of each value of a term from sampled worlds; "" is for no value.

    Warns that the probabilities are estimates.

    Args:
        reason: why the probabilities are not computed.
        conditions: the conditions of the question as text, for the error.
        stacklevel: of the warning.

    Raises:
        UndefinedError: it is certain that no world has the evidence.
        TooLargeError: too few sampled worlds have the evidence.
    """
    if not found.possible:
        raise make_no_world_error(ground.source, conditions)
    if found.accepted < MIN_EFFECTIVE_SAMPLES:
        problem = (
            "the samples are too few"
            if found.accepted == found.drawn
            else "its evidence is too improbable for sampling"
            if found.accepted
            else "no sample met the evidence, which is improbable or impossible"
        )
        raise TooLargeError(
            f"{reason}, and {problem}: an effective sample size of {found.accepted} in {found.drawn} worlds"
            f" drawn at random; expected at least {MIN_EFFECTIVE_SAMPLES}"
        )
    message = f"{reason}: estimated from {found.drawn} worlds drawn at random, effective sample size"
    warnings.warn(f"{message} {found.accepted}", ReasoningWarning, stacklevel=stacklevel)
    return {
        value: Estimate(Interval.from_count(count, found.accepted), found.accepted)
        for value, count in found.counts.items()
    }


def drop_no_value(ground: GroundProgram, term: str, estimates: dict[str, Estimate]) -> dict[str, Estimate]:
    """Return the estimates without that of no value.

    Raises:
        ProgramError: the term has no value in a sampled world.
    """
    share = estimates.pop("")
    if share:
        raise make_no_value_error(ground.source, term, f"{share.interval:.4g}")
    return estimates
