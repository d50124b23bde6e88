"""Search for an order of the components whose decision diagram is smaller, by simulated annealing.

Elimination chooses the cheapest component by the bits of all components that share a clause with it. States
have fewer bits: only whether bodies are satisfied. The search estimates these bits for a whole order, those
of linear recursions by the number of implications between the atoms of their frontiers, and moves one
component at a time. It takes as long as the expansion of a diagram with a million arcs or more, so it is
left to programs whose first order is too expensive.

Source: Kirkpatrick, Gelatt and Vecchi, "Optimization by simulated annealing", Science 220, 1983; orders of
minimal frontiers as in network reliability, Hardy, Lucet and Limnios, IEEE Trans. Reliability 56, 2007.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf

from lcorpp.reasoning._diagram import improve_order as improve_in_kernel
from lcorpp.reasoning.grounding.ground_program import DERIVE, Atom, Clause, GroundProgram
from lcorpp.reasoning.transitions.elimination_order import list_children, list_depth_first
from lcorpp.reasoning.transitions.linear_recursion import LinearRecursion, find_edges

MIN_GAIN = 0.3
"""Minimum gain of a better order: the decrease of the logarithm to base 2 of the number of states."""

_Group = tuple[int, list[list[int]]]
"""Clauses with the same head: (component, -1 for constraints; the components of each body)."""

_Rule = tuple[list[int], int, int]
"""A rule of a recursion: (components of the inputs, atom of the body, atom of the head); -1 for no atom."""


@dataclass(slots=True)
class OrderSearch:
    """The result of a search, from which another one continues.

    order: the components in the best order; None before the first gain.
    log_states: the estimated number of states of all steps, as a logarithm to base 2.
    """

    order: list[int] | None = None
    log_states: float = inf


def improve_order(
    search: OrderSearch,
    program: GroundProgram,
    components: Sequence[tuple[int, ...]],
    recursions: Iterable[tuple[LinearRecursion, Sequence[int]]],
    clauses: Iterable[Clause],
    needs: Sequence[set[int]],
    sizes: Sequence[float],
    parents: Sequence[int],
    max_work: float,
) -> bool:
    """Search for a better order than that of a tree, or than the best one so far; return whether it exists.

    Args:
        needs: component -> the components that must come before it.
        sizes: the bits of each component.
        parents: component -> the one before it in the tree, -1 for roots.
        max_work: the number of components and literals that the search visits.
    """
    component_of = {term: i for i, own in enumerate(components) for term in own}
    found = [own for own, _ in recursions]
    recursion_of = {term: number for number, own in enumerate(found) for term in own.terms}
    groups: dict[object, _Group] = {}
    rules: list[list[_Rule]] = [[] for _ in found]
    atoms: list[dict[Atom, int]] = [{} for _ in found]
    for index, clause in enumerate(clauses):
        if clause.term in recursion_of:
            number = recursion_of[clause.term]
            own_literals = [x for x in clause.body if recursion_of.get(x[0]) == number]
            inputs = sorted({component_of[x[0]] for x in clause.body if recursion_of.get(x[0]) != number})
            known = atoms[number]
            for body, head in find_edges(program, clause, own_literals) or ():
                start = -1 if body is None else known.setdefault(body, len(known))
                rules[number].append((inputs, start, known.setdefault(head, len(known))))
            continue
        child = component_of[clause.term] if clause.term >= 0 else -1
        decided = sorted({component_of[x[0]] for x in clause.body} - {child})
        if decided:
            key: object = (clause.term, clause.value) if clause.kind is DERIVE else index
            groups.setdefault(key, (child, []))[1].append(decided)
    for number, recursion in enumerate(found):
        known = atoms[number]
        for term, guess in recursion.guesses.items():
            for _, value, _ in guess.claims:
                atom = known.setdefault((term, value), len(known))
                rules[number].append(([component_of[term]], atom, -1))
    first = search.order or list_depth_first(list_children(parents))
    order, before, after = improve_in_kernel(
        sizes, list(map(sorted, needs)), list(groups.values()), rules, first, max_work
    )
    search.log_states = before
    if after >= before - MIN_GAIN:
        return False
    search.order, search.log_states = order, after
    return True
