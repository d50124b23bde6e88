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
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, LcorppError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.reasoning.answers import list_values
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.decision_diagram import MAX_ARCS
from lcorpp.reasoning.circuit.matrices import Groups, Index, Layer
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
        arrays |= {f"{number}/from/{source}": nodes.keys for source, nodes in layer.sources}
        matrix, pairs = layer.matrix, layer.matrix.columns.keys
        table = np.stack([matrix.rows.keys, layer.inputs.keys[pairs], matrix.weights], axis=1)
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
        layers = _read_layers(head, arrays, program)
        query = head["queries"][0] if head["single"] else head["queries"]
        return Circuit(program, head["inputs"], query, head["do"], layers)
    except LcorppError as error:
        raise DataError(f"{path}: not a circuit that can be used: {error}") from None
    except DECODING_ERRORS as error:
        raise DataError(f"{path}: not a stored circuit, or a damaged one: {error}") from None


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
) -> list[Layer]:
    """Read layers; check that each term has one, with outcomes in its range, and that they form a tree."""
    names = dict.fromkeys((*head["inputs"], *head["queries"]))
    n_outcomes = {-1: 1} | {i: len(list_values(program, name)) + 1 for i, name in enumerate(names)}
    stored = [_StoredLayer.read(number, own, arrays) for number, own in enumerate(head["layers"])]
    if head["version"] == 1:
        ending = dict(enumerate(arrays["ending"].tolist()))
        last = _StoredLayer(-1, [], (len(ending), 1), {(i, 0, 0): weight for i, weight in ending.items()})
        stored = [last, *[layer.reverse(number) for number, layer in enumerate(stored[::-1])]]
    variables = sorted([layer.variable for layer in stored if layer.variable != -1])
    if variables != list(range(len(names))):
        raise DataError(f"its layers are those of {variables}, not of the {len(names)} terms")
    layers: list[Layer] = []
    used: list[int] = []
    for number, layer in enumerate(stored):
        n_outputs, n_inputs = layer.shape
        shape = n_outputs, n_outcomes[layer.variable], n_inputs
        if not all(0 <= size <= MAX_ARCS for size in shape) or (n_inputs != 1 and not layer.sources):
            raise DataError(f"layer {number} has the shape {layer.shape}")
        for key, weight in layer.entries.items():
            if not (0 <= weight < inf and all(0 <= i < size for i, size in zip(key, shape, strict=True))):
                raise DataError(f"a matrix has entries outside of {layer.shape}, or negative ones")
        sources = []
        for source, nodes in layer.sources:
            if not 0 <= source < number or nodes.shape != (n_inputs,):
                raise DataError(f"layer {number} does not fit to layer {source} before it")
            n_nodes = layers[source].matrix.rows.size
            if not ((nodes >= 0) & (nodes < n_nodes)).all():
                raise DataError(f"layer {number} has inputs that are no outputs of layer {source}")
            sources.append((source, Groups(nodes, n_nodes)))
            used.append(source)
        layers.append(Layer.from_entries(layer.variable, sources, shape, layer.entries))
    if sorted(used) != list(range(len(layers) - 1)) or layers[-1].matrix.rows.size != 1:
        raise DataError("its layers do not end in one number")
    return layers


class _StoredLayer(NamedTuple):
    """A layer of a file, not checked yet.

    sources: (layer, nodes) for each branch.
    shape: (outputs, inputs).
    entries: (output, outcome, input) -> weight.
    """

    variable: int
    sources: Sequence[tuple[int, Index]]
    shape: tuple[int, int]
    entries: Mapping[tuple[int, int, int], float]

    @classmethod
    def read(
        cls, number: int, head: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]]
    ) -> _StoredLayer:
        """Read a layer; version 1 has no sources."""
        sources = [(int(s), arrays[f"{number}/from/{s}"].astype(np.intp)) for s in head.get("sources", ())]
        n_outputs, n_inputs = map(int, head["shape"])
        tables = {int(outcome): arrays[f"{number}/{outcome}"] for outcome in head["outcomes"]}
        entries = {
            (int(output), outcome, int(start)): weight
            for outcome, table in (tables or {0: arrays[f"{number}/every"]}).items()
            for output, start, weight in table.tolist()
        }
        return cls(int(head["label"]), sources, (n_outputs, n_inputs), entries)

    def reverse(self, number: int) -> _StoredLayer:
        """Transpose a layer of version 1; `number` is that of the layer before it."""
        entries = {(start, outcome, output): w for (output, outcome, start), w in self.entries.items()}
        sources = [(number, np.arange(self.shape[0]))]
        return _StoredLayer(self.variable, sources, self.shape[::-1], entries)
