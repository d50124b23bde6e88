"""Compilation, steps 1 to 4: transition system -> decision diagram -> matrices between the observed terms."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from lcorpp.errors import ProgramError
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.matrices import Layer, Matrix
from lcorpp.reasoning.circuit.trellis import Trellis, build_trellis
from lcorpp.reasoning.circuit.world_queries import WorldQueries, rescale
from lcorpp.reasoning.gc_pause import pause_gc
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import resolve_interventions, resolve_term, resolve_terms
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Array

MIN_WEIGHT = 1e-60
"""The products of matrices are scaled up if all weights are below this."""

_Entries = Mapping[tuple[int, tuple[int, tuple[int, ...]], int], float]
"""(outcome of the next observed term, (target state, outcomes of the others), input) -> weight"""


@pause_gc()
def compile_program(
    program: Program, inputs: Sequence[str], query: str | Sequence[str], do: Mapping[str, str]
) -> Circuit:
    """Compile a program.

    Args:
        inputs: the terms that evidence may name; an attribute with arguments is short for all its terms.
        query: a term, or several.
        do: interventions, term -> value.

    Raises:
        ProgramError: a name is unknown, a world breaks a condition of the language, or there are cr-rules.
        TooLargeError: the program is too large to be compiled.
    """
    if program.has_cr_rules:
        raise ProgramError(
            f"{program.file}: a program with cr-rules cannot be compiled: an observation may create worlds;"
            " ask for one posterior at a time"
        )
    names = list(dict.fromkeys(term for name in inputs for term in resolve_terms(program, name)))
    queries = canonical_text(resolve_term(program, query)) if isinstance(query, str) else [
        canonical_text(resolve_term(program, name)) for name in query
    ]  # fmt: skip
    do = resolve_interventions(program, do)
    observed = dict.fromkeys((*names, *((queries,) if isinstance(queries, str) else queries)))
    trellis = build_trellis(build_transition_system(ground_program(program, do), observed))
    layers, ending = build_layers(trellis, list(observed))
    circuit = Circuit(program, names, queries, do, layers, ending, WorldQueries(trellis))
    circuit.prepare()
    return circuit


def build_layers(trellis: Trellis, names: Sequence[str]) -> tuple[list[Layer], Array]:
    """Sum out all terms but the observed ones.

    Args:
        names: the observed terms; one that no rule names has no value in any world.

    Returns:
        (layers, ending): the layers in order, applied to the column [1], and the row that ends the product.
    """
    system, layers = trellis.system, []
    variables: dict[int, int] = {}  # observed term -> its index among them
    for i, name in enumerate(names):
        if name in system.term_numbers:
            variables[system.term_numbers[name]] = i
        else:
            no_value = len(system.program.source.attributes[name.partition("(")[0]].values)
            layers.append(Layer.from_entries(i, (1, 1), {no_value: {(0, 0): 1.0}}))
    weights = trellis.compute_weights()
    width = 1  # inputs of the next layer
    # state -> input -> weight: the product since the last layer, row by row
    product: list[dict[int, float]] = [{0: 1.0}] if trellis.level_sizes[0] else []
    n_multiplied = 0  # arcs in the product
    for step, (sources, targets, outcomes) in enumerate(trellis.arcs):
        terms = system.order[step]
        n_targets = trellis.level_sizes[step + 1]
        own = [i for i, term in enumerate(terms) if term in variables]
        n_multiplied += len(sources)
        if own:
            # the outcomes of the observed terms after the first, which later layers distinguish
            others = [tuple([trellis.outcomes[o][0][i] for i in own[1:]]) for o in outcomes]
            entries: dict[tuple[int, tuple[int, tuple[int, ...]], int], float] = {}
            for source, target, outcome, rest in zip(sources, targets, outcomes, others, strict=True):
                weight, value = weights[outcome], trellis.outcomes[outcome][0][own[0]]
                for start, factor in product[source].items():
                    key = (value, (target, rest), start)
                    entries[key] = entries.get(key, 0.0) + factor * weight
            width = _append_observed(layers, entries, [variables[terms[i]] for i in own], width, n_targets)
            product, n_multiplied = [{i: 1.0} for i in range(n_targets)], 0
            continue
        arcs = zip(sources, targets, outcomes, strict=True)
        product = _multiply_step(product, width, n_targets, arcs, weights)
        if not step % 16:
            rescale(product, MIN_WEIGHT)
        if width > 1 and sum(map(len, product)) > 4 * n_multiplied + 64:  # the product becomes dense
            matrix = {(target, start): w for target, row in enumerate(product) for start, w in row.items()}
            layers.append(Layer(-1, {}, Matrix.from_entries((n_targets, width), matrix)))
            width = n_targets
            product, n_multiplied = [{i: 1.0} for i in range(n_targets)], 0
    ending = np.zeros(width)
    for row in product:
        for start, factor in row.items():
            ending[start] += factor
    return layers, ending


def _multiply_step(
    product: Sequence[Mapping[int, float]],
    width: int,
    n_targets: int,
    arcs: Iterable[tuple[int, int, int]],
    weights: Sequence[float],
) -> list[dict[int, float]]:
    """Multiply the product by the matrix of one step."""
    if width == 1:
        column = [row.get(0, 0.0) for row in product]
        sums = [0.0] * n_targets
        for source, target, outcome in arcs:
            sums[target] += column[source] * weights[outcome]
        return [{0: weight} for weight in sums]
    following: list[dict[int, float]] = [{} for _ in range(n_targets)]
    for source, target, outcome in arcs:
        weight, row = weights[outcome], following[target]
        for start, factor in product[source].items():
            if start in row:
                row[start] += factor * weight
            else:
                row[start] = factor * weight
    return following


def _append_observed(
    layers: list[Layer], entries: _Entries, variables: Sequence[int], width: int, n_targets: int
) -> int:
    """Append a layer for each observed term of one step; return the width of the next layer.

    The nodes between these layers are pairs of a target state and the outcomes of the remaining terms.
    """
    for number, variable in enumerate(variables):
        is_last = number == len(variables) - 1
        nodes: dict[tuple[int, tuple[int, ...]], int] = {}
        by_outcome: dict[int, dict[tuple[int, int], float]] = {}
        for (value, node, start), weight in entries.items():
            target = node[0] if is_last else nodes.setdefault(node, len(nodes))
            own = by_outcome.setdefault(value, {})
            own[target, start] = own.get((target, start), 0.0) + weight
        height = n_targets if is_last else max(len(nodes), 1)
        layers.append(Layer.from_entries(variable, (height, width), by_outcome))
        width = height
        entries = {(rest[0], (target, rest[1:]), i): 1.0 for (target, rest), i in nodes.items()}
    return width
