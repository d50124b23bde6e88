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
from dataclasses import dataclass, field
from heapq import heappop, heappush
from math import inf

MAX_GREEDY_WIDTH = 10
"""If an elimination of the cheapest component costs more bits than this, other orders are tried."""

MAX_EXACT_DEGREE = 32
"""The degrees of the members of larger scopes are updated only when one of them is about to be eliminated."""

ORDERED_DEGREE = 1e9
"""The degree of components that are eliminated after all others, in the order of their ranks."""

Order = tuple[list[int], float, float]
"""The tree, and its width: the largest number of bits of the components that share a scope with another; of
all components, and of those that are not ordered."""


def eliminate(
    needs: Sequence[set[int]],
    groups: Sequence[Iterable[int]],
    sizes: Sequence[float],
    ranks: Sequence[int],
    ordered: Collection[int],
) -> Order:
    """Eliminate components from the leaves of the tree to the roots.

    Args:
        needs: component -> the components that must come before it.
        groups: the components of each constraint.
        sizes: the bits of each component.
        ranks: a permutation; of equally good components the one with the highest rank is eliminated.
        ordered: components with `ORDERED_DEGREE`, as they share one group.

    Returns:
        Component -> the one before it in the tree, -1 for roots; and the widths.
    """
    best = _eliminate(needs, groups, sizes, ranks, ordered, [0] * len(needs), inf)
    if best[1] > max([MAX_GREEDY_WIDTH, *[len(own) + 1 for own in needs]]):  # no order divides a clause
        for levels in _list_levels(needs):
            order = _eliminate(needs, groups, sizes, ranks, ordered, levels, best[1])
            if order[1] < best[1]:
                best = order
    return best


def arrange(
    needs: Sequence[set[int]],
    groups: Sequence[Iterable[int]],
    sizes: Sequence[float],
    order: Sequence[int],
) -> Order:
    """Arrange components in the tree that eliminates them in the opposite of an order.

    Args:
        needs, groups, sizes: as of `eliminate`.
        order: the components, those that others need before these.

    Returns:
        Component -> the one before it in the tree, -1 for roots; and the widths.
    """
    levels = [0] * len(order)
    for place, component in enumerate(reversed(order)):
        levels[component] = place
    # with levels there is no choice, so that ranks do not matter
    return _eliminate(needs, groups, sizes, levels, (), levels, inf)


def list_children(parents: Sequence[int]) -> list[list[int]]:
    """List the children of each node of a tree and, last, its roots, as these have the parent -1."""
    children: list[list[int]] = [[] for _ in (*parents, "roots")]
    for node, parent in enumerate(parents):
        children[parent].append(node)
    return children


def list_depth_first(children: Sequence[Sequence[int]]) -> list[int]:
    """List the nodes of a tree depth first; brothers keep their order. The last children are the roots."""
    nodes: list[int] = []
    stack = [*reversed(children[-1])]
    while stack:
        nodes.append(stack.pop())
        stack += reversed(children[nodes[-1]])
    return nodes


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
) -> Order:
    """Eliminate components; those of the lowest level first. End early if the width reaches a limit."""
    components = _link(needs, groups, ordered, levels, ranks, sizes)
    heap: list[tuple[int, float, int, int]] = []

    def push(i: int) -> None:
        own = components[i]
        own.degree, own.is_outdated = own.compute_degree(components), False
        heappush(heap, (own.level, own.degree, -own.rank, i))

    width, free_width, parents = 0.0, 0.0, [-1] * len(needs)
    ready = [i for i, own in enumerate(components) if not own.n_users]  # not yet on the heap
    while heap or ready:
        if len(ready) == 1 and not heap:  # no choice
            i = ready.pop()
        else:
            while ready:
                push(ready.pop())
            _, degree, _, i = heappop(heap)
            if components[i].is_eliminated or degree != components[i].degree:
                continue
            if components[i].is_outdated:
                push(i)
                continue
            width = max(width, degree)
            if not components[i].is_ordered:
                free_width = max(free_width, degree)
            if width >= limit:
                break
        components[i].is_eliminated = True
        scope = _merge_scopes(components, i, parents)
        if scope is None:
            continue
        for need in needs[i]:
            components[need].n_users -= 1
            if not components[need].n_users:
                ready.append(need)
        if heap and len(scope.members) <= MAX_EXACT_DEGREE:
            for member in scope.members:
                if not components[member].n_users and components[member].degree >= 0:
                    push(member)
    return parents, width, free_width


@dataclass(slots=True, eq=False)
class _Scope:
    """Components that share a clause or, after the elimination of others, what remains of their clauses.

    origin: the component whose elimination left it, -1 for a clause.
    is_merged: into another scope, or without a pair of members left.
    """

    members: set[int]
    origin: int = -1
    is_merged: bool = False


@dataclass(slots=True, eq=False)
class _Component:
    """A component during the elimination.

    n_users: the components not yet eliminated whose clauses name this one.
    degree: that on the heap, -1 before. is_outdated: whether the degree may have grown.
    """

    number: int
    size: float
    rank: int
    level: int
    is_ordered: bool
    scopes: list[_Scope] = field(default_factory=list)
    n_users: int = 0
    degree: float = -1.0
    is_outdated: bool = False
    is_eliminated: bool = False

    def drop_merged(self) -> list[_Scope]:
        """Return the scopes that are not merged, and forget the others."""
        self.scopes = [scope for scope in self.scopes if not scope.is_merged]
        return self.scopes

    def compute_degree(self, components: Sequence[_Component]) -> float:
        """The bits of all components that share a scope with this one."""
        if self.is_ordered:
            return ORDERED_DEGREE
        own = self.drop_merged()
        if not own:
            return 0.0
        members = own[0].members
        if len(own) == 1 and len(members) > MAX_EXACT_DEGREE:
            return len(members)
        if len(own) > 1:
            members = members.union(*[scope.members for scope in own])
        return sum([components[member].size for member in members]) - self.size


def _link(
    needs: Sequence[set[int]],
    groups: Iterable[Iterable[int]],
    ordered: Collection[int],
    levels: Sequence[int],
    ranks: Sequence[int],
    sizes: Sequence[float],
) -> list[_Component]:
    """Return the components, with the scopes of the clauses and constraints that they share."""
    components = [_Component(i, sizes[i], ranks[i], levels[i], i in ordered) for i in range(len(needs))]
    for i, needed in enumerate(needs):
        scope = _Scope({i, *needed})
        if needed:
            components[i].scopes.insert(0, scope)
        for need in needed:
            components[need].scopes.append(scope)
            components[need].n_users += 1
    for group in groups:
        scope = _Scope(set(group))
        for member in scope.members:
            components[member].scopes.append(scope)
    return components


def _merge_scopes(components: Sequence[_Component], i: int, parents: list[int]) -> _Scope | None:
    """Merge the scopes of an eliminated component to one without it; None if it shares none.

    The component becomes the parent of the components whose elimination left these scopes.
    """
    own = components[i].drop_merged()
    if not own:
        return None
    for scope in own:
        if scope.origin >= 0:
            parents[scope.origin] = i
    scope = own[-1]
    if len(own) > 1:
        scope = _Scope(scope.members.union(*[other.members for other in own]))
        for other in own:
            other.is_merged = True
        for member in scope.members:
            components[member].scopes.append(scope)
            components[member].is_outdated = True
    scope.members.discard(i)
    scope.origin = i
    if len(scope.members) == 1:  # the scope has done its work
        scope.is_merged = True
        (parents[i],) = scope.members
    return scope
