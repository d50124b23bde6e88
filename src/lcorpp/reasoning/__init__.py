"""Evidence to marginal: P-log programs, read, checked, compiled and answered.

program = read_plog("knowledge.plog")
marginal = program.posterior("intention", {"time": "afternoon", "classifier": "zero"})

The names below load their part of the room when they are first used: a command that asks one question need
not wait for numpy or clingo.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lcorpp.reasoning.circuit.compiled import Circuit
    from lcorpp.reasoning.circuit.storage import load_circuit
    from lcorpp.reasoning.classifier_rules import with_classifier
    from lcorpp.reasoning.engine import Engine, Estimate, ReasoningWarning, ask
    from lcorpp.reasoning.enumeration import Enumeration
    from lcorpp.reasoning.estimated import EstimatedDistribution
    from lcorpp.reasoning.explanation import Explanation, explain
    from lcorpp.reasoning.language.parser import parse_plog, parse_query, read_plog
    from lcorpp.reasoning.language.signature import Attribute
    from lcorpp.reasoning.language.syntax import Query
    from lcorpp.reasoning.program import Program, program_text
    from lcorpp.reasoning.worlds import World

_HOMES = {
    "circuit.compiled": ("Circuit",),
    "circuit.storage": ("load_circuit",),
    "classifier_rules": ("with_classifier",),
    "engine": ("Engine", "Estimate", "ReasoningWarning", "ask"),
    "enumeration": ("Enumeration",),
    "estimated": ("EstimatedDistribution",),
    "explanation": ("Explanation", "explain"),
    "language.parser": ("parse_plog", "parse_query", "read_plog"),
    "program": ("Program", "program_text"),
    "language.signature": ("Attribute",),
    "language.syntax": ("Query",),
    "worlds": ("World",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Attribute",
    "Circuit",
    "Engine",
    "Enumeration",
    "Estimate",
    "EstimatedDistribution",
    "Explanation",
    "Program",
    "Query",
    "ReasoningWarning",
    "World",
    "ask",
    "explain",
    "load_circuit",
    "parse_plog",
    "parse_query",
    "program_text",
    "read_plog",
    "with_classifier",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
