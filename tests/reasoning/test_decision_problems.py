"""Programs of DTProbLog: the best decisions by hand, by all worlds, and refusals by name."""

from itertools import product
from random import Random

import pytest
from tests.reasoning.decision_programs import make_decision_program

from lcorpp.errors import ParseError, TooLargeError, UndefinedError
from lcorpp.reasoning import choose_decisions, parse_decision_problem

UMBRELLA = r"""
0.3::rain. 0.5::wind.
?::umbrella. decision(raincoat).
broken_umbrella :- umbrella, rain, wind.
dry :- rain, raincoat.
dry :- rain, umbrella, \+broken_umbrella.
dry :- \+rain.
utility(broken_umbrella, -40).
utility(raincoat, -20).
utility(umbrella, -2).
utility(dry, 60).
"""


def test_the_umbrella_of_the_tutorial():
    """Umbrella alone: 60 (.7 + .15) - 40 * .15 - 2 = 43; nothing: 60 * .7 = 42."""
    best = choose_decisions(parse_decision_problem(UMBRELLA))
    assert best.choices == {"umbrella": True, "raincoat": False}
    assert (best.utility, best.difference) == pytest.approx((43, 1))
    assert best.next_choices == {"umbrella": False, "raincoat": False}


def compare_with_all_worlds(seed: int) -> None:
    program = make_decision_program(Random(seed))
    found = {}
    for signs in product((False, True), repeat=len(program.decisions)):
        decided = dict(zip(program.decisions, signs, strict=True))
        utility = program.compute_utility(decided)
        if utility is not None:
            found[signs] = utility
    problem = parse_decision_problem(program.write())
    if not found:
        with pytest.raises(UndefinedError):
            choose_decisions(problem)
        return
    best = choose_decisions(problem)
    chosen = tuple(best.choices[name] for name in program.decisions if name in best.choices)
    ordered = sorted(found.values(), reverse=True)
    assert best.utility == pytest.approx(ordered[0], abs=1e-9), program.write()
    assert found[chosen] == pytest.approx(ordered[0], abs=1e-9)
    if len(ordered) > 1:
        assert best.difference == pytest.approx(ordered[0] - ordered[1], abs=1e-9)


def test_random_programs_are_as_all_their_worlds():
    for seed in range(100):
        compare_with_all_worlds(seed)


@pytest.mark.slow
def test_many_random_programs_are_as_all_their_worlds():
    for seed in range(100, 1100):
        compare_with_all_worlds(seed)


def test_decisions_of_variables_and_negated_utilities():
    """Marketing: who buys tells a friend; an advertisement costs 2, a sale earns 5."""
    best = choose_decisions(
        parse_decision_problem(r"""
        person(ann). person(bob). friend(ann, bob).
        ?::advertise(P) :- person(P).
        0.9::trusts(X, Y) :- friend(X, Y).
        0.5::likes(P) :- person(P).
        buys(P) :- advertise(P), likes(P).
        buys(P) :- trusts(Q, P), buys(Q).
        utility(advertise(P), 1 - 3) :- person(P).
        utility(buys(P), 5) :- person(P).
        utility(\+buys(bob), 0).
        """)
    )
    assert best.choices == {"advertise(ann)": True, "advertise(bob)": False}
    # ann alone: -2 + 5 (.5 + .45); both: -4 + 5 (.5 + .5 + .5 * .45)
    assert (best.utility, best.difference) == pytest.approx((2.75, 2.75 - 2.125))


def test_evidence_conditions_the_utility():
    text = "0.5::a. ?::d. w :- a, d. utility(w, 4). utility(d, -1)."
    assert choose_decisions(parse_decision_problem(text)).utility == pytest.approx(1)
    assert choose_decisions(parse_decision_problem(f"{text} evidence(\\+a).")).choices == {"d": False}


def test_small_utilities_decide():
    assert choose_decisions(parse_decision_problem("?::a. utility(a, 1e-10).")).choices == {"a": True}
    assert choose_decisions(parse_decision_problem("decision(a). utility(a, 3).")).utility == 3


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("?::a; ?::b. utility(a, 1).", "1:1: a disjunction of decisions is not translated"),
        ("0.5::b. ?::a(X) :- b, c(X). c(1). utility(a(1), 1).", "the decision a(1) depends on chance"),
        ("0.5::b. ?::a. utility(a, 1) :- b.", "utility(...) that depends on chance is not translated"),
        ("?::a. utility(a, b).", "x.pl:1:15: b is not a number"),
        ("?::a. utility(3, 1).", "utility(3) is not translated; expected an atom"),
    ],
)
def test_refusals(text, words):
    with pytest.raises(ParseError) as caught:
        parse_decision_problem(text, file="x.pl")
    assert words in str(caught.value)


def test_too_many_decisions_are_refused():
    text = " ".join(f"?::d({i})." for i in range(21)) + " utility(d(0), 1)."
    with pytest.raises(TooLargeError, match=r"2097152 combinations of .*; expected at most"):
        choose_decisions(parse_decision_problem(text))
