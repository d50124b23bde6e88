"""Queries about whole worlds on the decision diagram: exact sums, the most probable worlds, samples.

Each path through the trellis is one world, and each world is one path.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from heapq import nlargest
from itertools import accumulate
from math import log, prod
from operator import itemgetter
from typing import TYPE_CHECKING, TypeVar

from lcorpp.reasoning.answers import PossibleWorld
from lcorpp.reasoning.circuit.trellis import Trellis, decode_world

if TYPE_CHECKING:
    import numpy as np

_Number = TypeVar("_Number", float, Fraction)

SAMPLER_CACHE_SIZE = 100
"""The tables to sample from are cached for at most this many sets of evidence."""

MIN_WEIGHT = 1e-100
"""Floating-point sums are scaled up if all of them are below this."""

_Observed = Mapping[int, list[tuple[int, int]]]
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

    def _encode(self, evidence: Mapping[str, str]) -> _Observed | None:
        """Encode evidence by steps; None if a term has no value in any world."""
        system = self.trellis.system
        observed: dict[int, list[tuple[int, int]]] = {}
        for name, value in evidence.items():
            term = system.term_numbers.get(name)
            if term is None:
                return None
            step, i = self._position_of[term]
            observed.setdefault(step, []).append((i, system.program.values[term].index(value)))
        return observed

    def _list_arcs(self, step: int, observed: _Observed) -> list[tuple[int, int, int]]:
        """List the arcs (source, target, outcome) of a step that agree with the evidence."""
        arcs = zip(*self.trellis.arcs[step], strict=True)
        outcomes, own = self.trellis.outcomes, observed.get(step)
        if not own:
            return list(arcs)
        return [arc for arc in arcs if all(outcomes[arc[2]][0][i] == value for i, value in own)]

    def compute_exact_weights(self, query: str, evidence: Mapping[str, str]) -> dict[str, Fraction]:
        """Sum the measures of the worlds with the evidence, by the value of a term; "" is for no value."""
        return self._sum_measures(query, evidence, [p for _, p in self.trellis.outcomes], Fraction(1))

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
        observed = self._encode(evidence)
        if observed is None or not self.trellis.level_sizes[0]:
            return {}
        queried = self.trellis.system.term_numbers.get(query)
        query_step, index = self._position_of[queried] if queried is not None else (-1, 0)
        outcomes = self.trellis.outcomes
        by_value: dict[int, dict[int, _Number]] = {-1: {0: one}}  # outcome of the query -> state -> weight
        for step in range(len(self.trellis.arcs)):
            arcs = self._list_arcs(step, observed)
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
                rescale(following.values(), MIN_WEIGHT)
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
        current = Counter([0] if self.trellis.level_sizes[0] else [])
        for sources, targets, _ in self.trellis.arcs:
            following: Counter[int] = Counter()
            for source, target in zip(sources, targets, strict=True):
                following[target] += current[source]
            current = following
        return current.total()

    def most_probable(self, evidence: Mapping[str, str], count: int) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds with the evidence, best first; none if the evidence is impossible.

        Source: the k-best form of Viterbi's algorithm, on logarithms, as long products underflow.
        """
        trellis = self.trellis
        observed = self._encode(evidence)
        if observed is None or not trellis.level_sizes[0]:
            return ()
        mass = sum(self.compute_exact_weights("", evidence).values())
        if not mass:
            return ()
        weights = [log(n.numerator) - log(n.denominator) if n else None for _, n in trellis.outcomes]
        # level -> state -> best partial paths: (log weight, source, rank of the path at the source, outcome)
        best: list[list[list[tuple[float, int, int, int]]]] = [[[(0.0, -1, -1, -1)]]]
        for step in range(len(trellis.arcs)):
            arriving: defaultdict[int, list[tuple[float, int, int, int]]] = defaultdict(list)
            for source, target, outcome in self._list_arcs(step, observed):
                weight = weights[outcome]
                if weight is not None:
                    paths = enumerate(best[-1][source])
                    arriving[target].extend((p[0] + weight, source, rank, outcome) for rank, p in paths)
            level = range(trellis.level_sizes[step + 1])
            best.append([nlargest(count, arriving[state], key=itemgetter(0)) for state in level])
        worlds = []
        for final_rank in range(len(best[-1][0])):
            state, rank = 0, final_rank  # the last level has one state
            path = []
            for level_paths in reversed(best[1:]):
                _, state, rank, outcome = level_paths[state][rank]
                path.append(trellis.outcomes[outcome])
            path.reverse()
            measure = prod([number for _, number in path], start=Fraction(1))
            values = decode_world(trellis.system, [values for values, _ in path])
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
        observed = self._encode(given)
        if observed is None or not self.trellis.level_sizes[0]:
            return None
        reachable = self._find_reachable(observed)  # weights of unreachable states would distort the scaling
        below = {0: 1.0}  # state -> weight of the paths from it to the end
        sampler: _Sampler = []
        for step in range(len(self.trellis.arcs) - 1, -1, -1):
            choices: dict[int, list[tuple[float, int, int]]] = {}
            for source, target, outcome in self._list_arcs(step, observed):
                if source not in reachable[step]:
                    continue
                weight = float(self.trellis.outcomes[outcome][1]) * below.get(target, 0.0)
                if weight > 0:
                    choices.setdefault(source, []).append((weight, target, outcome))
            sums: dict[int, float] = {}
            sampler.append({})
            for source, own in choices.items():
                total = sums[source] = sum(weight for weight, _, _ in own)
                cumulative = list(accumulate(weight / total for weight, _, _ in own))
                sampler[-1][source] = cumulative, [choice[1:] for choice in own]
            largest = max(sums.values(), default=1.0)
            below = {source: total / largest for source, total in sums.items()}
        sampler.reverse()
        return sampler if 0 in below else None

    def _find_reachable(self, observed: _Observed) -> list[set[int]]:
        """Find the states before each step that a path of positive weight reaches."""
        reachable = [{0}]
        for step in range(len(self.trellis.arcs) - 1):
            before = reachable[-1]
            arcs = self._list_arcs(step, observed)
            reachable.append(
                {target for source, target, o in arcs if source in before and self.trellis.outcomes[o][1]}
            )
        return reachable


def rescale(parts: Collection[dict[int, float]], minimum: float) -> None:
    """Scale weights up if all are below `minimum`: only ratios matter, and long products underflow."""
    largest = max((weight for part in parts for weight in part.values()), default=0.0)
    if 0 < largest < minimum:
        for part in parts:
            for state in part:
                part[state] /= largest
