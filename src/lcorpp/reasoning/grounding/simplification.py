"""What is the same in all worlds, taken out of a ground program before any world is looked at.

First the least fixed point of what may be true at all, then the outcomes that each term may have: a literal
that always holds leaves its body, a clause with one that never holds leaves the program. Neither changes a
world.
"""

from __future__ import annotations

from collections.abc import Sequence

from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram

SUPPORTS = (ClauseKind.DERIVE, ClauseKind.SELECT)
"""The kinds of clauses that give values to terms."""

PLAIN = (ClauseKind.DERIVE, ClauseKind.FORBID)
"""The kinds of clauses that say nothing more than their body and value."""


def simplify(ground: GroundProgram) -> tuple[list[Clause], list[int]]:
    """The clauses that matter, with the literals that matter, and the outcomes that each term may have.

    Returns:
        (clauses, outcomes); outcomes[t] has bit i for value i of term t and a last bit for having no value.
    """
    possible = _possible(ground)
    clauses = _without_the_forbidden(ground, _held(ground.clauses, possible))
    outcomes = _outcomes(ground, clauses, possible)
    while True:
        changed = _simplify(clauses, outcomes)
        if changed is None:
            return clauses, outcomes
        clauses = changed
        again = _outcomes(ground, clauses, outcomes)
        if again == outcomes:
            return clauses, outcomes
        outcomes = again


def _held(clauses: Sequence[Clause], possible: Sequence[int]) -> list[Clause]:
    """The clauses of which no literal needs a value that nothing gives.

    Rules and constraints stay once; variables that may change places say the same thing many times.
    """
    kept: list[Clause] = []
    met: set[object] = set()
    for clause in clauses:
        body = clause.body
        for term, allowed, negated in body:
            if not negated and not allowed & possible[term]:
                break
        else:
            if len(body) > 1 and clause.kind in PLAIN:
                key = clause.term, clause.value, frozenset(body)
                if key in met:
                    continue
                met.add(key)
            kept.append(clause)
    return kept


def _without_the_forbidden(ground: GroundProgram, clauses: list[Clause]) -> list[Clause]:
    """Rules for what an observation denies become constraints, which end a world as soon as possible."""
    allowed: dict[int, int] = {}
    waiting = [clause for clause in clauses if clause.kind is ClauseKind.FORBID and len(clause.body) == 1]
    if not waiting:
        return clauses
    derives: dict[int, list[int]] = {}
    for i, clause in enumerate(clauses):
        if clause.kind is ClauseKind.DERIVE:
            derives.setdefault(clause.term, []).append(i)
    found = list(clauses)
    while waiting:
        term, denied, _ = waiting.pop().body[0]
        before = allowed.get(term, -1)
        allowed[term] = before & ~denied
        if allowed[term] == before:
            continue
        for i in derives.get(term, ()):
            clause = found[i]
            if clause.kind is ClauseKind.DERIVE and not allowed[term] >> clause.value & 1:
                found[i] = Clause(ClauseKind.FORBID, -1, 0, clause.body, clause.statement)
                if len(clause.body) == 1:
                    waiting.append(found[i])
    result = []
    for clause in found:
        if clause.kind is ClauseKind.FORBID and len(clause.body) > 1:
            # worlds in which an observation fails are none, so that a constraint need not speak of them
            if any(not literal[1] & allowed.get(literal[0], -1) for literal in clause.body):
                continue
            body = tuple([x for x in clause.body if allowed.get(x[0], -1) & _all(ground, x[0]) & ~x[1]])
            if len(body) < len(clause.body):
                clause = Clause(ClauseKind.FORBID, -1, 0, body, clause.statement)
        result.append(clause)
    return result


def _all(ground: GroundProgram, term: int) -> int:
    return (1 << len(ground.values[term]) + 1) - 1


def _possible(ground: GroundProgram) -> list[int]:
    """For each term, as bits, the values that it may have in some world: the least fixed point."""
    possible = [0] * len(ground.values)
    if ground.do_is_fact:
        for term, value in ground.do.items():
            possible[term] |= 1 << value
    waiting: dict[int, list[Clause]] = {}
    derive = ClauseKind.DERIVE  # to look up a member of an Enum takes time
    ready = [clause for clause in ground.clauses if clause.kind in SUPPORTS]
    while ready:
        grown: list[int] = []
        for clause in ready:
            missing = -1
            for term, allowed, negated in clause.body:
                if not negated and not allowed & possible[term]:
                    missing = term
                    break
            if missing >= 0:
                waiting.setdefault(missing, []).append(clause)
                continue
            head = clause.term
            if clause.kind is derive:
                gives = 1 << clause.value
            else:
                gives = 1 << ground.do[head] if head in ground.do else (1 << len(ground.values[head])) - 1
            if gives & ~possible[head]:
                possible[head] |= gives
                grown.append(head)
        ready = [clause for term in grown for clause in waiting.pop(term, ())]
    return possible


def _outcomes(ground: GroundProgram, clauses: Sequence[Clause], possible: Sequence[int]) -> list[int]:
    """The outcomes of each term, given the clauses that are left; `possible` bounds the values."""
    derive = ClauseKind.DERIVE
    found = [0] * len(ground.values)
    certain: set[int] = set()
    facts: dict[int, int] = {}
    for clause in clauses:
        kind = clause.kind
        if kind not in SUPPORTS:
            continue
        term = clause.term
        gives = 1 << clause.value
        if kind is not derive:
            gives = 1 << ground.do[term] if term in ground.do else -1
        found[term] |= gives
        if not clause.body:
            certain.add(term)
            if kind is derive:  # any other value would contradict it
                facts[term] = facts.get(term, 0) | gives
    if ground.do_is_fact:
        for term, value in ground.do.items():
            found[term] = 1 << value
            certain.add(term)
    for term, bits in facts.items():
        found[term] = bits
    result = []
    for term, values in enumerate(ground.values):
        undefined = 1 << len(values)
        bits = found[term] & possible[term] & (undefined - 1)
        result.append(bits if term in certain else bits | undefined)
    return result


def _simplify(clauses: Sequence[Clause], outcomes: Sequence[int]) -> list[Clause] | None:
    """The clauses without what the outcomes decide; None if that changes nothing."""
    kept: list[Clause] = []
    changed = False
    for clause in clauses:
        drop = shorten = False
        for term, allowed, _ in clause.body:
            outcome = outcomes[term]
            meets = allowed & outcome
            if not meets:
                drop = True
                break
            if meets == outcome:
                shorten = True
        if drop:
            changed = True
            continue
        if shorten:
            body = tuple([x for x in clause.body if outcomes[x[0]] & ~x[1]])
            clause = Clause(
                clause.kind, clause.term, clause.value, body,
                clause.statement, clause.label, clause.instance, clause.number,
            )  # fmt: skip
            changed = True
        kept.append(clause)
    return kept if changed else None
