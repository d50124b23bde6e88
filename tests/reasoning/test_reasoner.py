"""The reasoner: choice of the method, warnings, caches and errors."""

from __future__ import annotations

import pickle
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError
from lcorpp.reasoning import Enumeration, Reasoner, ReasoningWarning, parse_plog, parse_query, read_plog
from lcorpp.values import Likelihood

PLOG = Path(__file__).parent.parent / "plog"
LCORPP = read_plog(PLOG / "lcorpp.plog")
HEART = read_plog(PLOG / "heart.plog")  # cr-rules
GOLDEN = {"time": "afternoon", "location": "classroom", "classifier": "zero"}


@pytest.fixture
def small(monkeypatch):
    """Make every program too large for compilation."""
    monkeypatch.setattr("lcorpp.reasoning.diagram.decision_diagram.build_decision_diagram.__defaults__", (1,))


def test_posterior_by_reasoner_and_enumeration():
    expected = Enumeration(LCORPP).exact("identity", GOLDEN)
    for reasoner in (Reasoner(LCORPP), Enumeration(LCORPP)):
        found = reasoner.posterior("identity", GOLDEN)
        assert found.values == tuple(expected)
        assert found.probabilities == pytest.approx([float(p) for p in expected.values()], abs=1e-12)
    assert Reasoner(LCORPP).exact("identity", GOLDEN) == expected
    assert expected["student"] == pytest.approx(0.359531, abs=5e-7)


def test_many_posteriors_are_those_of_single_evidences():
    """One circuit answers evidences about different terms, some of them soft."""
    evidence = [
        {},
        {"time": "morning"},
        {"location": "library", "classifier": "one"},
        {"classifier": Likelihood(("one", "zero"), np.array([0.2, 0.7])), "time": "evening"},
        GOLDEN,
    ]
    for subject in ("intention", ["identity", "intention"]):
        found = Reasoner(LCORPP).posteriors(subject, evidence)
        single = [Reasoner(LCORPP).posterior(subject, each) for each in evidence]
        assert [answer.values for answer in found] == [answer.values for answer in single]
        for answer, other in zip(found, single, strict=True):
            assert answer.probabilities == pytest.approx(other.probabilities, rel=1e-15, abs=0)
    assert Reasoner(LCORPP).posteriors("intention", []) == []


def test_many_posteriors_of_cr_rules_are_enumerated():
    found = Reasoner(HEART).posteriors("active", [{"slow": "true"}, {"slow": "true", "diet": "false"}])
    assert [answer["true"] for answer in found] == pytest.approx([40 / 43, 1], abs=1e-12)


def test_many_posteriors_of_a_too_large_program_are_estimates(small):
    with pytest.warns(ReasoningWarning):
        found = Reasoner(LCORPP).posteriors("intention", [GOLDEN, {}])
    with pytest.warns(ReasoningWarning):
        single = [Reasoner(LCORPP).posterior("intention", each) for each in (GOLDEN, {})]
    assert list(map(repr, found)) == list(map(repr, single))


@pytest.mark.parametrize(
    ("program", "question", "good", "evidence"),
    [
        (LCORPP, "intention", GOLDEN, {"time": "noon"}),
        (LCORPP, "intention", GOLDEN, {"wrong": "x"}),
        (LCORPP, "wrong", GOLDEN, {}),
        (parse_plog("p, q : boolean. random(p). q :- p."), "q", {"p": "true"}, {"p": "false"}),
        (parse_plog("p, q : boolean. random(p). q :- p. pr(p) = 0."), "p", {}, {"q": "true"}),
    ],
)
def test_the_error_of_many_posteriors_is_that_of_the_evidence(program, question, good, evidence):
    with pytest.raises((ProgramError, UndefinedError)) as single:
        Reasoner(program).posterior(question, evidence)
    with pytest.raises(type(single.value)) as many:
        Reasoner(program).posteriors(question, [good, evidence])
    assert str(many.value) == str(single.value)


def test_answers_are_cached_and_a_full_cache_is_cleared(monkeypatch):
    reasoner = Reasoner(LCORPP)
    first = reasoner.posterior("intention", GOLDEN)
    assert reasoner.posterior("intention", GOLDEN) is first
    assert (
        reasoner.posterior("intention", dict(reversed(GOLDEN.items())))["interested"] == first["interested"]
    )
    monkeypatch.setattr("lcorpp.reasoning.reasoner.CACHE_SIZE", 1)
    for value in ("morning", "afternoon", "evening"):
        reasoner.posterior("intention", {"time": value})
    assert reasoner.posterior("intention", GOLDEN)["interested"] == first["interested"]


