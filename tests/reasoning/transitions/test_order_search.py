"""The search for an order of the components, and the diagrams that result."""

from __future__ import annotations

from math import log2
from random import Random

import pytest
from hypothesis import given, strategies as st

from lcorpp.errors import TooLargeError
from lcorpp.reasoning import Program, Reasoner, parse_plog
from lcorpp.reasoning._diagram import improve_order
from lcorpp.reasoning.diagram import decision_diagram
from lcorpp.reasoning.diagram.decision_diagram import build_decision_diagram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions.transition_system import build_transition_system


def make_smokers(n: int) -> Program:
    """n people, of whom each is influenced by two others."""
    random = Random(n)
    people = range(1, n + 1)
    friends = [(a, b) for b in people for a in random.sample([p for p in people if p != b], 2)]
    rules = " ".join(f"friend({a},{b})." for a, b in friends)
    return parse_plog(
        f"person = {{1..{n}}}. #domain person(X;Y). friend, influences : person, person -> boolean."
        f" stress, smokes : person -> boolean. {rules} random(stress(X)). pr(stress(X)) = 3/10."
        " random(influences(X,Y)) :- friend(X,Y). pr(influences(X,Y)) = 2/10."
        " smokes(X) :- stress(X). smokes(Y) :- friend(X,Y), influences(X,Y), smokes(X)."
        " smokes(X) = false :- not smokes(X)."
    )


def test_pairs_that_belong_together_come_together():
    """x(i) depends on a(i) alone: with pairs one after the other there are two states, then one, n times."""
    n = 12
    groups = [(n + i, [[i]]) for i in range(n)]
    needs = [[] for _ in range(n)] + [[i] for i in range(n)]
    order, before, after = improve_order([1.0] * n + [0.0] * n, needs, groups, [], list(range(2 * n)), 3e5)
    states = [2**i for i in range(1, n + 1)] + [2**i for i in range(n)]
    assert before == pytest.approx(log2(sum(states)))
    assert after == pytest.approx(log2(3 * n))
    assert [order[k + 1] for k in range(0, 2 * n, 2)] == [n + order[k] for k in range(0, 2 * n, 2)]


def test_the_bits_of_one_step_are_at_most_those_of_its_outcomes():
    """A die is read by ten rules until the last step: six states, not 2^10."""
    n = 10
    groups = [(k, [[0]]) for k in range(1, n + 1)]
    needs = [[], *[[0]] * n]
    _, before, _ = improve_order([log2(6), *[0.0] * n], needs, groups, [], list(range(n + 1)), 0)
    live = [min(log2(6), n - k) for k in range(n + 1)]
    assert before == pytest.approx(log2(sum(2**bits for bits in live)))


@pytest.mark.parametrize("is_symmetric", [True, False])
def test_rules_of_recursions_have_the_states_of_relations(is_symmetric):
    """Three atoms in a circle, each rule twice: equivalences if they imply each other, else relations."""
    pairs = enumerate([(0, 1), (1, 2), (2, 0)] * 2)
    if is_symmetric:
        rules = [([step], *pair) for step, (a, b) in pairs for pair in ((a, b), (b, a))]
        kept = used = [
            2,
            3,
            3,
            3,
            2,
            0,
        ]  # atoms with undecided rules as heads, and with undecided rules as bodies
        bits = [0.085 * k**2 + 1.12 * k for k in kept]
    else:
        rules = [([step], a, b) for step, (a, b) in pairs]
        used, kept = [2, 3, 3, 2, 1, 0], [2, 3, 3, 1, 0, 0]  # as heads, as bodies; as both
        bits = [0.42 * u**2 + 0.5 * k + u - k for u, k in zip(used, kept, strict=True)]
    _, before, _ = improve_order([9.0] * 6, [[]] * 6, [], [rules], list(range(6)), 0)
    assert before == pytest.approx(log2(sum(2**own for own in bits)))


@given(st.integers(1, 10), st.randoms(use_true_random=False))
def test_orders_stay_topological_and_do_not_get_worse(n, random):
    needs = [sorted(random.sample(range(i), random.randint(0, min(i, 3)))) for i in range(n)]
    groups = [(i, [[need] for need in needs[i]]) for i in range(n) if needs[i]]
    arguments = [1.0] * n, needs, groups, [], list(range(n))
    order, before, after = improve_order(*arguments, 3000)
    assert sorted(order) == list(range(n))
    assert all(order.index(need) < order.index(i) for i in range(n) for need in needs[i])
    assert after <= before
    assert improve_order(*arguments, 3000) == (order, before, after)
    assert improve_order(*arguments[:-1], order, 0)[1] == pytest.approx(after)


