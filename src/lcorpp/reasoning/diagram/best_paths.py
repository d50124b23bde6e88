"""The most probable worlds of a decision diagram, best first, each when it is needed.

A world is a path: the arcs of its nodes in depth-first order. A cell is a stack of nodes that still have to
choose their arcs, so cells are the vertices of a graph in which worlds are paths. A path leaves the best one
at some of its cells by another arc, a sidetrack; its measure is that of the best path times the ratios of
its sidetracks. The sidetracks along the best path from a cell form a heap that shares its parts with the
heaps of the cells behind, so that n cells need O(n log n) memory and k paths O(k log k) time.

Source: Eppstein, "Finding the k shortest paths", SIAM J. Computing 28(2), 1998, with persistent leftist
heaps; Huang and Chiang, "Better k-best parsing", IWPT 2005, for the reduction of AND/OR graphs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

Choice = tuple[int, tuple[int, ...], int]
"""An arc: (weight of the best partial world that it begins, target in each branch, outcome)."""


@dataclass(slots=True, eq=False)
class _Cell:
    """A node on top of a stack of nodes, with its arcs, best first."""

    step: int
    choices: Sequence[Choice]
    rest: _Cell | None
    following: dict[int, _Cell | None] = field(default_factory=dict)
    sidetracks: _Heap | None = None
    is_complete: bool = False

    def compute_ratio(self, rank: int) -> Fraction:
        """Return the loss of a sidetrack: the arc with this rank instead of the best one."""
        return Fraction(self.choices[rank][0], self.choices[0][0])


class _Heap(NamedTuple):
    """A leftist heap of cells with a second arc, by the ratio of this arc; height: of its right spine."""

    ratio: Fraction
    cell: _Cell
    left: _Heap | None
    right: _Heap | None
    height: int


class Track(NamedTuple):
    """A sidetrack of a path: the one before, its cell, and the rank of its arc."""

    before: Track | None
    cell: _Cell
    rank: int


def _insert(heap: _Heap | None, ratio: Fraction, cell: _Cell) -> _Heap:
    if heap is None or ratio >= heap.ratio:
        return _Heap(ratio, cell, heap, None, 1)
    left, right = heap.left, _insert(heap.right, ratio, cell)
    if left is None or left.height < right.height:
        left, right = right, left
    return _Heap(heap.ratio, heap.cell, left, right, 1 + (right.height if right else 0))


class BestPaths:
    """The paths of a diagram in the order of their weights.

    Args:
        children, roots: the first steps of the branches of each step, and the first steps of the diagram.
        choices: the arcs of each node of each step.
    """

    def __init__(
        self,
        children: Sequence[Sequence[int]],
        roots: Sequence[int],
        choices: Sequence[Sequence[Sequence[Choice]]],
    ) -> None:
        self._children, self._choices = children, choices
        self._cells: dict[tuple[int, int, _Cell | None], _Cell] = {}
        self._first = self._push(roots, (0,) * len(roots), None)

    def iterate(self) -> Iterator[tuple[Fraction, Track | None]]:
        """Yield the weight of each path relative to that of the first, and its last sidetrack."""
        numbers = count()  # the earlier found of two equal paths is the first
        queue: list[tuple[Fraction, int, Fraction, _Heap, int, Track | None]] = []

        def add(base: Fraction, heap: _Heap | None, rank: int, before: Track | None) -> None:
            if heap is not None and rank < len(heap.cell.choices):
                weight = base * (heap.ratio if rank == 1 else heap.cell.compute_ratio(rank))
                heappush(queue, (-weight, next(numbers), base, heap, rank, before))

        yield Fraction(1), None
        add(Fraction(1), self._find_sidetracks(self._first), 1, None)
        while queue:
            cost, _, base, heap, rank, before = heappop(queue)
            track = Track(before, heap.cell, rank)
            yield -cost, track
            add(base, heap, rank + 1, before)
            if rank == 1:
                add(base, heap.left, 1, before)
                add(base, heap.right, 1, before)
            add(-cost, self._find_sidetracks(self._follow(heap.cell, rank)), 1, track)

    def list_outcomes(self, track: Track | None) -> list[int]:
        """List the outcome of each step on a path, given its last sidetrack."""
        ranks: dict[_Cell | None, int] = {}
        while track is not None:
            ranks[track.cell] = track.rank
            track = track.before
        outcomes = [0] * len(self._children)
        cell = self._first
        while cell is not None:
            rank = ranks.get(cell, 0)
            outcomes[cell.step] = cell.choices[rank][2]
            cell = self._follow(cell, rank)
        return outcomes

    def _push(self, steps: Sequence[int], nodes: Sequence[int], rest: _Cell | None) -> _Cell | None:
        """Put nodes on a stack, the first one on top."""
        for step, node in zip(reversed(steps), reversed(nodes), strict=True):
            key = step, node, rest
            if key not in self._cells:
                ordered = sorted(self._choices[step][node], key=lambda choice: -choice[0])
                self._cells[key] = _Cell(step, ordered, rest)
            rest = self._cells[key]
        return rest

    def _follow(self, cell: _Cell, rank: int) -> _Cell | None:
        """Return the stack after the arc with this rank."""
        if rank not in cell.following:
            cell.following[rank] = self._push(self._children[cell.step], cell.choices[rank][1], cell.rest)
        return cell.following[rank]

    def _find_sidetracks(self, cell: _Cell | None) -> _Heap | None:
        """Return the sidetracks along the best path from a cell."""
        path: list[_Cell] = []
        while cell is not None and not cell.is_complete:
            path.append(cell)
            cell = self._follow(cell, 0)
        heap = cell.sidetracks if cell else None
        for cell in reversed(path):
            if len(cell.choices) > 1:
                heap = _insert(heap, cell.compute_ratio(1), cell)
            cell.sidetracks, cell.is_complete = heap, True
        return heap
