"""Store a compiled circuit in one file: numbers, JSON and the program's text, no code.

The file is a numpy archive (.npz). Its entry `circuit` is JSON: format and version, the program's text,
inputs, queries and interventions, and for each layer its variable, shape (outputs, outcomes, inputs) and the
layers before it (key `sources`). The entries `<layer>/from/<source>` are the outputs of these layers that are
factors of its inputs, `<layer>/first` is the first entry of each output, `<layer>/entries` has the outcome
and the input of each entry, with the exponent of 2 if weights are tiny, and `<layer>/weights` its weight.
Circuits of tables (`tables` is true) are those of the program; files of versions 1 and 2 are compiled again.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.archives import locate_damage, pack_archive, unpack_archive
from lcorpp.errors import DataError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.reasoning._diagram import Layers
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.circuit.compiler import compile_program
from lcorpp.reasoning.language.parser import parse_plog
from lcorpp.reasoning.language.program import Program, program_text
from lcorpp.reasoning.questions import list_values
from lcorpp.reasoning.resolve import resolve_interventions, resolve_subject
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp circuit", 3, older=(1, 2))

MAX_SIZE = 2**31
"""Layers have fewer outputs, outcomes and inputs."""


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
    stored: Any = circuit.layers.store() if circuit.layers is not None else []
    for number, (variable, shape, sources, first, outcomes, inputs, weights, exponents) in enumerate(stored):
        arrays |= {f"{number}/from/{source}": nodes for source, nodes in sources}
        arrays[f"{number}/first"], arrays[f"{number}/weights"] = first, weights
        arrays[f"{number}/entries"] = np.stack(
            [outcomes, inputs, exponents] if len(exponents) else [outcomes, inputs]
        )
        layers.append({"variable": variable, "shape": shape, "sources": [source for source, _ in sources]})
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
        if head["version"] < FORMAT.version or head["tables"]:
            return compile_program(program, head["inputs"], query, head["do"])
        return Circuit(program, head["inputs"], query, head["do"], _read_layers(head, arrays, program))


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


def _read_layers(head: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]], program: Program) -> Layers:
    """Read the layers.

    Raises:
        DataError: a term has not one layer, with outcomes in its range, or the layers do not form a tree.
    """
    stored = []
    for number, own in enumerate(head["layers"]):
        outcomes, inputs, *exponents = arrays[f"{number}/entries"].astype(np.int64)
        sources = [(source, arrays[f"{number}/from/{source}"].astype(np.int64)) for source in own["sources"]]
        first = arrays[f"{number}/first"].astype(np.int64)
        weights = arrays[f"{number}/weights"].astype(np.float64)
        shape = _, _, _ = tuple([int(size) for size in own["shape"]])
        if not all(0 < size < MAX_SIZE for size in shape):
            raise DataError(f"layer {number} has the shape {own['shape']}")
        stored.append(
            (own["variable"], shape, sources, first, outcomes, inputs, weights, *(exponents or [inputs[:0]]))
        )
    names = dict.fromkeys((*head["inputs"], *head["queries"]))
    n_outcomes = [len(list_values(program, name)) + 1 for name in names]
    found = sorted([(own[0], own[1][1]) for own in stored if own[0] != -1])
    if found != list(enumerate(n_outcomes)):
        raise DataError(
            f"its layers are those of {[variable for variable, _ in found]}, not of the {len(names)} terms"
        )
    try:
        return Layers(stored)
    except (TypeError, ValueError) as error:
        raise DataError(str(error)) from error
