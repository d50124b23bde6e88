"""The choice between tables and the decision diagram for a question."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.factors.factor_graph import build_factor_graph, make_network_graph
from lcorpp.reasoning.factors.network import TableNetwork, list_question_terms
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Formula

ENTRIES_PER_NODE = 100.0
"""A node of a decision diagram takes as long as this many multiplications of tables, at least."""

MAX_NETWORKS = 10
"""The tables of a Bayesian network are kept for at most this many sets of interventions."""


def find_network(
    program: Program, do: Mapping[str, str], networks: dict[object, TableNetwork]
) -> TableNetwork | None:
    """Find the tables of a Bayesian network for all questions among those built so far, or build them."""
    key = frozenset(do.items())
    if key not in networks:
        network = choose_network(program, do, (), program.attributes)
        if network is None:
            return None
        if len(networks) >= MAX_NETWORKS:
            networks.clear()
        networks[key] = network
    return networks[key]


def choose_network(
    program: Program,
    do: Mapping[str, str],
    questions: Sequence[str],
    facts: Iterable[str],
    nodes: float = inf,
    observed: Sequence[Formula] = (),
    asked: Formula = (),
) -> TableNetwork | None:
    """Build the tables of a program; None if it has none, or the decision diagram is cheaper.

    Args:
        do: interventions, term -> value.
        questions: terms and joints that will be queried; without any, the number of the evidence.
        facts: terms that evidence will name, and further questions.
        nodes: an estimate of the nodes of the diagram.
        observed, asked: as in `ground_program`.
    """
    if isinstance(program, BayesianNetwork) and not (observed or asked):
        return TableNetwork(make_network_graph(program, do))
    given = [term for fact in facts for term in list_question_terms(fact)]
    terms = [*[term for question in questions for term in list_question_terms(question)], *given]
    tables = program.tables if isinstance(program, BayesianNetwork) else None
    source = program.skeleton if isinstance(program, BayesianNetwork) else program
    graph = build_factor_graph(ground_program(source, do, observed, asked), terms, tables)
    if graph is None:
        return None
    network = TableNetwork(graph)
    if tables is not None:
        return network
    try:
        return network if is_cheaper(network.estimate_cost(questions, given), nodes) else None
    except TooLargeError:
        return None


def is_cheaper(cost: float, nodes: float) -> bool:
    """Compare the multiplications of tables with the nodes of a decision diagram."""
    return cost < ENTRIES_PER_NODE * nodes
