"""Queries about whole worlds on the decision diagram: exact sums, the most probable worlds, samples.

All work from the leaves of the diagram to its roots: the result for a node combines its arcs (OR), the result
for an arc the nodes of the branches to which it leads (AND).
"""

from __future__ import annotations

from bisect import bisect_right
from collections import UserDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property, partial
from itertools import accumulate, islice
from math import lcm, prod
from operator import mul
from typing import TYPE_CHECKING, Any

from lcorpp.reasoning.answers import PossibleWorld, Value
from lcorpp.reasoning.diagram.decision_diagram import Arcs, DecisionDiagram, decode_world, iterate_arcs

if TYPE_CHECKING:
    import numpy as np

    from lcorpp.reasoning.diagram.best_paths import Choice, Track

    _Sampler = list[list[tuple[list[float], list[Choice]]]]
    """For each node of each step: (cumulative probabilities of its arcs, arcs)"""

SAMPLER_CACHE_SIZE = 100
"""The tables to sample from are cached for at most this many sets of evidence."""

_Weights = Sequence[Any] | Mapping[int, Any]
"""The weight of each outcome."""


class WorldQueries:
    """Queries about the worlds of a decision diagram.

    Evidence is a mapping from terms to values, as text; the program must know the terms.
    """

    def __init__(self, diagram: DecisionDiagram) -> None:
        self.diagram = diagram
        self._samplers: dict[frozenset[tuple[str, str]], _Sampler] = {}

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

    @cached_property
    def _integers(self) -> tuple[list[dict[int, int]], Fraction]:
        """See `_find_integers`, for all arcs."""
        return self._find_integers(self.diagram.arcs)

    def _excludes(self, evidence: Mapping[str, str]) -> bool:
        """Whether a term of the evidence has no value in any world, as no rule names it."""
        return not evidence.keys() <= self.diagram.system.term_numbers.keys()

    def _list_arcs(self, evidence: Mapping[str, str]) -> list[Arcs]:
        """List the arcs of each step that agree with the evidence."""
        system = self.diagram.system
        terms = [system.term_numbers[name] for name in evidence]
        observed = zip(terms, evidence.values(), strict=True)
        return self._select_arcs({term: system.program.values[term].index(value) for term, value in observed})

    def _select_arcs(self, outcome_of: Mapping[int, int]) -> list[Arcs]:
        """List the arcs of each step with some outcomes of terms."""
        diagram = self.diagram
        outcomes, arcs_of = diagram.outcomes, list(diagram.arcs)
        for term, observed in outcome_of.items():
            step, i = self._position_of[term]
            labels = arcs_of[step].outcomes
            kept = [k for k, label in enumerate(labels) if outcomes[label].values[i] == observed]
            arcs_of[step] = arcs_of[step].select(kept)
        return arcs_of

    def compute_exact_weights(self, query: str, evidence: Mapping[str, str]) -> dict[Value, Fraction]:
        """Sum the measures of the worlds with the evidence, by the value of a term; "" is for no value."""
        if self._excludes(evidence):
            return {}
        arcs_of = self._list_arcs(evidence)
        weights, unit = self._find_integers(arcs_of)
        return {value: w * unit for value, w in self._sum_measures(query, arcs_of, weights).items()}

    def compute_measure(self, outcome_of: Mapping[int, int]) -> Fraction:
        """Sum the measures of the worlds with some outcomes of terms, by number."""
        weights, unit = self._integers
        return Fraction(self._sum_measures("", self._select_arcs(outcome_of), weights).get("", 0) * unit)

    def compute_float_weights(self, query: str, evidence: Mapping[str, str]) -> dict[Value, float]:
        """Sum as `compute_exact_weights` in floating point; only the ratios matter."""
        if self._excludes(evidence):
            return {}
        from lcorpp.reasoning.diagram.layers import build_layers  # fractions need none

        if not self.diagram.has_worlds:
            return {}
        system = self.diagram.system
        layers = build_layers(self.diagram, [query], evidence)
        values = (*system.program.values[system.term_numbers[query]], "")
        return {value: w for value, w in zip(values, layers.weigh_outcomes(0), strict=True) if w}

    def count(self) -> int:
        """Count the possible worlds."""
        arcs_of = self._list_arcs({})
        ones = [[1] * len(self.diagram.outcomes)] * len(arcs_of)
        return sum(self._sum_measures("", arcs_of, ones).values())

    def _find_integers(self, arcs_of: Sequence[Arcs]) -> tuple[list[dict[int, int]], Fraction]:
        """Return the weights of the outcomes of each step as integers, and the measure of weight 1."""
        weights, unit = [], Fraction(1)
        for arcs in arcs_of:
            numbers = {outcome: self.diagram.outcomes[outcome].weight for outcome in arcs.outcomes}
            common = lcm(*[number.denominator for number in numbers.values()])
            weights.append({o: n.numerator * (common // n.denominator) for o, n in numbers.items()})
            unit /= common
        return weights, unit

    def _sum_measures(
        self, query: str, arcs_of: Sequence[Arcs], weights: Sequence[_Weights]
    ) -> dict[Value, Any]:
        """Sum the measures by the value of a term.

        Args:
            arcs_of: the arcs of each step that worlds may use.
            weights: for each step the weights of the outcomes, in the type of the sums.
        """
        diagram = self.diagram
        if not diagram.has_worlds:
            return {}

        tree, program = diagram.system.tree, diagram.system.program
        queried = diagram.system.term_numbers.get(query, -1)
        step_of_query, index = self._position_of.get(queried, (-1, 0))
        path = tree.find_path(step_of_query) if queried >= 0 else []
        sums: dict[int, list[Any]] = {}  # step -> node -> sum over the partial worlds of its subtree
        for step in sorted(set(range(len(arcs_of))).difference(path), reverse=True):
            sums[step] = own_sums = [0] * diagram.sizes[step]
            factors = self._multiply_branches(arcs_of[step], tree.children[step], weights[step], sums)
            for source, factor in zip(arcs_of[step].sources, factors, strict=True):
                own_sums[source] += factor
        others = [sums[root][0] for root in tree.roots if root in sums]
        above: list[Any] = [prod(others)]  # node -> sum over the rest
        if queried < 0:
            return {"": above[0]} if above[0] else {}
        for step, following in zip(path, (*path[1:], -1), strict=True):
            arcs, own = arcs_of[step], tree.children[step]
            factors = self._multiply_branches(arcs, own, weights[step], sums)
            if following >= 0:
                below: list[Any] = [0] * diagram.sizes[following]
                targets = arcs.targets[own.index(following)]
                for source, target, factor in zip(arcs.sources, targets, factors, strict=True):
                    below[target] += above[source] * factor
                above = below
        names, result = program.values[queried], dict[Value, Any]()
        for source, label, factor in zip(arcs.sources, arcs.outcomes, factors, strict=True):
            if above[source] * factor:
                value = diagram.outcomes[label].values[index]
                name = names[value] if value < len(names) else ""
                result[name] = result.get(name, 0) + above[source] * factor
        return result

    @staticmethod
    def _multiply_branches(
        arcs: Arcs, children: Sequence[int], weights: _Weights, sums: Mapping[int, Sequence[Any]]
    ) -> Iterator[Any]:
        """Multiply the weight of each arc by those sums of nodes to which it leads that are known."""
        factors = map(weights.__getitem__, arcs.outcomes)
        for child, targets in zip(children, arcs.targets, strict=True):
            if child in sums:
                factors = map(mul, factors, map(sums[child].__getitem__, targets))
        return factors

    def most_probable(self, evidence: Mapping[str, str], count: int) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds with the evidence, best first; none if the evidence is impossible."""
        if self._excludes(evidence):
            return ()
        arcs_of = self._list_arcs(evidence)
        weights, _ = self._find_integers(arcs_of)
        mass = self._sum_measures("", arcs_of, weights).get("")
        if not mass:
            return ()
        from lcorpp.reasoning.diagram.best_paths import BestPaths  # rarely needed

        tree, outcomes = self.diagram.system.tree, self.diagram.outcomes
        choices = self._list_choices(arcs_of, weights, partial(max, default=0))
        paths = BestPaths(tree.children, tree.roots, choices)
        first = prod([max(choices[root][0])[0] for root in tree.roots])

        def decode(track: Track | None) -> dict[str, str]:
            labels = paths.list_outcomes(track)
            return decode_world(self.diagram.system, [outcomes[label].values for label in labels])

        return tuple(
            [
                PossibleWorld(_LazyValues(partial(decode, track)), ratio * Fraction(first, mass))
                for ratio, track in islice(paths.iterate(), count)
            ]
        )

    def sample(
        self, count: int, rng: np.random.Generator, given: Mapping[str, str]
    ) -> list[dict[str, str]] | None:
        """Draw worlds with their probabilities given evidence; None if the evidence is impossible."""
        if self._excludes(given):
            return None
        key = frozenset(given.items())
        if key not in self._samplers:
            if len(self._samplers) >= SAMPLER_CACHE_SIZE:
                self._samplers.clear()
            self._samplers[key] = self._build_sampler(given)
        sampler = self._samplers[key]
        tree = self.diagram.system.tree
        if not all(sampler[root] and sampler[root][0][1] for root in tree.roots):
            return None
        worlds, decoded = [], dict[tuple[int, ...], dict[str, str]]()
        for uniform in rng.random((count, len(sampler))).tolist():
            nodes, outcomes = dict.fromkeys(tree.roots, 0), []
            for step, number in enumerate(uniform):
                cumulative, choices = sampler[step][nodes[step]]
                _, targets, outcome = choices[bisect_right(cumulative, number)]
                nodes.update(zip(tree.children[step], targets, strict=True))
                outcomes.append(outcome)
            drawn = tuple(outcomes)
            if drawn not in decoded:
                decoded[drawn] = decode_world(
                    self.diagram.system, [self.diagram.outcomes[outcome].values for outcome in drawn]
                )
            worlds.append(dict(decoded[drawn]))
        return worlds

    def _build_sampler(self, given: Mapping[str, str]) -> _Sampler:
        arcs_of = self._list_arcs(given)
        sampler: _Sampler = []
        for nodes in self._list_choices(arcs_of, self._find_integers(arcs_of)[0], sum):
            sums = [list(accumulate([weight for weight, _, _ in choices])) for choices in nodes]
            sampler.append([([s / own[-1] for s in own], c) for own, c in zip(sums, nodes, strict=True)])
        return sampler

    def _list_choices(
        self,
        arcs_of: Sequence[Arcs],
        weights: Sequence[_Weights],
        combine: Callable[[Iterable[int]], int],
    ) -> list[list[list[Choice]]]:
        """List the arcs of each node of each step, with the combined weights of the partial worlds behind."""
        choices: list[list[list[Choice]]] = [[[] for _ in range(size)] for size in self.diagram.sizes]
        combined: dict[int, list[int]] = {}  # step -> node -> combined weight
        for step in range(len(arcs_of) - 1, -1, -1):
            children = self.diagram.system.tree.children[step]
            products = self._multiply_branches(arcs_of[step], children, weights[step], combined)
            for (source, targets, outcome), weight in zip(iterate_arcs(arcs_of[step]), products, strict=True):
                if weight:
                    choices[step][source].append((weight, targets, outcome))
            combined[step] = [combine([weight for weight, _, _ in own]) for own in choices[step]]
        return choices


class _LazyValues(UserDict[str, str]):
    """The terms and values of a world, decoded when they are needed."""

    def __init__(self, decode: Callable[[], dict[str, str]]) -> None:
        self._decode = decode

    @cached_property
    def data(self) -> dict[str, str]:  # type: ignore[override]
        return self._decode()

    def __reduce__(self) -> tuple[type[dict[str, str]], tuple[dict[str, str]]]:
        return dict, (self.data,)  # the diagram stays behind
