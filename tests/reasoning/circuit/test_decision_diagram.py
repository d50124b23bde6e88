"""Decision diagrams: nodes, arcs and their outcomes."""

from __future__ import annotations

from fractions import Fraction

from lcorpp.reasoning import Reasoner, parse_plog
from lcorpp.reasoning.circuit.decision_diagram import build_decision_diagram
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions.transition_system import build_transition_system

COINS = parse_plog(
    "coin = {heads, tails}. c1, c2 : coin. random(c1). random(c2). :- c1=tails, c2=tails.", file="coins.plog"
)
HALF = Fraction(1, 2)


def test_two_coins_that_do_not_both_show_tails():
    """The example of the module's docstring."""
    diagram = build_decision_diagram(build_transition_system(ground_program(COINS, {})))
    assert diagram.sizes == [1, 2]
    assert diagram.arcs == [([0, 0], ([0, 1],), [0, 1]), ([0, 0, 1], (), [2, 3, 2])]
    assert [(own.values, own.weight) for own in diagram.outcomes] == [((i % 2,), HALF) for i in range(4)]
    assert repr(diagram) == "DecisionDiagram(coins.plog: 2 steps, 3 nodes, 5 arcs)"


def test_branches_have_their_own_nodes():
    """Two of three coins depend on the first; a constraint about the last drops nodes on both branches."""
    program = parse_plog(
        "c1, c2, c3 : boolean. random(c1). random(c2). random(c3). pr(c2 | c1) = 1/4. pr(c3 | c1) = 1/8."
        " :- c1, c3."
    )
    diagram = build_decision_diagram(build_transition_system(ground_program(program, {}), ["c1", "c2", "c3"]))
    tree = diagram.system.tree
    names = [program_terms(diagram, step) for step in range(3)]
    assert (names, tree.children, tree.roots) == (["c1", "c2", "c3"], [[1, 2], [], []], [0])
    assert diagram.sizes == [1, 2, 2]
    assert WorldQueries(diagram).count() == 6
    assert WorldQueries(diagram).compute_exact_weights("c1", {"c2": "true"}) == {
        "true": Fraction(7, 64), "false": Fraction(1, 4)
    }  # fmt: skip
    assert WorldQueries(diagram).compute_exact_weights("c2", {"c1": "true", "c3": "true"}) == {}


def program_terms(diagram, step):
    return ", ".join(diagram.system.program.names[term] for term in diagram.system.tree.order[step])


def test_sums_over_arcs_are_sums_over_worlds():
    system = build_transition_system(ground_program(COINS, {}), ["c1", "c2"])
    worlds = WorldQueries(build_decision_diagram(system))
    assert worlds.count() == 3
    assert worlds.compute_exact_weights("c1", {}) == {"heads": HALF, "tails": Fraction(1, 4)}
    assert worlds.compute_float_weights("c1", {"c2": "tails"}) == {"heads": 1.0}


def test_short_representations():
    circuit = Reasoner(COINS).compile(["c1"], "c2")
    assert repr(circuit) == "Circuit(coins.plog: c2 given c1; 2 layers)"
    (world,) = circuit.most_probable({})
    assert repr(world) == "PossibleWorld(1/3: {c1=heads, c2=heads})"
    many = Reasoner(parse_plog("i = {1..99}. p : i -> boolean. random(p(I)). #domain i(I)."))
    long = many.compile(["p"], ["p(1)", "p(2)"])
    for value in (long, long.most_probable({})[0], long.world_queries.diagram.system.program):
        assert len(repr(value)) < 200
