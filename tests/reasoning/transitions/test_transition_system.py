"""Bits of the state: the example of the module's docstring."""

from __future__ import annotations

from lcorpp.reasoning import parse_plog
from lcorpp.reasoning.diagram.decision_diagram import build_decision_diagram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions.transition_system import build_transition_system

TRUE, FALSE, NO_VALUE = 0, 1, 2


def test_the_example_of_two_bodies():
    program = parse_plog("a, b, c, x : boolean. random(a). random(b). random(c). x :- a, b=false. x :- c.")
    system = build_transition_system(ground_program(program, {}), ["x"])
    assert [system.program.names[term] for (term,) in system.tree.order] == ["a", "b", "c", "x"]
    a, b, c, x = system.transitions
    assert [t.live_masks for t in system.transitions] == [(0b01,), (0b10,), (0b10,), ()]
    assert (a.input_mask, x.input_mask) == (0b00, 0b10)
    assert (a.find_effect([FALSE])[1:], a.find_effect([TRUE])[1:]) == ((0, 0, 0, {}), (0b01, 0, 0, {}))
    assert (b.find_effect([FALSE])[1:], b.find_effect([TRUE])[1:]) == (
        (0, 0, 0b01, {0b01: 0b10}),
        (0, 0, 0, {}),
    )
    assert (c.find_effect([TRUE])[1:], c.find_effect([FALSE])[1:]) == ((0b10, 0, 0, {}), (0, 0, 0, {}))
    outcomes = x.distribution.list_outcomes([0b00, 0b10])
    assert [outcomes[state][0].values[0] for state in (0b00, 0b10)] == [NO_VALUE, TRUE]
    assert build_decision_diagram(system).sizes == [1, 2, 2, 2]


def test_facts_that_contradict_each_other_after_simplification_leave_no_world():
    program = parse_plog("s = {u, v}. a : s. c : boolean. random(c). a = u. a = v :- a = u.")
    assert not build_decision_diagram(build_transition_system(ground_program(program, {}))).has_worlds
