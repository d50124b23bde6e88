"""Strongly connected components of a graph."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence


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
