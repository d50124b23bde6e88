"""Estimates from sampled worlds, for programs that are too large to be compiled."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from lcorpp.errors import TooLargeError
from lcorpp.notebook import html_table, join_some
from lcorpp.reasoning.answers import QueryAnswer, Value, answer_query
from lcorpp.reasoning.language.issues import ReasoningWarning
from lcorpp.reasoning.query_model import QueryModel
from lcorpp.reasoning.questions import list_questions
from lcorpp.reasoning.transitions.rejection_sampling import MIN_EFFECTIVE_SAMPLES, Progress, sample_worlds
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Z95, Distribution, Interval
from lcorpp.values.distribution import format_value


class Estimate(float):
    """An estimated probability or expectation; the interval of a sum covers any correlation.

    interval: the number with its 95 % confidence interval.
    effective: the effective sample size.

    Examples:
        >>> from lcorpp import Interval
        >>> from lcorpp.reasoning import Estimate
        >>> Estimate(Interval.from_count(30, 100), effective=100)  # 30 of 100 sampled worlds
        Estimate(0.3 [0.2189, 0.3958]; effective sample size 100)
    """

    interval: Interval
    effective: int

    def __new__(cls, interval: Interval, effective: int) -> Estimate:
        estimate = super().__new__(cls, interval.estimate)
        estimate.interval, estimate.effective = interval, effective
        return estimate

    def __reduce__(self) -> tuple[type[Estimate], tuple[Interval, int]]:
        return Estimate, (self.interval, self.effective)

    @staticmethod
    def estimate_mean(numbers: Sequence[Fraction], shares: Sequence[Estimate]) -> Estimate:
        """Estimate the expectation of a number from the shares of its values.

        The normal interval with four more worlds, two of the smallest and two of the largest number, so that
        it has a width even if all worlds have the same number.

        Source: Agresti and Coull, "Approximate is better than 'exact' for interval estimation of binomial
        proportions", The American Statistician 52(2), 1998, for numbers of which two are possible.
        """
        values, n = np.array(numbers, dtype=np.float64), shares[0].effective
        counts = np.array(shares) * n
        mean = float(counts @ values / n)
        counts[[values.argmin(), values.argmax()]] += 2
        middle = float(counts @ values / (n + 4))
        half = Z95 * float(np.sqrt(counts @ (values - middle) ** 2)) / (n + 4)
        low, high = max(middle - half, float(values.min())), min(middle + half, float(values.max()))
        return Estimate(Interval(mean, min(mean, low), max(mean, high)), n)

    def __str__(self) -> str:
        return f"{self.interval:.4g}"

    def __add__(self, other: float) -> Estimate:
        more = other.interval if isinstance(other, Estimate) else Interval.exact(float(other))
        low, high = self.interval.low + more.low, self.interval.high + more.high
        return Estimate(Interval(self.interval.estimate + more.estimate, low, high), self.effective)

    __radd__ = __add__

    def __repr__(self) -> str:
        return f"Estimate({self.interval:.4g}; effective sample size {self.effective})"


@dataclass(frozen=True, eq=False, repr=False)
class EstimatedDistribution(Distribution):
    """A `Distribution` estimated from sampled worlds.

    intervals: (n,) each probability with its 95 % confidence interval.
    effective: the effective sample size.

    Examples:
        >>> from lcorpp import Interval
        >>> from lcorpp.reasoning import Estimate, EstimatedDistribution
        >>> p = Interval.from_count(30, 100)  # 30 of 100 sampled worlds
        >>> q = Interval.from_count(70, 100)
        >>> shares = {"true": Estimate(p, effective=100), "false": Estimate(q, effective=100)}
        >>> estimated = EstimatedDistribution.from_estimates(shares)
        >>> estimated["true"], str(estimated.intervals[0])
        (0.3, '0.300 [0.219, 0.396]')
    """

    intervals: tuple[Interval, ...]
    effective: int

    @classmethod
    def from_estimates(cls, estimates: Any, is_joint: bool = False) -> EstimatedDistribution:
        """Return the distribution of estimates of all values: value -> estimate.

        Args:
            is_joint: whether the values shall be tuples, also of one attribute.
        """
        values = [(value,) if is_joint and isinstance(value, str) else value for value in estimates]
        p = np.array(list(estimates.values()), dtype=np.float64)
        intervals = tuple(estimate.interval for estimate in estimates.values())
        return cls(tuple(values), p / p.sum(), intervals, next(iter(estimates.values())).effective)

    def __iter__(self) -> Iterator[tuple[Any, Estimate]]:
        """Iterate over the values and the estimates of their probabilities."""
        estimates = [Estimate(interval, self.effective) for interval in self.intervals]
        return iter(zip(self.values, estimates, strict=True))

    def __str__(self) -> str:
        shown = [
            f"{format_value(value)}: {interval:.4g}"
            for value, interval in zip(self.values, self.intervals, strict=True)
        ]
        return f"{join_some(shown)}; effective sample size {self.effective}"

    def __repr__(self) -> str:
        return f"EstimatedDistribution({self})"

    def _repr_html_(self) -> str:
        rows = [
            (format_value(value), f"{interval:.4g}")
            for value, interval in zip(self.values, self.intervals, strict=True)
        ]
        return html_table(("value", "probability"), rows, caption="Estimated distribution")


def estimate_answer(
    model: QueryModel, reason: TooLargeError, samples: int, seed: int, progress: Progress | None = None
) -> QueryAnswer:
    """Answer a query from sampled worlds, as `answer_query`; the numbers are `Estimate`s.

    Warns that they will be, before the first world is drawn, and of the effective sample size.

    Args:
        reason: why the answer is not computed.
        samples: the number of worlds drawn; more, if too few of them satisfy the observations.
        progress: as in `sample_worlds`.

    Raises:
        ProgramError, UndefinedError: as `answer_query`; or a world violates a condition of the language.
        TooLargeError: too few sampled worlds satisfy the observations.
    """

    asked = model.query.written or str(model.query)
    message = f"{reason}: {asked} will be estimated from {samples} or more worlds drawn at random"
    warnings.warn(message, ReasoningWarning, stacklevel=_find_caller())
    # worlds are drawn without guesses, which may turn out wrong
    system = build_transition_system(model.ground, list_questions(model.query), max_frontier=0)

    def weigh(question: str) -> Mapping[Value, int]:
        found = sample_worlds(model.ground, system, question, samples, seed, progress)
        if not found.possible:
            return {}
        worlds = f"{found.drawn} worlds drawn at random"
        if found.accepted < MIN_EFFECTIVE_SAMPLES:
            problem = (
                "the samples are too few"
                if found.accepted == found.drawn
                else "its evidence is too improbable for sampling"
                if found.accepted
                else "no sample satisfied the evidence, which is improbable or impossible"
            )
            raise TooLargeError(
                f"{reason}, and {problem}: an effective sample size of {found.accepted} in {worlds}; expected"
                f" at least {MIN_EFFECTIVE_SAMPLES}"
            )
        message = f"{reason}: estimated from {worlds}, effective sample size {found.accepted}"
        warnings.warn(message, ReasoningWarning, stacklevel=_find_caller())
        return found.counts

    return answer_query(model.ground.source, model.query, weigh, _make_estimate)


def _find_caller() -> int:
    """Return the level of the caller of the package, to which warnings point."""
    frame, level = sys._getframe(1), 1
    while frame.f_back and frame.f_globals.get("__name__", "").startswith(("lcorpp.", "contextlib")):
        frame, level = frame.f_back, level + 1
    return level


def _make_estimate(count: int, total: int) -> Estimate:
    return Estimate(Interval.from_count(count, total), total)
