"""Step 2b: group the clauses of a component by structure, so that equal components share all later work.

Relational programs say the same of most terms: ``x(T+1)`` depends on ``x(T)`` for each T. A `RuleGroup`
therefore refers to the terms in its bodies only by the rank of the step that decides them, and to the bits of
the state only by slots; `transition_builder` assigns bits to the slots of each component. For

    x(5)=true :- x(4)=true, y(2)=true.      x(5)=true :- z(1)=true.

decided in the order z(1), y(2), x(4), there are three dependencies (ranks 0, 1, 2) and one clause group with
two bodies. One slot records that a body is satisfied; another that the first body, which spans ranks 1 to 2,
is falsified.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram, Literal

DERIVE, ASSIGN, FORBID = (  # local names: the attribute access of Enum members is slow
    ClauseKind.DERIVE,
    ClauseKind.ASSIGN,
    ClauseKind.FORBID,
)

Conditions = tuple[tuple[int, int], ...]
"""(index of a term in its component, mask of the outcomes that satisfy the literal), for each literal."""

BodyUpdate = tuple[Conditions, int, bool, int]
"""How a step updates a body: the conditions on its terms, the slot of *falsified* (-1 if only this step
matters for the body), whether this is the last step of the body, and the slot of *satisfied* (-1 for a
constraint)."""


@dataclass(slots=True, eq=False)
class ClauseGroup:
    """Clauses with the same head; only whether one of their bodies is true matters.

    clause: the head, and those literals of the body that are about the component itself.
    always: whether one of the bodies is always true.
    satisfied: the slot of the bit for "a body is satisfied", -1 if `always`.
    """

    clause: Clause
    always: bool = False
    satisfied: int = -1
    bodies: list[Body] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class Body:
    """The literals of a body by the ranks of the steps that decide their terms.

    conditions: (rank, conditions on the terms of that step), sorted by rank.
    first, last: the lowest and highest rank.
    falsified: the slot of the bit for "a literal is false", -1 if `first` is `last`.
    """

    conditions: Sequence[tuple[int, Conditions]]
    first: int
    last: int
    falsified: int = -1


@dataclass(slots=True, eq=False)
class Dependency:
    """The dependency of a rule group on one earlier step.

    rank: the position of the step among those that the rule group depends on.
    allocates, releases: the slots whose bits this step uses first, and last.
    updates: the bodies that the step can satisfy or falsify.
    groups: the clause groups with several bodies among them.
    """

    rank: int
    allocates: list[int] = field(default_factory=list)
    releases: list[int] = field(default_factory=list)
    updates: list[BodyUpdate] = field(default_factory=list)
    groups: list[ClauseGroup] = field(default_factory=list)

    def list_slots(self) -> list[int]:
        """Return the slots of all bits that the step reads or writes."""
        slots = {slot for _, falsified, _, satisfied in self.updates for slot in (falsified, satisfied)}
        slots.update([body.falsified for group in self.groups for body in group.bodies])
        return sorted(slots)


@dataclass(slots=True, eq=False)
class RuleGroup:
    """The clauses of one component, or constraints over the same terms, without the names of other terms.

    terms: the terms of the first component with this rule group; none for constraints.
    always: the indexes of the clause groups with a body that is always true.
    dependencies: one for each step that decides a term of the bodies, in the order of the steps.
    n_slots: the number of bits; those for *satisfied* come first, in the order of the clause groups.
    recursive: whether a term depends on itself, or several terms on each other.
    is_shared: whether several components have this rule group.
    """

    terms: tuple[int, ...]
    groups: list[ClauseGroup]
    always: list[int]
    dependencies: list[Dependency]
    n_slots: int = 0
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
                group = groups[key] = ClauseGroup(_with_body(clause, own_literals))
            if body.conditions:
                group.bodies.append(body)
            else:
                group.always = True
        count = 1 + max([rank for rank, _ in needed.values()], default=-1)
        always = [number for number, group in enumerate(groups.values()) if group.always]
        result = cls(terms, list(groups.values()), always, [Dependency(rank) for rank in range(count)])
        result.recursive = recursive
        for group in result.groups:
            if group.always:
                group.bodies = []
            else:
                group.satisfied = result._new_slot()
                first_end = min([body.last for body in group.bodies])
                result.dependencies[first_end].allocates.append(group.satisfied)
        for group in result.groups:
            result._register(group.bodies, group.satisfied)
            if len(group.bodies) > 1:
                for rank in {rank for body in group.bodies for rank, _ in body.conditions}:
                    result.dependencies[rank].groups.append(group)
        result._register(constraints, -1)
        result.dependencies = [dependency for dependency in result.dependencies if dependency.updates]
        return result

    def _register(self, bodies: Iterable[Body], satisfied: int) -> None:
        """Add the updates of bodies that satisfy the same slot to the dependencies."""
        dependencies = self.dependencies
        for body in bodies:
            if body.last > body.first:
                body.falsified = self._new_slot()
                dependencies[body.first].allocates.append(body.falsified)
                dependencies[body.last].releases.append(body.falsified)
            for rank, conditions in body.conditions:
                dependencies[rank].updates.append((conditions, body.falsified, rank == body.last, satisfied))

    def _new_slot(self) -> int:
        self.n_slots += 1
        return self.n_slots - 1


def _split_body(
    clause: Clause, needed: Mapping[int, tuple[int, int]], outcomes: Sequence[int]
) -> tuple[list[Literal], Body]:
    """Split a body into literals about the component itself and conditions on earlier steps."""
    own_literals: list[Literal] = []
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


def _with_body(clause: Clause, body: Sequence[Literal]) -> Clause:
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
            if other == term:
                structure += -1, allowed, negated
                continue
            if other in needed:
                number = needed[other]
            else:
                number = needed[other] = len(needed)
            structure += number, allowed & outcomes[other]
    return None if term in program.do else structure, needed
