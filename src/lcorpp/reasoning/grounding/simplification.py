"""Compilation, step 1: simplify a ground program without changing its worlds.

1. Turn rules that contradict an observation into constraints, which cut worlds off earlier.
2. Compute the possible outcomes of each term: the values that the clauses derive or select if each literal is
   true that may be (a least fixed point), and no value unless a clause without body gives one.
3. Drop literals that are true for all possible outcomes, clauses with a literal that is true for none, and
   the pr-atoms and dynamic ranges of terms without a selection. Repeat 2 and 3 until nothing changes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from lcorpp.reasoning.grounding.ground_program import (
    ASSIGN,
    DERIVE,
    FORBID,
    RANGE,
    SELECT,
    Clause,
    GroundProgram,
)


def simplify(program: GroundProgram) -> tuple[list[Clause], list[int]]:
    """Simplify a ground program.

    Returns:
        (clauses, outcomes): outcomes[t] is the mask of the possible outcomes of term t, with bit i for value
        i and the next bit for no value.
    """
    clauses, observed = _propagate_observations(program.clauses)
    before: object = None
    while (decided := _compute_outcomes(program, clauses)) != before:
        shorter = _drop_decided(clauses, *decided, observed)
        if shorter is None:
            break
        clauses, before = shorter, decided
    return clauses, decided[0]


def _compute_outcomes(program: GroundProgram, clauses: Sequence[Clause]) -> tuple[list[int], set[int]]:
    """Compute the mask of the possible outcomes of each term, and the terms that may be selected."""
    possible = [0] * len(program.values)  # term -> mask of values, without literals that need another
    random: set[int] = set()
    facts: dict[int, int] = {}  # term -> mask of the values that it has in every world, 0 if any
    if program.do_is_fact:
        for term, value in program.do.items():
            possible[term] = facts[term] = 1 << value
    waiting: dict[int, list[Clause]] = {}  # term of a literal -> clauses that need another value of it
    ready: Sequence[Clause] = clauses
    while ready:
        extended: list[int] = []
        for clause in ready:
            kind = clause.kind
            if kind is not DERIVE and kind is not SELECT:
                continue
            for term, allowed, negated in clause.body:
                if not negated and not allowed & possible[term]:
                    waiting.setdefault(term, []).append(clause)
                    break
            else:
                head = clause.term
                mask = 1 << clause.value
                if kind is SELECT:
                    random.add(head)
                    n_values = len(program.values[head])
                    mask = 1 << program.do[head] if head in program.do else (1 << n_values) - 1
                if not clause.body:
                    facts[head] = facts.get(head, 0) | (mask if kind is DERIVE else 0)
                if mask & ~possible[head]:
                    possible[head] |= mask
                    extended.append(head)
        ready = [clause for term in extended for clause in waiting.pop(term, ())]
    outcomes = [mask | 1 << len(values) for mask, values in zip(possible, program.values, strict=True)]
    for term, mask in facts.items():
        outcomes[term] = mask or possible[term]  # another value than a fact would contradict it
    return outcomes, random


def _propagate_observations(clauses: list[Clause]) -> tuple[list[Clause], dict[int, int]]:
    """Replace rules whose head contradicts an observation by constraints.

    Returns:
        (clauses, observed): term -> the mask of the outcomes that agree with the observations.
    """
    observed: dict[int, int] = {}
    # constraints have no head
    waiting = [clause for clause in clauses if clause.term < 0 and len(clause.body) == 1]
    rules: dict[int, list[int]] = {}
    for i, clause in enumerate(clauses) if waiting else ():
        if clause.kind is DERIVE:
            rules.setdefault(clause.term, []).append(i)
    replaced = list(clauses)
    while waiting:
        term, forbidden, _ = waiting.pop().body[0]
        before = observed.get(term, -1)
        observed[term] = before & ~forbidden
        if observed[term] == before:
            continue
        for i in rules.get(term, ()):
            clause = replaced[i]
            if clause.kind is DERIVE and not observed[term] >> clause.value & 1:
                replaced[i] = Clause(FORBID, -1, 0, clause.body, clause.statement)
                if len(clause.body) == 1:
                    waiting.append(replaced[i])
    return replaced, observed


def _drop_decided(
    clauses: Sequence[Clause], outcomes: Sequence[int], random: Collection[int], observed: Mapping[int, int]
) -> list[Clause] | None:
    """Drop what has no effect; None if nothing changes.

    A constraint of several literals forbids only worlds that agree with the observations; those of one
    literal, which forbid the others, stay.
    """
    agreeing = list(outcomes)
    for term, mask in observed.items():
        agreeing[term] &= mask
    kept: list[Clause] = []
    changed = False
    for clause in clauses:
        possible = agreeing if clause.term < 0 and len(clause.body) > 1 else outcomes
        shorten = False
        drop = (clause.kind is RANGE or clause.kind is ASSIGN) and clause.term not in random
        for term, allowed, _ in clause.body:
            satisfying = allowed & possible[term]
            if not satisfying:
                drop = True
                break
            if satisfying == possible[term]:
                shorten = True
        if drop:
            changed = True
            continue
        if shorten:
            body = tuple([x for x in clause.body if possible[x[0]] & ~x[1]])
            clause = Clause(
                clause.kind, clause.term, clause.value, body,
                clause.statement, clause.label, clause.instance, clause.number,
            )  # fmt: skip
            changed = True
        kept.append(clause)
    return kept if changed else None
