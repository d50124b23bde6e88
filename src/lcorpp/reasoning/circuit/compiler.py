"""Compilation: a program becomes tables, or a transition system, its decision diagram and layers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from lcorpp.errors import ProgramError
from lcorpp.reasoning.circuit.choice import choose_engine
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.diagram.decision_diagram import DecisionDiagram
from lcorpp.reasoning.diagram.layers import build_layers
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
    engine = choose_engine(program, do, circuit.queries, circuit.inputs, circuit, networks=networks)
    if isinstance(engine, DecisionDiagram):
        circuit.diagram = engine
        circuit.layers = build_layers(engine, dict.fromkeys((*names, *queries)))
    else:
        circuit.network = engine
    return circuit
