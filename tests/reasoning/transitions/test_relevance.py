"""Rules that no query depends on: they need no step, and worlds list their terms."""

from __future__ import annotations

from fractions import Fraction

import pytest

from lcorpp.errors import UndefinedError
from lcorpp.reasoning import Enumeration, Program, Reasoner, parse_plog
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions.transition_system import build_transition_system

FRIENDS = [(2, 4), (5, 8), (7, 10), (1, 8), (8, 10), (2, 3), (1, 10), (1, 6), (2, 5), (7, 8)]


def make_smokers(friends: list[tuple[int, int]], query: str) -> Program:
    """The smokers of the ProbLog papers: stress or a friend's influence makes a person smoke."""
    pairs = " ".join(f"friend({i},{j}). friend({j},{i})." for i, j in friends)
    return parse_plog(f"""
        person = {{1..{max(map(max, friends))}}}. #domain person(X; Y).
        stress, smokes, prone, asthma : person -> boolean. friend, influences : person, person -> boolean.
        {pairs}
        random(stress(X)). pr(stress(X)) = 3/10. random(prone(X)). pr(prone(X)) = 4/10.
        random(influences(X,Y)) :- friend(X,Y). pr(influences(X,Y)) = 2/10.
        smokes(X) :- stress(X). smokes(X) :- friend(X,Y), influences(Y,X), smokes(Y).
        asthma(X) :- smokes(X), prone(X). ?{{{query}}}.""")


def list_steps(program: Program, queried: list[str]) -> set[str]:
    system = build_transition_system(ground_program(program, {}), queried)
    return {
        program_name
        for terms in system.tree.order
        for program_name in map(system.program.names.__getitem__, terms)
    }


def test_unread_effects_and_facts_have_no_step():
    program = make_smokers([(1, 2)], "smokes(2)")
    steps = list_steps(program, ["smokes(2)"])
    assert {"smokes(2)", "stress(1)", "influences(1,2)"} <= steps
    assert not {"asthma(1)", "asthma(2)", "friend(1,2)"} & steps
    assert "asthma(1)" in list_steps(program, ["asthma(1)"])


@pytest.mark.parametrize(
    ("rule", "has_step"),
    [
        ("p :- a.", False),
        ("p :- a. p = false :- not p.", False),
        ("p :- a. p = false :- not a.", True),  # two values: they may contradict each other
        ("p :- a. p = false.", True),
        ("p :- a. p = false :- not p = false.", True),  # no stable model
        ("p :- not q. q :- not p.", True),  # two stable models
        ("p :- q. q :- p. q :- a.", False),
        ("p :- a. random(b). :- p, b.", True),
        ("p :- a. random(b) :- p.", True),
    ],
)
def test_rules_with_one_model_only(rule, has_step):
    program = parse_plog(f"a, b, p, q : boolean. random(a). {rule} ?{{a}}.")
    assert ("p" in list_steps(program, ["a"])) == has_step


def test_worlds_list_the_terms_without_steps():
    program = make_smokers([(1, 2), (2, 3)], "smokes(2)")
    expected = {frozenset(world.values.items()): world.measure for world in Enumeration(program).worlds}
    circuit = Reasoner(program).compile([], "smokes(2)")
    found = {
        frozenset(world.values.items()): world.measure for world in circuit.most_probable({}, len(expected))
    }
    assert found == expected
    assert Reasoner(program).count() == len(expected)


@pytest.mark.parametrize(
    ("query", "answer"),
    [("smokes(10)", 0.4491914782419146), ("asthma(10)", 0.4 * 0.4491914782419146)],
)
def test_ten_smokers(query, answer):
    """The answer of ProbLog 2.3 (SDD) to its program of the same meaning."""
    program = make_smokers(FRIENDS, query)
    assert Reasoner(program).ask(program.queries[0]) == pytest.approx(answer, rel=1e-12)


def test_evidence_about_a_term_that_no_rule_names():
    program = parse_plog("a, b, c : boolean. random(a) :- b. random(b) :- a. random(c).")
    assert Reasoner(program).exact("c", {})["true"] == Fraction(1, 2)
    for term in ("a", "b"):
        with pytest.raises(UndefinedError, match=f"no possible world of positive measure has {term}=true"):
            Reasoner(program).compile([term], "c").most_probable({term: "true"})
