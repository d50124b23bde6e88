"""Answer sets in plain Python, so that only `asp_translation` depends on clingo."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

SelectionAtom = tuple[int, str, str, str]
"""A random selection that applies: (statement, label arguments, instance, term)."""

RangeAtom = tuple[int, str, str, str]
"""A member of a dynamic range: (statement of the selection, instance, term, value)."""

AssignmentAtom = tuple[int, str, tuple[str, ...], str, str]
"""A pr-atom that applies: (statement, label arguments, instance, term, value)."""

DerivationAtom = tuple[int, str]
"""A rule with a true body: (statement, term in the head)."""


@dataclass(frozen=True)
class AnswerSet:
    """An answer set of the logical part of a program; statements are indexes into the program.

    values: term -> value, sorted by term.
    selections: the selections that apply to terms without intervention.
    possible: the members of dynamic ranges.
    assigned: the pr-atoms about selected terms.
    derived: the rules that derive a value of a selected term; semantics of 2018 only.
    """

    values: Mapping[str, str]
    selections: tuple[SelectionAtom, ...]
    possible: frozenset[RangeAtom]
    assigned: tuple[AssignmentAtom, ...]
    derived: tuple[DerivationAtom, ...] = ()
