"""The exact reasoner: known answers, conditions of the language, and what must be refused."""

from __future__ import annotations

import pickle
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning import Enumeration, Program, ask, parse_plog, parse_query, read_plog

PLOG = Path(__file__).parents[2] / "plog"
SEEN = {"time": "afternoon", "location": "classroom", "classifier": "zero"}


@pytest.fixture(scope="module")
def lcorpp() -> Enumeration:
    return Enumeration(read_plog(PLOG / "lcorpp.plog"))


def probability(program: Program, query: str) -> Fraction:
    return Enumeration(program).ask(parse_query(query, program))


def test_golden_marginals_are_exact(lcorpp: Enumeration) -> None:
    # By hand: prior 1/3 each, times P(afternoon|i) P(classroom|i) (P(int|i) .24 + P(not|i) .71).
    weights = {
        "student": Fraction(15, 100) * Fraction(7, 10) * Fraction(569, 1000),
        "professor": Fraction(1, 10) * Fraction(9, 10) * Fraction(663, 1000),
        "visitor": Fraction(7, 10) * Fraction(2, 10) * Fraction(334, 1000),
    }
    total = sum(weights.values())
    assert lcorpp.exact("identity", SEEN) == {name: weight / total for name, weight in weights.items()}
    marginal = lcorpp.posterior("identity", SEEN)
    assert marginal.values == ("student", "professor", "visitor")
    assert marginal.probabilities == pytest.approx([0.359531, 0.359079, 0.281390], abs=5e-7)  # six digits
    assert lcorpp.posterior("intention", SEEN)["interested"] == pytest.approx(0.220250, abs=5e-7)


def test_worlds_are_a_distribution(lcorpp: Enumeration) -> None:
    assert len(lcorpp.worlds) == 72
    assert sum(world.measure for world in lcorpp.worlds) == 1


def test_attributes_and_equality_of_programs(lcorpp: Enumeration) -> None:
    program = lcorpp.program
    assert program.attributes["time"].values == ("morning", "afternoon", "evening")
    assert program.attributes["time"].line == 11
    assert pickle.loads(pickle.dumps(program)) == program
    again = pickle.loads(pickle.dumps(lcorpp))
    assert again.exact("identity", SEEN) == lcorpp.exact("identity", SEEN)


def test_ask_gives_distribution_or_probability(lcorpp: Enumeration) -> None:
    whole = ask(lcorpp.program, parse_query("intention", lcorpp.program))
    assert isinstance(whole, dict)
    assert sum(whole.values()) == 1
    assert ask(lcorpp.program, parse_query("?{intention=interested}.", lcorpp.program)) == whole["interested"]


def test_samples_follow_the_measure(lcorpp: Enumeration) -> None:
    rng = np.random.default_rng(7)
    drawn = [lcorpp.sample(rng, SEEN) for _ in range(4000)]
    assert all(world["time"] == "afternoon" for world in drawn)
    share = np.mean([world["identity"] == "visitor" for world in drawn])
    assert share == pytest.approx(0.281390, abs=0.03)  # four standard errors of 4000 draws


def test_a_sample_never_has_measure_zero() -> None:
    program = parse_plog("s={a,b,c}. x : s. random(x). pr(x=b)=1.")
    rng = np.random.default_rng(0)
    assert {Enumeration(program).sample(rng)["x"] for _ in range(20)} == {"b"}


@pytest.mark.parametrize(
    ("evidence", "words"),
    [
        ({"tim": "morning"}, "'tim' is not declared; expected one of identity, time"),
        ({"time": "night"}, "'night' is not a value of time; expected one of morning, afternoon, evening"),
        ({"time(": "night"}, "'time(': unexpected end"),
        ({"3": "night"}, "'3' is not an attribute"),
    ],
)
def test_unknown_evidence_is_named(lcorpp: Enumeration, evidence: dict[str, str], words: str) -> None:
    with pytest.raises(ProgramError) as caught:
        lcorpp.posterior("identity", evidence)
    assert words in str(caught.value)


def test_impossible_evidence_is_undefined_not_zero() -> None:
    program = parse_plog("p : boolean. q : boolean. random(p). q :- p. -q :- -p.", file="pq.plog")
    with pytest.raises(
        UndefinedError, match=r"pq\.plog: no possible world of positive measure has p=true, q=false"
    ):
        Enumeration(program).posterior("p", {"p": "true", "q": "false"})
    with pytest.raises(UndefinedError, match=r"obs\(not p=true\), obs\(q=true\)"):
        probability(program, "p=true | obs(not p), obs(q)")


