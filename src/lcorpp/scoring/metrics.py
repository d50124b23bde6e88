"""Scores of strategies, each with a 95 % confidence interval, and their paired differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from lcorpp.decision import STRATEGIES
from lcorpp.errors import DecisionError, check_type
from lcorpp.notebook import html_table
from lcorpp.values import Array, Interval

METRICS = ("f1", "precision", "recall", "accuracy", "cost", "return")
"""The names of the scores in tables and files."""


DIFFERENCES = ("f1", "cost", "return")
"""The names of the scores whose differences between strategies have intervals."""


@dataclass(frozen=True, eq=False)
class Scores:
    """The scores of a strategy.

    counts: (V, V + 1) counts[i, j] decisions with true value i and reported value j; the last column counts
        decisions without a report.
    f1, precision, recall: of the domain's positive class; without one, means over all values.
    accuracy: fraction of correct reports among all decisions.
    cost: mean cost of the actions before the report.
    return_: mean return: reward of the report minus cost, undiscounted.
    cost_sd: standard deviation of the cost of single decisions.
    variables: with several shared variables, the accuracy of each; `accuracy` is that of all together.
    samples: name in `DIFFERENCES` -> (n,) a number for each of n people, whose mean is the score; {} if the
        scores are exact.
    gap: the largest gap between the bounds of the robot's policy at the priors of these people, in reward
        units; None for a strategy that does not plan or has policies of its own, and without an upper bound.
    limits: limit of the domain -> share of the people whom it is about with its event, or their mean cost; {}
        if the scores are exact.

    Examples:
        >>> from lcorpp import load_robot
        >>> from lcorpp.decision import strategies
        >>> from lcorpp.scoring import evaluate_exactly
        >>> full = load_robot("intention", cache=False)
        >>> channels = {"motion": full.senses["motion"].classifier}
        >>> (scores,) = evaluate_exactly(full.domain, full.robot, channels, strategies(["LCORPP"]))
        >>> {name: round(interval.estimate, 2) for name, interval in scores.metrics.items()}
        {'f1': 0.85, 'precision': 0.86, 'recall': 0.84, 'accuracy': 0.88, 'cost': 9.28, 'return': 51.53}
    """

    strategy: str
    counts: Array
    f1: Interval
    precision: Interval
    recall: Interval
    accuracy: Interval
    cost: Interval
    return_: Interval
    cost_sd: float
    variables: Mapping[str, Interval] = field(default_factory=dict)
    samples: Mapping[str, Array] = field(default_factory=dict, repr=False)
    gap: float | None = None
    limits: Mapping[str, Interval] = field(default_factory=dict)

    @property
    def metrics(self) -> dict[str, Interval]:
        """The scores by their names in tables, `METRICS`."""
        scores = (self.f1, self.precision, self.recall, self.accuracy, self.cost, self.return_)
        return dict(zip(METRICS, scores, strict=True))

    @property
    def cells(self) -> dict[str, float]:
        """The scores of a row of a file, with the ends of the intervals: NAME, NAME_low, NAME_high.

        With several shared variables, accuracy_NAME is the accuracy of each.
        """
        parts = {f"accuracy_{name}": accuracy for name, accuracy in self.variables.items()}
        limits = {f"limit_{name}": share for name, share in self.limits.items()}
        return make_cells(self.metrics | parts | limits)

    @property
    def columns(self) -> dict[str, Interval]:
        """The scores of a table: of several variables the accuracy of each and of all together.

        Precision and recall of single combinations of values have little meaning there.
        """
        if not self.variables:
            return {"F1": self.f1} | {name: self.metrics[name] for name in METRICS[1:]}
        return {**self.variables, "all": self.accuracy, "cost": self.cost, "return": self.return_}

    def subtract(self, other: Scores) -> dict[str, Interval]:
        """Return how much higher F1, cost and return are than another strategy's: name -> paired interval.

        All strategies of a comparison decide about the same people, so a difference is the mean of the
        differences of single people, and its interval is that of this mean: it is narrower than the intervals
        of the two means suggest. Differences of exact scores are exact; those of bounds are bounds.

        Raises:
            DecisionError: `other` is not a `Scores`, or of another number of people.
        """
        check_type(other, Scores, "the other strategy's scores", DecisionError)
        sizes = [{name: len(sample) for name, sample in each.samples.items()} for each in (self, other)]
        if sizes[0] != sizes[1]:
            raise DecisionError(
                f"{self.strategy} and {other.strategy} are scored on different people; expected scores of one"
                " comparison"
            )
        if self.samples:
            pairs = ((name, own, other.samples[name]) for name, own in self.samples.items())
            return {name: Interval.from_sample(own - others) for name, own, others in pairs}
        bounds = ((name, self.metrics[name], other.metrics[name]) for name in DIFFERENCES)
        return {
            name: Interval(
                a.estimate - b.estimate, a.low - b.high, a.high - b.low, min(a.confidence, b.confidence)
            )
            for name, a, b in bounds
        }

    def __repr__(self) -> str:
        return (
            f"<Scores {self.strategy}: F1 {self.f1:.3f}, accuracy {self.accuracy:.3f}, cost {self.cost:.2f},"
            f" return {self.return_:.2f}>"
        )

    def _repr_html_(self) -> str:
        return scores_to_html([self])


def make_cells(intervals: Mapping[str, Interval]) -> dict[str, float]:
    """Return the cells of some quantities with their intervals: NAME, NAME_low and NAME_high of each."""
    return {
        f"{name}{end}": value
        for name, interval in intervals.items()
        for end, value in (("", interval.estimate), ("_low", interval.low), ("_high", interval.high))
    }


def find_reference(scores: Sequence[Scores]) -> Scores:
    """Return the scores with which the others are compared: of the strategy that uses most parts.

    That is the last one in the paper's table, LCORPP, or R+P in a domain without senses. Without any of the
    paper's strategies it is the last of `scores`.
    """
    rows = {row.strategy: row for row in scores}
    shipped = [row.name for row in STRATEGIES if row.name in rows]
    return rows[shipped[-1]] if shipped else scores[-1]


def scores_to_html(scores: Sequence[Scores], caption: str = "Scores") -> str:
    """Return the scores of several strategies as an HTML table, intervals included."""
    rows = [
        (row.strategy, *(format(cell, get_format(name)) for name, cell in row.columns.items()))
        for row in scores
    ]
    return html_table(("strategy", *(scores[0].columns if scores else METRICS)), rows, caption=caption)


def get_format(name: str) -> str:
    """Return the format of the numbers of a score: two digits for rewards, three for proportions."""
    return ".2f" if name in ("cost", "return") else ".3f"
