"""Blocks: the parts of a program that are no tables by themselves, such as recursions.

A block is a set of clauses whose product a decision diagram sums (`block_table`). Its *boundary* are the
terms that it shares with other clauses or with questions; all its other terms are summed out. A block begins
with the clauses of a component of several terms, or with a term or constraint about too many others. It grows
by all clauses about one term of the boundary after the other, until the boundary is small enough for a table.
Example: the reachability of rooms reads 24 doors and the rain. No other clause reads the doors, so they are
summed out, and the table has two axes: the rain, and the queried room.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import inf

SMALL_BITS = 8
"""A block does not grow further when its boundary has at most this many bits."""

MAX_BITS = 14
"""Maximum number of bits of a boundary."""

MAX_WORK = 5_000_000
"""Maximum number of terms that are visited while a block grows, some seconds."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """The clauses of a component, or all constraints about the same terms.

    terms: those that the clauses define, none for constraints.
    scope: these, and the terms in bodies.
    is_table: whether it can be a factor of its own.
    """

    terms: tuple[int, ...]
    scope: frozenset[int]
    is_table: bool


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Parts of a program that become one table.

    inner: the terms that are summed out. boundary: the terms of the table, sorted.
    """

    parts: Sequence[Part]
    inner: frozenset[int]
    boundary: tuple[int, ...]


def find_blocks(
    parts: Sequence[Part], bits: Mapping[int, float], fixed: Collection[int]
) -> list[Block] | None:
    """Find a block for each part that is no table; None if one has a boundary of more than `MAX_BITS`.

    Args:
        bits: of the outcomes of each term.
        fixed: terms that are not summed out, as questions or evidence will name them.
    """
    parts_of: defaultdict[int, set[int]] = defaultdict(set)
    for number, part in enumerate(parts):
        for term in part.scope:
            parts_of[term].add(number)
    growth_of: dict[int, _Growth] = {}  # part -> the block that has it
    for seed, part in enumerate(parts):
        if part.is_table or seed in growth_of:
            continue
        growth = _Growth(parts, parts_of, bits, fixed, growth_of)
        growth.add({seed})
        growth.shrink_boundary()
        if growth.size > MAX_BITS:
            return None
        growth_of |= dict.fromkeys(growth.parts, growth)
    return [
        Block([parts[i] for i in sorted(own.parts)], frozenset(own.inner), tuple(sorted(own.boundary)))
        for own in dict.fromkeys(growth_of.values())
    ]


class _Growth:
    """A block while it grows.

    size: bits of the boundary.
    """

    def __init__(
        self,
        parts: Sequence[Part],
        parts_of: Mapping[int, set[int]],
        bits: Mapping[int, float],
        fixed: Collection[int],
        growth_of: Mapping[int, _Growth],
    ) -> None:
        self._parts, self._parts_of, self._bits, self._fixed = parts, parts_of, bits, fixed
        self._growth_of = growth_of
        self.parts: set[int] = set()
        self.inner: set[int] = set()
        self.boundary: dict[int, None] = {}  # those near to the first part come first
        self.size = 0.0
        self._n_outside = {term: len(own) for term, own in parts_of.items()}  # parts that are not added
        self._changes: dict[int, float] = {}  # of the size, if the other parts of a term were added
        self._work = 0

    def add(self, numbers: Collection[int]) -> None:
        """Add parts."""
        self.parts.update(numbers)
        scopes = [sorted(self._parts[number].scope) for number in sorted(numbers)]
        changed = Counter([term for scope in scopes for term in scope])
        for term, n_parts in changed.items():
            self._n_outside[term] -= n_parts
            if term in self._fixed or self._n_outside[term]:
                if term not in self.boundary:
                    self.size += self._bits[term]
                    self.boundary[term] = None
            else:
                self.inner.add(term)
                if term in self.boundary:
                    self.size -= self._bits[term]
                    del self.boundary[term]
        near = {
            other
            for term in changed
            for number in self._parts_of[term] - self.parts
            for other in self._parts[number].scope
        }
        for term in near.union(changed):
            self._changes.pop(term, None)

    def shrink_boundary(self) -> None:
        """Add parts as long as the boundary is large, and does not grow."""
        while self.size > SMALL_BITS and self._work < MAX_WORK:
            best, least = -1, inf
            for term in self.boundary:
                if term not in self._changes:
                    self._changes[term] = self._compute_change(term)
                if self._changes[term] < least:
                    best, least = term, self._changes[term]
            if least > 1e-9:  # bits are rounded
                return
            self.add(self._list_others(best))

    def _list_others(self, term: int) -> set[int]:
        """List the other parts about a term; with a part of an earlier block the whole block."""
        others = self._parts_of[term] - self.parts
        return others.union(*[self._growth_of[i].parts for i in others if i in self._growth_of])

    def _compute_change(self, term: int) -> float:
        """Compute how the size changes if all parts about a term are added."""
        if term in self._fixed:
            return inf
        scopes = [self._parts[number].scope for number in self._list_others(term)]
        added = Counter([other for scope in scopes for other in scope])
        self._work += len(added) + len(self.boundary)
        change = 0.0
        for other, n_parts in added.items():
            is_open = other in self._fixed or self._n_outside[other] > n_parts
            if is_open != (other in self.boundary):
                change += self._bits[other] if is_open else -self._bits[other]
        return change
