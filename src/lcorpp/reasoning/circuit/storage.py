"""Store a compiled circuit in one file: numbers, JSON and the program's text, no code.

The file is a numpy archive (.npz). Its entry `circuit` is JSON: format and version, the program's text,
inputs, queries and interventions, and for each layer its variable (key `label`), shape (outputs, inputs),
outcomes and the layers before it (key `sources`). The entries `<layer>/<outcome>`, or `<layer>/every` without
outcomes, are tables of output, input and weight, as text if weights are below the range of floating point
(earlier files have an exponent of 2 as a fourth column); `<layer>/from/<source>` are the nodes that are its
inputs. Files of version 1, a chain of layers, are compiled again; so are circuits of tables
(`tables` is true), which are those of the program.
"""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.archives import locate_damage, pack_archive, unpack_archive
from lcorpp.errors import DataError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.compiler import compile_program
from lcorpp.reasoning.circuit.decision_diagram import MAX_ARCS
from lcorpp.reasoning.circuit.matrices import WIDE, Groups, Layer
from lcorpp.reasoning.language.parser import parse_plog
from lcorpp.reasoning.language.program import Program, program_text
from lcorpp.reasoning.questions import list_values
from lcorpp.reasoning.resolve import resolve_interventions, resolve_subject
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp circuit", 2, older=(1,))

MAX_WEIGHT = 1e100
"""Larger weights are not read; those of probabilities are at most 1."""


def save_circuit(circuit: Circuit, path: str | Path) -> None:
    """Write a circuit to a file that `load_circuit` reads.

    Raises:
        FileError: the file cannot be written.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> from lcorpp.reasoning import load_circuit, save_circuit
        >>> coins = parse_plog("a, b : boolean. random(a). random(b). pr(b | a) = 3/4. pr(b | -a) = 1/4.")
        >>> save_circuit(Reasoner(coins).compile(["a"], "b"), "coins.npz")
        >>> load_circuit("coins.npz")({"a": "true"})
        Distribution(true: 0.75, false: 0.25)
    """
    arrays: dict[str, npt.NDArray[Any]] = {}
    layers = []
    for number, layer in enumerate(circuit.layers):
        arrays |= {f"{number}/from/{source}": nodes.keys for source, nodes in layer.sources}
        matrix, pairs = layer.matrix, layer.matrix.columns.keys
        columns: list[npt.NDArray[Any]] = [matrix.rows.keys, layer.inputs.keys[pairs], matrix.weights]
        if matrix.weights.dtype == object:  # decimal numbers
            columns = [column.astype(str) for column in columns]
        table = np.stack(columns, axis=1)
        own = layer.outcomes.keys[pairs]
        outcomes = [] if layer.variable < 0 else np.unique(own).tolist()
        arrays |= {f"{number}/{outcome}": table[own == outcome] for outcome in outcomes}
        if not outcomes:
            arrays[f"{number}/every"] = table
        layers.append(
            {
                "label": layer.variable,
                "shape": [matrix.rows.size, layer.inputs.size],
                "outcomes": outcomes,
                "sources": [source for source, _ in layer.sources],
            }
        )
    head = {
        "file": circuit.program.file,
        "program": program_text(circuit.program),
        "semantics": circuit.program.semantics,
        "inputs": list(circuit.inputs),
        "queries": list(circuit.queries),
        "single": circuit.single,
        "do": circuit.do,
        "layers": layers,
        "tables": circuit.network is not None,
    }
    write_atomically(path, pack_archive(FORMAT, head, arrays))


