"""Compilation, steps 1 to 4: transition system -> decision diagram -> matrices between the observed terms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lcorpp.errors import ProgramError
from lcorpp.reasoning.answers import list_values
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.decision_diagram import DecisionDiagram, build_decision_diagram
from lcorpp.reasoning.circuit.matrices import Groups, Layer
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.gc_pause import pause_gc
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import resolve_inputs, resolve_interventions, resolve_queries
from lcorpp.reasoning.transitions.transition_system import build_transition_system

MIN_WEIGHT = 1e-30
"""Weights are scaled up if all of them are below this: only ratios matter, and long products underflow."""

_Row = Mapping[int, float]
"""input -> weight"""

_Entries = Mapping[tuple[tuple[int, ...], int, int], float]
"""(node and the outcomes of later observed terms, outcome of the next one, input) -> weight"""


@pause_gc()
def compile_program(
    program: Program,
    inputs: Sequence[str],
    query: str | Sequence[str | Sequence[str]],
    do: Mapping[str, str],
) -> Circuit:
    """Compile a program.

    Args:
        inputs: the terms that evidence may name; an attribute with arguments is short for all its terms.
        query: a question, or several; see `Reasoner.compile`.
        do: interventions, term -> value.

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
    observed = dict.fromkeys((*names, *queries))
    ground = ground_program(program, do, queried=queries)
    diagram = build_decision_diagram(build_transition_system(ground, observed))
    layers = build_layers(diagram, list(observed))
    query = queries[0] if isinstance(query, str) else queries
    return Circuit(program, names, query, do, layers, WorldQueries(diagram))


def build_layers(diagram: DecisionDiagram, names: Sequence[str]) -> list[Layer]:
    """Build the layers for the observed terms, each after its sources; the last one has one output."""
    if not diagram.has_worlds:
        sizes = [len(list_values(diagram.system.program.source, name)) + 1 for name in names]
        return [
            Layer.from_entries(i, ((i - 1, Groups([0], 1)),) if i else (), (1, size, 1), {})
            for i, size in enumerate(sizes)
        ]
    numbers = diagram.system.term_numbers
    layers: list[Layer] = []
    builder = _LayerBuilder(diagram, {numbers[name]: i for i, name in enumerate(names)}, layers)
    parts: dict[int, _Part] = {}
    for step in range(len(diagram.arcs) - 1, -1, -1):
        children = [parts.pop(child) for child in diagram.system.tree.children[step]]
        parts[step] = builder.sum_step(step, children)
    builder.finish([parts[root] for root in diagram.system.tree.roots])
    return layers


@dataclass(slots=True)
class _Part:
    """The nodes of a step as weighted sums of inputs.

    rows: node -> input -> weight.
    sources, n_inputs: the inputs, as in `Layer`; without sources the only input is 1.
    n_arcs: the number of arcs that the rows multiply.
    """

    rows: Sequence[_Row]
    sources: tuple[tuple[int, Groups], ...]
    n_inputs: int
    n_arcs: int = 0