def test_interventions_differ_from_observations():
    reasoner = Reasoner(read_plog(PLOG / "rat.plog"))
    assert reasoner.posterior("arsenic", {"death": "true"})["true"] == pytest.approx(0.981595, abs=5e-7)
    assert reasoner.posterior("arsenic", do={"death": "true"})["true"] == pytest.approx(0.4, abs=1e-12)
    assert reasoner.exact("arsenic", {}, {"death": "true"})["true"] == Fraction(2, 5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("weather", {}), "'weather'"),
        (("intention", {"weather": "wet"}), "'weather'"),
        (
            ("intention", {"time": "noon"}),
            "'noon' is not a value of time; expected one of morning, afternoon",
        ),
        (("intention", {"time": 3}), "3 is not a value of time"),
        (("intention", {"time": None}), "None is not a value of time"),
        (("intention", {"time": b"morning"}), "b'morning' is not a value of time"),
        (("intention", {"time": ["morning"]}), r"\['morning'\] is not a value of time"),
        (("intention", {b"time": "morning"}), "expected the name of an attribute, not b'time'"),
        (("intention", {3: "morning"}), "expected the name of an attribute, not 3"),
        (("intention", {None: "morning"}), "expected the name of an attribute, not None"),
        (([], {}), r"expected the name of an attribute, not \[\]"),
        ((None, {}), "expected the name of an attribute, not None"),
        (("intention", {}, {"time": "noon"}), "'noon' is not a value of time"),
        (("intention", {}, {"weather": "wet"}), "'weather'"),
        (("Time", {}), "'Time' is not an attribute"),
        (("time = morning", {}), "time = morning"),
        (("time", {"time": "morning", " time": "evening"}), "the evidence gives  time two values"),
    ],
)
def test_invalid_terms_and_evidence_are_errors(arguments, words):
    reasoner = Reasoner(LCORPP)
    for ask in (reasoner.posterior, reasoner.exact):
        with pytest.raises(ProgramError, match=words):
            ask(*arguments)


def test_values_may_be_numpy_strings():
    found = Reasoner(LCORPP).posterior("intention", {"time": np.str_("morning")})
    assert found["interested"] == Reasoner(LCORPP).posterior("intention", {"time": "morning"})["interested"]


def test_impossible_evidence():
    program = parse_plog("p, q : boolean. random(p). q :- p.", file="a.plog")
    for ask in (Reasoner(program).posterior, Reasoner(program).exact):
        with pytest.raises(
            UndefinedError, match=r"a\.plog: no possible world of positive measure has .*p=false"
        ):
            ask("q", {"q": "true", "p": "false"})
    with pytest.raises(ProgramError, match=r"a\.plog: q has no value with probability 1/2; ask for q=value"):
        Reasoner(program).exact("q", {})
    with pytest.raises(
        UndefinedError, match=r"a\.plog: no possible world .* has obs\(q=true\), do\(p=false\)"
    ):
        Reasoner(program).ask(parse_query("?{q} | obs(q), do(p=false)", program))


def test_ask_for_a_distribution_or_a_conjunction():
    reasoner = Reasoner(LCORPP)
    query = parse_query("?{identity=student, not time!=morning} | obs(location!=library)", LCORPP)
    assert reasoner.ask(query, exact=True) == Enumeration(LCORPP).ask(query) != 0
    assert reasoner.ask(query) == pytest.approx(float(Enumeration(LCORPP).ask(query)), abs=1e-12)
    query = parse_query("identity | obs(time=morning)", LCORPP)
    assert reasoner.ask(query, exact=True) == Enumeration(LCORPP).ask(query)
    assert list(reasoner.ask(query)) == ["student", "professor", "visitor"]


def test_impossible_queries_have_probability_0():
    program = parse_plog("p, q : boolean. random(p). pr(p) = 0.")
    for text in ("?{p}", "?{q}", "?{p, not p}", "?{p=true, p=false}"):
        assert Reasoner(program).ask(parse_query(text, program), exact=True) == 0
    assert Reasoner(program).ask(parse_query("?{not q}", program), exact=True) == 1


def test_queries_that_do_not_match_the_program_are_errors():
    other = parse_plog("weather : boolean. random(weather).")
    with pytest.raises(ProgramError, match="'weather' is not declared"):
        Reasoner(LCORPP).ask(parse_query("?{weather}", other))
    query = parse_query("?{time=morning} | do(time=morning), do(time=evening)", LCORPP)
    with pytest.raises(ProgramError, match=r"do\(time\) sets two values, morning and evening"):
        Reasoner(LCORPP).ask(query)


