"""What the grounder hands to whoever measures worlds: answer sets in plain Python, nothing of the solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Selected = tuple[int, str, str, str]
"""A selection that applies: its position in the program, label arguments, instance, term."""

Possible = tuple[int, str, str, str]
"""A member of a dynamic range: position of the selection, instance, term, value."""

Assigned = tuple[int, str, tuple[str, ...], str, str]
"""A pr-atom that speaks: its position in the program, label arguments, instance, term, value."""

Derived = tuple[int, str]
"""A regular rule with a true body: its position in the program, the term of its head."""


@dataclass(frozen=True)
class AnswerSet:
    """One answer set of the logical part of a program.

    values: term -> value, sorted by term.
    selections: those that apply and are not intervened with.
    possible: the members of dynamic ranges.
    assigned: the pr-atoms that speak of a term that is selected.
    derived: rules whose head has a term that is also selected; kept for the semantics of 2018 alone.
    """

    values: Mapping[str, str]
    selections: tuple[Selected, ...]
    possible: frozenset[Possible]
    assigned: tuple[Assigned, ...]
    derived: tuple[Derived, ...] = ()
