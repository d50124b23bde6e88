"""The most probable worlds of a decision diagram.

Source: the k-best form of Viterbi's algorithm, on logarithms, as long products underflow; Huang and Chiang,
"Better k-best parsing", IWPT 2005, Algorithm 1, for the combination of branches.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from heapq import heappop, heappush, nlargest
from math import log, prod
from typing import Any

from lcorpp.reasoning.circuit.decision_diagram import Arcs, DecisionDiagram, iterate_arcs

_Partial = tuple[float, Any]
"""(log weight, path): a path is the outcome of a step and the paths of its branches, as a nested tuple."""


def find_best_paths(
    diagram: DecisionDiagram, arcs_of: Sequence[Arcs], count: int
) -> tuple[list[list[int]], Fraction]:
    """Find the worlds of largest measure.

    Args:
        arcs_of: the arcs of each step that worlds may use.
        count: the largest number of worlds.

    Returns:
        (worlds, mass): the outcomes of the steps of each world, best first; and the measure of all worlds.
    """
    tree = diagram.system.tree
    logs = [log(n.numerator) - log(n.denominator) if n else None for _, n in diagram.outcomes]
    best: dict[int, dict[int, list[_Partial]]] = {}  # step -> node -> best partial worlds
    sums: dict[int, dict[int, Fraction]] = {}
    for step in range(len(tree.children) - 1, -1, -1):
        below = [best.pop(child) for child in tree.children[step]]
        masses = [sums.pop(child) for child in tree.children[step]]
        found: dict[int, list[_Partial]] = {}
        total: dict[int, Fraction] = {}
        for source, targets, outcome in iterate_arcs(arcs_of[step]):
            weight = logs[outcome]
            if weight is None or any(node not in own for own, node in zip(below, targets, strict=True)):
                continue
            lists = [own[node] for own, node in zip(below, targets, strict=True)]
            found.setdefault(source, []).extend(_combine(weight, (outcome,), lists, count))
            factors = [own[node] for own, node in zip(masses, targets, strict=True)]
            total[source] = total.get(source, Fraction(0)) + diagram.outcomes[outcome][1] * prod(factors)
        best[step] = {node: nlargest(count, own, key=_log_weight) for node, own in found.items()}
        sums[step] = total
    mass = prod([sums[root].get(0, Fraction(0)) for root in tree.roots], start=Fraction(1))
    if not mass:
        return [], mass
    return [
        _flatten(path) for _, path in _combine(0.0, (), [best[root][0] for root in tree.roots], count)
    ], mass


def _log_weight(partial: _Partial) -> float:
    return partial[0]


def _combine(
    weight: float, label: tuple[int, ...], lists: Sequence[Sequence[_Partial]], count: int
) -> list[_Partial]:
    """Return the best combinations of a label with one path from each list, best first.

    Args:
        lists: each sorted, best first.
    """
    combined: list[_Partial] = [(weight, label)]
    for own in lists:
        if len(combined) == 1 or len(own) == 1:
            combined = [(a + b, (*path, other)) for a, path in combined for b, other in own]
            continue
        heap = [(-combined[0][0] - own[0][0], 0, 0)]  # pairs of indexes, each reached from one other pair
        merged: list[_Partial] = []
        while heap and len(merged) < count:
            cost, i, j = heappop(heap)
            merged.append((-cost, (*combined[i][1], own[j][1])))
            if j + 1 < len(own):
                heappush(heap, (-combined[i][0] - own[j + 1][0], i, j + 1))
            if not j and i + 1 < len(combined):
                heappush(heap, (-combined[i + 1][0] - own[0][0], i + 1, 0))
        combined = merged
    return combined


def _flatten(path: Any) -> list[int]:
    """List the outcomes of a path in the order of the steps."""
    outcomes, stack = [], [path]
    while stack:
        item = stack.pop()
        if isinstance(item, tuple):
            stack.extend(reversed(item))
        else:
            outcomes.append(item)
    return outcomes
