"""Compiled circuits against answers known by hand or counted in plain Python."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from itertools import product
from math import comb, prod
from pathlib import Path

import pytest

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning import Reasoner, parse_plog, read_plog

PLOG = Path(__file__).parents[2] / "plog"
OBSERVED = {  # P(interested) given time and place, for the label one and the label zero: PLOG.md
    ("morning", "library"): (0.652180, 0.194752),
    ("morning", "classroom"): (0.301512, 0.052741),
    ("afternoon", "library"): (0.888243, 0.506214),
    ("afternoon", "classroom"): (0.686510, 0.220250),
    ("evening", "library"): (0.727998, 0.256627),
    ("evening", "classroom"): (0.532816, 0.128240),
}


def test_all_observations_of_the_paper():
    circuit = Reasoner(read_plog(PLOG / "lcorpp.plog")).compile(
        ["time", "location", "classifier"], "intention"
    )
    for (time, location), answers in OBSERVED.items():
        for label, answer in zip(("one", "zero"), answers, strict=True):
            evidence = {"time": time, "location": location, "classifier": label}
            assert circuit(evidence)["interested"] == pytest.approx(answer, abs=5e-7)  # six digits given


@pytest.mark.parametrize(
    ("program", "query", "value", "obs", "do", "answer"),
    [
        ("dice", "roll(d1)", "3", {}, {}, Fraction(3, 20)),
        ("monty_hall", "prize", "1", {"selected": "1", "open": "2"}, {}, Fraction(1, 3)),
        ("monty_hall", "prize", "3", {"selected": "1", "open": "2"}, {}, Fraction(2, 3)),
        ("monty_hall", "prize", "3", {"open": "2"}, {"selected": "1"}, Fraction(2, 3)),
        ("simpson", "recover", "true", {"drug": "true"}, {}, Fraction(1, 2)),
        ("simpson", "recover", "true", {"drug": "false"}, {}, Fraction(2, 5)),
        ("simpson", "recover", "true", {}, {"drug": "true"}, Fraction(2, 5)),
        ("simpson", "recover", "true", {}, {"drug": "false"}, Fraction(1, 2)),
        ("rat", "arsenic", "true", {"death": "true"}, {}, 0.981595),
        ("rat", "arsenic", "true", {}, {"death": "true"}, Fraction(2, 5)),
        ("robot", "in(1)", "r0", {"broken": "true", "blocked(r1)": "false"}, {}, Fraction(1, 3)),
        ("robot", "in(1)", "r0", {"broken": "true", "blocked(r1)": "true"}, {}, Fraction(1, 2)),
    ],
)
def test_answers_of_the_papers(program, query, value, obs, do, answer):
    read = read_plog(PLOG / f"{program}.plog")
    circuit = Reasoner(read).compile(list(obs), query, do)
    assert circuit(obs)[value] == pytest.approx(
        float(answer), abs=1e-12 if type(answer) is Fraction else 5e-7
    )
    assert circuit.exact(obs)[value] == pytest.approx(answer, abs=0 if type(answer) is Fraction else 5e-7)
    assert Reasoner(read).posterior(query, obs, do)[value] == circuit(obs)[value]


def test_thirty_dice():
    dice = ",".join(f"d{i}" for i in range(30))
    program = parse_plog(
        f"dice = {{{dice}}}. score = {{1..6}}. roll : dice -> score. random(roll(D)). pr(roll(d0)=6) = 1/4."
        " six : dice -> boolean. six(D) :- roll(D)=6. some : boolean. some :- six(D). some=false :- not some."
    )
    chance = 1 - Fraction(3, 4) * Fraction(5, 6) ** 29
    assert Reasoner(program).compile([], "some").exact({})["true"] == chance
    given = Reasoner(program).compile(["roll"], "some").exact({f"roll(d{i})": "1" for i in range(29)})
    assert given == {"true": Fraction(1, 6), "false": Fraction(5, 6)}


def test_sum_of_dice_against_counting():
    program = parse_plog(
        "i = {1..4}. score = {1..6}. sum = {0..24}. roll : i -> score. random(roll(I)). s : i -> sum."
        " s(1)=V :- roll(1)=V. s(I+1)=V+W :- s(I)=V, roll(I+1)=W."
    )
    found = Reasoner(program).compile(["roll(1)"], "s(4)")
    counts = Counter(map(sum, product(range(1, 7), repeat=4)))
    assert found.exact({}) == {str(v): Fraction(counts[v], 6**4) for v in range(25)}
    counts = Counter(map(sum, product([2], *[range(1, 7)] * 3)))
    assert found.exact({"roll(1)": "2"}) == {str(v): Fraction(counts[v], 6**3) for v in range(25)}


def test_the_dynamic_range_shares_the_rest_evenly():
    program = parse_plog(
        "s = {u, v, w}. d = {1, 2}. x, y : s. ok : s -> boolean. random(x). ok(S) :- not x=S."
        " random(y : {X : ok(X)}). pr(y=w | not x=w) = 1/4. #domain s(S)."
    )
    circuit = Reasoner(program).compile(["x"], "y")
    assert circuit.exact({"x": "u"}) == {"u": 0, "v": Fraction(3, 4), "w": Fraction(1, 4)}
    assert circuit.exact({"x": "w"}) == {"u": Fraction(1, 2), "v": Fraction(1, 2), "w": 0}


def test_terms_with_equal_rules_but_different_facts():
    """One term may always take a value that its twin may take only sometimes."""
    program = parse_plog(
        "d = {1, 2}. #domain d(D). c : d -> boolean. may : d, boolean -> boolean. x : d -> boolean."
        " random(c(1)). c(2). may(D, true) :- c(D). random(x(D) : {X : may(D, X)})."
    )
    assert Reasoner(program).compile([], "c(1)").exact({}) == {"true": 1, "false": 0}


DO = """
s = {{a, b, c}}. ok : s -> boolean. ok(a). ok(b).
p : boolean. x : s. random(p). random(x : {{X : ok(X)}}) :- p.
#semantics {}.
"""


def test_interventions_in_2009_and_in_2018():
    old, new = (Reasoner(parse_plog(DO.format(year))) for year in (2009, 2018))
    assert old.compile([], "p", {"x": "c"}).exact({}) == {"true": Fraction(1, 2), "false": Fraction(1, 2)}
    assert new.compile([], "p", {"x": "c"}).exact({}) == {"true": 0, "false": 1}  # c is out of range
    assert old.compile([], "x", {"x": "c"}).exact({})["c"] == 1
    assert new.compile(["p"], "x", {"x": "a"}).exact({"p": "true"})["a"] == 1
    with pytest.raises(ProgramError, match="x has no value with probability 1"):
        new.compile(["p"], "x", {"x": "a"})({"p": "false"})


def test_contradictory_interventions():
    text = "p, q : boolean. random(p). random(q) :- p. do(q=true). q=false :- p=false."
    old, new = (Reasoner(parse_plog(f"#semantics {year}. {text}")) for year in (2009, 2018))
    with pytest.raises(UndefinedError):
        old.compile([], "p", {"q": "false"})({})
    assert new.compile([], "p", {"q": "false"}).exact({})["true"] == 0  # only where q is selected


@pytest.mark.parametrize("circular", ["", " r : boolean. r :- q, not r=false. q :- r, p=false."])
def test_condition_1_in_2009_and_in_2018(circular):
    text = "p, q : boolean. random(p). random(q). q :- p." + circular
    assert Reasoner(parse_plog("#semantics 2009. " + text)).compile([], "q").exact({})["true"] == Fraction(
        2, 3
    )
    with pytest.raises(ProgramError, match=r"Condition 1: q .* in the world \{p=true, q=true"):
        Reasoner(parse_plog("#semantics 2018. " + text)).compile([], "q")


def test_no_world_at_all():
    circuit = Reasoner(parse_plog("p : boolean. random(p). :- p. :- p=false.")).compile(["p"], "p")
    for answer in (circuit, circuit.exact, circuit.most_probable):
        with pytest.raises(UndefinedError, match="no possible world of positive measure"):
            answer({})


def test_two_thousand_observed_steps():
    """A chain: the weight of the evidence is far below the smallest float."""
    program = parse_plog(
        "t = {0..2000}. #domain t(T). x, see : t -> boolean. random(x(T)). random(see(T))."
        " pr(x(T+1) | x(T)) = 9/10. pr(x(T+1) | x(T)=false) = 1/5."
        " pr(see(T) | x(T)) = 3/4. pr(see(T) | x(T)=false) = 1/4."
    )
    circuit = Reasoner(program).compile(["see"], ["x(2000)", "x(0)"])
    seen = {f"see({t})": "true" if t % 7 < 4 else "false" for t in range(2001)}
    forward = [0.5, 0.5]  # filtered by hand
    for t in range(2001):
        if t:
            move = forward[0] * 0.9 + forward[1] * 0.2
            forward = [move, 1 - move]
        likely = (0.75, 0.25) if t % 7 < 4 else (0.25, 0.75)
        forward = [a * b for a, b in zip(forward, likely, strict=True)]
        forward = [a / sum(forward) for a in forward]
    found = circuit(seen)
    assert found["x(2000)"]["true"] == pytest.approx(forward[0], abs=1e-12)
    assert set(found) == {"x(2000)", "x(0)"}


def test_three_thousand_observed_coins_of_an_unknown_kind():
    program = parse_plog(
        "i = {1..3000}. kind = {fair, loaded}. #domain i(I). coin : kind. random(coin)."
        " heads : i -> boolean. random(heads(I)). pr(heads(I) | coin=loaded) = 2/3."
    )
    circuit = Reasoner(program).compile(["heads"], "coin")
    ones = 1755
    seen = {f"heads({i})": "true" if i <= ones else "false" for i in range(1, 3001)}
    odds = Fraction(2, 3) ** ones * Fraction(1, 3) ** (3000 - ones) / Fraction(1, 2) ** 3000
    assert circuit(seen)["loaded"] == pytest.approx(float(odds / (1 + odds)), abs=1e-9)  # 3000 roundings
    assert circuit.exact(seen)["loaded"] == odds / (1 + odds)


def test_improbable_is_not_impossible():
    """2000 heads of a fair coin, where they are certain of a loaded one: 2^-2000 has no floating point."""
    program = parse_plog(
        "i = {1..2000}. kind = {fair, loaded}. #domain i(I). coin : kind. random(coin)."
        " heads : i -> boolean. random(heads(I)). pr(heads(I) | coin=loaded) = 1. more : boolean."
        " random(more). pr(more | coin=fair) = 1/4. pr(more | coin=loaded) = 1."
    )
    circuit = Reasoner(program).compile(["coin", "heads"], "more")
    seen = {"coin": "fair", **{f"heads({i})": "true" for i in range(1, 2001)}}
    assert circuit(seen)["true"] == 0.25
    assert circuit.exact(seen)["true"] == Fraction(1, 4)
    assert circuit.most_probable(seen)[0].measure == Fraction(3, 4)


def test_improbable_hidden_values():
    program = parse_plog(
        "i = {1..2000}. #domain i(I). heads, all : i -> boolean. random(heads(I)). all(1) :- heads(1)."
        " all(I+1) :- all(I), heads(I+1). last : boolean. random(last) :- all(2000)."
        " pr(last | all(2000)) = 1/4. last=false :- not all(2000)."
    )
    assert Reasoner(program).compile(["all(2000)"], "last")({"all(2000)": "true"})["true"] == pytest.approx(
        0.25
    )


@pytest.mark.parametrize("n", [5_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_thousands_of_values(n):
    program = parse_plog(f"n = {{1..{n}}}. x : n. random(x). pr(x=7) = 1/2. low : boolean. low :- x < 8.")
    circuit = Reasoner(program).compile(["x"], "x")
    assert circuit({})["7"] == pytest.approx(0.5, abs=1e-12)
    assert circuit({})[str(n)] == pytest.approx(0.5 / (n - 1), abs=1e-12)
    assert circuit({"x": str(n)})[str(n)] == 1.0


def test_squares_of_a_chessboard():
    """Eight queens by chance: constraints over all pairs."""
    program = parse_plog(
        "n = {1..6}. #domain n(X;Y). q : n -> n. random(q(X)). :- q(X)=V, q(Y)=V, X < Y."
        " :- q(X)=V, q(Y)=V+Y-X, X < Y. :- q(X)=V, q(Y)=V-Y+X, X < Y."
    )
    circuit = Reasoner(program).compile(["q(2)"], "q(1)")
    placed = [  # the four solutions for six queens, by the row of the first
        (2, 4, 6, 1, 3, 5), (3, 6, 2, 5, 1, 4), (4, 1, 5, 2, 6, 3), (5, 3, 1, 6, 4, 2),
    ]  # fmt: skip
    assert circuit.exact({}) == {str(v): Fraction(sum(p[0] == v for p in placed), 4) for v in range(1, 7)}
    assert circuit.exact({"q(2)": "6"})["3"] == 1
    with pytest.raises(UndefinedError):
        circuit({"q(2)": "2"})


def test_wide_constraint_counts_subsets():
    n = 40
    program = parse_plog(
        f"i = {{1..{n}}}. c = {{0..{n}}}. on : i -> boolean. random(on(I)). k : i -> c. #domain i(I)."
        " k(1)=1 :- on(1). k(1)=0 :- on(1)=false. k(I+1)=V+1 :- k(I)=V, on(I+1). k(I+1)=V :- k(I)=V,"
        f" on(I+1)=false. :- not k({n})=20."
    )
    circuit = Reasoner(program).compile(["on(1)", "on(2)", "on(3)"], "on(40)")
    given = {"on(1)": "true", "on(2)": "true", "on(3)": "false"}
    assert circuit.exact(given)["true"] == Fraction(comb(n - 4, 17), comb(n - 3, 18))
    assert prod(circuit.exact({}).values()) == Fraction(1, 4)
