"""Store a compiled circuit in one file: numbers, JSON and the program's text, no code.

The file is a numpy archive (.npz). Its entry `circuit` is JSON: format and version, the program's text,
inputs, queries and interventions, and for each layer its variable (key `label`), shape, outcomes and the
layers before it (key `sources`). The entries `<layer>/<outcome>` and `<layer>/every` are the matrices,
`<layer>/from/<source>` the nodes that are its inputs. Version 1 had a chain of layers, applied the other way
round, and a last row `ending`.
"""

from __future__ import annotations

import io
import json
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, LcorppError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.decision_diagram import MAX_ARCS
from lcorpp.reasoning.circuit.matrices import Layer, Matrix
from lcorpp.reasoning.language.parser import parse_plog
from lcorpp.reasoning.language.program import Program, program_text
from lcorpp.reasoning.resolve import resolve_interventions, resolve_subject

FORMAT, VERSION = "lcorpp circuit", 2

DECODING_ERRORS = (
    *(ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, MemoryError),
    *(EOFError, OSError, zipfile.BadZipFile, zlib.error, struct.error),
    *(SyntaxError, tokenize.TokenError),  # numpy parses the headers of arrays as Python
)
"""The exceptions of numpy, zipfile and json for damaged files."""


def save_circuit(circuit: Circuit, path: str | Path) -> None:
    """Write a circuit to a file that `load_circuit` reads.

    Raises:
        FileError: the file cannot be written.
    """
    arrays: dict[str, npt.NDArray[Any]] = {}
    layers = []
    for number, layer in enumerate(circuit.layers):
        outcomes = sorted(layer.matrices)
        layers.append(
            {
                "label": layer.variable,
                "shape": list(layer.total.shape),
                "outcomes": outcomes,
                "sources": [source for source, _ in layer.sources],
            }
        )
        for source, nodes in layer.sources:
            arrays[f"{number}/from/{source}"] = nodes
        for outcome in outcomes:
            arrays[f"{number}/{outcome}"] = _make_table(layer.matrices[outcome])
        if not outcomes:
            arrays[f"{number}/every"] = _make_table(layer.total)
    head = {
        "format": FORMAT,
        "version": VERSION,
        "file": circuit.program.file,
        "program": program_text(circuit.program),
        "semantics": circuit.program.semantics,
        "inputs": list(circuit.inputs),
        "queries": list(circuit.queries),
        "single": circuit.single,
        "do": circuit.do,
        "layers": layers,
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, circuit=np.array(json.dumps(head)), **arrays)  # type: ignore[arg-type]
    write_atomically(path, buffer.getvalue())


def load_circuit(path: str | Path) -> Circuit:
    """Read the file of `save_circuit`; the circuit gives exactly the same answers as the one that was saved.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: the file has another format, is damaged, or is of a newer version.
    """
    content = read_bytes(path)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        head = json.loads(str(arrays.pop("circuit")))
        if head["format"] != FORMAT:
            raise DataError(f"its format is {head['format']!r}")
        if head["version"] not in (1, VERSION):
            raise DataError(f"its version is {head['version']!r}; this lcorpp reads version {VERSION}")
        program = _parse_program(head)
        layers = [_read_layer(layer, number, arrays) for number, layer in enumerate(head["layers"])]
        if head["version"] == 1:
            layers = _reverse_chain(layers, _read_ending(arrays["ending"]))
        query = head["queries"][0] if head["single"] else head["queries"]
        circuit = Circuit(program, head["inputs"], query, head["do"], layers)
        _check_layers(circuit)
        return circuit
    except LcorppError as error:
        raise DataError(f"{path}: not a circuit that can be used: {error}") from None
    except DECODING_ERRORS as error:
        raise DataError(f"{path}: not a stored circuit, or a damaged one: {error}") from None


def _read_ending(ending: npt.NDArray[Any]) -> dict[tuple[int, int], float]:
    return _read_table(np.stack([np.arange(len(ending)), np.zeros(len(ending)), ending], 1), (len(ending), 1))


