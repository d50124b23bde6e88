"""Compilation, steps 1 to 4: transition system -> decision diagram -> matrices between the observed terms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from itertools import chain
from typing import TYPE_CHECKING, Any

from lcorpp.errors import ProgramError
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.decision_diagram import DecisionDiagram
from lcorpp.reasoning.circuit.matrices import MIN_WEIGHT, WIDE, Groups, Layer
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import resolve_inputs, resolve_interventions, resolve_queries

if TYPE_CHECKING:
    from lcorpp.reasoning.factors.network import TableNetwork


def compile_program(
    program: Program,
    inputs: Sequence[str],
    query: str | Sequence[str | Sequence[str]],
    do: Mapping[str, str],
    networks: dict[object, TableNetwork] | None = None,
) -> Circuit:
    """Compile a program.

    Args:
        inputs: the terms that evidence may name; an attribute with arguments is short for all its terms.
        query: a question, or several; see `Reasoner.compile`.
        do: interventions, term -> value.
        networks: tables of the program built so far, to which new ones are added.

    Raises:
        ProgramError: a name is unknown, a world breaks a condition of the language, or there are cr-rules.
        TooLargeError: the program is too large to be compiled.
    """
    names, queries = resolve_inputs(program, inputs), resolve_queries(program, query)
    if program.has_cr_rules:
        raise ProgramError(
            f"{program.file}: a program with cr-rules cannot be compiled: an observation may create worlds;"
            " ask for one posterior at a time"
        )
    do = resolve_interventions(program, do)
    circuit = Circuit(program, names, queries[0] if isinstance(query, str) else queries, do)
    circuit.network = _find_network(circuit, networks if networks is not None else {})
    if circuit.network is None:
        circuit.layers = build_layers(circuit.diagram, dict.fromkeys((*names, *queries)))
    return circuit


def _find_network(circuit: Circuit, networks: dict[object, TableNetwork]) -> TableNetwork | None:
    """Find the tables of a program; None if its decision diagram is cheaper, or the program has no tables."""
    program, do = circuit.program, circuit.do
    if not (program.has_tables or circuit.system.tree.may_be_tables):
        return None
    from lcorpp.reasoning.factors.choice import choose_network, find_network  # few programs are tables

    if program.has_tables:
        return find_network(program, do, networks)
    return choose_network(program, do, circuit.queries, circuit.inputs, circuit.system.tree.nodes)


def build_layers(diagram: DecisionDiagram, names: Iterable[str]) -> list[Layer]:
    """Build the layers for the observed terms, each after its sources; the last one has one output."""
    try:
        return _LayerBuilder(diagram, names, diagram.compute_weights(), MIN_WEIGHT).build()
    except _UnderflowError:
        with localcontext(WIDE):
            weights: list[Any] = [Decimal(p.numerator) / p.denominator for _, p in diagram.outcomes]
            return _LayerBuilder(diagram, names, weights, 0.0).build()


class _UnderflowError(ArithmeticError):
    """A sum is so small that the product of two might underflow."""


@dataclass(slots=True)
class _Part:
    """The nodes of a step as weighted sums of inputs.

    rows: node -> input -> weight.
    sources, n_inputs: the inputs, as in `Layer`.
    n_arcs: the number of arcs that the rows multiply.
    lowest: a lower bound of the weights.
    """

    rows: Sequence[Mapping[int, float]]
    sources: Sequence[tuple[int, Groups]]
    n_inputs: int
    n_arcs: int = 0
    lowest: float = 1


class _LayerBuilder:
    """Sums out all terms but the observed ones, from the leaves of a decision diagram to its roots.

    Args:
        names: the observed terms.
        weights: of the outcomes of the diagram, in any type of numbers.
        min_weight: the smallest sum that is allowed.
    """

    def __init__(
        self, diagram: DecisionDiagram, names: Iterable[str], weights: Sequence[float], min_weight: float
    ) -> None:
        self._diagram, self._weights, self._min_weight = diagram, weights, min_weight
        numbers = diagram.system.term_numbers
        self._variables = {numbers[name]: i for i, name in enumerate(names)}
        self._layers: list[Layer] = []

    def build(self) -> list[Layer]:
        """Return the layers.

        Raises:
            _UnderflowError: a weight may be lost.
        """
        children = self._diagram.system.tree.children
        parts: dict[int, _Part | list[float]] = {}
        for step in range(len(children) - 1, -1, -1):
            parts[step] = self._sum_step(step, [parts.pop(child) for child in children[step]])
        (weight,), part = self._multiply([1], [[0]] * len(parts), parts.values())  # of the roots
        part.rows = [{start: factor * weight for start, factor in part.rows[0].items()}]
        self._append_product(part)
        return self._layers

    def _sum_step(self, step: int, children: Sequence[_Part | list[float]]) -> _Part | list[float]:
        """Return the nodes of a step, given those of its branches: numbers if none has observed terms."""
        diagram = self._diagram
        terms, arcs = diagram.system.tree.order[step], diagram.arcs[step]
        n_nodes = diagram.sizes[step] or 1  # one node without arcs if there is no world
        weights = [self._weights[outcome] for outcome in arcs.outcomes]
        if not all(weights):  # pr-atoms of probability 0
            kept = [i for i, weight in enumerate(weights) if weight]
            weights, arcs = [weights[i] for i in kept], arcs.select(kept)
        weights, part = self._multiply(weights, arcs.targets, children)
        observed = [i for i, term in enumerate(terms) if term in self._variables]
        if not observed and not part.sources:
            numbers: list[float] = [0] * n_nodes
            for source, weight in zip(arcs.sources, weights, strict=True):
                numbers[source] += weight
            self._check(numbers)
            return numbers
        nodes: Sequence[int] = arcs.sources
        index_of: dict[Any, int] = {}  # (node, outcome of each observed term) -> index of a sum
        if observed:
            outcomes = [diagram.outcomes[outcome][0] for outcome in arcs.outcomes]
            keys = [(n, *[own[i] for i in observed]) for n, own in zip(nodes, outcomes, strict=True)]
            index_of = {key: index for index, key in enumerate(dict.fromkeys(keys))}
            nodes = [index_of[key] for key in keys]
        sums: list[dict[int, float]] = [{} for _ in range(len(index_of) or n_nodes)]
        for node, weight, row in zip(nodes, weights, part.rows, strict=True):
            total = sums[node]
            for start, factor in row.items():
                if start in total:
                    total[start] += factor * weight
                else:
                    total[start] = factor * weight
        if observed:
            by_key = {key: sums[index] for key, index in index_of.items()}
            return self._append_observed(part, by_key, [terms[i] for i in observed], n_nodes)
        part.rows, part.n_arcs = sums, part.n_arcs + len(weights)
        part.lowest *= min(weights, default=1)
        if part.lowest < self._min_weight:
            part.lowest = self._check(chain.from_iterable([total.values() for total in sums]))
        if part.n_inputs > 1 and sum(map(len, sums)) > 4 * part.n_arcs + 64:  # the product becomes dense
            return self._append_product(part)
        return part

    def _multiply(
        self,
        weights: list[float],
        targets: Iterable[Sequence[int]],
        branches: Iterable[_Part | list[float]],
    ) -> tuple[list[float], _Part]:
        """Multiply the weights of arcs by the nodes to which they lead, those with observed terms apart.

        Args:
            targets: for each branch the node of each arc.

        Returns:
            The weights times the numbers; and the product of the other nodes, with a row for each arc.
        """
        varying: list[tuple[Sequence[int], _Part]] = []
        for own, branch in zip(targets, branches, strict=True):
            if isinstance(branch, _Part):
                varying.append((own, branch))
            else:
                weights = [weight * branch[target] for weight, target in zip(weights, own, strict=True)]
                self._check(weights)
        if not varying:
            return weights, _Part([{0: 1}] * len(weights), (), 1)
        if len(varying) == 1:
            ((own, part),) = varying
            return weights, replace(part, rows=[part.rows[target] for target in own])
        layers = [self._append_product(branch).sources[0] for _, branch in varying]
        joint = list(zip(*[own for own, _ in varying], strict=True))  # the node of each branch, for each arc
        numbers = {nodes: number for number, nodes in enumerate(dict.fromkeys(joint))}
        sources = [
            (layer, Groups([nodes[i] for nodes in numbers], outputs.size))
            for i, (layer, outputs) in enumerate(layers)
        ]
        return weights, _Part([{numbers[nodes]: 1} for nodes in joint], sources, len(numbers))

    def _append_product(self, part: _Part) -> _Part:
        """Append a layer whose outputs are the nodes of a part, unless it already has them; return them."""
        is_identity = all(row == {i: 1} for i, row in enumerate(part.rows))
        is_all = len(part.sources) == 1 and part.sources[0][1].is_identity  # outputs of the layer below
        if is_all and is_identity and len(part.rows) == part.n_inputs:
            return part
        entries = {(node, 0, start): w for node, row in enumerate(part.rows) for start, w in row.items()}
        return self._append(-1, part, (len(part.rows), 1, part.n_inputs), entries)

    def _append_observed(
        self, part: _Part, sums: Mapping[Any, Mapping[int, float]], terms: Sequence[int], n_nodes: int
    ) -> _Part:
        """Append a layer for each observed term of one step; return the outputs of the last.

        Args:
            sums: (node, outcome of each term) -> input -> weight.
        """
        for term in terms:
            outputs: dict[Any, int] = {}  # (node, outcomes of the terms that follow) -> output
            entries = {}
            for (node, outcome, *others), row in sums.items():
                output = outputs.setdefault((node, *others), len(outputs)) if others else node
                for start, weight in row.items():
                    entries[output, outcome, start] = weight
            n_outcomes = len(self._diagram.system.program.values[term]) + 1
            shape = len(outputs) or n_nodes, n_outcomes, part.n_inputs
            part = self._append(self._variables[term], part, shape, entries)
            sums = {key: {output: 1} for key, output in outputs.items()}
        return part

    def _append(
        self,
        variable: int,
        part: _Part,
        shape: tuple[int, int, int],
        entries: Mapping[tuple[int, int, int], float],
    ) -> _Part:
        """Append a layer with the inputs of a part, see `Layer.from_entries`; return its outputs."""
        self._layers.append(Layer.from_entries(variable, part.sources, shape, entries))
        outputs = Groups(range(shape[0]), shape[0])
        return _Part([{i: 1} for i in range(shape[0])], ((len(self._layers) - 1, outputs),), shape[0])

    def _check(self, numbers: Iterable[float]) -> float:
        """Return the smallest of the numbers, unless it is too small."""
        lowest = min(numbers, default=1)
        if lowest < self._min_weight:
            raise _UnderflowError
        return lowest
