"""Compilation, step 2: rule templates, the clauses of a component up to renaming of terms.

Relational programs have equal rules for most terms: ``x(T+1)`` depends on ``x(T)`` for each T. A
`RuleTemplate` therefore refers to a term in its bodies only by the rank of the step that decides it (rank 0
for the earliest of these steps), and to a bit of the state only by a slot, so that all later work on a
template is done once. `transition_system` has an example.

The masks of literals about other components contain their negation; the flag for `not` matters only inside of
a cycle, for the reduct.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

from lcorpp.reasoning.grounding.ground_program import (
    ASSIGN,
    DERIVE,
    FORBID,
    Clause,
    GroundLiteral,
    GroundProgram,
)

Conditions = tuple[tuple[int, int], ...]
"""(index of a term in its component, mask of the outcomes that satisfy the literal), for each literal."""

RankedBody = tuple[tuple[int, Conditions], ...]
"""The literals of a body about other components: (rank, conditions on the terms of that step), by rank."""

NO_SLOT = 0
"""The slot of what needs no bit; its bit is 0."""

BodyUpdate = tuple[Conditions, int, int]
"""How a step updates a body: if the conditions hold, the step satisfies its part of the body.

conditions: on the terms that the step decides.
pending_slot: of the bit for "the parts of earlier steps are satisfied", `NO_SLOT` if there are none.
target_slot: of the bit for "the part of this step is satisfied, too", which is the body if this step is the
    last; `NO_SLOT` for the last step of a constraint.
"""


@dataclass(slots=True, eq=False)
class ClauseGroup:
    """Clauses with the same head; only whether one of their bodies is true matters.

    clause: one of the clauses, for its head.
    own_literals: its literals about the component itself; a clause with such literals has its own group.
    bodies: the literals of each body about other components; none if one of the bodies has none, and in
        templates that are not recursive.
    satisfied_slot: of the bit for "a body is satisfied", `NO_SLOT` if one always is, and for constraints.
    pending: (slot, first, last): the slots for partly decided bodies, with the ranks between which they are
        in use.
    """

    clause: Clause
    own_literals: Sequence[GroundLiteral]
    bodies: Sequence[RankedBody]
    satisfied_slot: int = NO_SLOT
    pending: Sequence[tuple[int, int, int]] = ()


@dataclass(eq=False)
class Parent:
    """An earlier step that decides terms of the bodies.

    rank: its position among the steps that decide terms of the bodies.
    allocates, releases: the slots whose bits this step uses first, and last.
    updates: the bodies that the step can satisfy or falsify.
    clause_groups: the groups with several bodies of which the step updates one; once one of them is
        satisfied, the bits of the others are redundant.
    """

    rank: int
    allocates: list[int] = field(default_factory=list)
    releases: list[int] = field(default_factory=list)
    updates: list[BodyUpdate] = field(default_factory=list)
    clause_groups: list[ClauseGroup] = field(default_factory=list)

    @cached_property
    def slots(self) -> list[int]:
        """The slots of all bits that the step reads or writes."""
        slots = {slot for _, *own in self.updates for slot in own}
        slots.update([slot for group in self.clause_groups for slot, _, _ in group.pending])
        return sorted(slots)


@dataclass(slots=True, eq=False)
class RuleTemplate:
    """The clauses of a component, or constraints with the same last step, without the names of other terms.

    terms: the terms of the first component with this template, none for constraints. Other components with
        the template have terms with the same range and the same statements, and no interventions.
    clause_groups: the clauses by head; one group for constraints.
    parents: one for each step that can update a body, in the order of the steps.
    recursive: whether a term depends on itself, or several terms on each other.
    always_true: the indexes of the clause groups that are always true.
    n_slots: the number of slots.
    is_shared: whether several components have this template.
    """

    terms: tuple[int, ...]
    clause_groups: list[ClauseGroup]
    parents: list[Parent]
    recursive: bool
    always_true: list[int] = field(default_factory=list)
    n_slots: int = NO_SLOT + 1
    is_shared: bool = False

    @classmethod
    def from_clauses(
        cls,
        terms: tuple[int, ...],
        clauses: Sequence[Clause],
        places: Mapping[int, tuple[int, int]],
        outcomes: Sequence[int],
    ) -> RuleTemplate:
        """Create the template of a component, or of constraints.

        Args:
            places: term of a body outside of the component -> (rank of its step, index in its component).
            outcomes: the mask of the possible outcomes of each term.
        """
        groups: dict[object, tuple[Clause, Sequence[GroundLiteral], list[RankedBody]]] = {}
        recursive = len(terms) > 1
        for index, clause in enumerate(clauses):
            own_literals, body = _split_body(clause.body, places, outcomes)
            kind = clause.kind
            key: object = index  # equal keys: one group
            if own_literals:
                recursive = True
            elif kind is DERIVE:
                key = clause.term, clause.value
            elif kind is FORBID:
                key = kind
            elif kind is not ASSIGN:
                key = kind, clause.term, clause.value, clause.statement, clause.instance
            if key in groups:
                groups[key][2].append(body)
            else:
                groups[key] = clause, own_literals, [body]
        parents = [Parent(rank) for rank in sorted({rank for rank, _ in places.values()})]
        template = cls(terms, [ClauseGroup(*parts) for parts in groups.values()], parents, recursive)
        for index, group in enumerate(template.clause_groups):
            if () in group.bodies:
                template.always_true.append(index)
                group.bodies = ()
                continue
            if terms:
                group.satisfied_slot = template.add_slot()
                parents[min([body[-1][0] for body in group.bodies])].allocates.append(group.satisfied_slot)
            template._register_bodies(group)
            if not recursive:
                group.bodies = ()
        # steps that occur only in groups that are always true do not matter
        template.parents = [parent for parent in parents if parent.updates]
        return template

    def _register_bodies(self, group: ClauseGroup) -> None:
        """Add to the parents the updates of the bodies of a group.

        What remains of two bodies may be equal; it then has one slot, so that partial worlds with the same
        future have the same state.
        """
        parents = self.parents
        pending: dict[RankedBody, tuple[int, int, int]] = {}  # rest of a body -> as in `ClauseGroup`
        for body in group.bodies:
            slot = NO_SLOT
            for i in range(1, len(body)):
                (rank, conditions), rest = body[i - 1], body[i:]
                known = pending.get(rest)
                target, first, last = known or (self.add_slot(), rank, rest[0][0])
                if not known or rank < first:
                    pending[rest] = target, rank, last
                parents[rank].updates.append((conditions, slot, target))
                if known:
                    break  # the updates of the rest are there
                slot = target
            else:
                rank, conditions = body[-1]
                parents[rank].updates.append((conditions, slot, group.satisfied_slot))
        group.pending = tuple(pending.values())
        for slot, start, end in group.pending:
            parents[start].allocates.append(slot)
            parents[end].releases.append(slot)
        if len(group.bodies) > 1:
            for rank in {rank for body in group.bodies for rank, _ in body}:
                parents[rank].clause_groups.append(group)

    def add_slot(self) -> int:
        """Return a new slot."""
        self.n_slots += 1
        return self.n_slots - 1


Child = tuple[RuleTemplate, Parent, list[int]]
"""A component, or constraints, with bodies about the terms of one step: (template, parent, bits).

