"""Differences between strategies on the same people, with paired confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lcorpp.decision import STRATEGIES
from lcorpp.experiments.scoring.metrics import Difference, Scores, compute_mean_interval
from lcorpp.values import Array


def find_reference(names: Sequence[str]) -> str:
    """Return the strategy with which the others are compared: the one that uses most parts.

    That is the last one in the paper's table, LCORPP, or R+P in a domain without senses. Without any of the
    paper's strategies it is the last of `names`.
    """
    shipped = [row.name for row in STRATEGIES if row.name in names]
    return shipped[-1] if shipped else names[-1]


def add_differences(scores: Sequence[Scores], cost: Array, return_: Array) -> list[Scores]:
    """Return the scores with what the reference strategy costs and returns more than each of them.

    All strategies decide about the same people, so a difference is the mean of the differences of single
    people, and its interval is that of this mean: it is narrower than the intervals of the two means suggest.

    Args:
        scores: k strategies.
        cost, return_: (n, k) of n people; one row of exact means has intervals of zero width.
    """
    if len(scores) < 2:
        return list(scores)
    names = [row.strategy for row in scores]
    reference = find_reference(names)
    r = names.index(reference)
    return [
        row
        if row.strategy == reference
        else replace(
            row,
            difference=Difference(
                reference,
                compute_mean_interval(cost[:, r] - cost[:, k]),
                compute_mean_interval(return_[:, r] - return_[:, k]),
            ),
        )
        for k, row in enumerate(scores)
    ]