def _reverse_chain(layers: Sequence[Layer], ending: Mapping[tuple[int, int], float]) -> list[Layer]:
    """Convert the layers of version 1: the transposed matrices in reverse, after the last row."""
    result = [Layer(-1, (), {}, Matrix.from_entries((len(ending), 1), ending))]
    for layer in reversed(layers):
        sources = ((len(result) - 1, np.arange(layer.total.shape[0])),)
        matrices = {outcome: _transpose(matrix) for outcome, matrix in layer.matrices.items()}
        result.append(Layer(layer.variable, sources, matrices, _transpose(layer.total)))
    return result


def _transpose(matrix: Matrix) -> Matrix:
    entries = {(source, target): weight for (target, source), weight in matrix.list_entries().items()}
    return Matrix.from_entries((matrix.shape[1], matrix.shape[0]), entries)


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


def _check_layers(circuit: Circuit) -> None:
    """Check that each term has one layer, with outcomes in its range, and that the layers form a tree."""
    names = dict.fromkeys((*circuit.inputs, *circuit.queries))
    variables = sorted(layer.variable for layer in circuit.layers if layer.variable != -1)
    if variables != list(range(len(names))):
        raise DataError(f"its layers are those of {variables}, not of the {len(names)} terms")
    no_value = [len(circuit.values[name]) for name in names]
    for layer in circuit.layers:
        if any(not 0 <= o <= no_value[layer.variable] or layer.variable < 0 for o in layer.matrices):
            raise DataError(f"a layer has the outcomes {sorted(layer.matrices)}")
    used: list[int] = []
    for number, layer in enumerate(circuit.layers):
        n_inputs = layer.total.shape[1]
        if not layer.sources and n_inputs != 1:
            raise DataError(f"layer {number} takes {n_inputs} inputs, not 1")
        for source, nodes in layer.sources:
            if not 0 <= source < number or nodes.shape != (n_inputs,):
                raise DataError(f"layer {number} does not fit to layer {source} before it")
            if not ((nodes >= 0) & (nodes < circuit.layers[source].total.shape[0])).all():
                raise DataError(f"layer {number} has inputs that are no outputs of layer {source}")
            used.append(source)
    if sorted(used) != list(range(len(circuit.layers) - 1)) or circuit.layers[-1].total.shape[0] != 1:
        raise DataError("its layers do not end in one number")


def _make_table(matrix: Matrix) -> npt.NDArray[np.float64]:
    """Convert a matrix to an array (entries, 3): output, input, weight."""
    return np.array([(*key, weight) for key, weight in matrix.list_entries().items()]).reshape(-1, 3)


def _read_table(table: npt.NDArray[np.float64], shape: tuple[int, int]) -> dict[tuple[int, int], float]:
    entries = {(int(t), int(s)): float(w) for t, s, w in table}
    if not all(0 <= t < shape[0] and 0 <= s < shape[1] and 0 <= w < inf for (t, s), w in entries.items()):
        raise DataError(f"a matrix has entries outside of {shape}, or negative ones")
    return entries


def _read_layer(head: dict[str, Any], number: int, arrays: dict[str, Any]) -> Layer:
    shape = int(head["shape"][0]), int(head["shape"][1])
    if not all(0 <= size <= MAX_ARCS for size in shape):
        raise DataError(f"layer {number} has the shape {shape}")
    sources = tuple(
        [
            (int(source), arrays[f"{number}/from/{source}"].astype(np.intp))
            for source in head.get("sources", ())
        ]
    )
    by_outcome = {int(o): _read_table(arrays[f"{number}/{o}"], shape) for o in head["outcomes"]}
    if by_outcome:
        return Layer.from_entries(int(head["label"]), sources, shape, by_outcome)
    product = Matrix.from_entries(shape, _read_table(arrays[f"{number}/every"], shape))
    return Layer(int(head["label"]), sources, {}, product)