def test_inconsistent_program_is_undefined() -> None:
    with pytest.raises(UndefinedError, match="no possible world"):
        probability(parse_plog("p : boolean. random(p). :- p. :- -p."), "p=true")
    with pytest.raises(UndefinedError, match="no possible world of positive measure"):
        probability(parse_plog("p : boolean. random(p). pr(p)=1. obs(-p)."), "p=true")


def test_partial_attributes_are_an_error_with_the_probability() -> None:
    program = parse_plog("p : boolean. q : boolean. random(p). random(q) :- p.")
    with pytest.raises(ProgramError, match="q has no value with probability 1/2; ask for q=value"):
        Enumeration(program).posterior("q", {})
    assert Enumeration(program).exact("q", {"p": "true"})["true"] == Fraction(1, 2)
    assert probability(program, "q=true") == Fraction(1, 4)
    assert probability(program, "q!=true") == Fraction(1, 4)
    assert probability(program, "not q=true") == Fraction(3, 4)
    assert probability(program, "not q!=true") == Fraction(3, 4)


def test_partial_attributes_in_rules() -> None:
    program = parse_plog("""p : boolean. q : boolean. random(p). random(q) :- p.
        r1 : boolean. r2 : boolean. r3 : boolean.
        r1 :- q != true. r2 :- not q != true. r3 :- not q.""")
    for term, expected in {"r1": Fraction(1, 4), "r2": Fraction(3, 4), "r3": Fraction(3, 4)}.items():
        assert probability(program, f"{term}=true") == expected


def test_observations_and_interventions_reach_terms_with_arguments() -> None:
    # plog 2.0 ignores both on attributes with arguments and values other than true and false
    text = "d = {x, y}. v = {1..3}. f : d -> v. g : boolean. random(f(D)). g :- f(x) = 3."
    program = parse_plog(text)
    assert Enumeration(program).exact("f(x)", {"f(x)": "2"})["2"] == 1
    assert Enumeration(program).exact("f( x )", {}, {"f(x)": "2"})["2"] == 1
    assert probability(program, "f(y)=1 | obs(f(x)=2)") == Fraction(1, 3)
    assert probability(parse_plog(text + "obs(f(x)!=1)."), "g=true") == Fraction(1, 2)
    assert probability(parse_plog(text + "do(f(x)=3)."), "g=true") == 1


def test_intervention_removes_the_probability_of_the_term() -> None:
    program = parse_plog("p : boolean. q : boolean. random(p). random(q). pr(q|p)=1/4. pr(q|-p)=3/4.")
    assert probability(program, "p=true | do(q)") == Fraction(1, 2)
    assert probability(program, "p=true | obs(q)") == Fraction(1, 4)
    assert Enumeration(program).exact("p", {}, {"q": "true"})["true"] == Fraction(1, 2)
    with pytest.raises(ProgramError, match="sets two values"):
        probability(program, "p=true | do(q), do(-q)")
    derived = parse_plog("p : boolean. q : boolean. random(p). q :- p.")
    with pytest.raises(ProgramError, match="q has no random selection"):
        Enumeration(derived).exact("p", {}, {"q": "true"})


def test_default_probability_shares_over_the_possible_values() -> None:
    text = """s = {a, b, c, d}. x : s. ok : s -> boolean. ok(a). ok(b). ok(c).
        random(x : {X : ok(X)}). pr(x=a) = 0.5."""
    program = parse_plog(text)
    assert Enumeration(program).exact("x", {}) == {
        "a": Fraction(1, 2),
        "b": Fraction(1, 4),
        "c": Fraction(1, 4),
        "d": Fraction(0),
    }


def test_normalisation_is_global() -> None:
    # The constraint removes mass from p=true only, so p is no longer even.
    program = parse_plog("p : boolean. q : boolean. random(p). random(q). :- p, q.")
    assert probability(program, "p=true") == Fraction(1, 3)


def test_numbers_may_be_computed_from_variables() -> None:
    program = parse_plog("n = {1..4}. k : n. p : boolean. random(k). random(p). pr(p | k=K) = 1/K - 0.05*K.")
    assert probability(program, "p=true | obs(k=2)") == Fraction(2, 5)
    text = "n = {1..3}. k : n. p : boolean. random(k). random(p).\npr(p | k=K) = (2-K)/4."
    words = r"2:1: the probability -1/4 is not between 0 and 1, in the world \{k=3, p="
    with pytest.raises(ProgramError, match=words):
        probability(parse_plog(text), "p=true")


