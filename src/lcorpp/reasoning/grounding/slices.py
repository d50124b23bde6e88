"""Two-slice programs: the past of a step, and the step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

from lcorpp.errors import ProgramError
from lcorpp.reasoning.grounding.ground_program import SELECT, Clause, GroundProgram


def split_slices(
    ground: GroundProgram, state: str, initial: Iterable[str], is_old: Callable[[str], bool]
) -> tuple[GroundProgram, GroundProgram]:
    """Split a program into the past and a step.

    The past has the terms on which the carried terms of slice 0 and the initial evidence depend. The step has
    the other clauses; the carried terms of slice 0 are random in it, so that all states are equally probable.

    Args:
        state: the joint of the carried terms of slice 0; it is part of both.
        is_old: whether a term belongs to slice 0, by its name.

    Raises:
        ProgramError: the step depends on a term of the past that is not carried, or on a random term of
            slice 0 that is not: each step would draw it anew.
    """
    causes: dict[int, set[int]] = {}
    for clause in ground.clauses:
        causes.setdefault(clause.term, set()).update(literal[0] for literal in clause.body)
    numbers = {name: term for term, name in enumerate(ground.names)}
    own = [numbers[name] for name in state[1:].split(", ")]
    past: set[int] = set()
    rest = [numbers[state], *(numbers[name] for name in initial if name in numbers)]
    while rest:
        term = rest.pop()
        if term not in past:
            past.add(term)
            rest.extend(causes.get(term, ()))
    before: list[Clause] = []
    step = [Clause(SELECT, term, 0, ()) for term in own]
    old = {term for term, name in enumerate(ground.names) if is_old(name)}.difference(own)
    lost = past.difference(own)
    lost |= {clause.term for clause in ground.clauses if clause.kind is SELECT and clause.term in old}
    for clause in ground.clauses:
        terms = [literal[0] for literal in clause.body]
        if clause.term in past or (clause.term < 0 and past.issuperset(terms)):
            before.append(clause)
            if clause.term != numbers[state]:
                continue
        step.append(clause)
        for term in _trace(lost, terms, causes, old) if clause.term not in old else ():
            head = ground.names[clause.term] if clause.term >= 0 else "a constraint"
            raise ProgramError(
                f"{ground.source.file}: {head} depends on {ground.names[term]}, which is not carried from"
                " step to step"
            )
    return replace(ground, clauses=before), replace(ground, clauses=step)


def _trace(
    lost: set[int], terms: Iterable[int], causes: Mapping[int, set[int]], old: set[int]
) -> Iterator[int]:
    """Yield the lost terms on which terms depend, directly or by other terms of slice 0."""
    rest, seen = list(terms), set[int]()
    while rest:
        term = rest.pop()
        if term in lost:
            yield term
        elif term in old and term not in seen:
            seen.add(term)
            rest.extend(causes.get(term, ()))
