"""Elimination trees and strongly connected components."""

from __future__ import annotations

from hypothesis import given, strategies as st

from lcorpp.reasoning import parse_plog
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.grounding.strong_components import find_strongly_connected_components
from lcorpp.reasoning.transitions.transition_system import build_transition_system


@given(edges=st.sets(st.tuples(st.integers(0, 7), st.integers(0, 7))))
def test_components_are_the_classes_of_mutual_reachability(edges):
    successors = {node: sorted(b for a, b in edges if a == node) for node in range(8)}
    reach = [{node} for node in range(8)]
    for _ in range(8):
        reach = [
            own.union(*(reach[b] for b in own)) | {b for a in own for b in successors[a]} for own in reach
        ]
    classes = {tuple(b for b in range(8) if b in reach[a] and a in reach[b]) for a in range(8)}
    components = find_strongly_connected_components(successors)
    assert set(components) == classes
    assert len(components) == len(classes)
    position = {node: i for i, nodes in enumerate(components) for node in nodes}
    assert all(position[b] <= position[a] for a, b in edges)  # what a node points to comes first


def test_a_chain_has_a_frontier_of_one_term():
    program = parse_plog(
        "t = {0..50}. #domain t(T). x : t -> boolean. random(x(T)). pr(x(T+1) | x(T)) = 9/10."
    )
    system = build_transition_system(ground_program(program, {}))
    assert [system.program.names[term] for (term,) in system.tree.order] == [f"x({i})" for i in range(51)]
    assert max(mask.bit_count() for transition in system.transitions for mask in transition.live_masks) == 1
    assert len(set(system.transitions)) < 6  # equal steps share their transition
    assert repr(system) == "TransitionSystem(<text>: 51 terms, 51 steps)"


def test_slices_are_eliminated_one_after_the_other():
    """The cheapest component is often in another slice; the width would grow with the number of slices."""
    program = parse_plog("""
        t = {0..50}. next = {1..50}. #domain t(T). #domain next(N). people = {student, professor, visitor}.
        who : t -> people. in_library, interested : t -> boolean.
        random(who(0)). who(N)=W :- who(N-1)=W, people(W). random(in_library(T)). random(interested(T)).
        pr(in_library(N) | in_library(N-1), who(N)=student) = 0.7.
        pr(interested(N) | interested(N-1)) = 0.9.
        pr(interested(N) | interested(N-1)=false, in_library(N)) = 0.2.""")
    system = build_transition_system(ground_program(program, {}))
    assert max(mask.bit_count() for transition in system.transitions for mask in transition.live_masks) < 12
