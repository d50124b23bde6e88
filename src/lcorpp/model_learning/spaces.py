"""What is known about the hidden states before learning: the shared variables, by the reports."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from lcorpp.errors import DataError, expected_one_of
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.relations import Relation, find_relations
from lcorpp.values import Indices


@dataclass(frozen=True, eq=False)
class Space:
    """V shared values, which do not change within an episode, and the reports that name them.

    pattern: of the reports; "" without a pattern.
    variables: names. values: (V,) of each shared value, a value of each variable.
    reports: (A, V) which variables of a report are right, as bits; -1 for actions that are no reports.
    relations: of the questions whose names, or those of their answers, have shared values.
    """

    pattern: str
    variables: tuple[str, ...]
    values: tuple[tuple[str, ...], ...]
    reports: Indices
    relations: tuple[Relation, ...] = ()

    @classmethod
    def unknown(cls, episodes: Episodes) -> Space:
        """Return the space of one value, without reports."""
        return cls("", (), ((),), np.full((len(episodes.action_names), 1), -1))

    @classmethod
    def of_reports(cls, episodes: Episodes, text: str) -> Space:
        """Return the space of some reports.

        Args:
            text: a pattern of the actions that report, e.g. ``deliver_{item}_{room}``, or a variable and the
                value that each report names: ``wish: give_tour=tour, stay_away=nothing``.

        Raises:
            DataError: the text is neither, it has a variable twice, fewer than two actions are reports, one
                of them is no action, all earned the same, or a combination of values has no report.
        """
        names, reported = _read_values(text, episodes) if ":" in text else _match_pattern(text, episodes)
        if len(reported) < 2:
            raise DataError(
                f"{len(reported)} actions fit to the reports {text!r}; expected at least two."
                f" Actions: {', '.join(episodes.action_names)}"
            )
        places = np.isin(episodes.actions, [episodes.action_names.index(action) for action in reported])
        if len(earned := np.unique(episodes.rewards[places])) < 2:
            raise DataError(
                f"all reports earned {episodes.reward_values[earned[0]]:g}, so that nothing relates them to"
                " the states; expected right and wrong reports with different rewards"
            )
        own = [sorted({values[i] for values in reported.values()}) for i in range(len(names))]
        if max(map(len, own)) < 2:
            raise DataError(
                f"all reports of {text!r} name the same values; expected two or more of a variable"
            )
        values = tuple(product(*own))
        if missing := sorted(set(values) - set(reported.values())):
            raise DataError(
                f"the episodes have no report of {', '.join(missing[0])}; expected one for each combination"
                f" of values, as {next(iter(reported))}: add an episode with it"
            )
        reports = np.full((len(episodes.action_names), len(values)), -1)
        for action, named in reported.items():
            reports[episodes.action_names.index(action)] = list_rights(named, values)
        return cls("" if ":" in text else text, names, values, reports)

    def relate(self, episodes: Episodes) -> Space:
        """Return the space with the relations of the questions of episodes."""
        names, questions = (
            (episodes.action_names, episodes.observation_names),
            np.flatnonzero(~self.is_report),
        )
        return replace(self, relations=find_relations(self.variables, self.values, *names, questions))

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


def list_rights(reported: Sequence[str], values: Sequence[Sequence[str]]) -> list[int]:
    """Return for each shared value which variables of a report are right, as bits."""
    return [sum(1 << i for i, x in enumerate(reported) if x == own[i]) for own in values]


_Reported = dict[str, tuple[str, ...]]
"""Action -> the value of each variable that it reports."""


def _match_pattern(pattern: str, episodes: Episodes) -> tuple[tuple[str, ...], _Reported]:
    parts = re.split(r"\{(\w+)\}", pattern)
    names = tuple(parts[1::2])
    if not names or len(set(names)) < len(names):
        raise DataError(
            f"the reports are {pattern!r}; expected variables in braces, each once, as in"
            " report_{intention}, or a variable and its values, as in 'wish: give_tour=tour,"
            " stay_away=nothing'"
        )
    texts = [re.escape(part) if i % 2 == 0 else "(.+?)" for i, part in enumerate(parts)]
    expression = re.compile("".join(texts))
    matches = ((action, expression.fullmatch(action)) for action in episodes.action_names)
    return names, {action: match.groups() for action, match in matches if match}


def _read_values(text: str, episodes: Episodes) -> tuple[tuple[str, ...], _Reported]:
    variable, _, pairs = text.partition(":")
    reported: _Reported = {}
    for pair in pairs.split(","):
        action, _, value = (part.strip() for part in pair.partition("="))
        if not action or not value or action in reported:
            raise DataError(f"the reports are {text!r}; expected VARIABLE: ACTION=VALUE, ACTION=VALUE")
        if action not in episodes.action_names:
            raise DataError(f"the report {action} is no action; {expected_one_of(episodes.action_names)}")
        reported[action] = (value,)
    return (variable.strip(),), reported
