"""What is the same in all worlds, taken out of a ground program before any world is looked at.

First the least fixed point of what may be true at all, then the outcomes that each term may have: a literal
that always holds leaves its body, a clause with one that never holds leaves the program. Neither changes a
world.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lcorpp.reasoning.circuit.ground import Clause, Ground, Kind

SUPPORTS = (Kind.DERIVE, Kind.SELECT)
"""The kinds of clauses that give values to terms."""


def simplified(ground: Ground) -> tuple[list[Clause], list[int]]:
    """The clauses that matter, with the literals that matter, and the outcomes that each term may have.

    Returns:
        (clauses, outcomes); outcomes[t] has bit i for value i of term t and a last bit for having no value.
    """
    possible = _possible(ground)
    clauses = [clause for clause in _distinct(ground.clauses) if _can_hold(clause, possible)]
    clauses = _without_the_forbidden(ground, clauses)
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


def _distinct(clauses: Sequence[Clause]) -> Iterator[Clause]:
    """Each rule and constraint once; variables that may change places say the same thing many times."""
    met: set[object] = set()
    for clause in clauses:
        if len(clause.body) > 1 and clause.kind in (Kind.DERIVE, Kind.FORBID):
            key = clause.term, clause.value, frozenset(clause.body)
            if key in met:
                continue
            met.add(key)
        yield clause


def _without_the_forbidden(ground: Ground, clauses: list[Clause]) -> list[Clause]:
    """Rules for what an observation denies become constraints, which end a world as soon as possible."""
    allowed: dict[int, int] = {}
    waiting = [clause for clause in clauses if clause.kind is Kind.FORBID and len(clause.body) == 1]
    if not waiting:
        return clauses
    derives: dict[int, list[int]] = {}
    for i, clause in enumerate(clauses):
        if clause.kind is Kind.DERIVE:
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
            if clause.kind is Kind.DERIVE and not allowed[term] >> clause.value & 1:
                found[i] = Clause(Kind.FORBID, -1, 0, clause.body, clause.statement)
                if len(clause.body) == 1:
                    waiting.append(found[i])
    result = []
    for clause in found:
        if clause.kind is Kind.FORBID and len(clause.body) > 1:
            # worlds in which an observation fails are none, so that a constraint need not speak of them
            if any(not literal[1] & allowed.get(literal[0], -1) for literal in clause.body):
                continue
            body = tuple([x for x in clause.body if allowed.get(x[0], -1) & _all(ground, x[0]) & ~x[1]])
            if len(body) < len(clause.body):
                clause = Clause(Kind.FORBID, -1, 0, body, clause.statement)
        result.append(clause)
    return result


def _all(ground: Ground, term: int) -> int:
    return (1 << len(ground.values[term]) + 1) - 1


def _can_hold(clause: Clause, possible: Sequence[int]) -> bool:
    """Whether no literal of the body needs a value that nothing gives."""
    for term, allowed, negated in clause.body:  # noqa: SIM110  # a hot loop
        if not negated and not allowed & possible[term]:
            return False
    return True


def _possible(ground: Ground) -> list[int]:
    """For each term, as bits, the values that it may have in some world: the least fixed point."""
    possible = [0] * len(ground.values)
    if ground.do_is_fact:
        for term, value in ground.do.items():
            possible[term] |= 1 << value
    waiting: dict[int, list[Clause]] = {}
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
            if clause.kind is Kind.DERIVE:
                gives = 1 << clause.value
            else:
                gives = 1 << ground.do[head] if head in ground.do else (1 << len(ground.values[head])) - 1
            if gives & ~possible[head]:
                possible[head] |= gives
                grown.append(head)
        ready = [clause for term in grown for clause in waiting.pop(term, ())]
    return possible


def _outcomes(ground: Ground, clauses: Sequence[Clause], possible: Sequence[int]) -> list[int]:
    """The outcomes of each term, given the clauses that are left; `possible` bounds the values."""
    found = [0] * len(ground.values)
    certain: set[int] = set()
    facts: dict[int, int] = {}
    for clause in clauses:
        if clause.kind is Kind.DERIVE:
            found[clause.term] |= 1 << clause.value
        elif clause.kind is Kind.SELECT:
            found[clause.term] |= 1 << ground.do[clause.term] if clause.term in ground.do else -1
        else:
            continue
        if not clause.body:
            certain.add(clause.term)
            if clause.kind is Kind.DERIVE:  # any other value would contradict it
                facts[clause.term] = facts.get(clause.term, 0) | 1 << clause.value
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
