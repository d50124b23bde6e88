"""Compilation, step 2: order the components of a ground program so that the frontier stays small.

A component is a strongly connected set of terms of the dependency graph (usually one term); each comes after
the components that its clauses name. The frontier after a component consists of the decided terms that
clauses of undecided components or open constraints still name. The order is greedy: next is the component
that enlarges the frontier least (in bits), as in min-size heuristics for variable elimination and path
decompositions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from heapq import heapify, heappop, heappush
from math import log2

from lcorpp.reasoning.grounding.ground_program import Clause


def order_components(clauses: Sequence[Clause], outcomes: Sequence[int]) -> list[tuple[int, ...]]:
    """Compute the elimination order.

    Args:
        clauses: the simplified clauses.
        outcomes: the mask of the possible outcomes of each term.

    Returns:
        The terms of each component, in the order of elimination.
    """
    n_terms = len(outcomes)
    needs: list[set[int]] = [set() for _ in range(n_terms)]  # term -> the terms in the bodies of its clauses
    joint: set[frozenset[int]] = set()  # the terms of a constraint are on the frontier until all are decided
    for clause in clauses:
        body = clause.body
        if clause.term >= 0:  # constraints have no head
            for literal in body:
                needs[clause.term].add(literal[0])
        elif len(body) > 1:
            joint.add(frozenset([literal[0] for literal in body]))
    for term, needed in enumerate(needs):
        needed.discard(term)
    components: list[tuple[int, ...]] = [(term,) for term in range(n_terms)]
    component_needs = needs
    constraints: Iterable[frozenset[int]] = joint
    if any(needed and max(needed) > term for term, needed in enumerate(needs)):  # cycles are possible
        strong = find_strongly_connected_components(needs)
        if len(strong) < n_terms:
            components = sorted(strong)
            component_of = {term: i for i, terms in enumerate(components) for term in terms}
            component_needs = [
                {component_of[need] for term in terms for need in needs[term]} - {i}
                for i, terms in enumerate(components)
            ]
            constraints = {frozenset([component_of[term] for term in group]) for group in joint}
    bits = {mask: log2(mask.bit_count() or 1) for mask in set(outcomes)}
    sizes = [sum([bits[outcomes[term]] for term in terms]) for terms in components]
    groups = sorted([sorted(group) for group in constraints if len(group) > 1])
    return [components[i] for i in _order_greedily(component_needs, groups, sizes)]


def _order_greedily(
    needs: Sequence[set[int]], groups: Sequence[Sequence[int]], sizes: Sequence[float]
) -> list[int]:
    """Order components.

    Args:
        needs: component -> the components that must come before it.
        groups: the components of each constraint.
        sizes: the bits of each component on the frontier.
    """
    count = len(needs)
    users: list[list[int]] = [[] for _ in range(count)]
    for user, needed in enumerate(needs):
        for need in needed:
            users[need].append(user)
    groups_of: dict[int, list[int]] = {}
    for number, group in enumerate(groups):
        for member in group:
            groups_of.setdefault(member, []).append(number)
    undecided = [len(group) for group in groups]  # members of each constraint
    missing = [len(needed) for needed in needs]  # undecided needs of each component
    n_references = [  # to each component, from undecided components and open constraints
        len(users[i]) + len(groups_of.get(i, ())) for i in range(count)
    ]

    def compute_growth(i: int) -> float:
        """The bits that deciding a component adds to the frontier."""
        growth = sizes[i] if n_references[i] else 0.0
        for need in needs[i]:
            if n_references[need] == 1:
                growth -= sizes[need]
        for number in groups_of.get(i, ()):
            if undecided[number] == 1:  # deciding i closes the constraint
                growth -= sum([sizes[m] for m in groups[number] if m != i and n_references[m] == 1])
        return growth

    heap = [(compute_growth(i), i) for i in range(count) if not missing[i]]
    heapify(heap)
    done = [False] * count
    order: list[int] = []
    while heap:
        growth, i = heappop(heap)
        if done[i]:
            continue
        if groups:  # without constraints the growth only decreases, and each decrease pushes a new entry
            current = compute_growth(i)
            if current > growth + 1e-9:
                heappush(heap, (current, i))
                continue
        done[i] = True
        order.append(i)
        changed: list[int] = []
        for number in groups_of.get(i, ()):
            undecided[number] -= 1
            if not undecided[number]:
                for member in groups[number]:
                    n_references[member] -= 1
            elif undecided[number] == 1:
                changed.extend(m for m in groups[number] if not done[m])
        for need in needs[i]:
            n_references[need] -= 1
            if n_references[need] == 1:
                changed.extend([user for user in users[need] if not done[user]])
        for user in users[i]:
            missing[user] -= 1
            if not missing[user]:
                heappush(heap, (compute_growth(user), user))
        for other in changed:
            if not missing[other] and not done[other]:
                heappush(heap, (compute_growth(other), other))
    return order


def find_strongly_connected_components(needs: Sequence[Iterable[int]]) -> list[tuple[int, ...]]:
    """Return the strongly connected components of a graph, each after the components it points to.

    Args:
        needs: node -> its successors.

    Source: Tarjan, SIAM J. Comput. 1(2), 1972, without recursion.
    """
    index = [0] * len(needs)
    low = [0] * len(needs)
    on_stack = [False] * len(needs)
    stack: list[int] = []
    components: list[tuple[int, ...]] = []
    counter = 0
    for root in range(len(needs)):
        if index[root]:
            continue
        counter += 1
        index[root] = low[root] = counter
        stack.append(root)
        on_stack[root] = True
        work = [(root, iter(needs[root]))]
        while work:
            node, rest = work[-1]
            for need in rest:
                if not index[need]:
                    counter += 1
                    index[need] = low[need] = counter
                    stack.append(need)
                    on_stack[need] = True
                    work.append((need, iter(needs[need])))
                    break
                if on_stack[need] and index[need] < low[node]:
                    low[node] = index[need]
            else:
                work.pop()
                if work and low[node] < low[work[-1][0]]:
                    low[work[-1][0]] = low[node]
                if low[node] == index[node]:
                    members = []
                    while True:
                        member = stack.pop()
                        on_stack[member] = False
                        members.append(member)
                        if member == node:
                            break
                    components.append(tuple(sorted(members)))
    return components
