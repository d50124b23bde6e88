"""Questions about whole worlds: exact sums, the most probable worlds, worlds drawn at random.

Each path through the trellis is one world, and each world one path.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from heapq import nlargest
from itertools import accumulate
from math import log
from typing import TYPE_CHECKING, TypeVar

from lcorpp.reasoning.circuit.trellis import Trellis, decode_world
from lcorpp.reasoning.world import World

if TYPE_CHECKING:
    import numpy as np

_Number = TypeVar("_Number", float, Fraction)

SAMPLER_CACHE_SIZE = 100
"""For how many sets of evidence the tables to draw from are kept."""

_Draw = list[dict[int, tuple[list[float], list[tuple[int, int]]]]]


class WorldQueries:
    """The worlds of a trellis.

    Evidence is a mapping from terms to values, as text; the terms must be known to the program.
    """

    def __init__(self, trellis: Trellis) -> None:
        self.trellis = trellis
        self._draws: dict[frozenset[tuple[str, str]], _Draw | None] = {}

    @cached_property
    def _place(self) -> dict[int, tuple[int, int]]:
        """Term -> the step that decides it, and which of its terms it is."""
        return {
            term: (position, i)
            for position, terms in enumerate(self.trellis.plan.order)
            for i, term in enumerate(terms)
        }

    def _allowed(self, evidence: Mapping[str, str]) -> dict[int, list[tuple[int, int]]] | None:
        """Step -> (which of its terms, outcome); None where a term never has a value."""
        allowed: dict[int, list[tuple[int, int]]] = {}
        for name, value in evidence.items():
            term = self.trellis.plan.index.get(name)
            if term is None:
                return None
            position, i = self._place[term]
            allowed.setdefault(position, []).append((i, self.trellis.plan.ground.values[term].index(value)))
        return allowed

    def _edges(
        self, position: int, allowed: Mapping[int, list[tuple[int, int]]]
    ) -> list[tuple[int, int, int]]:
        """The edges (source, target, move) of a step that agree with the evidence."""
        edges = zip(*self.trellis.edges[position], strict=True)
        given = allowed.get(position)
        if not given:
            return list(edges)
        moves = self.trellis.moves
        return [edge for edge in edges if all(moves[edge[2]][0][i] == value for i, value in given)]

    def exact(self, query: str, evidence: Mapping[str, str]) -> dict[str, Fraction]:
        """The weight of each value of a term together with the evidence; "" stands for no value."""
        return self._sums(query, evidence, [number for _, number in self.trellis.moves], Fraction(1))

    def weights(self, query: str, evidence: Mapping[str, str]) -> dict[str, float]:
        """The same as `exact` in floating point; only the ratios mean something."""
        return self._sums(query, evidence, self.trellis.floats(), 1.0)

    def _sums(
        self, query: str, evidence: Mapping[str, str], numbers: Sequence[_Number], one: _Number
    ) -> dict[str, _Number]:
        allowed = self._allowed(evidence)
        if allowed is None or not self.trellis.layers[0]:
            return {}
        asked = self.trellis.plan.index.get(query)
        at, which = self._place[asked] if asked is not None else (-1, 0)
        moves = self.trellis.moves
        by_outcome: dict[int, dict[int, _Number]] = {-1: {0: one}}  # outcome of the query -> state -> weight
        for position in range(len(self.trellis.edges)):
            edges = self._edges(position, allowed)
            following: dict[int, dict[int, _Number]] = {}
            for value, current in by_outcome.items():
                for source, target, move in edges:
                    weight = current.get(source)
                    if weight is not None:
                        into = following.setdefault(moves[move][0][which] if position == at else value, {})
                        gained = weight * numbers[move]
                        into[target] = into[target] + gained if target in into else gained
            if isinstance(one, float):
                _scale(following.values())
            by_outcome = following
        names = self.trellis.plan.ground.values[asked] if asked is not None else ()
        found: dict[str, _Number] = {}
        for value, current in by_outcome.items():
            for weight in current.values():
                name = names[value] if 0 <= value < len(names) else ""
                found[name] = found[name] + weight if name in found else weight
        return found

    def count(self) -> int:
        """How many possible worlds there are."""
        current = {0: 1} if self.trellis.layers[0] else {}
        for sources, targets, _ in self.trellis.edges:
            following: dict[int, int] = {}
            for source, target in zip(sources, targets, strict=True):
                following[target] = following.get(target, 0) + current[source]
            current = following
        return sum(current.values())

    def most_probable(self, evidence: Mapping[str, str], count: int) -> tuple[World, ...]:
        """The most probable worlds with the evidence, best first; none if it is impossible.

        Source: the k-best form of Viterbi's algorithm, on logarithms, as products of thousands vanish.
        """
        allowed = self._allowed(evidence)
        if allowed is None or not self.trellis.layers[0]:
            return ()
        weights = [log(n.numerator) - log(n.denominator) if n else None for _, n in self.trellis.moves]
        best: list[list[tuple[float, int, int, int]]] = [[(0.0, -1, -1, -1)]]  # log, source, rank, move
        history = []
        total = {0: Fraction(1)}
        for position in range(len(self.trellis.edges)):
            arriving: dict[int, list[tuple[float, int, int, int]]] = {}
            sums: dict[int, Fraction] = {}
            for source, target, move in self._edges(position, allowed):
                weight = weights[move]
                if weight is None or not best[source]:
                    continue
                arriving.setdefault(target, []).extend(
                    (entry[0] + weight, source, rank, move) for rank, entry in enumerate(best[source])
                )
                if source in total:
                    number = self.trellis.moves[move][1]
                    sums[target] = sums.get(target, Fraction(0)) + total[source] * number
            history.append(best)
            total = sums
            best = [
                nlargest(count, arriving.get(i, ()), key=lambda entry: entry[0])
                for i in range(self.trellis.layers[position + 1])
            ]
        history.append(best)
        mass = total.get(0, Fraction(0))
        if not mass:
            return ()
        found = []
        for rank in range(len(best[0])):
            moves: list[int] = []
            state, place = 0, rank
            for layer in range(len(history) - 1, 0, -1):
                _, source, before, move = history[layer][state][place]
                moves.append(move)
                state, place = source, before
            moves.reverse()
            measure = Fraction(1)
            for move in moves:
                measure *= self.trellis.moves[move][1]
            values = decode_world(self.trellis.plan, [self.trellis.moves[move][0] for move in moves])
            found.append(World(values, measure / mass))
        return tuple(found)

    def sample(self, rng: np.random.Generator, given: Mapping[str, str]) -> dict[str, str] | None:
        """Draw a world with its probability given some evidence; None if that is impossible."""
        key = frozenset(given.items())
        if key not in self._draws:
            if len(self._draws) >= SAMPLER_CACHE_SIZE:
                self._draws.clear()
            self._draws[key] = self._tables(given)
        tables = self._draws[key]
        if tables is None:
            return None
        state, outcomes = 0, []
        uniform = rng.random(len(tables)).tolist()
        for table, number in zip(tables, uniform, strict=True):
            cumulative, ways = table[state]
            state, move = ways[min(bisect_right(cumulative, number), len(ways) - 1)]
            outcomes.append(self.trellis.moves[move][0])
        return decode_world(self.trellis.plan, outcomes)

    def _tables(self, given: Mapping[str, str]) -> _Draw | None:
        """For each step and state, what to draw from: cumulative probabilities and (target, move)."""
        allowed = self._allowed(given)
        if allowed is None or not self.trellis.layers[0]:
            return None
        alive = self._reached(allowed)  # what cannot be reached must not make the rest look negligible
        below = {0: 1.0}
        tables: _Draw = []
        for position in range(len(self.trellis.edges) - 1, -1, -1):
            ways: dict[int, list[tuple[float, int, int]]] = {}
            for source, target, move in self._edges(position, allowed):
                if source not in alive[position]:
                    continue
                weight = float(self.trellis.moves[move][1]) * below.get(target, 0.0)
                if weight > 0:
                    ways.setdefault(source, []).append((weight, target, move))
            sums = {source: sum(way[0] for way in found) for source, found in ways.items()}
            tables.append(
                {
                    source: (
                        list(accumulate(way[0] / sums[source] for way in found)),
                        [way[1:] for way in found],
                    )
                    for source, found in ways.items()
                }
            )
            largest = max(sums.values(), default=1.0)
            below = {source: total / largest for source, total in sums.items()}
        tables.reverse()
        return tables if 0 in below else None

    def _reached(self, allowed: Mapping[int, list[tuple[int, int]]]) -> list[set[int]]:
        """For each step, the states in which it may be met."""
        reached = [{0}]
        for position in range(len(self.trellis.edges) - 1):
            before = reached[-1]
            edges = self._edges(position, allowed)
            reached.append({t for s, t, move in edges if s in before and self.trellis.moves[move][1]})
        return reached


def _scale(parts: Collection[dict[int, float]]) -> None:
    """Weights that became tiny are scaled up together: only their ratios matter."""
    largest = max((weight for part in parts for weight in part.values()), default=1.0)
    if 0 < largest < 1e-100:
        for part in parts:
            for state in part:
                part[state] /= largest
