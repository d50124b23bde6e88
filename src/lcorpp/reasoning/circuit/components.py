"""The strongly connected components of a graph."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def components(needs: Sequence[Iterable[int]]) -> list[tuple[int, ...]]:
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