def load_circuit(path: str | Path) -> Circuit:
    """Read the file of `save_circuit`; the circuit gives exactly the same answers as the one that was saved.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: the file has another format, is damaged, or is of a newer version.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> from lcorpp.reasoning import load_circuit, save_circuit
        >>> die = parse_plog("sides = {1..6}. roll : sides. random(roll). pr(roll=6) = 1/2.")
        >>> save_circuit(Reasoner(die).compile([], "roll"), "die.npz")
        >>> load_circuit("die.npz").queries
        ('roll',)
    """
    content = read_bytes(path)
    with locate_damage(path, "circuit"):
        head, arrays = unpack_archive(FORMAT, content)
        program = _parse_program(head)
        query = head["queries"][0] if head["single"] else head["queries"]
        is_current = head["version"] == FORMAT.version and not head.get("tables")
        layers = _read_layers(head, arrays, program) if is_current else None
        if layers is None:
            return compile_program(program, head["inputs"], query, head["do"])
        return Circuit(program, head["inputs"], query, head["do"], layers)


def _parse_program(head: dict[str, Any]) -> Program:
    """Parse the program and check that it knows all terms of the circuit."""
    program = parse_plog(head["program"], file=head["file"], semantics=head["semantics"])
    for key in ("inputs", "queries"):
        terms = [resolve_subject(program, name) for name in head[key]]
        if terms != head[key] or (key == "inputs" and len(set(terms)) < len(terms)):
            raise DataError(f"its {key} are {head[key]}")
    if not head["queries"]:
        raise DataError("it has no queries")
    resolve_interventions(program, head["do"])
    return program


def _read_layers(
    head: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]], program: Program
) -> list[Layer] | None:
    """Read the layers; None if a weight is 0: an earlier lcorpp may have lost tiny weights.

    Raises:
        DataError: a term has not one layer, with outcomes in its range, or the layers do not form a tree.
    """
    names = dict.fromkeys((*head["inputs"], *head["queries"]))
    n_outcomes = {-1: 1} | {i: len(list_values(program, name)) + 1 for i, name in enumerate(names)}
    layers: list[Layer] = []
    used: list[int] = []
    has_zeros = False
    for number, own in enumerate(head["layers"]):
        n_outputs, n_inputs = map(int, own["shape"])
        shape = n_outputs, n_outcomes[own["label"]], n_inputs
        if not all(0 <= size <= MAX_ARCS for size in shape) or (n_inputs != 1 and not own["sources"]):
            raise DataError(f"layer {number} has the shape {own['shape']}")
        entries: dict[tuple[int, int, int], Any] = {}
        for outcome in own["outcomes"] or ["every"]:
            for output, start, weight, *exponent in arrays[f"{number}/{outcome}"].tolist():
                key = int(output), 0 if outcome == "every" else int(outcome), int(start)
                if isinstance(weight, str) or exponent:
                    weight = WIDE.multiply(Decimal(weight), WIDE.power(2, int(*exponent)))
                inside = all(0 <= i < size for i, size in zip(key, shape, strict=True))
                if not (inside and 0 <= weight < MAX_WEIGHT):
                    raise DataError(f"a matrix has entries outside of {shape}, or that are not weights")
                has_zeros |= not weight
                entries[key] = weight
        sources = []
        for source in own["sources"]:
            nodes = arrays[f"{number}/from/{source}"].astype(np.intp)
            if not 0 <= source < number or nodes.shape != (n_inputs,):
                raise DataError(f"layer {number} does not fit layer {source} before it")
            n_nodes = layers[source].matrix.rows.size
            if not ((nodes >= 0) & (nodes < n_nodes)).all():
                raise DataError(f"layer {number} has inputs that are not outputs of layer {source}")
            sources.append((source, Groups(nodes, n_nodes)))
            used.append(source)
        layers.append(Layer.from_entries(own["label"], sources, shape, entries))
    variables = sorted([layer.variable for layer in layers if layer.variable != -1])
    if variables != list(range(len(names))):
        raise DataError(f"its layers are those of {variables}, not of the {len(names)} terms")
    if sorted(used) != list(range(len(layers) - 1)) or layers[-1].matrix.rows.size != 1:
        raise DataError("its layers do not end in one number")
    return None if has_zeros else layers
