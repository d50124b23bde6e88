"""Queries about whole worlds on the decision diagram: exact sums, the most probable worlds, samples.

All work from the leaves of the diagram to its roots: the result for a node combines its arcs (OR), the result
for an arc the nodes of the branches to which it leads (AND).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from math import prod
from typing import TYPE_CHECKING, Any, TypeVar

from lcorpp.reasoning.answers import PossibleWorld
from lcorpp.reasoning.circuit.best_paths import find_best_paths
from lcorpp.reasoning.circuit.decision_diagram import Arcs, DecisionDiagram, decode_world, iterate_arcs

if TYPE_CHECKING:
    import numpy as np

    from lcorpp.values import Array

_Number = TypeVar("_Number", float, Fraction, int)

SAMPLER_CACHE_SIZE = 100
"""The tables to sample from are cached for at most this many sets of evidence."""

MIN_WEIGHT = 1e-30
"""Weights are scaled up if all of them are below this: only ratios matter, and long products underflow."""

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
            labels = arcs_of[step].outcomes
            kept = [k for k, label in enumerate(labels) if outcomes[label][0][i] == observed]
            arcs_of[step] = arcs_of[step].select(kept)
        return arcs_of

    def compute_exact_weights(self, query: str, evidence: Mapping[str, str]) -> dict[str, Fraction]:
        """Sum the measures of the worlds with the evidence, by the value of a term; "" is for no value."""
        return self._sum_measures(query, evidence, [number for _, number in self.diagram.outcomes])

    def restore_lost(
        self, evidence: Sequence[Mapping[str, str]], by_query: Mapping[str, tuple[Sequence[str], Array]]
    ) -> None:
        """Replace rows of 0 by sums of fractions, if the compiler lost weights to underflow.

        Args:
            evidence: of each row.
            by_query: query -> (values, (B, outcomes) weights).
        """
        for query, (values, weights) in by_query.items():
            for row in [i for i, own in enumerate(weights.tolist()) if not any(own)]:
                exact = self.compute_exact_weights(query, evidence[row])
                total = sum(exact.values()) or 1
                weights[row] = [float(exact.get(name, 0) / total) for name in (*values, "")]

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
        step_of_query, index = self._position_of[queried] if queried is not None else (-1, 0)
        path: list[int] = tree.find_path(step_of_query) if queried is not None else []
        sums: dict[int, list[Any]] = {}  # step -> node -> sum over the partial worlds of its subtree
        on_path = set(path)
        for step in range(len(arcs_of) - 1, -1, -1):
            if step not in on_path:
                factors = self._multiply_branches(arcs_of[step], tree.children[step], numbers, sums)
                sums[step] = _sum_by_node(arcs_of[step].sources, factors, diagram.sizes[step])
                if scale and (len(tree.children[step]) > 1 or not step % 8):
                    _rescale(sums[step])
        others = [sums[root][0] for root in tree.roots if root not in on_path]
        above: list[Any] = [float(all(others)) if scale else prod(others)]  # node -> sum over the rest
        if queried is None:
            return {"": above[0]} if above[0] else {}
        for step, following in zip(path, (*path[1:], -1), strict=True):
            branches = [child for child in tree.children[step] if child != following]
            arcs = arcs_of[step]
            rest = self._multiply_branches(arcs, tree.children[step], numbers, sums, skipped=following)
            factors = [above[source] * factor for source, factor in zip(arcs.sources, rest, strict=True)]
            if following >= 0:
                targets = arcs.targets[tree.children[step].index(following)]
                above = _sum_by_node(targets, factors, diagram.sizes[following])
                if scale and (branches or not step % 8):
                    _rescale(above)
        names, result = program.values[queried], dict[str, Any]()
        for label, factor in zip(arcs_of[step_of_query].outcomes, factors, strict=True):
            if factor:
                value = diagram.outcomes[label][0][index]
                name = names[value] if value < len(names) else ""
                result[name] = result.get(name, 0) + factor
        return result

    def _multiply_branches(
        self,
        arcs: Arcs,
        children: Sequence[int],
        numbers: Sequence[Any],
        sums: Mapping[int, Sequence[Any]],
        skipped: int = -1,
    ) -> list[Any]:
        """Multiply the weight of each arc by the sums of the nodes to which it leads.

        Args:
            children: the first step of each branch. skipped: one of them that is left out.
        """
        factors = [numbers[label] for label in arcs.outcomes]
        for child, targets in zip(children, arcs.targets, strict=True):
            if child != skipped:
                below = sums[child]
                factors = [factor * below[node] for factor, node in zip(factors, targets, strict=True)]
        return factors

    def count(self) -> int:
        """Count the possible worlds."""
        arcs_of = self._list_arcs({})
        if arcs_of is None:
            return 0
        tree = self.diagram.system.tree
        counts: list[list[int]] = [[0] * size for size in self.diagram.sizes]
        for step in range(len(counts) - 1, -1, -1):
            below = [counts[child] for child in tree.children[step]]
            for source, targets, _ in iterate_arcs(arcs_of[step]):
                counts[step][source] += prod(
                    [own[target] for own, target in zip(below, targets, strict=True)]
                )
        return prod([counts[root][0] for root in tree.roots])

    def most_probable(self, evidence: Mapping[str, str], count: int) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds with the evidence, best first; none if the evidence is impossible."""
        arcs_of = self._list_arcs(evidence)
        if arcs_of is None:
            return ()
        paths, mass = find_best_paths(self.diagram, arcs_of, count)
        worlds = []
        for path in paths:
            labels = [self.diagram.outcomes[outcome] for outcome in path]
            measure = prod([number for _, number in labels], start=Fraction(1))
            values = decode_world(self.diagram.system, [values for values, _ in labels])
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
            for source, targets, outcome in iterate_arcs(arcs_of[step]):
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
            for source, targets, outcome in iterate_arcs(arcs):
                if source in reachable[step] and outcomes[outcome][1]:
                    for child, target in zip(tree.children[step], targets, strict=True):
                        reachable[child].add(target)
        return reachable


def _sum_by_node(nodes: Sequence[int], factors: Sequence[Any], size: int) -> list[Any]:
    """Sum the factors of arcs by their source or target."""
    sums: list[Any] = [0] * size
    for node, factor in zip(nodes, factors, strict=True):
        sums[node] += factor
    return sums


def _rescale(weights: list[float]) -> None:
    """Scale tiny weights up together: only their ratios matter."""
    largest = max(weights, default=0.0)
    if 0 < largest < MIN_WEIGHT:
        weights[:] = [weight / largest for weight in weights]
