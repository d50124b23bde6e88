"""In which order the terms of a ground program are decided, so that as little as possible stays undecided
in between.

Terms that depend on each other in a circle form one component. Components are taken greedily, each time the
one that leaves the smallest frontier: the terms already decided that something still to be decided asks
for.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from heapq import heapify, heappop, heappush
from math import log2

from lcorpp.reasoning.grounding.ground_program import Clause


def order_components(clauses: Sequence[Clause], outcomes: Sequence[int]) -> list[tuple[int, ...]]:
    """The components in the order in which they are decided.

    Args:
        clauses: the simplified clauses.
        outcomes: the outcomes of each term, as bits.

    Returns:
        The terms of each component; a component comes after all that it depends on.
    """
    count = len(outcomes)
    needs: list[set[int]] = [set() for _ in range(count)]
    joint: set[frozenset[int]] = set()  # the terms of a constraint stay on the frontier until all are decided
    for clause in clauses:
        body = clause.body
        if clause.term >= 0:
            for literal in body:
                needs[clause.term].add(literal[0])
        elif len(body) > 1:
            joint.add(frozenset([literal[0] for literal in body]))
    for term, needed in enumerate(needs):
        needed.discard(term)
    found: list[tuple[int, ...]] = [(term,) for term in range(count)]
    inner = needs
    groups: Iterable[frozenset[int]] = joint
    if any(needed and max(needed) > term for term, needed in enumerate(needs)):  # there may be circles
        parts = strongly_connected_components(needs)
        if len(parts) < count:
            found = sorted(parts)
            of = {term: i for i, terms in enumerate(found) for term in terms}
            inner = [
                {of[need] for term in terms for need in needs[term]} - {i} for i, terms in enumerate(found)
            ]
            groups = {frozenset([of[term] for term in group]) for group in joint}
    size = {bits: log2(bits.bit_count() or 1) for bits in set(outcomes)}
    sizes = [sum([size[outcomes[term]] for term in terms]) for terms in found]
    return [found[i] for i in _greedy(inner, sorted([sorted(g) for g in groups if len(g) > 1]), sizes)]


def _greedy(needs: Sequence[set[int]], groups: Sequence[Sequence[int]], sizes: Sequence[float]) -> list[int]:
    count = len(needs)
    users: list[list[int]] = [[] for _ in range(count)]
    for user, needed in enumerate(needs):
        for need in needed:
            users[need].append(user)
    joint: dict[int, list[int]] = {}
    for number, group in enumerate(groups):
        for member in group:
            joint.setdefault(member, []).append(number)
    open_groups = [len(group) for group in groups]
    waits = [len(needed) for needed in needs]
    wanted = [
        len(users[i]) + len(joint.get(i, ())) for i in range(count)
    ]  # how much keeps it on the frontier

    def score(i: int) -> float:
        grows = sizes[i] if wanted[i] else 0.0
        for need in needs[i]:
            if wanted[need] == 1:
                grows -= sizes[need]
        for number in joint.get(i, ()):
            if open_groups[number] == 1:  # deciding i closes the constraint
                grows -= sum([sizes[m] for m in groups[number] if m != i and wanted[m] == 1])
        return grows

    heap = [(score(i), i) for i in range(count) if not waits[i]]
    heapify(heap)
    done = [False] * count
    order: list[int] = []
    while heap:
        given, i = heappop(heap)
        if done[i]:
            continue
        if groups:  # without constraints a score only gets better, and is then given anew
            now = score(i)
            if now > given + 1e-9:
                heappush(heap, (now, i))
                continue
        done[i] = True
        order.append(i)
        better: list[int] = []
        for number in joint.get(i, ()):
            open_groups[number] -= 1
            if not open_groups[number]:
                for member in groups[number]:
                    wanted[member] -= 1
            elif open_groups[number] == 1:
                better.extend(m for m in groups[number] if not done[m])
        for need in needs[i]:
            wanted[need] -= 1
            if wanted[need] == 1:
                better.extend([user for user in users[need] if not done[user]])
        for user in users[i]:
            waits[user] -= 1
            if not waits[user]:
                heappush(heap, (score(user), user))
        for other in better:
            if not waits[other] and not done[other]:
                heappush(heap, (score(other), other))
    return order


def strongly_connected_components(needs: Sequence[Iterable[int]]) -> list[tuple[int, ...]]:
    """The strongly connected components, each after those it needs.

    Source: Tarjan, SIAM J. Comput. 1(2), 1972, without recursion.
    """
    index = [0] * len(needs)
    low = [0] * len(needs)
    on_stack = [False] * len(needs)
    stack: list[int] = []
    found: list[tuple[int, ...]] = []
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
                    found.append(tuple(sorted(members)))
    return found
