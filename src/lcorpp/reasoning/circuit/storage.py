"""A compiled circuit in one file: numbers, JSON and the text of the program, nothing that runs when it is
loaded.

The file is a numpy archive (.npz). Its entry `circuit` is JSON: format and version, the program's text,
inputs, queries and interventions, and of each layer the label and the shape; `ending` and
`<layer>/<outcome>/...` are the matrices.
"""

from __future__ import annotations

import io
import json
import struct
import tokenize
import zipfile
import zlib
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, LcorppError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.matrices import Layer, Matrix
from lcorpp.reasoning.circuit.trellis import MAX_ARCS
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.parser import parse_plog
from lcorpp.reasoning.language.program import Program, program_text
from lcorpp.reasoning.resolve import resolve_interventions, resolve_term

FORMAT, VERSION = "lcorpp circuit", 1

DAMAGED = (
    *(ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, MemoryError),
    *(EOFError, OSError, zipfile.BadZipFile, zlib.error, struct.error),
    *(SyntaxError, tokenize.TokenError),  # numpy reads the heads of arrays as Python
)
"""What numpy, zipfile and json raise when bytes are not what they seem."""


def save_circuit(circuit: Circuit, path: str | Path) -> None:
    """Write a circuit to a file that `load_circuit` reads.

    Raises:
        FileError: the file cannot be written.
    """
    arrays: dict[str, npt.NDArray[Any]] = {"ending": circuit.ending}
    layers = []
    for number, layer in enumerate(circuit.layers):
        outcomes = sorted(layer.matrices)
        layers.append({"label": layer.label, "shape": list(layer.every.shape), "outcomes": outcomes})
        for outcome in outcomes:
            arrays[f"{number}/{outcome}"] = _table(layer.matrices[outcome])
        if not outcomes:
            arrays[f"{number}/every"] = _table(layer.every)
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
    """Read what `save_circuit` wrote; it answers exactly as the one that was saved.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: it is not such a file, is damaged, or of a newer version.
    """
    content = read_bytes(path)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        head = json.loads(str(arrays.pop("circuit")))
        if head["format"] != FORMAT:
            raise DataError(f"its format is {head['format']!r}")
        if head["version"] != VERSION:
            raise DataError(f"its version is {head['version']!r}; this lcorpp reads version {VERSION}")
        program = _program(head)
        layers = []
        width = 1
        for number, layer in enumerate(head["layers"]):
            layers.append(_layer(layer, number, arrays))
            if layer["shape"][1] != width:
                raise DataError(f"layer {number} takes {layer['shape'][1]} inputs, not {width}")
            width = layer["shape"][0]
        ending = np.asarray(arrays["ending"], dtype=np.float64)
        if ending.shape != (width,):
            raise DataError(f"its ending has the shape {ending.shape}, not ({width},)")
        if not (np.isfinite(ending).all() and (ending >= 0).all()):
            raise DataError("its ending has numbers that are no weights")
        query = head["queries"][0] if head["single"] else head["queries"]
        circuit = Circuit(program, head["inputs"], query, head["do"], layers, ending)
        _check_labels(circuit)
        return circuit
    except LcorppError as error:
        raise DataError(f"{path}: not a circuit that can be used: {error}") from None
    except DAMAGED as error:
        raise DataError(f"{path}: not a stored circuit, or a damaged one: {error}") from None


def _program(head: dict[str, Any]) -> Program:
    """The program, which must know all the terms of the circuit."""
    if head["semantics"] not in ("2009", "2018") or not isinstance(head["file"], str):
        raise DataError(f"its program is {head['file']!r} of {head['semantics']!r}")
    program = parse_plog(head["program"], file=head["file"], semantics=head["semantics"])
    for key in ("inputs", "queries"):
        terms = [canonical_text(resolve_term(program, name)) for name in head[key]]
        if terms != head[key] or (key == "inputs" and len(set(terms)) < len(terms)):
            raise DataError(f"its {key} are {head[key]}")
    if not head["queries"]:
        raise DataError("it asks for nothing")
    resolve_interventions(program, head["do"])
    return program


def _check_labels(circuit: Circuit) -> None:
    """Each term has one layer, with outcomes that it may have."""
    names = dict.fromkeys((*circuit.inputs, *circuit.queries))
    labels = sorted(layer.label for layer in circuit.layers if layer.label != -1)
    if labels != list(range(len(names))):
        raise DataError(f"its layers are those of {labels}, not of the {len(names)} terms")
    outcomes = [len(circuit.values[name]) for name in names]
    for layer in circuit.layers:
        if any(not 0 <= o <= outcomes[layer.label] or layer.label < 0 for o in layer.matrices):
            raise DataError(f"a layer has the outcomes {sorted(layer.matrices)}")


def _table(matrix: Matrix) -> npt.NDArray[np.float64]:
    """(entries, 3) target, source, weight."""
    return np.array([(*key, weight) for key, weight in matrix.entries().items()]).reshape(-1, 3)


def _matrix(table: npt.NDArray[np.float64], shape: tuple[int, int]) -> Matrix:
    entries = {(int(t), int(s)): float(w) for t, s, w in table}
    if not all(0 <= t < shape[0] and 0 <= s < shape[1] and 0 <= w < inf for (t, s), w in entries.items()):
        raise DataError(f"a matrix has entries outside of {shape}, or negative ones")
    return Matrix.of(shape, entries)


def _layer(head: dict[str, Any], number: int, arrays: dict[str, Any]) -> Layer:
    shape = int(head["shape"][0]), int(head["shape"][1])
    if not all(0 <= size <= MAX_ARCS for size in shape):
        raise DataError(f"layer {number} has the shape {shape}")
    matrices = {int(o): _matrix(arrays[f"{number}/{o}"], shape) for o in head["outcomes"]}
    if not matrices:
        return Layer(int(head["label"]), {}, _matrix(arrays[f"{number}/every"], shape))
    every: dict[tuple[int, int], float] = {}
    for matrix in matrices.values():
        for key, weight in matrix.entries().items():
            every[key] = every.get(key, 0.0) + weight
    return Layer(int(head["label"]), matrices, Matrix.of(shape, every))
