"""What is known about the hidden states before learning: the shared variables, by the reports."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import product

import numpy as np

from lcorpp.errors import DataError
from lcorpp.model_learning.episodes import Episodes
from lcorpp.values import Indices


@dataclass(frozen=True, eq=False)
class Space:
    """V shared values, which do not change within an episode, and the reports that name them.

    pattern: of the reports; "" without any.
    variables: names. values: (V,) of each shared value, a value of each variable.
    reports: (A, V) which variables of a report are right, as bits; -1 for actions that are no reports.
    """

    pattern: str
    variables: tuple[str, ...]
    values: tuple[tuple[str, ...], ...]
    reports: Indices

    @classmethod
    def unknown(cls, episodes: Episodes) -> Space:
        """Return the space of one value, without reports."""
        return cls("", (), ((),), np.full((len(episodes.action_names), 1), -1))

    @classmethod
    def of_reports(cls, episodes: Episodes, pattern: str) -> Space:
        """Return the space of the reports of a pattern, e.g. ``deliver_{item}_{room}``.

        Raises:
            DataError: the pattern has no variable or one twice, fewer than two actions fit to it, all reports
                earned the same, or a combination of values has no report.
        """
        names, expression = _compile(pattern)
        fits = {
            action: match.groups()
            for action in episodes.action_names
            if (match := expression.fullmatch(action))
        }
        if len(fits) < 2:
            raise DataError(
                f"{len(fits)} actions fit to the pattern of reports {pattern!r}; expected at least two."
                f" Actions: {', '.join(episodes.action_names)}"
            )
        places = np.isin(episodes.actions, [episodes.action_names.index(action) for action in fits])
        if len(earned := np.unique(episodes.rewards[places])) < 2:
            raise DataError(
                f"all reports earned {episodes.reward_values[earned[0]]:g}, so that nothing relates them to"
                " the states; expected right and wrong reports with different rewards"
            )
        own = [sorted({values[i] for values in fits.values()}) for i in range(len(names))]
        values = tuple(product(*own))
        if missing := sorted(set(values) - set(fits.values())):
            raise DataError(
                f"the episodes have no report {_fill(pattern, names, missing[0])}; expected one for each"
                f" combination of values, as {next(iter(fits))}: add an episode with it"
            )
        reports = np.full((len(episodes.action_names), len(values)), -1)
        for action, reported in fits.items():
            right = [sum(1 << i for i, x in enumerate(reported) if x == value[i]) for value in values]
            reports[episodes.action_names.index(action)] = right
        return cls(pattern, names, values, reports)

    def __len__(self) -> int:
        return len(self.values)

    def count_starts(self, count: int) -> int:
        """Return in how many of K states an episode may start.

        With reports, the first state of each value: its other states follow from actions.
        """
        return len(self) if self.variables else count

    @property
    def is_report(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(A,) whether an action is a report."""
        found: np.ndarray[tuple[int], np.dtype[np.bool_]] = self.reports[:, 0] >= 0
        return found


def _compile(pattern: str) -> tuple[tuple[str, ...], re.Pattern[str]]:
    parts = re.split(r"\{(\w+)\}", pattern)
    names = tuple(parts[1::2])
    if not names or len(set(names)) < len(names):
        raise DataError(
            f"the pattern of reports is {pattern!r}; expected variables in braces, each once, as in"
            " report_{intention}"
        )
    texts = [re.escape(part) if i % 2 == 0 else "(.+?)" for i, part in enumerate(parts)]
    return names, re.compile("".join(texts))


def _fill(pattern: str, names: tuple[str, ...], values: tuple[str, ...]) -> str:
    for name, value in zip(names, values, strict=True):
        pattern = pattern.replace(f"{{{name}}}", value)
    return pattern
