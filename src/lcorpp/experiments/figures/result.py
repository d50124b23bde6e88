"""The result of a figure: its numbers, their verdicts on the paper's hypotheses, and its drawing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Literal

from lcorpp.errors import DecisionError
from lcorpp.experiments.figures.published import Deviation
from lcorpp.values import Interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TRIALS, FAST_TRIALS = 5000, 1000
"""Simulated people per setting: as many as in the paper, and with `FigureOptions.fast`."""

MIN_TRIALS = 100
"""Normal intervals of means need about as many people."""

Row = Mapping[str, str | float | int | None]
"""Column -> cell. The ends of the interval of a column NAME are in NAME_low and NAME_high."""

Layout = Literal["wide", "column"]
"""Panels side by side over the width of a page, or one above the other in the width of a column."""


@dataclass(frozen=True)
class FigureOptions:
    """Options of all figures.

    fast: fewer people, tracks and seeds, for a look at everything; then more is not decided.
    seed: of all random numbers. jobs: processes; the results are the same for any number.
    trials: simulated people per setting; None takes `TRIALS`, or `FAST_TRIALS` with `fast`.
    """

    fast: bool = False
    seed: int = 0
    jobs: int = 1
    trials: int | None = None

    def __post_init__(self) -> None:
        if self.jobs < 1:
            raise DecisionError(f"the number of processes is {self.jobs}; expected at least 1")
        if self.trials is not None and self.trials < MIN_TRIALS:
            raise DecisionError(
                f"the number of trials is {self.trials}; expected at least {MIN_TRIALS}, as intervals of"
                " fewer people do not cover what they should"
            )

    @property
    def n_trials(self) -> int:
        """Simulated people per setting."""
        return self.trials or (FAST_TRIALS if self.fast else TRIALS)

    @property
    def identity(self) -> dict[str, int | bool]:
        """What determines the results: all but the number of processes."""
        return {"fast": self.fast, "seed": self.seed, "trials": self.n_trials}


class Verdict(StrEnum):
    """Whether the numbers confirm a claim."""

    HOLDS = "holds"
    OPEN = "is not decided"
    FAILS = "does not hold"


@dataclass(frozen=True)
class Finding:
    """A claim of the paper, or of ours, and the verdict of the numbers on it.

    claim: a clause, e.g. "LCORPP returns more than R+P". evidence: the numbers that decide, and beside exact
        ones the simulated ones with intervals, as a check.
    """

    claim: str
    verdict: Verdict
    evidence: str

    def __str__(self) -> str:
        return f"{self.claim}: {self.verdict} ({self.evidence})."


@dataclass(frozen=True, eq=False)
class FigureResult:
    """The result of a figure.

    name: as in the table of figures. title: of the report's section.
    table: tidy rows with equal columns; see `Row`.
    findings: the hypotheses, decided from the numbers.
    draw: returns the figure in a layout.
    deviations: our numbers beside the published ones.
    notes: what a reader must know to judge the numbers, in sentences.
    configuration: name -> value of what was run, besides the options.
    """

    name: str
    title: str
    table: Sequence[Row]
    findings: Sequence[Finding]
    draw: Callable[[Layout], Figure]
    deviations: Sequence[Deviation] = ()
    notes: Sequence[str] = ()
    configuration: Mapping[str, str | int | float] = field(default_factory=dict)

    @property
    def paragraph(self) -> str:
        """The findings and notes as one paragraph."""
        return " ".join([*map(str, self.findings), *self.notes])


def judge(differences: Sequence[Interval]) -> Verdict:
    """Decide whether all differences are above 0: each whole interval, or none of one.

    Simulated differences may leave it open; where an exact number is known, it decides, see `judge_exactly`.
    """
    if all(difference.low > 0 for difference in differences):
        return Verdict.HOLDS
    return Verdict.FAILS if any(difference.high <= 0 for difference in differences) else Verdict.OPEN


def judge_exactly(numbers: Sequence[float]) -> Verdict:
    """Decide whether all exact numbers are above 0."""
    return judge([Interval.exact(number) for number in numbers])


def subtract_from(value: float, interval: Interval) -> Interval:
    """Return a number minus a quantity, as an interval."""
    return Interval(value - interval.estimate, value - interval.high, value - interval.low)