def test_loops_have_answers() -> None:
    # an even loop gives two stable models for one selection; both count with the whole measure
    program = parse_plog("p : boolean. a : boolean. b : boolean. random(p). a :- p, not b. b :- p, not a.")
    assert probability(program, "a=true") == Fraction(1, 3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "p : boolean. q : boolean.\nrandom(p).\nrandom(q).\nrandom(q) :- p.",
            "c.plog:4:1: Condition 1: q is also selected at random by the rule at c.plog:3:1, in",
        ),
        (
            "s={a,b}. ok : s, s -> boolean. x : s.\nok(Z,Y).\nrandom(x : {Y : ok(Z,Y)}) :- s(Z).",
            "x is also selected at random by the rule at c.plog:3:1 with other values of its variables",
        ),
        (
            "p : boolean. q : boolean. random(p). random(q).\npr(q) = 1/2.\npr(q | p) = 1/2.",
            "c.plog:3:1: Condition 2: q=true also has a pr-atom at c.plog:2:1, in the world {p=true",
        ),
        (
            "s={a,b,c}. x : s. ok : s -> boolean. ok(a). ok(b). random(x : {X : ok(X)}).\npr(x=c) = 1/2.",
            "c.plog:2:1: Condition 3: x=c has a pr-atom outside of its dynamic range {a, b}, in the world {",
        ),
        (
            "s={a,b,c}. x : s. random(x).\npr(x=a) = 0.75. pr(x=b) = 0.75.",
            "c.plog:2:1: not unitary: the probabilities of x sum to 3/2, not at most 1, with the pr-atom at"
            " c.plog:2:17, in the world {x=",
        ),
        (
            "p : boolean. random(p).\npr(p) = 1/2.\npr(-p) = 1/4.",
            "c.plog:2:1: not unitary: the probabilities of p sum to 3/4, not 1, with the pr-atom at"
            " c.plog:3:1, in the world {p=false}",
        ),
    ],
)
def test_conditions_of_the_language(text: str, words: str) -> None:
    with pytest.raises(ProgramError) as caught:
        assert Enumeration(parse_plog(text, file="c.plog")).worlds
    assert words in str(caught.value)


def test_labels_distinguish_selections_and_their_arguments_instances() -> None:
    program = parse_plog("""p : boolean. q : boolean. random(p).
        [r1] random(q) :- p. [r2] random(q) :- -p. [r1] pr(q) = 1/4. [r2] pr(q) = 3/4.""")
    assert probability(program, "q=true | obs(p)") == Fraction(1, 4)
    assert probability(program, "q=true | obs(-p)") == Fraction(3, 4)
    program = parse_plog("d={x,y}. f : d -> boolean. [r(D)] random(f(D)). [r(x)] pr(f(x)) = 1/4.")
    assert probability(program, "f(x)=true") == Fraction(1, 4)
    assert probability(program, "f(y)=true") == Fraction(1, 2)


def test_records_intervals_and_negative_numbers() -> None:
    text = """place = {at(1,1), at(1,2), home}. n = {-1..1}. x : place. y : n. z : n. random(x). random(y).
        z = Y mod 2 :- y = Y.  w : boolean. w :- x = at(1,K), n(K)."""
    program = parse_plog(text)
    assert program.attributes["x"].values == ("at(1,1)", "at(1,2)", "home")
    assert Enumeration(program).exact("x", {"x": "at(1,2)"})["at(1,2)"] == 1
    assert Enumeration(program).exact("z", {"y": "-1"})["-1"] == 1
    assert probability(program, "w=true") == Fraction(1, 3)


def test_instances_outside_of_their_sorts_are_dropped() -> None:
    program = parse_plog("t = {0..2}. f : t -> t. random(f(0)). f(T+1) = V+1 :- f(T) = V.")
    assert Enumeration(program).exact("f(2)", {"f(0)": "0"})["2"] == 1
    with pytest.raises(ProgramError, match=r"f\(1\) has no value with probability 1/3"):
        Enumeration(program).exact("f(1)", {})


def test_too_many_worlds_are_refused() -> None:
    program = parse_plog("n = {1..20}. f : n -> boolean. random(f(X)).", file="big.plog")
    with pytest.raises(ProgramError, match="more than 1000 possible worlds"):
        assert Enumeration(program, limit=1000).worlds


def test_undefined_arithmetic_is_an_error_at_its_statement(capfd: pytest.CaptureFixture[str]) -> None:
    program = parse_plog("n = {0..2}. x : n. p : boolean. random(x).\np :- x = X, 2/X = 1.", file="d.plog")
    with pytest.raises(ProgramError, match=r"d\.plog:2:1: cannot be grounded: operation undefined"):
        assert Enumeration(program).worlds
    assert capfd.readouterr() == ("", "")


def test_clingo_is_loaded_only_to_enumerate() -> None:
    code = (
        "import sys, lcorpp.reasoning as r; r.parse_plog('p : boolean.'); assert 'clingo' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