parent: the step, as a parent in the template.
bits: slot -> bit of the state, 0 before the slot is allocated and after it is released.
"""


def _split_body(
    body: Sequence[GroundLiteral],
    places: Mapping[int, tuple[int, int]],
    outcomes: Sequence[int],
) -> tuple[tuple[GroundLiteral, ...], RankedBody]:
    """Split a body into literals about the component itself and conditions on earlier steps.

    Args:
        places, outcomes: as in `RuleTemplate.from_clauses`.
    """
    own_literals: tuple[GroundLiteral, ...] = ()
    parts: list[tuple[int, Conditions]] = []
    for literal in body:
        term, mask, _ = literal
        if term in places:
            parts.append(_make_condition(*places[term], mask & outcomes[term]))
        else:
            own_literals = (*own_literals, literal)
    if len(parts) > 1:
        parts.sort()
        if len({rank for rank, _ in parts}) < len(parts):
            parts = _join_conditions(parts)
    return own_literals, tuple(parts)


@lru_cache(4096)
def _make_condition(rank: int, index: int, mask: int) -> tuple[int, Conditions]:
    """Make the condition of a literal; equal ones share memory."""
    return rank, ((index, mask),)


def _join_conditions(parts: Iterable[tuple[int, Conditions]]) -> list[tuple[int, Conditions]]:
    """Join the conditions on the terms of the same step."""
    joined: dict[int, dict[int, int]] = {}
    for rank, ((index, mask),) in parts:
        masks = joined.setdefault(rank, {})
        masks[index] = masks.get(index, mask) & mask
    return [(rank, tuple(masks.items())) for rank, masks in joined.items()]


def describe_structure(
    program: GroundProgram, term: int, clauses: Sequence[Clause], outcomes: Sequence[int]
) -> tuple[list[object], dict[int, int]]:
    """Describe the clauses of a term up to renaming: terms with equal descriptions can share a template.

    Args:
        term: a term without intervention, -1 for constraints.

    Returns:
        (structure, needed): a list of hashable parts; and the other terms of the bodies, numbered by first
        occurrence. The order in which they are decided is not in the structure.
    """
    # the terms of an attribute share the tuple of values, the clauses of a statement the number: ids suffice
    structure: list[object] = [id(program.values[term]) if term >= 0 else -1]
    needed: dict[int, int] = {}
    codes: dict[object, int] = {}  # of labels and instances: only their equality matters
    for clause in clauses:
        kind = clause.kind
        if kind is DERIVE:
            structure += kind, clause.value
        elif kind is FORBID:
            structure.append(kind)
        else:
            label = codes.setdefault(clause.label, len(codes))
            structure += kind, clause.value, clause.statement, label, id(clause.number)
            if kind is not ASSIGN:
                structure.append(codes.setdefault(clause.instance, len(codes)))
        for other, allowed, negated in clause.body:
            if other == term:  # -1 denotes the term itself
                structure += -1, allowed, negated
            else:
                structure += needed.setdefault(other, len(needed)), allowed & outcomes[other]
    return structure, needed
