"""What depends on given predicates or tables, and predicates that depend on their own negation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import TypeVar

from lcorpp.reasoning.language.translation.problog_clauses import PrologClause

T = TypeVar("T")


def find_dependents(start: Iterable[T], users: Mapping[T, Iterable[T]]) -> set[T]:
    """Return the start and all that depend on it; `users` maps each element to those that use it directly."""
    found: set[T] = set()
    waiting = list(start)
    while waiting:
        if (element := waiting.pop()) not in found:
            found.add(element)
            waiting.extend(users.get(element, ()))
    return found


def has_negative_cycle(clauses: Sequence[PrologClause]) -> bool:
    """Return whether a predicate depends on its own negation; whether an atom does needs the instances."""
    uses = {
        (head.key, goal.term.key, goal.negated)
        for clause in clauses
        for _, head in clause.heads
        for goal in chain.from_iterable(clause.alternatives)
    }
    users: dict[tuple[str, int], set[tuple[str, int]]] = {}
    for user, used, _ in uses:
        users.setdefault(used, set()).add(user)
    return any(negated and used in find_dependents([user], users) for user, used, negated in uses)
