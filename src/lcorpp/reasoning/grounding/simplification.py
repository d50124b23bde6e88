"""Compilation, step 1: simplify a ground program without changing its worlds.

1. Drop the clauses whose positive literals no clause can satisfy (least fixed point over all clauses), and
   the pr-atoms and dynamic ranges of terms without a selection.
2. Turn rules that contradict an observation into constraints, which cut worlds off earlier.
3. Compute the possible outcomes of each term; drop literals that are true for all of them and clauses with a
   literal that is true for none; repeat until nothing changes.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from lcorpp.reasoning.grounding.ground_program import (
    ASSIGN,
    DERIVE,
    FORBID,
    RANGE,
    SELECT,
    Clause,
    GroundProgram,
    make_full_mask,
)

SUPPORTING_KINDS = (DERIVE, SELECT)
"""The kinds of clauses that give values to terms."""

ATTENDANT_KINDS = (RANGE, ASSIGN)
"""The kinds of clauses that matter only for random terms."""


def simplify(program: GroundProgram) -> tuple[list[Clause], list[int]]:
    """Simplify a ground program.

    Returns:
        (clauses, outcomes): outcomes[t] is the mask of the possible outcomes of term t, with bit i for value
        i and the next bit for no value.
    """
    possible, random = _compute_possible_values(program)
    clauses = _propagate_observations(program, _drop_unsupported(program.clauses, possible, random))
    outcomes = _compute_outcomes(program, clauses, possible)
    narrowed: list[int] | None = None
    while narrowed != outcomes:
        outcomes = narrowed or outcomes
        shorter = _drop_decided_literals(clauses, outcomes)
        if shorter is None:
            break
        clauses = shorter
        narrowed = _compute_outcomes(program, clauses, outcomes)
    return clauses, outcomes


def _compute_possible_values(program: GroundProgram) -> tuple[list[int], set[int]]:
    """Compute the mask of the values that each term may have in some world: the least fixed point.

    Returns:
        (masks, terms): the second are those that may be selected at random.
    """
    possible = [0] * len(program.values)
    random: set[int] = set()
    if program.do_is_fact:
        for term, value in program.do.items():
            possible[term] |= 1 << value
    waiting: dict[int, list[Clause]] = {}
    ready = [clause for clause in program.clauses if clause.kind in SUPPORTING_KINDS]
    while ready:
        extended: list[int] = []
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
            if clause.kind is DERIVE:
                mask = 1 << clause.value
            else:
                random.add(head)
                mask = 1 << program.do[head] if head in program.do else (1 << len(program.values[head])) - 1
            if mask & ~possible[head]:
                possible[head] |= mask
                extended.append(head)
        ready = [clause for term in extended for clause in waiting.pop(term, ())]
    return possible, random


def _drop_unsupported(
    clauses: Sequence[Clause], possible: Sequence[int], random: Collection[int]
) -> list[Clause]:
    """Drop idle clauses and those with a positive literal that needs an impossible value."""
    kept: list[Clause] = []
    for clause in clauses:
        if clause.term not in random and clause.kind in ATTENDANT_KINDS:
            continue
        for term, allowed, negated in clause.body:
            if not negated and not allowed & possible[term]:
                break
        else:
            kept.append(clause)
    return kept


def _propagate_observations(program: GroundProgram, clauses: list[Clause]) -> list[Clause]:
    """Replace rules whose head contradicts an observation by constraints, which cut worlds off earlier."""
    allowed: dict[int, int] = {}  # term -> the outcomes that agree with the observations
    # constraints have no head
    waiting = [clause for clause in clauses if clause.term < 0 and len(clause.body) == 1]
    if not waiting:
        return clauses
    rules: dict[int, list[int]] = {}
    for i, clause in enumerate(clauses):
        if clause.kind is DERIVE:
            rules.setdefault(clause.term, []).append(i)
    replaced = list(clauses)
    while waiting:
        term, forbidden, _ = waiting.pop().body[0]
        before = allowed.get(term, -1)
        allowed[term] = before & ~forbidden
        if allowed[term] == before:
            continue
        for i in rules.get(term, ()):
            clause = replaced[i]
            if clause.kind is DERIVE and not allowed[term] >> clause.value & 1:
                replaced[i] = Clause(FORBID, -1, 0, clause.body, clause.statement)
                if len(clause.body) == 1:
                    waiting.append(replaced[i])
    result = []
    for clause in replaced:
        if clause.term < 0 and len(clause.body) > 1:
            # the observations alone forbid the worlds in which such a literal is true
            if any(not literal[1] & allowed.get(literal[0], -1) for literal in clause.body):
                continue
            body = tuple(
                [
                    x
                    for x in clause.body
                    if allowed.get(x[0], -1) & make_full_mask(len(program.values[x[0]])) & ~x[1]
                ]
            )
            if len(body) < len(clause.body):
                clause = Clause(FORBID, -1, 0, body, clause.statement)
        result.append(clause)
    return result


def _compute_outcomes(
    program: GroundProgram, clauses: Sequence[Clause], possible: Sequence[int]
) -> list[int]:
    """Compute the possible outcomes of each term from the remaining clauses; `possible` bounds the values."""
    supported = [0] * len(program.values)
    certain: set[int] = set()  # terms that have a value in every world
    facts: dict[int, int] = {}
    for clause in clauses:
        kind = clause.kind
        if kind not in SUPPORTING_KINDS:
            continue
        term = clause.term
        mask = 1 << clause.value
        if kind is not DERIVE:
            mask = 1 << program.do[term] if term in program.do else -1
        supported[term] |= mask
        if not clause.body:
            certain.add(term)
            if kind is DERIVE:  # a fact: any other value would contradict it
                facts[term] = facts.get(term, 0) | mask
    if program.do_is_fact:
        for term, value in program.do.items():
            supported[term] = 1 << value
            certain.add(term)
    for term, mask in facts.items():
        supported[term] = mask
    result = []
    for term, values in enumerate(program.values):
        no_value = 1 << len(values)
        mask = supported[term] & possible[term] & (no_value - 1)
        result.append(mask if term in certain else mask | no_value)
    return result


def _drop_decided_literals(clauses: Sequence[Clause], outcomes: Sequence[int]) -> list[Clause] | None:
    """Drop literals that are always true and clauses with one that is never true; None if nothing changes."""
    kept: list[Clause] = []
    changed = False
    for clause in clauses:
        drop = shorten = False
        for term, allowed, _ in clause.body:
            possible = outcomes[term]
            satisfying = allowed & possible
            if not satisfying:
                drop = True
                break
            if satisfying == possible:
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
