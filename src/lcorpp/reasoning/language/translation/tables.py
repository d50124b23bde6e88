"""Tables of answers, and the derivations of those that depend on chance."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from math import inf
from typing import NamedTuple

from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.translation.prolog_terms import Compound, PrologTerm


class GroundLiteral(NamedTuple):
    """An answer in a table, and whether it is negated."""

    table: Table
    atom: Compound
    negated: bool


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
    uses: the tables on which it depends.
    is_modal: whether its answers depend on what the call leaves open, as `\\+ p(X)` and `X == 1` differ
        before and after X has a value; then another call may have other answers, or derivations.
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
    uses: dict[Table, None] = field(default_factory=dict)
    is_modal: bool = False

    def select_answers(self, atom: Compound) -> dict[Compound, bool]:
        """Select the answers that may match an atom: one if the atom is ground."""
        if not atom.is_ground or self.call.is_ground:
            return self.answers
        return {atom: self.answers[atom]} if atom in self.answers else {}
