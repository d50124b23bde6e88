"""What names of actions and observations state about answers: ``confirm_cup``, ``hear_cup`` name a value.

Actions that differ in the named values only are questions of one kind. By their relation, an answer depends
on whether the named values are right, and all values are alike: few numbers, which few data determine.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from lcorpp.values import Indices


@dataclass(frozen=True, eq=False)
class Relation:
    """Questions of one kind, given which their rows of observations are the same up to names.

    actions: (n,) indices. groups: (n, V) number of the row of each action and shared value.
    cells: (n, V, O) number of the probability in that row that observations share.
    """

    actions: Indices
    groups: Indices
    cells: Indices


def find_relations(
    variables: Sequence[str],
    values: Sequence[tuple[str, ...]],
    action_names: Sequence[str],
    observation_names: Sequence[str],
    questions: Indices,
) -> tuple[Relation, ...]:
    """Return the relation of each kind of question that names values, or whose observations do.

    values: (V,) of the variables. questions: indices of the actions that may be some.
    """
    known = _index_values(variables, values)
    named = [_find_named(name, known) for name in observation_names]
    kinds: dict[str, list[tuple[int, dict[int, str]]]] = {}
    for action in questions.tolist():
        template, found = _find_named(action_names[action], known)
        kinds.setdefault(template, []).append((action, found))
    relations = []
    for of_kind in kinds.values():
        if of_kind[0][1] or any(found for _, found in named):
            relations.append(_relate(of_kind, named, values))
    return tuple(relations)


def list_answers(
    variables: Sequence[str], values: Sequence[tuple[str, ...]], observation_names: Sequence[str]
) -> list[str]:
    """Return the observations that were recorded for some values only, with all values: also ``hear_tea``."""
    known, names = _index_values(variables, values), dict.fromkeys(observation_names)
    ranges = [dict.fromkeys(own) for own in zip(*values, strict=True)]
    for name in observation_names:
        template, found = _find_named(name, known)
        for choice in product(*(ranges[i] for i in found)):
            full = template
            for i, value in zip(found, choice, strict=True):
                full = full.replace(f"{{{i}}}", value)
            names[full] = None
    return list(names)


def _relate(
    actions: list[tuple[int, dict[int, str]]],
    observations: list[tuple[str, dict[int, str]]],
    values: Sequence[tuple[str, ...]],
) -> Relation:
    groups, cells = dict[tuple[bool, ...], int](), dict[tuple[str, tuple[bool, ...]], int]()

    def compare(named: dict[int, str], value: tuple[str, ...]) -> tuple[bool, ...]:
        return tuple(value[i] == own for i, own in named.items())

    of_rows = [
        [groups.setdefault(compare(named, value), len(groups)) for value in values] for _, named in actions
    ]
    of_cells = [
        [cells.setdefault((template, compare(named, value)), len(cells)) for template, named in observations]
        for value in values
    ]
    return Relation(
        np.array([action for action, _ in actions]),
        np.array(of_rows),
        np.tile(np.array(of_cells), (len(actions), 1, 1)),
    )


def _index_values(variables: Sequence[str], values: Sequence[tuple[str, ...]]) -> dict[str, int]:
    """Return value -> its only variable; longer ones first, as they may contain others."""
    found: dict[str, set[int]] = {}
    for value in values:
        for i, own in enumerate(value):
            found.setdefault(own, set()).add(i)
    unique = {own: next(iter(of)) for own, of in found.items() if len(of) == 1}
    return dict(sorted(unique.items(), key=lambda pair: -len(pair[0])))


def _find_named(name: str, known: dict[str, int]) -> tuple[str, dict[int, str]]:
    """Return a name with braces for the values in it, and variable -> value."""
    found = dict[int, str]()
    for value, variable in known.items():
        pattern = rf"(?:(?<=_)|^){re.escape(value)}(?=_|$)"
        if variable not in found and re.search(pattern, name):
            name, found[variable] = re.sub(pattern, f"{{{variable}}}", name, count=1), value
    return name, dict(sorted(found.items()))
