"""From a program to a circuit: walk through its states once, then multiply out all that was not asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from lcorpp.errors import ProgramError
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.matrices import Layer, Matrix
from lcorpp.reasoning.circuit.trellis import Trellis, build_trellis
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.gc_pause import gc_paused
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import resolve_interventions, resolve_term, resolve_terms
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Array


@gc_paused()
def compile_program(
    program: Program, inputs: Sequence[str], query: str | Sequence[str], do: Mapping[str, str]
) -> Circuit:
    """Compile a program.

    Args:
        inputs: the terms that evidence may name; an attribute with arguments stands for all its terms.
        query: a term, or several.
        do: interventions, term -> value.

    Raises:
        ProgramError: a name is unknown, a world breaks a condition of the language, or there are cr-rules.
        TooLargeError: the program has too many states.
    """
    if program.has_cr_rules:
        raise ProgramError(
            f"{program.file}: a program with cr-rules cannot be compiled: an observation may create worlds;"
            " ask for one posterior at a time"
        )
    names = list(dict.fromkeys(found for name in inputs for found in resolve_terms(program, name)))
    queries = canonical_text(resolve_term(program, query)) if isinstance(query, str) else [
        canonical_text(resolve_term(program, name)) for name in query
    ]  # fmt: skip
    do = resolve_interventions(program, do)
    observed = dict.fromkeys((*names, *((queries,) if isinstance(queries, str) else queries)))
    built: Trellis = build_trellis(build_transition_system(program, do, wanted=observed))
    layers, ending = labelled_layers(built, list(observed))
    circuit = Circuit(program, names, queries, do, layers, ending, WorldQueries(built))
    circuit.prepare()
    return circuit


def labelled_layers(built: Trellis, names: Sequence[str]) -> tuple[list[Layer], Array]:
    """The layers for some terms; a term that no rule speaks of never has a value, which is a layer too."""
    index = built.plan.index
    labels = {index[name]: i for i, name in enumerate(names) if name in index}
    layers, ending = multiply_out(built, labels)
    missing = [i for i, name in enumerate(names) if name not in index]
    never = [
        Layer.never(i, len(built.plan.ground.source.attributes[names[i].partition("(")[0]].values))
        for i in missing
    ]
    return [*never, *layers], ending


TINY = 1e-60
"""Weights below this are scaled up: only their ratios matter, and a long product would vanish."""


def multiply_out(paths: Trellis, labels: Mapping[int, int]) -> tuple[list[Layer], Array]:
    """Multiply out everything between the observed terms.

    Args:
        labels: term -> its position among the observed ones.

    Returns:
        (layers, ending): the layers in order, applied to the column [1], and the row that ends the product.
    """
    weights, asked = paths.floats(), set(labels)
    layers: list[Layer] = []
    width = 1
    carried: list[dict[int, float]] = [{0: 1.0}] if paths.layers[0] else []  # state -> input -> weight
    spent = 0
    for position, (sources, targets, moves) in enumerate(paths.edges):
        terms = paths.plan.order[position]
        count = paths.layers[position + 1]
        own = [] if asked.isdisjoint(terms) else [i for i, term in enumerate(terms) if term in asked]
        spent += len(sources)
        if own:
            nodes = [
                tuple([paths.moves[m][0][i] for i in own[1:]]) for m in moves
            ]  # what the labels after the first one still have to tell apart
            entries: dict[tuple[int, tuple[int, tuple[int, ...]], int], float] = {}
            for source, target, move, rest in zip(sources, targets, moves, nodes, strict=True):
                weight, value = weights[move], paths.moves[move][0][own[0]]
                for start, carry in carried[source].items():
                    key = (value, (target, rest), start)
                    entries[key] = entries.get(key, 0.0) + carry * weight
            width = _labelled(layers, entries, [labels[terms[i]] for i in own], width, count)
            carried, spent = [{i: 1.0} for i in range(count)], 0
            continue
        carried = _carried_on(carried, width, count, zip(sources, targets, moves, strict=True), weights)
        if not position % 16:
            _scale(carried)
        if width > 1 and sum(map(len, carried)) > 4 * spent + 64:
            layers.append(_plain(carried, width))
            width = count
            carried, spent = [{i: 1.0} for i in range(count)], 0
    ending = np.zeros(width)
    for row in carried:
        for start, carry in row.items():
            ending[start] += carry
    return layers, ending


def _carried_on(
    carried: Sequence[Mapping[int, float]],
    width: int,
    count: int,
    edges: Iterable[tuple[int, int, int]],
    weights: Sequence[float],
) -> list[dict[int, float]]:
    """The weights from each input to each state, one step further."""
    if width == 1:
        plain = [row.get(0, 0.0) for row in carried]
        sums = [0.0] * count
        for source, target, move in edges:
            sums[target] += plain[source] * weights[move]
        return [{0: weight} for weight in sums]
    following: list[dict[int, float]] = [{} for _ in range(count)]
    for source, target, move in edges:
        weight, into = weights[move], following[target]
        for start, carry in carried[source].items():
            if start in into:
                into[start] += carry * weight
            else:
                into[start] = carry * weight
    return following


def _labelled(
    layers: list[Layer],
    entries: Mapping[tuple[int, tuple[int, tuple[int, ...]], int], float],
    labels: Sequence[int],
    width: int,
    count: int,
) -> int:
    """Append a layer for each label of one step; nodes between them remember the values still to be told."""
    for number, label in enumerate(labels):
        last = number == len(labels) - 1
        nodes: dict[tuple[int, tuple[int, ...]], int] = {}
        split: dict[int, dict[tuple[int, int], float]] = {}
        for (value, node, start), weight in entries.items():
            target = node[0] if last else nodes.setdefault(node, len(nodes))
            part = split.setdefault(value, {})
            part[target, start] = part.get((target, start), 0.0) + weight
        height = count if last else max(len(nodes), 1)
        layers.append(_layer(label, split, (height, width)))
        width = height
        entries = {(rest[0], (target, rest[1:]), i): 1.0 for (target, rest), i in nodes.items()}
    return width


def _layer(label: int, split: Mapping[int, Mapping[tuple[int, int], float]], shape: tuple[int, int]) -> Layer:
    every: dict[tuple[int, int], float] = {}
    for part in split.values():
        for key, weight in part.items():
            every[key] = every.get(key, 0.0) + weight
    return Layer(label, {v: Matrix.of(shape, split[v]) for v in sorted(split)}, Matrix.of(shape, every))


def _plain(carried: Sequence[Mapping[int, float]], width: int) -> Layer:
    entries = {(target, start): w for target, row in enumerate(carried) for start, w in row.items()}
    return Layer(-1, {}, Matrix.of((len(carried), width), entries))


def _scale(carried: list[dict[int, float]]) -> None:
    largest = max((weight for row in carried for weight in row.values()), default=0.0)
    if 0 < largest < TINY:
        for row in carried:
            for start in row:
                row[start] /= largest
