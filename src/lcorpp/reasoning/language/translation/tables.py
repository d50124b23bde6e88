"""Tables of answers, and the derivations of those that depend on chance."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from math import inf
from typing import TypeAlias

from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.translation.prolog_terms import Compound, PrologTerm

GroundLiteral: TypeAlias = tuple[Compound, bool]
"""A ground atom, and whether it is negated."""


@dataclass(frozen=True)
class Choice:
    """A random choice between the heads of an instance of a clause.

    clause: its index.
    values: those of its variables.
    head: the index of the chosen head.
    probability: of this head.
    """

    clause: int
    values: tuple[PrologTerm, ...]
    head: int
    probability: Fraction


@dataclass(frozen=True)
class Derivation:
    """A way in which an atom is true: the literals and the choice of a ground clause."""

    literals: tuple[GroundLiteral, ...]
    choice: Choice | None
    at: Place


@dataclass(eq=False)
class Table:
    """The answers to a call.

    answers: each with whether it is certain.
    derivations: of the answers that are not.
    round, low: the round in which it was evaluated last, and the least depth on which it depends.
    depth: that of its frame while it is evaluated.
    has_changed: whether it, or a table that is repeated with it, has a new answer since the last round.
    """

    call: Compound
    at: Place
    answers: dict[Compound, bool] = field(default_factory=dict)
    derivations: dict[Compound, dict[Derivation, None]] = field(default_factory=dict)
    is_complete: bool = False
    round: int = -1
    low: float = inf
    depth: int | None = None
    has_changed: bool = False
