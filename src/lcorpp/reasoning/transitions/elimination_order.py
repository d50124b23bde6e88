"""The order in which components are eliminated, and the tree that results, see `elimination_tree`.

Of the components that no clause needs any more, the one that shares clauses with the fewest others (in bits)
is eliminated; the others then share what remains of its clauses. This is minimum-degree elimination, kept to
topological orders; scopes are merged instead of connecting all pairs of their members. Where this is
expensive, two fixed orders are tried, too.

Source: Amestoy, Davis and Duff, "An approximate minimum degree ordering algorithm", SIAM J. Matrix Anal. 17,
1996 (quotient graphs).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from heapq import heappop, heappush
from math import inf

MAX_GREEDY_WIDTH = 10
"""If an elimination of the cheapest component costs more bits than this, other orders are tried."""

MAX_EXACT_DEGREE = 32
"""The degrees of the members of larger scopes are updated only when one of them is about to be eliminated."""

ORDERED_DEGREE = 1e9
"""The degree of components that are eliminated after all others, in the order of their ranks."""

_Order = tuple[list[int], float]
"""The tree, and its width: the largest number of bits of the components that share a scope with another."""


def eliminate(
    needs: Sequence[set[int]],
    groups: Sequence[Iterable[int]],
    sizes: Sequence[float],
    ranks: Sequence[int],
    ordered: Collection[int],
) -> list[int]:
    """Eliminate components from the leaves of the tree to the roots.

    Args:
        needs: component -> the components that must come before it.
        groups: the components of each constraint.
        sizes: the bits of each component.
        ranks: a permutation; of equally good components the one with the highest rank is eliminated.

        ordered: components with `ORDERED_DEGREE`, as they share one group.

    Returns:
        Component -> the one before it in the tree, -1 for roots.
    """
    best = _eliminate(needs, groups, sizes, ranks, ordered, [0] * len(needs), inf)
    if best[1] > max([MAX_GREEDY_WIDTH, *[len(own) + 1 for own in needs]]):  # no order divides a clause
        for levels in _list_levels(needs):
            order = _eliminate(needs, groups, sizes, ranks, ordered, levels, best[1])
            if order[1] < best[1]:
                best = order
    return best[0]


def _list_levels(needs: Sequence[set[int]]) -> list[list[int]]:
    """List two orders from the leaves to the roots: by distance from the leaves, and from the roots.

    Programs of many time slices need them: what is eliminated from one slice makes other components of the
    slice more expensive, so that the cheapest component is often in the slice before.
    """
    from graphlib import TopologicalSorter  # here, as few programs need it

    order = list(TopologicalSorter(dict(enumerate(needs))).static_order())
    heights, depths = [0] * len(needs), [0] * len(needs)
    for i in order:
        depths[i] = 1 + max([depths[need] for need in needs[i]], default=0)
    for i in reversed(order):
        for need in needs[i]:
            heights[need] = max(heights[need], heights[i] + 1)
    return [heights, [-depth for depth in depths]]


def _eliminate(
    needs: Sequence[set[int]],
    groups: Iterable[Iterable[int]],
    sizes: Sequence[float],
    ranks: Sequence[int],
    ordered: Collection[int],
    levels: Sequence[int],
    limit: float,
) -> _Order:
    """Eliminate components; those of the lowest level first. End early if the width reaches a limit."""
    # scope: components that share a clause or, after the elimination of others, what remains of their clauses
    scopes = [{i, *own} for i, own in enumerate(needs)] + [set(group) for group in groups]
    origin = [-1] * len(scopes)  # scope -> the component whose elimination left it
    merged = [False] * len(scopes)  # into a later scope
    scopes_of: list[list[int]] = [[i] if own else [] for i, own in enumerate(needs)]
    n_users = [0] * len(needs)  # the components not yet eliminated whose clauses name this one
    for i, needed in enumerate(needs):
        for need in needed:
            scopes_of[need].append(i)
            n_users[need] += 1
    for number in range(len(needs), len(scopes)):
        for member in scopes[number]:
            scopes_of[member].append(number)

    def compute_degree(i: int) -> float:
        """The bits of all components that share a scope with a component."""
        if i in ordered:
            return ORDERED_DEGREE
        own = scopes_of[i] = [number for number in scopes_of[i] if not merged[number]]
        if not own:
            return 0.0
        members = scopes[own[0]]
        if len(own) == 1 and len(members) > MAX_EXACT_DEGREE:
            return len(members)
        if len(own) > 1:
            members = members.union(*[scopes[number] for number in own])
        return sum([sizes[member] for member in members]) - sizes[i]

    degrees = [-1.0] * len(needs)  # of the components on the heap
    outdated = [False] * len(needs)  # whether the degree may have grown
    heap: list[tuple[int, float, int, int]] = []
    width = 0.0

    def push(i: int) -> None:
        degrees[i], outdated[i] = compute_degree(i), False
        heappush(heap, (levels[i], degrees[i], -ranks[i], i))

    eliminated = [False] * len(needs)
    parents = [-1] * len(needs)
    ready = [i for i, count in enumerate(n_users) if not count]  # not yet on the heap
    while heap or ready:
        if len(ready) == 1 and not heap:  # no choice
            i = ready.pop()
        else:
            while ready:
                push(ready.pop())
            _, degree, _, i = heappop(heap)
            if eliminated[i] or degree != degrees[i]:
                continue
            if outdated[i]:
                push(i)
                continue
            width = max(width, degree)
            if width >= limit:
                break
        eliminated[i] = True
        own = [number for number in scopes_of[i] if not merged[number]]
        if not own:
            continue
        for number in own:
            if origin[number] >= 0:
                parents[origin[number]] = i
        scope = scopes[number]
        if len(own) > 1:
            number = len(scopes)
            scope = scope.union(*[scopes[other] for other in own])
            for other in own:
                merged[other] = True
            for member in scope:
                scopes_of[member].append(number)
                outdated[member] = True
            scopes.append(scope)
            origin.append(-1)
            merged.append(False)
        scope.discard(i)
        origin[number] = i
        if len(scope) == 1:  # the scope has done its work
            merged[number] = True
            (parents[i],) = scope
        for need in needs[i]:
            n_users[need] -= 1
            if not n_users[need]:
                ready.append(need)
        if heap and len(scope) <= MAX_EXACT_DEGREE:
            for member in scope:
                if not n_users[member] and degrees[member] >= 0:
                    push(member)
    return parents, width
