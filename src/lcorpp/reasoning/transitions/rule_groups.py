"""Compilation, step 2: group clauses by structure, so that equal components share all later work.

Relational programs say the same of most terms: ``x(T+1)`` depends on ``x(T)`` for each T. A `RuleGroup`
therefore refers to a term in its bodies only by the rank of the step that decides it (rank 0 for the earliest
of these steps), and to a bit of the state only by a bit slot; `transition_builder` assigns a bit to each slot
of each component. For

    x(5)=true :- x(4)=true, y(2)=true.      x(5)=true :- z(1)=true.

decided in the order z(1), y(2), x(4), there are three dependencies (ranks 0, 1, 2) and one clause group with
two bodies. The bit of one slot records that a body is satisfied; that of another slot that the first body,
which spans ranks 1 to 2, is falsified.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundLiteral, GroundProgram

DERIVE, ASSIGN, FORBID = (  # local names: the attribute access of Enum members is slow
    ClauseKind.DERIVE,
    ClauseKind.ASSIGN,
    ClauseKind.FORBID,
)

Conditions = tuple[tuple[int, int], ...]
"""(index of a term in its component, mask of the outcomes that satisfy the literal), for each literal."""

NO_SLOT = -1
"""The bit slot of what needs no bit."""


class BodyUpdate(NamedTuple):
    """How a step updates a body.

    conditions: on the terms that the step decides.
    falsified: the bit slot for "a literal is false", `NO_SLOT` if only this step matters for the body.
    is_last: whether no later step matters for the body.
    satisfied: the bit slot for "a body is satisfied", `NO_SLOT` for a constraint.
    """

    conditions: Conditions
    falsified: int
    is_last: bool
    satisfied: int


@dataclass(slots=True, eq=False)
class ClauseGroup:
    """Clauses with the same head; only whether one of their bodies is true matters.

    clause: the head, and those literals of the body that are about the component itself.
    always: whether one of the bodies is always true.
    satisfied: the bit slot for "a body is satisfied", `NO_SLOT` if `always`.
    """

    clause: Clause
    always: bool = False
    satisfied: int = NO_SLOT
    bodies: list[Body] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class Body:
    """The literals of a body about other components, by the ranks of the steps that decide their terms.

    conditions: (rank, conditions on the terms of that step), sorted by rank.
    first, last: the lowest and highest rank.
    falsified: the bit slot for "a literal is false", `NO_SLOT` if `first` is `last`.
    """

    conditions: Sequence[tuple[int, Conditions]]
    first: int
    last: int
    falsified: int = NO_SLOT


@dataclass(slots=True, eq=False)
class Dependency:
    """The dependency of a rule group on one earlier step.

    rank: the position of the step among those that the rule group depends on.
    allocates, releases: the bit slots whose bits this step uses first, and last.
    updates: the bodies that the step can satisfy or falsify.
    clause_groups: those clause groups with several bodies of which the step updates one.
    """

    rank: int
    allocates: list[int] = field(default_factory=list)
    releases: list[int] = field(default_factory=list)
    updates: list[BodyUpdate] = field(default_factory=list)
    clause_groups: list[ClauseGroup] = field(default_factory=list)

    def list_bit_slots(self) -> list[int]:
        """Return the bit slots of all bits that the step reads or writes."""
        slots = {slot for update in self.updates for slot in (update.falsified, update.satisfied)}
        slots.update([body.falsified for group in self.clause_groups for body in group.bodies])
        return sorted(slots)


@dataclass(slots=True, eq=False)
class RuleGroup:
    """The clauses of one component, or constraints over the same terms, without the names of other terms.

    terms: the terms of the first component with this rule group; none for constraints.
    clause_groups: the clauses by head; none for constraints.
    always: the indexes of the clause groups with a body that is always true.
    dependencies: one for each step that decides a term of the bodies, in the order of the steps.
    n_bit_slots: the number of bits; those for *satisfied* come first, in the order of the clause groups.
    recursive: whether a term depends on itself, or several terms on each other.
    is_shared: whether several components have this rule group.
    """

    terms: tuple[int, ...]
    clause_groups: list[ClauseGroup]
    always: list[int]
    dependencies: list[Dependency]
    n_bit_slots: int = 0
    recursive: bool = False
    is_shared: bool = False

    @classmethod
    def from_clauses(
        cls,
        terms: tuple[int, ...],
        clauses: Sequence[Clause],
        needed: Mapping[int, tuple[int, int]],
        outcomes: Sequence[int],
    ) -> RuleGroup:
        """Group the clauses of a component, or constraints.

        Args:
            needed: term of a body outside of the component -> (rank of its step, index in its component).
            outcomes: the mask of the possible outcomes of each term.
        """
        groups: dict[object, ClauseGroup] = {}
        constraints: list[Body] = []
        recursive = len(terms) > 1
        for number, clause in enumerate(clauses):
            own_literals, body = _split_body(clause, needed, outcomes)
            if not terms:
                constraints.append(body)
                continue
            kind, key = clause.kind, None  # type: ClauseKind, object
            # equal keys: one clause group; a number is unique, so that such a clause has its own group
            if own_literals:
                key, recursive = number, True
            elif kind is ASSIGN:
                key = number
            elif kind is DERIVE:
                key = clause.term, clause.value
            else:
                key = kind, clause.term, clause.value, clause.statement, clause.instance
            group = groups.get(key)
            if group is None:
                group = groups[key] = ClauseGroup(_replace_body(clause, own_literals))
            if body.conditions:
                group.bodies.append(body)
            else:
                group.always = True
        n_steps = 1 + max([rank for rank, _ in needed.values()], default=-1)
        always = [number for number, group in enumerate(groups.values()) if group.always]
        result = cls(terms, list(groups.values()), always, [Dependency(rank) for rank in range(n_steps)])
        result.recursive = recursive
        for group in result.clause_groups:
            if group.always:
                group.bodies = []
            else:
                group.satisfied = result._add_bit_slot()
                earliest_end = min([body.last for body in group.bodies])
                result.dependencies[earliest_end].allocates.append(group.satisfied)
        for group in result.clause_groups:
            result._register_bodies(group.bodies, group.satisfied)
            if len(group.bodies) > 1:
                for rank in {rank for body in group.bodies for rank, _ in body.conditions}:
                    result.dependencies[rank].clause_groups.append(group)
        result._register_bodies(constraints, NO_SLOT)
        result.dependencies = [dependency for dependency in result.dependencies if dependency.updates]
        return result

    def _register_bodies(self, bodies: Iterable[Body], satisfied: int) -> None:
        """Add to the dependencies the updates of bodies with the same bit slot for *satisfied*."""
        dependencies = self.dependencies
        for body in bodies:
            if body.last > body.first:
                body.falsified = self._add_bit_slot()
                dependencies[body.first].allocates.append(body.falsified)
                dependencies[body.last].releases.append(body.falsified)
            for rank, conditions in body.conditions:
                dependencies[rank].updates.append(
                    BodyUpdate(conditions, body.falsified, rank == body.last, satisfied)
                )

    def _add_bit_slot(self) -> int:
        """Add a bit slot; return it."""
        self.n_bit_slots += 1
        return self.n_bit_slots - 1


def _split_body(
    clause: Clause, needed: Mapping[int, tuple[int, int]], outcomes: Sequence[int]
) -> tuple[list[GroundLiteral], Body]:
    """Split a body into literals about the component itself and conditions on earlier steps."""
    own_literals: list[GroundLiteral] = []
    masks: dict[int, int] = {}
    for literal in clause.body:
        term = literal[0]
        if term not in needed:
            own_literals.append(literal)
        elif term in masks:
            masks[term] &= literal[1]
        else:
            masks[term] = literal[1] & outcomes[term]
    if not masks:
        return own_literals, Body((), 0, 0)
    conditions: list[tuple[int, Conditions]] = []
    for term, mask in masks.items():
        rank, index = needed[term]
        conditions.append((rank, ((index, mask),)))
    if len(conditions) > 1:
        conditions.sort()
        if len({rank for rank, _ in conditions}) < len(conditions):
            conditions = _join_by_rank(conditions)
    return own_literals, Body(conditions, conditions[0][0], conditions[-1][0])


def _join_by_rank(conditions: Iterable[tuple[int, Conditions]]) -> list[tuple[int, Conditions]]:
    joined: dict[int, Conditions] = {}
    for rank, own in conditions:
        joined[rank] = joined.get(rank, ()) + own
    return list(joined.items())


def _replace_body(clause: Clause, body: Sequence[GroundLiteral]) -> Clause:
    """Return the clause with another body."""
    if len(body) == len(clause.body):
        return clause
    return Clause(
        clause.kind, clause.term, clause.value, tuple(body),
        clause.statement, clause.label, clause.instance, clause.number,
    )  # fmt: skip


def describe_structure(
    program: GroundProgram, term: int, clauses: Sequence[Clause], outcomes: Sequence[int]
) -> tuple[list[object] | None, dict[int, int]]:
    """Describe the clauses of a term up to renaming: terms with equal descriptions can share a rule group.

    Args:
        term: the term, -1 for constraints.

    Returns:
        (structure, needed): a list of hashable parts, None if the term cannot share a rule group; and the
        other terms of the bodies, numbered by first occurrence. Their elimination order is not in the
        structure.
    """
    # the terms of an attribute share the tuple of values, the clauses of a statement the number: ids suffice
    structure: list[object] = [id(program.values[term]) if term >= 0 else -1]
    needed: dict[int, int] = {}
    numbers: dict[object, int] = {}  # of labels and instances: only their equality matters
    for clause in clauses:
        kind = clause.kind
        if kind is DERIVE:
            structure += kind, clause.value
        elif kind is not FORBID:
            label = numbers.setdefault(clause.label, len(numbers))
            structure += kind, clause.value, clause.statement, label, id(clause.number)
            if kind is not ASSIGN:
                structure.append(numbers.setdefault(clause.instance, len(numbers)))
        else:
            structure.append(kind)
        for other, allowed, negated in clause.body:
            if other == term:  # -1 stands for the term itself
                structure += -1, allowed, negated
                continue
            if other in needed:
                number = needed[other]
            else:
                number = needed[other] = len(needed)
            structure += number, allowed & outcomes[other]
    return None if term in program.do else structure, needed