def test_cr_rules_are_enumerated():
    assert HEART.has_cr_rules
    reference, reasoner = Enumeration(HEART), Reasoner(HEART)
    for text in ("?{active} | obs(slow)", "?{unusual}"):
        query = parse_query(text, HEART)
        assert reasoner.ask(query, exact=True) == reference.ask(query)
        assert reasoner.ask(query) == float(reference.ask(query))
    assert reasoner.posterior("active", {"slow": "true"})["true"] == pytest.approx(40 / 43)
    assert reasoner.exact("active", {"slow": "true"})["true"] == Fraction(40, 43)
    assert reasoner.sample(np.random.default_rng(0), {"slow": "true"})["unusual"] == "true"
    with pytest.raises(ProgramError, match="cr-rules cannot be compiled"):
        reasoner.compile([], "active")


def test_too_large_warns_and_estimates(small):
    reasoner = Reasoner(LCORPP, samples=4000)
    with pytest.warns(ReasoningWarning) as issued:
        found = reasoner.posterior("intention", GOLDEN)
    words = " MiB of arcs in the decision diagram: estimated from 4000 worlds"
    assert [words in str(warning.message) for warning in issued] == [False, True]
    assert 400 < found.effective < 4000
    exact = Enumeration(LCORPP).exact("intention", GOLDEN)
    for p, interval in zip(exact.values(), found.intervals, strict=True):
        assert abs(interval.estimate - float(p)) < 1.3 * (interval.high - interval.low)
    assert found.probabilities.sum() == pytest.approx(1)
    with pytest.warns(ReasoningWarning):
        asked = reasoner.ask(parse_query("intention | obs(time=morning)", LCORPP))
    exact = Enumeration(LCORPP).exact("intention", {"time": "morning"})
    for value, estimate in asked.items():
        assert 0 < estimate.interval.high - estimate.interval.low < 0.08
        assert abs(estimate - float(exact[value])) < 0.08
    with pytest.warns(ReasoningWarning):
        asked = reasoner.ask(parse_query("?{intention=interested, time=morning}", LCORPP))
    assert isinstance(asked, float)
    assert 0 < asked.interval.high - asked.interval.low < 0.08


def test_exact_methods_of_a_too_large_program_are_errors(small):
    reasoner = Reasoner(LCORPP)
    for answer in (
        lambda: reasoner.exact("intention", {}),
        lambda: reasoner.compile([], "intention"),
        lambda: reasoner.ask(parse_query("intention", LCORPP), exact=True),
        lambda: reasoner.sample(np.random.default_rng(0)),
    ):
        with pytest.raises(TooLargeError, match=r"lcorpp\.plog: more than \S+ MiB of arcs in the decision"):
            answer()


def test_estimates_of_undefined_answers_are_errors(small):
    program = parse_plog("p, q : boolean. random(p). random(q) :- p.")
    with (
        pytest.warns(ReasoningWarning),
        pytest.raises(ProgramError, match=r"q has no value with probability 0\.\d+ \[0\.\d+, 0\.\d+\];"),
    ):
        Reasoner(program, samples=1000).posterior("q", {})
    words = r"no sample satisfied the evidence, which is improbable or impossible: .* 0 in 10 w"
    with pytest.warns(ReasoningWarning), pytest.raises(TooLargeError, match=words):
        Reasoner(program, samples=10).posterior("p", {"q": "true", "p": "false"})


def test_large_programs_are_refused(monkeypatch):
    """30 terms that constraints join pairwise: more states than any machine could hold."""
    monkeypatch.setattr(
        "lcorpp.reasoning.diagram.decision_diagram.build_decision_diagram.__defaults__", (200_000,)
    )
    program = parse_plog(
        "i = {1..30}. c : i -> i. random(c(I)). #domain i(I;J). same : i, i -> boolean."
        " same(I,J) :- c(I)=V, c(J)=V, I < J. some : boolean. some :- not same(1,2), same(3,4), not"
        " same(5,30)."
        " :- same(I,J)."
    )
    with pytest.raises(TooLargeError, match=r"more than 0.1907 MiB of arcs"):
        Reasoner(program).compile([], "c(1)")


