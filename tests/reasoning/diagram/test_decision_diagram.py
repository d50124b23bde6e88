"""Decision diagrams: nodes, arcs and their outcomes."""

from __future__ import annotations

from fractions import Fraction

import pytest

from lcorpp.errors import ProgramError, TooLargeError
from lcorpp.reasoning import Enumeration, Reasoner, parse_plog, parse_query
from lcorpp.reasoning._diagram import CompiledTransition, Diagram
from lcorpp.reasoning.diagram import decision_diagram, layers
from lcorpp.reasoning.diagram.decision_diagram import build_decision_diagram
from lcorpp.reasoning.diagram.world_queries import WorldQueries
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions.transition_system import build_transition_system

COINS = parse_plog(
    "coin = {heads, tails}. c1, c2 : coin. random(c1). random(c2). :- c1=tails, c2=tails.", file="coins.plog"
)
COINS_QUERY = parse_query("c1", COINS)
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


def test_states_of_many_words():
    """A switch decides which of 150 pairs is read: the pending bodies of all pairs are bits of the state."""
    n = 150
    program = parse_plog(
        f"i = {{1..{n}}}. #domain i(I). s : i. on, lit : boolean. a : i -> boolean. random(s). random(on)."
        " a(I) :- s = I. both : i -> boolean. both(I) :- a(I), on. lit :- both(I). lit=false :- not lit."
        " q : boolean. random(q). pr(q | lit) = 3/4. pr(q | -lit) = 1/4."
    )
    names = ["s", "on", "q", "both(7)"]
    system = build_transition_system(ground_program(program, {}), names)
    assert system.transitions[0].n_words >= 2
    worlds = WorldQueries(build_decision_diagram(system))
    assert worlds.count() == 4 * n
    found = worlds.compute_exact_weights("s", {"q": "true", "both(7)": "true"})
    assert found == {"7": Fraction(1, n) * HALF * Fraction(3, 4)}
    assert worlds.compute_float_weights("q", {"on": "true"}) == pytest.approx({"true": 1, "false": 1 / 3})


def test_nodes_without_a_world_are_dropped_from_equal_steps():
    """A chain of 301 terms in which only the world where all are true is possible: one node a step."""
    program = parse_plog(
        "t = {0..300}. #domain t(T). x : t -> boolean. random(x(T)). pr(x(T+1) | x(T)) = 9/10."
        " :- not x(300). :- x(T), x(T+1)=false. :- x(T)=false, x(T+1)."
    )
    diagram = build_decision_diagram(build_transition_system(ground_program(program, {}), ["x(0)"]))
    assert diagram.sizes == [1] * 301
    weights = WorldQueries(diagram).compute_exact_weights("x(0)", {})
    assert weights["true"] == HALF * Fraction(9, 10) ** 300
    assert not weights.get("false")


def test_a_violation_in_a_large_diagram_is_an_error_of_the_program(monkeypatch):
    program = parse_plog("s = {u, v}. a : s. b : boolean. random(b). random(a). pr(a=u)=3/4. pr(a=v)=3/4.")
    monkeypatch.setattr(decision_diagram, "MAX_LISTED_ARCS", 1)
    with pytest.raises(ProgramError, match="in the world"):
        build_decision_diagram(build_transition_system(ground_program(program, {}), ["a", "b"]))
    with pytest.raises(TooLargeError, match=r"5 arcs in the decision diagram; fractions, .* at most 1"):
        Reasoner(COINS).exact("c1", {})
    assert Reasoner(COINS).ask(COINS_QUERY) == pytest.approx({"heads": 2 / 3, "tails": 1 / 3})


def test_limits_of_labels_and_layers(monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(decision_diagram, "MAX_LABELS", 3)
        with pytest.raises(TooLargeError, match=r"coins\.plog: more than 3 labels of arcs"):
            Reasoner(COINS).compile([], "c1")
    monkeypatch.setattr(layers, "MAX_BYTES", 20)
    with pytest.raises(TooLargeError, match=r"coins\.plog: more than \S+ MiB in the layers"):
        Reasoner(COINS).compile(["c2"], "c1")


def test_a_wide_state_is_refused(monkeypatch):
    monkeypatch.setattr("lcorpp.reasoning.transitions.transition_system.MAX_BITS", 0)
    with pytest.raises(TooLargeError, match=r"coins\.plog: states of more than 0 bits"):
        Reasoner(COINS).compile([], "c1")


def test_the_kernel_refuses_arguments_that_do_not_fit():
    bits = bytes(8)
    transition = CompiledTransition(1, bits, [], [])
    graph = Diagram([[]], [0], 1, True)
    with pytest.raises(ValueError, match="no step was entered"):
        graph.expand(100)
    assert graph.enter(transition, False) == [bits]
    with pytest.raises(ValueError, match="without choices"):
        graph.expand(100)
    with pytest.raises(ValueError, match="not expanded"):
        graph.prune()
    with pytest.raises(ValueError, match="not expanded"):
        graph.list_labels(0)
    with pytest.raises(ValueError, match="an effect that"):
        transition.add_choices(bits, [(0, 0)])
    with pytest.raises(ValueError, match="bits of a wrong length"):
        transition.add_effect(bits, bits, bits, bits)
    with pytest.raises(ValueError, match="an implication out of range"):
        transition.add_closure([], [(-1, 5, 1)], [], 2, 3, [])
    for children, roots in (([[]], [1]), ([[0]], [0]), ([[], []], [0]), ([[1], []], [0, 1])):
        with pytest.raises(ValueError, match=r"steps that are no tree|a step without a parent"):
            Diagram(children, roots, 1, True)
    with pytest.raises(ValueError, match="states without bits"):
        Diagram([[]], [0], 0, True)


def test_the_diagram_agrees_with_the_enumeration_after_a_failed_limit():
    """Outcomes that a refused expansion found are those of the next one."""
    system = build_transition_system(ground_program(COINS, {}), ["c1", "c2"])
    with pytest.raises(TooLargeError):
        build_decision_diagram(system, 1)
    weights = WorldQueries(build_decision_diagram(system)).compute_exact_weights("c1", {})
    total = sum(weights.values())
    assert {value: p / total for value, p in weights.items()} == Enumeration(COINS).exact("c1", {})
