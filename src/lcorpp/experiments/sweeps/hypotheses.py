"""The paper's hypotheses in the configurations of a sweep: where each holds, and by how much."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from lcorpp.experiments.figures.result import Verdict, judge
from lcorpp.experiments.sweeps.evaluation import CHAIN, Rows, list_pairs
from lcorpp.values import Interval

DIGITS = 9
"""Digits of differences: exact ones below are rounding errors."""

METRICS = ("return", "cost")


@dataclass(frozen=True)
class Hypothesis:
    """An order of strategies: each returns more, or costs less, than the next.

    metric: "return" or "cost". strategies: at least two, the best first.
    """

    metric: str
    strategies: tuple[str, ...]

    def __str__(self) -> str:
        sign = " > " if self.metric == "return" else " < "
        return f"{sign.join(self.strategies)} in {self.metric}"

    @property
    def column(self) -> str:
        """The column of the verdicts in the table."""
        return f"{self.metric}_hypothesis"

    def find_advantages(self, rows: Mapping[str, Mapping[str, Any]]) -> list[Interval]:
        """Return by how much each strategy is better than the next, with paired intervals.

        Args:
            rows: strategy -> its row in one configuration.
        """
        name = f"{self.metric}_difference"
        advantages = []
        for worse in self.strategies[1:]:
            ends = [round(rows[worse][f"{name}{end}"], DIGITS) for end in ("", "_low", "_high")]
            middle, low, high = ends
            better = (
                Interval(middle, low, high) if self.metric == "return" else Interval(-middle, -high, -low)
            )
            advantages.append(better)
        return advantages


def list_hypotheses(strategies: Sequence[str]) -> list[Hypothesis]:
    """Return the hypotheses on these strategies: LCORPP > R+P > P in return, LCORPP < R+P < P in cost.

    Strategies that are missing are left out; without two of them there is no hypothesis.
    """
    order = tuple(name for name in reversed(CHAIN) if name in strategies)
    return [Hypothesis(metric, order) for metric in METRICS] if list_pairs(order) else []


def judge_configuration(rows: Rows) -> dict[str, Verdict]:
    """Return the verdict on each hypothesis in a configuration, by its column."""
    own = {row["strategy"]: row for row in rows}
    return {h.column: judge(h.find_advantages(own)) for h in list_hypotheses(list(own))}


def describe_results(rows: Rows, axes: Sequence[str], setting: str) -> str:
    """Return a paragraph: in how many configurations each hypothesis holds, and where it does not.

    Args:
        rows: as in `SweepResult`. axes: the columns of the axes. setting: e.g. the domain and its preset.
    """
    configurations: dict[tuple[Any, ...], dict[str, Mapping[str, Any]]] = {}
    for row in rows:
        configurations.setdefault(tuple(row[axis] for axis in axes), {})[row["strategy"]] = row
    values = {axis: list(dict.fromkeys(row[axis] for row in rows)) for axis in axes}
    ranges = ", ".join(f"{axis} {_describe_values(values[axis], values[axis])}" for axis in axes)
    number = len(configurations)
    sentences = [f"{number} configuration{'s' * (number > 1)} of {setting}: {ranges}."]
    strategies = list(dict.fromkeys(row["strategy"] for row in rows))
    best = Counter(max(own, key=lambda name: own[name]["return"]) for own in configurations.values())
    if len(strategies) > 1:
        listed = ", ".join(f"{strategy} in {count}" for strategy, count in best.most_common())
        sentences.append(f"The highest return: {listed}.")
    for hypothesis in list_hypotheses(strategies):
        verdicts = {key: next(iter(own.values()))[hypothesis.column] for key, own in configurations.items()}
        counts = Counter(verdicts.values())
        listed = ", ".join(f"{verdict} in {counts[verdict]}" for verdict in Verdict if counts[verdict])
        sentences.append(f"{hypothesis}: {listed}.")
        failed = [key for key, verdict in verdicts.items() if verdict == Verdict.FAILS]
        if failed and len(failed) < number:
            sentences.append(f"Where it does not hold, {_describe_region(failed, values)}.")
        sentences += _describe_extremes(hypothesis, configurations, axes)
    unsolved = {tuple(row[axis] for axis in axes) for row in rows if not row["converged"]}
    if unsolved:
        sentences.append(
            f"In {len(unsolved)} the solver stopped at its limit: its policy may not be optimal."
        )
    return " ".join(sentences)


def _describe_region(keys: Sequence[tuple[Any, ...]], values: Mapping[str, Sequence[Any]]) -> str:
    """Describe some configurations by the values of the axes that they have."""
    parts = []
    for number, (axis, known) in enumerate(values.items()):
        found = {key[number] for key in keys}
        if len(found) < len(known):
            parts.append(f"{axis} is {_describe_values([v for v in known if v in found], known)}")
    return " and ".join(parts) or "the axes have all of their values"


def _describe_values(found: Sequence[Any], known: Sequence[Any]) -> str:
    """List some values of an axis, or give the ends of numbers without a gap."""
    ordered = known if isinstance(known[0], str) else sorted(known)
    first, last = ordered.index(found[0]), ordered.index(found[-1])
    low, high = min(first, last), max(first, last)
    if len(found) > 2 and not isinstance(found[0], str) and high - low + 1 == len(found):
        return f"from {_format(ordered[low])} to {_format(ordered[high])}"
    return " or ".join(map(_format, found))


def _describe_extremes(
    hypothesis: Hypothesis,
    configurations: Mapping[tuple[Any, ...], Mapping[str, Mapping[str, Any]]],
    axes: Sequence[str],
) -> list[str]:
    """Return a sentence about the smallest and the largest advantage of each strategy over the next."""
    advantages = {key: hypothesis.find_advantages(own) for key, own in configurations.items()}
    parts = []
    for number, (better, worse) in enumerate(pairwise(hypothesis.strategies)):
        ends = [
            (
                advantages[key][number].estimate,
                ", ".join(f"{a} {_format(v)}" for a, v in zip(axes, key, strict=True)),
            )
            for pick in (min, max)
            for key in [pick(advantages, key=lambda k: advantages[k][number].estimate)]
        ]
        (low, where), (high, there) = ends
        verb = "returns" if hypothesis.metric == "return" else "saves"
        parts.append(
            f"{better} {verb} {low:+.2f} ({where}) to {high:+.2f} ({there}) more than {worse}"
            if low != high
            else f"{better} {verb} {low:+.2f} more than {worse}"
        )
    return [f"{'; '.join(parts)}."] if parts else []


def _format(value: Any) -> str:
    """Return a value of an axis, numbers with four digits."""
    return value if isinstance(value, str) else f"{value:.4g}"