def test_the_progress_of_a_large_diagram_is_reported(monkeypatch):
    monkeypatch.setattr("lcorpp.reasoning.diagram.decision_diagram.TRIALS", ((0, 1e3),))
    reports = []
    query = parse_query("intention | obs(time=morning)", LCORPP)
    found = Reasoner(LCORPP).ask(query, progress=lambda share, text: reports.append((share, text)))
    assert found == Reasoner(LCORPP).ask(query)
    shares, texts = zip(*reports, strict=True)
    assert [*shares] == [step / len(shares) for step in range(len(shares))]
    arcs = [int(text.removesuffix(" arcs of the decision diagram")) for text in texts]
    assert arcs[0] == 0
    assert arcs == sorted(arcs)
    assert arcs[-1] > 0


def test_samples_follow_the_world_probabilities():
    reasoner, draws, rng = Reasoner(LCORPP), 3000, np.random.default_rng(7)
    for given in ({}, {"classifier": "one"}):
        counts = Counter(reasoner.sample(rng, given)["intention"] for _ in range(draws))
        p = float(reasoner.exact("intention", given)["interested"])
        assert abs(counts["interested"] - draws * p) <= 5 * sqrt(draws * p * (1 - p))
    with pytest.raises(ProgramError, match="'noon' is not a value of time"):
        reasoner.sample(rng, {"time": "noon"})
    with pytest.raises(UndefinedError):
        Reasoner(parse_plog("p : boolean. random(p). :- p.")).sample(rng, {"p": "true"})


def test_reasoners_can_be_pickled():
    reasoner = Reasoner(LCORPP, samples=7)
    reasoner.posterior("intention", GOLDEN)
    again = pickle.loads(pickle.dumps(reasoner))
    assert again.posterior("intention", GOLDEN)["interested"] == pytest.approx(0.220250, abs=5e-7)
    assert again.samples == 7


def test_threads_may_share_a_reasoner():
    reasoner = Reasoner(read_plog(PLOG / "lcorpp.plog"))
    times = ["morning", "afternoon", "evening"] * 20
    with ThreadPoolExecutor(8) as pool:
        found = [
            p["interested"] for p in pool.map(lambda t: reasoner.posterior("intention", {"time": t}), times)
        ]
    assert found == found[:3] * 20


@pytest.mark.parametrize("evidence", [{"p": "true"}, {"f(g(a),1)": "u"}, {"f( g(a), 1 )": "u"}])
def test_records_name_terms_and_values(evidence):
    program = parse_plog(
        "sorts #c = {a, b}. #r = g(#c). #n = 1..2. #s = {u, v}. attributes f : #r, #n -> #s. p : #boolean."
        " best : #r. statements random(f(X,N)). random(p) :- f(g(a),1) = u. p=false :- f(g(a),1) = v."
        " best = X :- f(X,1) = u, f(Y,1) = v. best = g(a) :- f(g(a),1) = V, f(g(b),1) = V."
    )
    assert Reasoner(program).posterior("f(g(a),1)", evidence)["u"] == 1
    found = Reasoner(program).exact("best", evidence)
    assert found == Enumeration(program).exact("best", evidence) == {"g(a)": 1, "g(b)": 0}


def test_sorts_of_one_member():
    program = parse_plog(
        "sorts #n = 1..3. #left = #n - {2, 3}. attributes x : #left. f : #left -> #boolean."
        " statements random(x). random(f(X)) :- x = X. pr(f(X)) = 1/4."
    )
    circuit = Reasoner(program).compile(["f", "x"], "f(1)")
    assert circuit({"x": "1"})["true"] == 0.25
    assert circuit(np.array([[-1, 0], [0, -1]])).tolist() == [[0.25, 0.75], [1, 0]]


def test_empty_sorts_are_refused():
    with pytest.raises(ProgramError, match="1:18: the sort none is empty"):
        parse_plog("sorts #n = 1..2. #none = #n - #n. attributes x : #none. statements random(x).")


@pytest.mark.parametrize(
    "text",
    [
        "x : n. random(x). random(x).",
        "x : n. random(x). pr(x=1) = 1/2. pr(x=1) = 1/3.",
        "x : n. ok : n -> boolean. ok(3). random(x : {V : ok(V)}). pr(x=1) = 1/2.",
        "x : n. random(x). pr(x=1) = 3/4. pr(x=2) = 1/2.",
        "x : n. random(x). pr(x=V) = 1/2.",
    ],
)
def test_both_reasoners_report_a_violated_condition_in_the_same_words(text):
    """A range such as {3} must not be taken for the place of a statement."""
    program = parse_plog(f"n = {{1..3}}. {text}")
    with pytest.raises(ProgramError) as counted:
        Enumeration(program).posterior("x", {})
    with pytest.raises(ProgramError) as compiled:
        Reasoner(program).posterior("x")
    first, second = (str(error.value).partition(", in the world ")[0] for error in (counted, compiled))
    assert first == second
