"""Queries about whole worlds on the decision diagram: exact sums, the most probable worlds, samples.

All work from the leaves of the diagram to its roots: the result for a node combines its arcs (OR), the result
for an arc the nodes of the branches to which it leads (AND).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from heapq import heappop, heappush, nlargest
from itertools import accumulate
from math import log, prod
from typing import TYPE_CHECKING, Any, TypeVar

from lcorpp.reasoning.answers import PossibleWorld
from lcorpp.reasoning.circuit.decision_diagram import Arcs, DecisionDiagram, decode_world

if TYPE_CHECKING:
    import numpy as np

_Number = TypeVar("_Number", float, Fraction, int)

SAMPLER_CACHE_SIZE = 100
"""The tables to sample from are cached for at most this many sets of evidence."""

MIN_WEIGHT = 1e-30
"""Weights are scaled up if all of them are below this: only ratios matter, and long products underflow."""

_Partial = tuple[float, Any]
"""(log weight, path): a path is the outcome of a step and the paths of its branches, as a nested tuple."""

_Sampler = list[dict[int, tuple[list[float], list[tuple[tuple[int, ...], int]]]]]
"""For each step: node -> (cumulative probabilities, (targets, outcome) of each arc)"""


class WorldQueries:
    """Queries about the worlds of a decision diagram.

    Evidence is a mapping from terms to values, as text; the program must know the terms.
    """

    def __init__(self, diagram: DecisionDiagram) -> None:
        self.diagram = diagram
        self._samplers: dict[frozenset[tuple[str, str]], _Sampler | None] = {}

    def __repr__(self) -> str:
        return f"WorldQueries({self.diagram!r})"

    @cached_property
    def _position_of(self) -> dict[int, tuple[int, int]]:
        """Term -> (step that decides it, index in the step)."""
        return {
            term: (step, i)
            for step, terms in enumerate(self.diagram.system.tree.order)
            for i, term in enumerate(terms)
        }

    def _list_arcs(self, evidence: Mapping[str, str]) -> list[Arcs] | None:
        """List the arcs of each step that agree with the evidence; None if there is no world."""
        diagram = self.diagram
        system, outcomes = diagram.system, diagram.outcomes
        if not diagram.has_worlds:
            return None
        arcs_of = list(diagram.arcs)
        for name, value in evidence.items():
            term = system.term_numbers.get(name)
            if term is None:  # it has no value in any world
                return None
            step, i = self._position_of[term]
            observed = system.program.values[term].index(value)
            sources, targets, labels = arcs_of[step]
            kept = [k for k, label in enumerate(labels) if outcomes[label][0][i] == observed]
            arcs_of[step] = Arcs(
                [sources[k] for k in kept],
                tuple([[branch[k] for k in kept] for branch in targets]),
                [labels[k] for k in kept],
            )
        return arcs_of

    def compute_exact_weights(self, query: str, evidence: Mapping[str, str]) -> dict[str, Fraction]:
        """Sum the measures of the worlds with the evidence, by the value of a term; "" is for no value."""
        return self._sum_measures(query, evidence, [number for _, number in self.diagram.outcomes])

    def compute_float_weights(self, query: str, evidence: Mapping[str, str]) -> dict[str, float]:
        """Sum as `compute_exact_weights` in floating point; only the ratios matter."""
        return self._sum_measures(query, evidence, self.diagram.compute_weights(), scale=True)

    def _sum_measures(
        self, query: str, evidence: Mapping[str, str], numbers: Sequence[_Number], *, scale: bool = False
    ) -> dict[str, Any]:
        """Sum the measures by the value of a term.

        Args:
            numbers: the weight of each outcome, in the type of the sums.
            scale: whether to scale tiny weights up.
        """
        arcs_of, diagram = self._list_arcs(evidence), self.diagram
        if arcs_of is None:
            return {}
        tree, program = diagram.system.tree, diagram.system.program
        queried = diagram.system.term_numbers.get(query)
        query_step, index = self._position_of[queried] if queried is not None else (-1, 0)
        # step -> outcome of the query, None below and beside its step -> node -> sum over partial worlds
        sums: dict[int, dict[int | None, list[Any]]] = {}
        for step in range(len(arcs_of) - 1, -1, -1):
            sources, targets, labels = arcs_of[step]
            products: dict[int | None, list[Any]] = {None: [numbers[label] for label in labels]}
            for child, nodes in zip(tree.children[step], targets, strict=True):
                below = sums.pop(child)
                products = {
                    (a if b is None else b): [f * own[node] for f, node in zip(factors, nodes, strict=True)]
                    for a, factors in products.items()
                    for b, own in below.items()
                }
            if step == query_step:
                values = [diagram.outcomes[label][0][index] for label in labels]
                products = {
                    value: [f if v == value else 0 for f, v in zip(products[None], values, strict=True)]
                    for value in set(values)
                }
            size = diagram.sizes[step]
            sums[step] = {a: _sum_by_source(sources, factors, size) for a, factors in products.items()}
            if scale and (len(targets) > 1 or not step % 8):
                _rescale(sums[step].values())
        weights: dict[int | None, Any] = {None: 1}
        for root in tree.roots:
            own = {a: float(x[0] > 0) if a is None and scale else x[0] for a, x in sums[root].items()}
            weights = {(a if b is None else b): x * y for a, x in weights.items() for b, y in own.items()}
        result: dict[str, Any] = {}
        for value, weight in weights.items():
            if weight:
                names = program.values[queried] if queried is not None and value is not None else ()
                name = names[value] if value is not None and value < len(names) else ""
                result[name] = result.get(name, 0) + weight
        return result

    def count(self) -> int:
        """Count the possible worlds."""
        arcs_of = self._list_arcs({})
        if arcs_of is None:
            return 0
        tree = self.diagram.system.tree
        counts: list[list[int]] = [[0] * size for size in self.diagram.sizes]
        for step in range(len(counts) - 1, -1, -1):
            below = [counts[child] for child in tree.children[step]]
            for source, targets, _ in _iterate(arcs_of[step]):
                counts[step][source] += prod(
                    [own[target] for own, target in zip(below, targets, strict=True)]
                )
        return prod([counts[root][0] for root in tree.roots])

    def most_probable(self, evidence: Mapping[str, str], count: int) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds with the evidence, best first; none if the evidence is impossible.

        Source: the k-best form of Viterbi's algorithm, on logarithms, as long products underflow.
        """
        arcs_of, diagram = self._list_arcs(evidence), self.diagram
        if arcs_of is None:
            return ()
        tree = diagram.system.tree
        logs = [log(n.numerator) - log(n.denominator) if n else None for _, n in diagram.outcomes]
        best: dict[int, dict[int, list[_Partial]]] = {}  # step -> node -> best partial worlds
        sums: dict[int, dict[int, Fraction]] = {}
        for step in range(len(tree.children) - 1, -1, -1):
            below = [best.pop(child) for child in tree.children[step]]
            masses = [sums.pop(child) for child in tree.children[step]]
            found: dict[int, list[_Partial]] = {}
            total: dict[int, Fraction] = {}
            for source, targets, outcome in _iterate(arcs_of[step]):
                weight = logs[outcome]
                if weight is None or any(
                    target not in own for own, target in zip(below, targets, strict=True)
                ):
                    continue
                lists = [own[target] for own, target in zip(below, targets, strict=True)]
                found.setdefault(source, []).extend(_combine(weight, (outcome,), lists, count))
                factors = [own[target] for own, target in zip(masses, targets, strict=True)]
                total[source] = total.get(source, Fraction(0)) + diagram.outcomes[outcome][1] * prod(factors)
            best[step] = {node: nlargest(count, own, key=_log_weight) for node, own in found.items()}
            sums[step] = total
        mass = prod([sums[root].get(0, Fraction(0)) for root in tree.roots])
        if not mass:
            return ()
        worlds = []
        for _, path in _combine(0.0, (), [best[root][0] for root in tree.roots], count):
            labels = [diagram.outcomes[outcome] for outcome in _flatten(path)]
            measure = prod([number for _, number in labels], start=Fraction(1))
            worlds.append(
                PossibleWorld(decode_world(diagram.system, [values for values, _ in labels]), measure / mass)
            )
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
        tree = self.diagram.system.tree
        nodes, outcomes = dict.fromkeys(tree.roots, 0), []
        uniform = rng.random(len(sampler)).tolist()
        for step, number in enumerate(uniform):
            cumulative, choices = sampler[step][nodes[step]]
            targets, outcome = choices[min(bisect_right(cumulative, number), len(choices) - 1)]
            nodes.update(zip(tree.children[step], targets, strict=True))
            outcomes.append(self.diagram.outcomes[outcome][0])
        return decode_world(self.diagram.system, outcomes)

    def _build_sampler(self, given: Mapping[str, str]) -> _Sampler | None:
        arcs_of = self._list_arcs(given)
        if arcs_of is None:
            return None
        tree, weights = self.diagram.system.tree, self.diagram.compute_weights()
        reachable = self._find_reachable(arcs_of)  # weights of unreachable nodes would distort the scaling
        below: dict[int, dict[int, float]] = {}  # step -> node -> weight of its partial worlds
        sampler: _Sampler = [{} for _ in arcs_of]
        for step in range(len(arcs_of) - 1, -1, -1):
            factors = [below.pop(child) for child in tree.children[step]]
            choices: dict[int, list[tuple[float, tuple[int, ...], int]]] = {}
            for source, targets, outcome in _iterate(arcs_of[step]):
                if source not in reachable[step]:
                    continue
                weight = weights[outcome]
                for own, target in zip(factors, targets, strict=True):
                    weight *= own.get(target, 0.0)
                if weight > 0:
                    choices.setdefault(source, []).append((weight, targets, outcome))
            sums = {source: sum([choice[0] for choice in own]) for source, own in choices.items()}
            sampler[step] = {
                source: (
                    list(accumulate([choice[0] / sums[source] for choice in own])),
                    [choice[1:] for choice in own],
                )
                for source, own in choices.items()
            }
            largest = max(sums.values(), default=1.0)
            below[step] = {source: total / largest for source, total in sums.items()}
        return sampler if all(0 in below[root] for root in tree.roots) else None

    def _find_reachable(self, arcs_of: Sequence[Arcs]) -> list[set[int]]:
        """Find the nodes of each step that arcs of positive weight reach."""
        tree, outcomes = self.diagram.system.tree, self.diagram.outcomes
        reachable: list[set[int]] = [{0} if step in tree.roots else set() for step in range(len(arcs_of))]
        for step, arcs in enumerate(arcs_of):
            for source, targets, outcome in _iterate(arcs):
                if source in reachable[step] and outcomes[outcome][1]:
                    for child, target in zip(tree.children[step], targets, strict=True):
                        reachable[child].add(target)
        return reachable


def _iterate(arcs: Arcs) -> Iterator[tuple[int, tuple[int, ...], int]]:
    """Yield the source, the target in each branch and the outcome of each arc."""
    branches = zip(*arcs.targets, strict=True) if arcs.targets else [()] * len(arcs.sources)
    return zip(arcs.sources, branches, arcs.outcomes, strict=True)


def _sum_by_source(sources: Sequence[int], factors: Sequence[_Number], size: int) -> list[_Number]:
    """Sum the factors of arcs by their source node."""
    sums: list[Any] = [0] * size
    for source, factor in zip(sources, factors, strict=True):
        sums[source] += factor
    return sums


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


def _rescale(parts: Collection[list[Any]]) -> None:
    """Scale tiny weights up together: only their ratios matter."""
    largest = max([max(part, default=0) for part in parts], default=0)
    if 0 < largest < MIN_WEIGHT:
        for part in parts:
            part[:] = [weight / largest for weight in part]