class _LayerBuilder:
    """Sums out all terms but the observed ones, from the leaves of a decision diagram to its roots.

    Args:
        variables: observed term -> its index among the observed terms.
        layers: the list to which layers are appended.
    """

    def __init__(self, diagram: DecisionDiagram, variables: Mapping[int, int], layers: list[Layer]) -> None:
        self._diagram, self._variables, self._layers = diagram, variables, layers
        self._weights = diagram.compute_weights()

    def sum_step(self, step: int, children: Sequence[_Part]) -> _Part:
        """Return the nodes of a step, given those of its branches."""
        diagram, variables = self._diagram, self._variables
        terms, arcs, n_nodes = diagram.system.tree.order[step], diagram.arcs[step], diagram.sizes[step]
        weights = [self._weights[outcome] for outcome in arcs.outcomes]
        if not all(weights):  # pr-atoms of probability 0
            kept = [i for i, weight in enumerate(weights) if weight]
            weights, arcs = [weights[i] for i in kept], arcs.select(kept)
        observed = [i for i, term in enumerate(terms) if term in variables]
        if not observed and not any(child.sources for child in children):
            return _sum_numbers(arcs.sources, arcs.targets, weights, children, n_nodes)
        rows, part = self._multiply_branches(arcs.targets, weights, children)
        if observed:
            entries: dict[tuple[tuple[int, ...], int, int], float] = {}
            for source, outcome, weight, row in zip(arcs.sources, arcs.outcomes, weights, rows, strict=True):
                values = diagram.outcomes[outcome][0]
                node = source, *[values[i] for i in observed[1:]]
                for start, factor in row.items():
                    key = node, values[observed[0]], start
                    entries[key] = entries.get(key, 0.0) + factor * weight
            return self._append_observed(part, entries, [terms[i] for i in observed], n_nodes)
        sums: list[dict[int, float]] = [{} for _ in range(n_nodes)]
        for source, weight, row in zip(arcs.sources, weights, rows, strict=True):
            own = sums[source]
            for start, factor in row.items():
                if start in own:
                    own[start] += factor * weight
                else:
                    own[start] = factor * weight
        part.rows, part.n_arcs = sums, part.n_arcs + len(weights)
        if not step % 16:
            _rescale(sums)
        if part.n_inputs > 1 and sum(map(len, sums)) > 4 * part.n_arcs + 64:  # the product becomes dense
            return self._append_product(part)
        return part

    def finish(self, tops: Sequence[_Part]) -> None:
        """Append the last layer, whose output is the product of the roots."""
        weights = [1.0]
        rows, part = self._multiply_branches([[0] for _ in tops], weights, tops)
        part.rows = [{start: factor * weights[0] for start, factor in rows[0].items()}]
        self._append_product(part)

    def _multiply_branches(
        self, targets: Sequence[Sequence[int]], weights: list[float], branches: Sequence[_Part]
    ) -> tuple[list[_Row], _Part]:
        """Multiply the nodes to which arcs lead.

        Args:
            targets: for each branch the node of each arc.
            weights: of the arcs; branches of numbers are multiplied into them.

        Returns:
            (rows, part): the product of the other branches for each arc, input -> weight; and a part with
            these inputs, still without rows.
        """
        varying: list[tuple[Sequence[int], _Part]] = []
        for own, branch in zip(targets, branches, strict=True):
            if branch.sources:
                varying.append((own, branch))
                continue
            numbers = _scale_numbers(branch)
            for i, target in enumerate(own):
                weights[i] *= numbers[target]
        if not varying:
            return [{0: 1.0}] * len(weights), _Part((), (), 1)
        if len(varying) == 1:
            own, branch = varying[0]
            return [branch.rows[target] for target in own], _Part(
                (), branch.sources, branch.n_inputs, branch.n_arcs
            )
        places: dict[tuple[int, ...], int] = {}  # nodes of the branches -> input
        rows: list[_Row] = [
            {places.setdefault(nodes, len(places)): 1.0}
            for nodes in zip(*[own for own, _ in varying], strict=True)
        ]
        layers = [self._append_product(branch).sources[0] for _, branch in varying]
        keys = zip(*places, strict=True)
        sources = [
            (layer, Groups(own, outputs.size)) for (layer, outputs), own in zip(layers, keys, strict=True)
        ]
        return rows, _Part((), tuple(sources), len(places))

    def _append_product(self, part: _Part) -> _Part:
        """Append a layer whose outputs are the nodes of a part, unless it has them already; return them."""
        is_identity = all(row == {i: 1.0} for i, row in enumerate(part.rows))
        is_all = len(part.sources) == 1 and part.sources[0][1].layout is None  # outputs of the layer below
        if is_all and is_identity and len(part.rows) == part.n_inputs:
            return part
        entries = {(node, 0, start): w for node, row in enumerate(part.rows) for start, w in row.items()}
        return self._append(-1, part, (len(part.rows), 1, part.n_inputs), entries)

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
        return _Part([{i: 1.0} for i in range(shape[0])], ((len(self._layers) - 1, outputs),), shape[0])

    def _append_observed(self, part: _Part, entries: _Entries, terms: Sequence[int], n_nodes: int) -> _Part:
        """Append a layer for each observed term of one step; return the outputs of the last.

        The outputs of the others are pairs of a node of the step and the outcomes of the terms that follow.
        """
        for i, term in enumerate(terms):
            is_last = i == len(terms) - 1
            nodes: dict[tuple[int, ...], int] = {}
            by_output = {
                (node[0] if is_last else nodes.setdefault(node, len(nodes)), outcome, start): weight
                for (node, outcome, start), weight in entries.items()
            }
            n_outcomes = len(self._diagram.system.program.values[term]) + 1
            shape = n_nodes if is_last else max(len(nodes), 1), n_outcomes, part.n_inputs
            part = self._append(self._variables[term], part, shape, by_output)
            entries = {((node[0], *node[2:]), node[1], i): 1.0 for node, i in nodes.items()}
        return part


def _sum_numbers(
    sources: Sequence[int],
    targets: Sequence[Sequence[int]],
    weights: list[float],
    branches: Sequence[_Part],
    n_nodes: int,
) -> _Part:
    """Sum the weights of arcs times the numbers of the nodes to which they lead, by their source."""
    for own, branch in zip(targets, branches, strict=True):
        numbers = _scale_numbers(branch)
        weights = [weight * numbers[target] for weight, target in zip(weights, own, strict=True)]
    column = [0.0] * n_nodes
    for source, weight in zip(sources, weights, strict=True):
        column[source] += weight
    return _Part([{0: weight} for weight in column], (), 1)


def _scale_numbers(part: _Part) -> list[float]:
    """Return the numbers of a part without sources, scaled up if all of them are tiny."""
    numbers = [row[0] for row in part.rows]
    largest = max(numbers, default=1.0)
    return [number / largest for number in numbers] if 0 < largest < MIN_WEIGHT else numbers


def _rescale(rows: Sequence[dict[int, float]]) -> None:
    """Scale tiny weights up together: only their ratios matter."""
    largest = max([weight for row in rows for weight in row.values()], default=0.0)
    if 0 < largest < MIN_WEIGHT:
        for row in rows:
            for start in row:
                row[start] /= largest
