"""Queries about whole worlds on the decision diagram: exact sums, the most probable worlds, samples.

Each path through the trellis is one world, and each world is one path.
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

from lcorpp.reasoning.answers import PossibleWorld
from lcorpp.reasoning.circuit.trellis import Trellis, decode_world

if TYPE_CHECKING:
    import numpy as np

_Number = TypeVar("_Number", float, Fraction)

SAMPLER_CACHE_SIZE = 100
"""The tables to sample from are cached for at most this many sets of evidence."""

MIN_WEIGHT = 1e-100
"""Weights are scaled up if all of them are below this: only ratios matter, and long products underflow."""

_Allowed = Mapping[int, list[tuple[int, int]]]
"""step -> (index of the term in the step, outcome) for each observed term that the step decides"""

_Sampler = list[dict[int, tuple[list[float], list[tuple[int, int]]]]]
"""For each step: state -> (cumulative probabilities, (target, outcome) of each arc)"""


class WorldQueries:
    """Queries about the worlds of a trellis.

    Evidence is a mapping from terms to values, as text; the program must know the terms.
    """

    def __init__(self, trellis: Trellis) -> None:
        self.trellis = trellis
        self._samplers: dict[frozenset[tuple[str, str]], _Sampler | None] = {}

    def __repr__(self) -> str:
        return f"WorldQueries({self.trellis!r})"

    @cached_property
    def _position_of(self) -> dict[int, tuple[int, int]]:
        """Term -> (step that decides it, index in the step)."""
        return {
            term: (step, i)
            for step, terms in enumerate(self.trellis.system.order)
            for i, term in enumerate(terms)
        }

    def _encode(self, evidence: Mapping[str, str]) -> _Allowed | None:
        """Encode evidence by steps; None if a term has no value in any world."""
        system = self.trellis.system
        allowed: dict[int, list[tuple[int, int]]] = {}
        for name, value in evidence.items():
            term = system.term_numbers.get(name)
            if term is None:
                return None
            step, i = self._position_of[term]
            allowed.setdefault(step, []).append((i, system.program.values[term].index(value)))
        return allowed

    def _list_arcs(self, step: int, allowed: _Allowed) -> list[tuple[int, int, int]]:
        """List the arcs (source, target, outcome) of a step that agree with the evidence."""
        arcs = zip(*self.trellis.arcs[step], strict=True)
        observed = allowed.get(step)
        if not observed:
            return list(arcs)
        outcomes = self.trellis.outcomes
        return [arc for arc in arcs if all(outcomes[arc[2]][0][i] == value for i, value in observed)]

    def compute_exact_weights(self, query: str, evidence: Mapping[str, str]) -> dict[str, Fraction]:
        """Sum the measures of the worlds with the evidence, by the value of a term; "" is for no value."""
        return self._sum_measures(
            query, evidence, [number for _, number in self.trellis.outcomes], Fraction(1)
        )

    def compute_float_weights(self, query: str, evidence: Mapping[str, str]) -> dict[str, float]:
        """Sum as `compute_exact_weights` in floating point; only the ratios matter."""
        return self._sum_measures(query, evidence, self.trellis.compute_weights(), 1.0)

    def _sum_measures(
        self, query: str, evidence: Mapping[str, str], numbers: Sequence[_Number], one: _Number
    ) -> dict[str, _Number]:
        """Sum the measures by the value of a term.

        Args:
            numbers: the weight of each outcome, in the type of the sums.
            one: 1 in that type.
        """
        allowed = self._encode(evidence)
        if allowed is None or not self.trellis.level_sizes[0]:
            return {}
        queried = self.trellis.system.term_numbers.get(query)
        query_step, index = self._position_of[queried] if queried is not None else (-1, 0)
        outcomes = self.trellis.outcomes
        by_value: dict[int, dict[int, _Number]] = {-1: {0: one}}  # outcome of the query -> state -> weight
        for step in range(len(self.trellis.arcs)):
            arcs = self._list_arcs(step, allowed)
            following: dict[int, dict[int, _Number]] = {}
            for value, current in by_value.items():
                for source, target, outcome in arcs:
                    weight = current.get(source)
                    if weight is not None:
                        key = outcomes[outcome][0][index] if step == query_step else value
                        sums = following.setdefault(key, {})
                        product = weight * numbers[outcome]
                        sums[target] = sums[target] + product if target in sums else product
            if isinstance(one, float):
                _rescale(following.values())
            by_value = following
        names = self.trellis.system.program.values[queried] if queried is not None else ()
        weights: dict[str, _Number] = {}
        for value, current in by_value.items():
            for weight in current.values():
                name = names[value] if 0 <= value < len(names) else ""
                weights[name] = weights[name] + weight if name in weights else weight
        return weights

    def count(self) -> int:
        """Count the possible worlds."""
        current = {0: 1} if self.trellis.level_sizes[0] else {}
        for sources, targets, _ in self.trellis.arcs:
            following: dict[int, int] = {}
            for source, target in zip(sources, targets, strict=True):
                following[target] = following.get(target, 0) + current[source]
            current = following
        return sum(current.values())

    def most_probable(self, evidence: Mapping[str, str], count: int) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds with the evidence, best first; none if the evidence is impossible.

        Source: the k-best form of Viterbi's algorithm, on logarithms, as long products underflow.
        """
        trellis = self.trellis
        allowed = self._encode(evidence)
        if allowed is None or not trellis.level_sizes[0]:
            return ()
        weights = [log(n.numerator) - log(n.denominator) if n else None for _, n in trellis.outcomes]
        # state -> best partial paths: (log weight, source, rank of the path at the source, outcome)
        best: list[list[tuple[float, int, int, int]]] = [[(0.0, -1, -1, -1)]]
        history = []
        total = {0: Fraction(1)}
        for step in range(len(trellis.arcs)):
            arriving: dict[int, list[tuple[float, int, int, int]]] = {}
            sums: dict[int, Fraction] = {}
            for source, target, outcome in self._list_arcs(step, allowed):
                weight = weights[outcome]
                if weight is None or not best[source]:
                    continue
                arriving.setdefault(target, []).extend(
                    (path[0] + weight, source, rank, outcome) for rank, path in enumerate(best[source])
                )
                if source in total:
                    number = trellis.outcomes[outcome][1]
                    sums[target] = sums.get(target, Fraction(0)) + total[source] * number
            history.append(best)
            total = sums
            best = [
                nlargest(count, arriving.get(i, ()), key=lambda path: path[0])
                for i in range(trellis.level_sizes[step + 1])
            ]
        history.append(best)
        mass = total.get(0, Fraction(0))
        if not mass:
            return ()
        worlds = []
        for final_rank in range(len(best[0])):
            path: list[int] = []
            state, rank = 0, final_rank
            for level in range(len(history) - 1, 0, -1):
                _, source, source_rank, outcome = history[level][state][rank]
                path.append(outcome)
                state, rank = source, source_rank
            path.reverse()
            measure = Fraction(1)
            for outcome in path:
                measure *= trellis.outcomes[outcome][1]
            values = decode_world(trellis.system, [trellis.outcomes[outcome][0] for outcome in path])
            worlds.append(PossibleWorld(values, measure / mass))
        return tuple(worlds)

    def sample(self, rng: np.random.Generator, given: Mapping[str, str]) -> dict[str, str] | None:
        """Draw a world with its probability given evidence; None if the evidence is impossible."""
        key = frozenset(given.items())
        if key not in self._samplers:
            if len(self._samplers) >= SAMPLER_CACHE_SIZE:
                self._samplers.clear()
            self._samplers[key] = self._build_sampler(given)
        sampler = self._samplers[key]
        if sampler is None:
            return None
        state, outcomes = 0, []
        uniform = rng.random(len(sampler)).tolist()
        for step, number in zip(sampler, uniform, strict=True):
            cumulative, choices = step[state]
            state, outcome = choices[min(bisect_right(cumulative, number), len(choices) - 1)]
            outcomes.append(self.trellis.outcomes[outcome][0])
        return decode_world(self.trellis.system, outcomes)

    def _build_sampler(self, given: Mapping[str, str]) -> _Sampler | None:
        allowed = self._encode(given)
        if allowed is None or not self.trellis.level_sizes[0]:
            return None
        reachable = self._find_reachable(allowed)  # weights of unreachable states would distort the scaling
        below = {0: 1.0}  # state -> weight of the paths from it to the end
        sampler: _Sampler = []
        for step in range(len(self.trellis.arcs) - 1, -1, -1):
            choices: dict[int, list[tuple[float, int, int]]] = {}
            for source, target, outcome in self._list_arcs(step, allowed):
                if source not in reachable[step]:
                    continue
                weight = float(self.trellis.outcomes[outcome][1]) * below.get(target, 0.0)
                if weight > 0:
                    choices.setdefault(source, []).append((weight, target, outcome))
            sums = {source: sum(choice[0] for choice in own) for source, own in choices.items()}
            sampler.append(
                {
                    source: (
                        list(accumulate(choice[0] / sums[source] for choice in own)),
                        [choice[1:] for choice in own],
                    )
                    for source, own in choices.items()
                }
            )
            largest = max(sums.values(), default=1.0)
            below = {source: total / largest for source, total in sums.items()}
        sampler.reverse()
        return sampler if 0 in below else None

    def _find_reachable(self, allowed: _Allowed) -> list[set[int]]:
        """Find the states before each step that a path of positive weight reaches."""
        reachable = [{0}]
        for step in range(len(self.trellis.arcs) - 1):
            before = reachable[-1]
            arcs = self._list_arcs(step, allowed)
            reachable.append(
                {target for source, target, o in arcs if source in before and self.trellis.outcomes[o][1]}
            )
        return reachable


def _rescale(parts: Collection[dict[int, float]]) -> None:
    """Scale tiny weights up together: only their ratios matter."""
    largest = max((weight for part in parts for weight in part.values()), default=1.0)
    if 0 < largest < MIN_WEIGHT:
        for part in parts:
            for state in part:
                part[state] /= largest
