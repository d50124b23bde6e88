"""Strongly connected components of a graph."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TypeVar

_Node = TypeVar("_Node", int, str)


def find_strongly_connected_components(
    successors: Mapping[_Node, Iterable[_Node]],
) -> list[tuple[_Node, ...]]:
    """Return the strongly connected components of a graph, each after the components it points to.

    Args:
        successors: node -> the nodes to which it points.

    Source: Tarjan, SIAM J. Comput. 1(2), 1972, without recursion.
    """
    finished = len(successors)
    index: dict[_Node, int] = {}  # node -> number in the order of visits
    low: dict[_Node, int] = {}
    stack: list[_Node] = []
    components: list[tuple[_Node, ...]] = []
    for root in successors:
        work: list[tuple[_Node, Iterator[_Node]]] = []
        entered = None if root in index else root
        while entered is not None or work:
            if entered is not None:
                index[entered] = low[entered] = len(index)
                stack.append(entered)
                work.append((entered, iter(successors[entered])))
            node, rest = work[-1]
            entered = None
            for successor in rest:
                if successor not in index:
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
                    index.update(dict.fromkeys(members, finished))
                    components.append(tuple(sorted(members)))
    return components
