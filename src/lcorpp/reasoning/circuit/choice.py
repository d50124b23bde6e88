"""The choice between tables and the decision diagram for a question.

The decision diagram decides the terms in an order in which causes come first, so that its size is exponential
in the width of such orders. Tables are summed in any order, but each must be small. Where a program is no
product of small tables, its recursions and other large parts become blocks, each a table that a decision
diagram computes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.diagram.decision_diagram import (
    DecisionDiagram,
    build_decision_diagram,
    find_small_diagram,
)
from lcorpp.reasoning.grounding.ground_program import GroundProgram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Formula
from lcorpp.reasoning.questions import list_question_terms
from lcorpp.reasoning.transitions.transition_system import TransitionSystem

if TYPE_CHECKING:
    from lcorpp.reasoning.factors.network import TableNetwork
    from lcorpp.reasoning.language.networks.bayesian_network import ProbabilityTable

ENTRIES_PER_NODE = 100.0
"""A node of a decision diagram takes as long as this many multiplications of tables, at least."""

MAX_NETWORKS = 10
"""The tables of a Bayesian network are kept for at most this many sets of interventions."""


class Grounded(Protocol):
    """A program grounded for a question."""

    @property
    def ground(self) -> GroundProgram:
        """The ground program."""

    @property
    def system(self) -> TransitionSystem:
        """The program as a transition system."""


def choose_engine(
    program: Program,
    do: Mapping[str, str],
    questions: Sequence[str],
    facts: Sequence[str],
    model: Grounded,
    networks: dict[object, TableNetwork] | None = None,
    observed: Sequence[Formula] = (),
    asked: Formula = (),
    progress: Callable[[float, str], None] | None = None,
) -> TableNetwork | DecisionDiagram:
    """Build the tables of a program, or its decision diagram where it has none or this is cheaper.

    Args:
        do: interventions, term -> value.
        questions: terms and joints that will be queried; without any, the number of the evidence.
        facts: terms that evidence will name.
        model: the program with all these terms.
        networks: the tables of a Bayesian network for all questions, by interventions; new ones are added.
        observed, asked: as in `ground_program`.
        progress: as in `build_decision_diagram`.

    Raises:
        TooLargeError, ProgramError: as `build_decision_diagram`.
    """
    network: TableNetwork | None = None
    if program.has_tables:
        from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork  # imports numpy

        if observed or asked:
            assert isinstance(program, BayesianNetwork)
            ground = ground_program(program.skeleton, do, observed, asked)
            network = _build_network(ground, questions, facts, inf, program.tables)
        else:
            network = _find_network(program, do, networks if networks is not None else {})
    else:
        system = model.system
        if system.tree.is_wide:
            if system.tree.may_have_blocks and (diagram := find_small_diagram(system)):
                return diagram
            network = _build_network(model.ground, questions, facts, system.tree.nodes)
    return network or build_decision_diagram(model.system, progress=progress)


def _find_network(
    program: Program, do: Mapping[str, str], networks: dict[object, TableNetwork]
) -> TableNetwork:
    """Find the tables of a Bayesian network for all questions among those built so far, or build them."""
    key = frozenset(do.items())
    if key not in networks:
        from lcorpp.reasoning.factors.network import make_table_network  # imports numpy

        if len(networks) >= MAX_NETWORKS:
            networks.clear()
        networks[key] = make_table_network(program, do)
    return networks[key]


def _build_network(
    program: GroundProgram,
    questions: Sequence[str],
    facts: Sequence[str],
    nodes: float,
    tables: Mapping[str, ProbabilityTable] = MappingProxyType({}),
) -> TableNetwork | None:
    """Build the tables of a program for some questions; None if the decision diagram is cheaper.

    Args:
        nodes: an estimate of the nodes of the diagram; that of a Bayesian network is never cheaper.
        tables: as in `build_factor_graph`.
    """
    from lcorpp.reasoning.factors.division import divide_program

    given = [term for fact in facts for term in list_question_terms(fact)]
    terms = [*[term for question in questions for term in list_question_terms(question)], *given]
    parents = {name: table.parents for name, table in tables.items()}
    division = divide_program(program, terms, parents)
    if division is None or (division.blocks and not (tables or division.has_wide_tables)):
        return None
    from lcorpp.reasoning.factors.factor_graph import build_factor_graph  # imports numpy
    from lcorpp.reasoning.factors.network import TableNetwork

    graph = build_factor_graph(division, tables)
    if graph is None:
        return None
    network = TableNetwork(graph)
    try:
        return network if tables or is_cheaper(network.estimate_cost(questions, given), nodes) else None
    except TooLargeError:
        return None


def is_cheaper(cost: float, nodes: float) -> bool:
    """Compare the multiplications of tables with the nodes of a decision diagram."""
    return cost < ENTRIES_PER_NODE * nodes