def test_constraints_and_bodies_of_several_steps():
    """a and b are read by x, b and c by a constraint: bits for a, for the body and b, then for x or c."""
    groups = [(3, [[0, 1]]), (-1, [[1, 2]])]
    sizes, needs = [1.0, 1.0, 1.0, 1.0], [[], [], [], [0, 1]]
    _, before, _ = improve_order(sizes, needs, groups, [], [0, 1, 3, 2], 0)
    assert before == pytest.approx(log2(2**1 + 2**2 + 2**1 + 2**0))
    _, before, _ = improve_order(sizes, needs, groups, [], [0, 1, 2, 3], 0)
    assert before == pytest.approx(log2(2**1 + 2**2 + 2**1 + 2**0))


def test_rules_without_inputs_need_no_states():
    rules = [([1], 0, 1), ([2], 1, 2)]
    estimates = [
        improve_order([1.0] * 3, [[]] * 3, [], [own], [0, 1, 2], 0)[1]
        for own in (rules, [([], 0, 2), *rules])
    ]
    assert estimates[0] == estimates[1]


def test_estimates_are_near_the_sizes_of_diagrams():
    """Within 2 bits for influences in one direction, and for contacts in both."""
    people = make_smokers(12)
    contacts = parse_plog(str(people) + " smokes(X) :- friend(X,Y), influences(X,Y), smokes(Y).")
    for program in (people, contacts):
        terms = ["smokes(3)", "smokes(5)"]
        system = build_transition_system(ground_program(program, {}), terms)
        _, estimate = system.reorder(0.0)
        states = sum(build_decision_diagram(system).sizes)
        assert abs(estimate - log2(states)) < 2, (estimate, states)


def test_a_search_continues_from_the_best_order():
    system = build_transition_system(ground_program(make_smokers(14), {}), ["smokes(3)", "smokes(5)"])
    _, first = system.reorder(0.0)
    better, second = system.reorder(1e6)
    assert better is not None
    assert second < first - 1
    _, third = better.reorder(0.0)
    assert third == second
    none, fourth = better.reorder(0.0)
    assert (none, fourth) == (None, second)


def test_arguments_that_do_not_fit_are_refused():
    assert improve_order([], [], [], [], [], 1e3)[0] == []
    with pytest.raises(ValueError, match="work of a search"):
        improve_order([1.0], [[]], [], [], [0], -5)
    with pytest.raises(ValueError, match="not topological"):
        improve_order([1.0, 1.0], [[1], []], [], [], [0, 1], 10)
    with pytest.raises(ValueError, match="not an order"):
        improve_order([1.0, 1.0], [[], []], [], [], [0, 0], 10)
    with pytest.raises(ValueError, match="a step out of range"):
        improve_order([1.0, 1.0], [[], []], [(2, [[0]])], [], [0, 1], 10)


def test_a_better_order_has_fewer_states_and_the_same_answers(monkeypatch):
    program, terms = make_smokers(14), ["smokes(3)", "smokes(5)", "smokes(9)"]
    evidence = {"smokes(5)": "true", "smokes(9)": "false"}
    usual = build_decision_diagram(build_transition_system(ground_program(program, {}), terms))
    answer = Reasoner(program).exact("smokes(3)", evidence)
    monkeypatch.setattr(decision_diagram, "TRIALS", ((0, 3e6),))
    better = build_decision_diagram(build_transition_system(ground_program(program, {}), terms))
    assert sum(better.sizes) < 0.6 * sum(usual.sizes)
    assert Reasoner(program).exact("smokes(3)", evidence) == answer


def test_programs_with_too_many_expected_states_are_refused_at_once(monkeypatch):
    monkeypatch.setattr(decision_diagram, "TRIALS", ((0, 1e3),))
    monkeypatch.setattr(decision_diagram, "MAX_LOG_STATES", 3)
    monkeypatch.setattr(decision_diagram, "_expand", lambda _, limit, *__: None if not limit else 1 / 0)
    words = r"<text>: about 2\^\d+\.\d states of the decision diagram; expected at most 2\^3"
    with pytest.raises(TooLargeError, match=words):
        Reasoner(make_smokers(9)).exact("smokes(1)")
