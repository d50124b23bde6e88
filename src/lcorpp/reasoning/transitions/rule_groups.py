"""Heads: all that is said about a term, in a form that it shares with the terms about which the same is said.

A program that repeats itself says the same of most of its terms. A head knows the terms that its bodies ask
for only by the order in which they are decided, and the bits of a state only as slots, to be filled anew for
each term; so whatever follows from it has to be found once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram, Literal

DERIVE, ASSIGN, FORBID = (
    ClauseKind.DERIVE,
    ClauseKind.ASSIGN,
    ClauseKind.FORBID,
)  # to look up a member of an Enum takes time

Conditions = tuple[tuple[int, int], ...]
"""Which of the terms of a step, and the outcomes of it that make a literal true."""

BodyUpdate = tuple[Conditions, int, bool, int]
"""What a step can do to a body: the conditions on its terms, the slot of *denied* (-1 if no other step has
to do with the body), whether this is the last such step, and the slot of *true* (-1 for a constraint)."""


@dataclass(slots=True, eq=False)
class ClauseGroup:
    """Clauses with one head: that one of their bodies is true is all that matters.

    always: whether one of the bodies is true in any case.
    true: the slot of its bit, -1 if it needs none.
    """

    clause: Clause
    always: bool = False
    true: int = -1
    bodies: list[Body] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class Body:
    """A body on its way: the stages of the head at which it is touched, and the slot of *denied*."""

    touched: Sequence[tuple[int, Conditions]]
    first: int
    last: int
    denied: int = -1


@dataclass(slots=True, eq=False)
class Dependency:
    """What a head has to do with one of the steps that come before its own.

    takes, frees: the slots of the bits that come into use there, and of those that no longer matter after it.
    groups: those touched there that have several bodies.
    """

    rank: int
    takes: list[int] = field(default_factory=list)
    frees: list[int] = field(default_factory=list)
    touches: list[BodyUpdate] = field(default_factory=list)
    groups: list[ClauseGroup] = field(default_factory=list)

    def slots(self) -> list[int]:
        """The slots of all bits that matter there."""
        found = {slot for _, denied, _, true in self.touches for slot in (denied, true)}
        found.update([body.denied for group in self.groups for body in group.bodies])
        return sorted(found)


@dataclass(slots=True, eq=False)
class RuleGroup:
    """What is said about one component, or what constraints say of the same terms.

    terms: those of the component, or of the first that has this head; none for constraints.
    always: the positions of the groups that need no bit.
    stages: one for each step that the bodies ask for, in their order.
    slots: how many bits are needed; those for *true* come first, in the order of the groups.
    circular: whether a term depends on itself, or several on each other.
    again: whether it is that of more than one component.
    """

    terms: tuple[int, ...]
    groups: list[ClauseGroup]
    always: list[int]
    stages: list[Dependency]
    slots: int = 0
    circular: bool = False
    again: bool = False

    @classmethod
    def of(
        cls,
        terms: tuple[int, ...],
        clauses: Sequence[Clause],
        asked: Mapping[int, tuple[int, int]],
        outcomes: Sequence[int],
    ) -> RuleGroup:
        """Gather the clauses of a component, or constraints.

        Args:
            asked: each term outside of the component that a body asks for -> its stage, and which of the
                terms of that step it is.
            outcomes: the outcomes of each term, as bits.
        """
        groups: dict[object, ClauseGroup] = {}
        constraints: list[Body] = []
        circular = len(terms) > 1
        for number, clause in enumerate(clauses):
            inner, body = _body(clause, asked, outcomes)
            if not terms:
                constraints.append(body)
                continue
            kind, key = clause.kind, None  # type: ClauseKind, object
            if inner:
                key, circular = number, True
            elif kind is ASSIGN:
                key = number
            elif kind is DERIVE:
                key = clause.term, clause.value
            else:
                key = kind, clause.term, clause.value, clause.statement, clause.instance
            group = groups.get(key)
            if group is None:
                group = groups[key] = ClauseGroup(_alone(clause, inner))
            if body.touched:
                group.bodies.append(body)
            else:
                group.always = True
        count = 1 + max([rank for rank, _ in asked.values()], default=-1)
        always = [number for number, group in enumerate(groups.values()) if group.always]
        head = cls(terms, list(groups.values()), always, [Dependency(rank) for rank in range(count)])
        head.circular = circular
        for group in head.groups:
            if group.always:
                group.bodies = []
            else:
                group.true = head._slot()
                head.stages[min([body.last for body in group.bodies])].takes.append(group.true)
        for group in head.groups:
            head._place(group.bodies, group.true)
            if len(group.bodies) > 1:
                for rank in {rank for body in group.bodies for rank, _ in body.touched}:
                    head.stages[rank].groups.append(group)
        head._place(constraints, -1)
        head.stages = [stage for stage in head.stages if stage.touches]
        return head

    def _place(self, bodies: Iterable[Body], true: int) -> None:
        """Tell the stages of bodies that lead to one bit."""
        stages = self.stages
        for body in bodies:
            if body.last > body.first:
                body.denied = self._slot()
                stages[body.first].takes.append(body.denied)
                stages[body.last].frees.append(body.denied)
            for rank, conditions in body.touched:
                stages[rank].touches.append((conditions, body.denied, rank == body.last, true))

    def _slot(self) -> int:
        self.slots += 1
        return self.slots - 1


def _body(
    clause: Clause, asked: Mapping[int, tuple[int, int]], outcomes: Sequence[int]
) -> tuple[list[Literal], Body]:
    """The literals of the component itself, and the others, of which those of one term hold together."""
    inner: list[Literal] = []
    outer: dict[int, int] = {}
    for literal in clause.body:
        term = literal[0]
        if term not in asked:
            inner.append(literal)
        elif term in outer:
            outer[term] &= literal[1]
        else:
            outer[term] = literal[1] & outcomes[term]
    if not outer:
        return inner, Body((), 0, 0)
    touched: list[tuple[int, Conditions]] = []
    for term, allowed in outer.items():
        rank, which = asked[term]
        touched.append((rank, ((which, allowed),)))
    if len(touched) > 1:
        touched.sort()
        if len({rank for rank, _ in touched}) < len(touched):
            touched = _together(touched)
    return inner, Body(touched, touched[0][0], touched[-1][0])


def _together(touched: Iterable[tuple[int, Conditions]]) -> list[tuple[int, Conditions]]:
    """The conditions on the terms of one step in one."""
    found: dict[int, Conditions] = {}
    for rank, conditions in touched:
        found[rank] = found.get(rank, ()) + conditions
    return list(found.items())


def _alone(clause: Clause, inner: Sequence[Literal]) -> Clause:
    """A clause with what is decided together with its head; only that is left to decide there."""
    if len(inner) == len(clause.body):
        return clause
    return Clause(
        clause.kind, clause.term, clause.value, tuple(inner),
        clause.statement, clause.label, clause.instance, clause.number,
    )  # fmt: skip


def describe_structure(
    ground: GroundProgram, term: int, clauses: Sequence[Clause], outcomes: Sequence[int]
) -> tuple[list[object] | None, dict[int, int]]:
    """All that a term's head and what follows from it depend on, but for the order of the terms asked for.

    Args:
        term: -1 for constraints.

    Returns:
        (look, asked): None if the term is like no other, and the other terms that its clauses ask for,
        numbered as they are met.
    """
    # terms of an attribute share their values, clauses of a statement their number
    parts: list[object] = [id(ground.values[term]) if term >= 0 else -1]
    asked: dict[int, int] = {}
    told: dict[object, int] = {}  # labels and instances say only which of them are the same
    for clause in clauses:
        kind = clause.kind
        if kind is DERIVE:
            parts += kind, clause.value
        elif kind is not FORBID:
            label = told.setdefault(clause.label, len(told))
            parts += kind, clause.value, clause.statement, label, id(clause.number)
            if kind is not ASSIGN:
                parts.append(told.setdefault(clause.instance, len(told)))
        else:
            parts.append(kind)
        for need, allowed, negated in clause.body:
            if need == term:
                parts += -1, allowed, negated
                continue
            if need in asked:
                number = asked[need]
            else:
                number = asked[need] = len(asked)
            parts += number, allowed & outcomes[need]
    return None if term in ground.do else parts, asked
