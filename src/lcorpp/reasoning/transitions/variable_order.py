"""Compilation, step 2: the variable order, in which the components of a ground program are decided.

A component is a strongly connected set of terms of the dependency graph (usually one term); each comes after
the components that its clauses name. The frontier after a component consists of the decided terms that
clauses of undecided components or open constraints (with undecided terms) still name: they determine the
size of a level of the decision diagram. The order is greedy: next is the component that enlarges the frontier
least (in bits), as in min-size heuristics for variable elimination and path decompositions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from heapq import heapify, heappop, heappush
from math import log2

from lcorpp.reasoning.grounding.ground_program import Clause


def order_components(clauses: Sequence[Clause], outcomes: Sequence[int]) -> list[tuple[int, ...]]:
    """Compute the variable order.

    Args:
        clauses: the simplified clauses.
        outcomes: the mask of the possible outcomes of each term.

    Returns:
        The terms of each component, in the order of decision.
    """
    n_terms = len(outcomes)
    needs: list[set[int]] = [set() for _ in range(n_terms)]  # term -> the other terms in its bodies
    constraints: set[frozenset[int]] = set()  # the terms of each
    for clause in clauses:
        if clause.term >= 0:  # constraints have no head
            for literal in clause.body:
                needs[clause.term].add(literal[0])
        elif len(clause.body) > 1:
            constraints.add(frozenset([literal[0] for literal in clause.body]))
    for term, needed in enumerate(needs):
        needed.discard(term)
    components: list[tuple[int, ...]] = [(term,) for term in range(n_terms)]
    # there is no cycle if every term needs only smaller ones
    if any(needed and max(needed) > term for term, needed in enumerate(needs)):
        components = sorted(find_strongly_connected_components(needs))
        if len(components) < n_terms:
            component_of = {term: i for i, terms in enumerate(components) for term in terms}
            needs = [
                {component_of[need] for term in terms for need in needs[term]} - {i}
                for i, terms in enumerate(components)
            ]
            constraints = {frozenset([component_of[term] for term in terms]) for terms in constraints}
    bits = {mask: log2(mask.bit_count() or 1) for mask in set(outcomes)}
    sizes = [sum([bits[outcomes[term]] for term in terms]) for terms in components]
    joint = sorted([sorted(members) for members in constraints if len(members) > 1])
    return [components[i] for i in _order_greedily(needs, joint, sizes)]


def _order_greedily(
    needs: Sequence[set[int]], constraints: Sequence[Sequence[int]], sizes: Sequence[float]
) -> Iterator[int]:
    """Iterate over the indexes of the components in their order.

    Args:
        needs: component -> the components that must come before it.
        constraints: the components of each constraint.
        sizes: the bits of each component on the frontier.
    """
    count = len(needs)
    users: list[list[int]] = [[] for _ in range(count)]
    for user, needed in enumerate(needs):
        for need in needed:
            users[need].append(user)
    constraints_of: dict[int, list[int]] = {}
    for constraint, members in enumerate(constraints):
        for member in members:
            constraints_of.setdefault(member, []).append(constraint)
    n_undecided_members = [len(members) for members in constraints]
    n_undecided_needs = [len(needed) for needed in needs]
    n_references = [  # to each component, from undecided components and open constraints
        len(users[i]) + len(constraints_of.get(i, ())) for i in range(count)
    ]

    def compute_growth(i: int) -> float:
        """The bits that deciding a component adds to the frontier, at most."""
        growth = sizes[i] if n_references[i] else 0.0
        for need in needs[i]:
            if n_references[need] == 1:
                growth -= sizes[need]
        for constraint in constraints_of.get(i, ()):
            if n_undecided_members[constraint] == 1:  # deciding i closes the constraint
                members = constraints[constraint]
                growth -= sum([sizes[m] for m in members if m != i and n_references[m] == 1])
        return growth

    # The growth of an undecided component only decreases. An entry may be too high after a constraint closed,
    # as this pushes no new entries; the order then is a little worse.
    heap = [(compute_growth(i), i) for i in range(count) if not n_undecided_needs[i]]
    heapify(heap)
    done = [False] * count
    while heap:
        _, i = heappop(heap)
        if done[i]:
            continue
        done[i] = True
        yield i
        changed: list[int] = []
        for constraint in constraints_of.get(i, ()):
            n_undecided_members[constraint] -= 1
            if not n_undecided_members[constraint]:
                for member in constraints[constraint]:
                    n_references[member] -= 1
            elif n_undecided_members[constraint] == 1:
                changed.extend([member for member in constraints[constraint] if not done[member]])
        for need in needs[i]:
            n_references[need] -= 1
            if n_references[need] == 1:
                changed.extend([user for user in users[need] if not done[user]])
        for user in users[i]:
            n_undecided_needs[user] -= 1
            if not n_undecided_needs[user]:
                heappush(heap, (compute_growth(user), user))
        for other in changed:
            if not n_undecided_needs[other]:
                heappush(heap, (compute_growth(other), other))


def find_strongly_connected_components(successors: Sequence[Iterable[int]]) -> list[tuple[int, ...]]:
    """Return the strongly connected components of a graph, each after the components it points to.

    Args:
        successors: node -> the nodes to which it points.

    Source: Tarjan, SIAM J. Comput. 1(2), 1972, without recursion.
    """
    finished = len(successors) + 1
    index = [0] * len(successors)  # node -> number in the order of visits; 0: not visited
    low = [0] * len(successors)
    stack: list[int] = []
    work: list[tuple[int, Iterator[int]]] = []
    components: list[tuple[int, ...]] = []
    counter = 0
    for root in range(len(successors)):
        entered = None if index[root] else root
        while entered is not None or work:
            if entered is not None:
                counter += 1
                index[entered] = low[entered] = counter
                stack.append(entered)
                work.append((entered, iter(successors[entered])))
            node, rest = work[-1]
            entered = None
            for successor in rest:
                if not index[successor]:
                    entered = successor
                    break
                if index[successor] < low[node]:
                    low[node] = index[successor]
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    members = [stack.pop()]
                    while members[-1] != node:
                        members.append(stack.pop())
                    for member in members:
                        index[member] = finished
                    components.append(tuple(sorted(members)))
    return components
