"""A program made ready to be walked through: its terms in order, and what deciding each does to the state.

A state says of the clauses that are touched but not finished whether their bodies can still be true. It has
two kinds of bits: *denied*, for a body of which some literal was found false, and *true*, for a body, or
one of several bodies that say the same, that was found true. Two ways that lead to the same bits have the
same future, and are one state from there on; so it does not matter which die showed the six, or which block
stands where.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from lcorpp.reasoning.circuit.collection import without_collection
from lcorpp.reasoning.circuit.ground import Clause, Ground, Kind, Literal
from lcorpp.reasoning.circuit.grounder import ground_program
from lcorpp.reasoning.circuit.loops import Circle, circle
from lcorpp.reasoning.circuit.ordering import ordered
from lcorpp.reasoning.circuit.simplification import simplified
from lcorpp.reasoning.circuit.steps import Decision, Entry, SingleTerm
from lcorpp.reasoning.language.syntax import Literal as SyntaxLiteral
from lcorpp.reasoning.program import Program

Effect = tuple[int, int, int, Mapping[int, int]]
"""What an outcome does to a state: bits that it sets, denied bits without which there is no world, the denied
bits of the bodies that are finished by it, and the bit to set for each of them that is not denied."""

MOST_ABSORBED = 64
"""How many groups of clauses a step looks through for bits that no longer matter; beyond, states may be
told apart needlessly, which costs time and changes no answer."""


@dataclass(slots=True, eq=False)
class _Pending:
    """A clause on its way: where its body is touched, and the bits that speak of it.

    group: the clauses that say the same of the same term; None for a constraint.
    """

    group: _Group | None
    outer: dict[int, int]
    first: int
    last: int
    denied: int = 0


@dataclass(slots=True, eq=False)
class _Group:
    """Clauses with one head: that one of their bodies is true is all that matters."""

    clause: Clause
    owner: int
    members: list[_Pending]
    always: bool = False
    true: int = 0
    begins: int = -1


@dataclass(slots=True, eq=False)
class Step:
    """The decision of one component, and what it does to the state.

    terms: the terms that are decided.
    mask: the bits of their clauses.
    absorb: pairs (true, denied): once a body of a group is true, whether the others are denied is no matter.
    keep: the bits that are needed afterwards.
    """

    terms: tuple[int, ...]
    decision: Decision
    mask: int
    absorb: list[tuple[int, int]] = field(default_factory=list)
    keep: int = 0
    position: int = 0
    _touching: list[_Pending] = field(default_factory=list)
    _all_denied: int = 0
    _met: dict[int, list[_Pending]] = field(default_factory=dict)
    _effects: dict[object, Effect | None] = field(default_factory=dict)
    _watched: tuple[int, ...] = ()

    def touch(self, touching: list[_Pending]) -> None:
        """Take note of the clauses whose bodies speak of these terms."""
        self._touching = touching
        for pending in touching:
            if pending.last > self.position:
                self._all_denied |= pending.denied
        if len(self.terms) == 1:
            term = self.terms[0]
            for pending in touching:
                allowed = pending.outer[term]
                while allowed:
                    lowest = allowed & -allowed
                    self._met.setdefault(lowest.bit_length() - 1, []).append(pending)
                    allowed ^= lowest
        else:
            watched = {term for pending in touching for term in pending.outer}
            self._watched = tuple([i for i, term in enumerate(self.terms) if term in watched])

    def effect(self, values: Sequence[int]) -> Effect | None:
        """What an outcome does to a state; None if a constraint forbids it."""
        if len(self.terms) == 1:
            value = values[0]
            if value not in self._effects:
                self._effects[value] = self._effect(self._met.get(value, ()))
            return self._effects[value]
        key = tuple([values[i] for i in self._watched])
        if key not in self._effects:
            has = {self.terms[i]: values[i] for i in self._watched}
            met = [
                p
                for p in self._touching
                if all(allowed >> has[t] & 1 for t, allowed in p.outer.items() if t in has)
            ]
            self._effects[key] = self._effect(met)
        return self._effects[key]

    def _effect(self, met: Iterable[_Pending]) -> Effect | None:
        sets, must, finished = self._all_denied, 0, 0
        true: dict[int, int] = {}
        for pending in met:
            if pending.last > self.position:
                sets &= ~pending.denied
            elif pending.group is None:
                if not pending.denied:
                    return None
                must |= pending.denied
            elif not pending.denied:
                sets |= pending.group.true
            else:
                finished |= pending.denied
                true[pending.denied] = pending.group.true
        return sets, must, finished, true


@dataclass(slots=True, eq=False)
class Plan:
    """A program made ready.

    ground: its terms, without the clauses; `index` finds one by its text.
    consistent: False where it is plain that there is no world.
    """

    ground: Ground
    steps: list[Step]
    consistent: bool
    index: dict[str, int]


def plan(
    program: Program,
    do: Mapping[str, str],
    observed: Iterable[SyntaxLiteral] = (),
    wanted: Iterable[str] = (),
    asked: Sequence[SyntaxLiteral] = (),
) -> Plan:
    """Ground a program and order its terms.

    Args:
        do: interventions beside those in the program, term -> value.
        observed: literals without which there is no world, beside the observations in the program.
        wanted: the terms whose outcomes will be asked for.
        asked: literals for which the term `ASKED` stands.

    Raises:
        ProgramError: arithmetic is undefined.
    """
    with without_collection():
        return _plan(program, do, observed, wanted, asked)


def _plan(
    program: Program,
    do: Mapping[str, str],
    observed: Iterable[SyntaxLiteral],
    wanted: Iterable[str],
    asked: Sequence[SyntaxLiteral],
) -> Plan:
    ground = ground_program(program, do, observed, asked)
    clauses, outcomes = simplified(ground)
    order = ordered(clauses, outcomes)
    joined = _joined(ground, clauses, order)
    index = {name: term for term, name in enumerate(ground.names)}
    consistent = not any(c.term < 0 and not c.body for c in clauses)
    needed = {index[name] for name in wanted if name in index}
    steps = _steps(ground, clauses, outcomes, joined, needed)
    if len(joined) < len(order) and any(isinstance(step.decision, Circle) for step in steps):
        steps = _steps(ground, clauses, outcomes, order, needed)  # what was joined could not be stratified
    ground.clauses = []  # the steps have what they need of them
    return Plan(ground, steps, consistent, index)


def _joined(
    ground: Ground, clauses: Sequence[Clause], order: Sequence[tuple[int, ...]]
) -> Sequence[tuple[int, ...]]:
    """The components, where circles without chance are made one with their neighbours without chance.

    Such a circle is worked out for all states at once, so that what leads to it had better be, too.
    """
    if all(len(terms) == 1 for terms in order):
        return order
    chance = {clause.term for clause in clauses if clause.kind is Kind.SELECT} | ground.do.keys()
    joined: list[tuple[int, ...]] = []
    run: list[tuple[int, ...]] = []

    def end() -> None:
        if any(len(terms) > 1 for terms in run):
            joined.append(tuple([term for terms in run for term in terms]))
        else:
            joined.extend(run)
        run.clear()

    for terms in order:
        if chance.isdisjoint(terms):
            run.append(terms)
        else:
            end()
            joined.append(terms)
    end()
    return joined


def _steps(
    ground: Ground,
    clauses: Sequence[Clause],
    outcomes: Sequence[int],
    order: Sequence[tuple[int, ...]],
    wanted: set[int],
) -> list[Step]:
    place = [0] * len(ground.values)
    for position, terms in enumerate(order):
        for term in terms:
            place[term] = position
    circular = [len(terms) > 1 for terms in order]
    for clause in clauses:
        if clause.term >= 0 and not circular[place[clause.term]]:
            own = clause.term
            for literal in clause.body:
                if literal[0] == own:
                    circular[place[own]] = True
    groups, pending = _grouped(clauses, outcomes, place, circular)
    shared: dict[object, Any] = {}
    opening: list[list[_Pending]] = [[] for _ in order]
    closing: list[list[_Pending]] = [[] for _ in order]
    touching: list[list[_Pending]] = [[] for _ in order]
    beginning: list[list[_Group]] = [[] for _ in order]
    owned: list[list[_Group]] = [[] for _ in order]
    for p in pending:
        if p.last > p.first:
            opening[p.first].append(p)
            closing[p.last].append(p)
            positions = [place[term] for term in p.outer]
            for position in positions if len(positions) == 2 else set(positions):
                touching[position].append(p)
        else:
            touching[p.first].append(p)
        if p.group and (p.group.begins < 0 or p.last < p.group.begins):
            p.group.begins = p.last
    for group in groups:
        owned[group.owner].append(group)
        if not group.always:
            beginning[group.begins].append(group)
    bits = _Bits()
    steps: list[Step] = []
    for position, terms in enumerate(order):
        for p in opening[position]:
            p.denied = bits.take()
        for group in beginning[position]:
            group.true = bits.take()
        mask = 0
        entries: list[Entry] = []
        for group in owned[position]:
            entries.append((group.true, group.clause))
            mask |= group.true
        decision: Decision
        if circular[position]:
            asked = wanted.intersection(terms)
            for p in touching[position]:
                asked.update(term for term in p.outer if place[term] == position)
            decision = circle(ground, terms, entries, shared, asked)
        else:
            decision = SingleTerm(ground, terms[0], entries, shared)
        step = Step(terms, decision, mask, position=position)
        step.touch(touching[position])
        bits.free(mask)
        for p in closing[position]:
            bits.free(p.denied)
        step.absorb = _absorbed(touching[position], position)
        step.keep = bits.live
        steps.append(step)
    for group in groups:
        group.members = []  # members know their group: no circles for Python's collector to find
    return steps


def _grouped(
    clauses: Sequence[Clause], outcomes: Sequence[int], place: Sequence[int], circular: Sequence[bool]
) -> tuple[list[_Group], list[_Pending]]:
    """The clauses by their heads, and those that need bits."""
    groups: dict[object, _Group] = {}
    pending: list[_Pending] = []
    for number, clause in enumerate(clauses):
        own = place[clause.term] if clause.term >= 0 else -1
        outer: dict[int, int] = {}  # literals of one term hold together
        inner: list[Literal] = []
        for literal in clause.body:
            term = literal[0]
            if place[term] == own:
                inner.append(literal)
            elif term in outer:
                outer[term] &= literal[1]
            else:
                outer[term] = literal[1] & outcomes[term]
        group = None
        if own >= 0:
            kind = clause.kind
            key: object
            if inner or kind is Kind.ASSIGN:
                key = number
            elif kind is Kind.DERIVE:
                key = kind, clause.term, clause.value
            else:
                key = kind, clause.term, clause.value, clause.statement, clause.instance
            group = groups.get(key)
            if group is None:
                alone = clause
                if circular[own]:  # only what is decided together is left to decide there
                    c = clause
                    alone = Clause(
                        c.kind, c.term, c.value, tuple(inner), c.statement, c.label, c.instance, c.number
                    )
                group = groups[key] = _Group(alone, own, [])
        if outer:
            if len(outer) == 1:
                first = last = place[next(iter(outer))]
            else:
                positions = [place[term] for term in outer]
                first, last = min(positions), max(positions)
            p = _Pending(group, outer, first, last)
            if group is None:
                pending.append(p)
            elif not group.always:
                group.members.append(p)
        elif group is not None:
            group.always = True
    for group in groups.values():
        if not group.always:
            pending.extend(group.members)
    return list(groups.values()), pending


def _absorbed(touching: Sequence[_Pending], position: int) -> list[tuple[int, int]]:
    """For the groups that this step touches: the bits of members still open, which a true body makes idle."""
    found: dict[int, tuple[int, int]] = {}
    for p in touching:
        group = p.group
        if group and len(group.members) > 1 and group.true and id(group) not in found:
            idle = 0
            for member in group.members:
                if member.denied and member.first <= position < member.last:
                    idle |= member.denied
            found[id(group)] = group.true, idle
            if len(found) > MOST_ABSORBED:
                return []
    return [pair for pair in found.values() if pair[1]]


class _Bits:
    """Which bits of a state are in use."""

    def __init__(self) -> None:
        self.live, self._free, self._next = 0, [], 1  # type: int, list[int], int

    def take(self) -> int:
        """A bit that is not in use."""
        if self._free:
            bit = self._free.pop()
        else:
            bit, self._next = self._next, self._next << 1
        self.live |= bit
        return bit

    def free(self, bits: int) -> None:
        """Bits that are no longer needed."""
        self.live &= ~bits
        while bits:
            lowest = bits & -bits
            self._free.append(lowest)
            bits ^= lowest
