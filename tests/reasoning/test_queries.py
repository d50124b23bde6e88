"""Queries about several attributes: joint distributions."""

from __future__ import annotations

from fractions import Fraction
from math import prod
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from tests.reasoning.circuit.programs import Case, cases
from tests.reasoning.circuit.test_agreement import SUITE, check, outcome

from lcorpp.errors import ParseError, ProgramError, TooLargeError, UndefinedError
from lcorpp.reasoning import (
    Enumeration,
    Reasoner,
    ReasoningWarning,
    load_circuit,
    parse_plog,
    parse_query,
    read_plog,
    save_circuit,
)
from lcorpp.values import Likelihood

PLOG = Path(__file__).parents[1] / "plog"
HOUSE = parse_plog(
    "items = {cup, plate}. people = {ann, bob}. times = {am, noon}."
    " item : items. person : people. time : times. random(time). random(person). random(item)."
    " pr(person=ann | time=noon) = 3/4. pr(item=cup | person=ann) = 1/5.",
    file="house.plog",
)
PAIRS = [("cup", "ann"), ("cup", "bob"), ("plate", "ann"), ("plate", "bob")]
NOON = [Fraction(3, 20), Fraction(1, 8), Fraction(3, 5), Fraction(1, 8)]
PARTIAL = parse_plog("p, q : boolean. random(p). random(q) :- p.", file="partial.plog")


@pytest.mark.parametrize("engine", [Enumeration, Reasoner])
def test_the_joint_keeps_the_correlation(engine):
    reasoner = engine(HOUSE)
    assert reasoner.exact(["item", "person"], {"time": "noon"}) == dict(zip(PAIRS, NOON, strict=True))
    found = reasoner.posterior(["item", "person"], {"time": "noon"})
    assert found.values == tuple(PAIRS)
    assert found.probabilities == pytest.approx([float(p) for p in NOON], abs=1e-12)
    assert found["plate", "ann"] == pytest.approx(0.6)
    assert found.most_likely() == ("plate", "ann")
    assert repr(found).startswith("Distribution((cup, ann): 0.15, (cup, bob): 0.125")
    assert "<td>(cup, ann)</td>" in found._repr_html_()
    assert reasoner.exact(["item"], {"time": "noon"}) == {
        ("cup",): Fraction(11, 40), ("plate",): Fraction(29, 40),
    }  # fmt: skip
    assert reasoner.exact(("person", "item"), do={"person": "bob"})["bob", "cup"] == Fraction(1, 2)


def test_queries_without_values_ask_for_the_joint():
    query = parse_query("item, person | obs(time=noon)", HOUSE)
    assert parse_query(str(query), HOUSE) == query
    assert str(query) == "?item, person | obs(time=noon)."
    answer = dict(zip(PAIRS, NOON, strict=True))
    assert Enumeration(HOUSE).ask(query) == Reasoner(HOUSE).ask(query, exact=True) == answer
    assert Reasoner(HOUSE).ask(query) == pytest.approx({v: float(p) for v, p in answer.items()}, abs=1e-12)
    program = parse_plog(f"{HOUSE}{query}")
    assert program.queries == (query,)
    assert parse_plog(str(program)) == program
    assert parse_query("?{p, q}", PARTIAL).subjects == ()  # in braces a conjunction of booleans


@SUITE
@given(cases(), st.data())
def test_joints_of_random_programs_agree_with_the_enumeration(case: Case, data: st.DataObject):
    others = [name for name in case.inputs if name != case.query]
    names = data.draw(st.permutations([case.query, *others[:2]]))
    check(Case(**{**vars(case), "query": "?" + ", ".join(names)}))


def test_the_joint_has_the_marginals():
    program = read_plog(PLOG / "lcorpp.plog")
    reasoner, names = Reasoner(program), ["identity", "intention", "location"]
    joint = reasoner.exact(names, {"time": "morning"})
    for i, name in enumerate(names):
        marginal = dict.fromkeys(program.attributes[name].values, Fraction(0))
        for value, p in joint.items():
            marginal[value[i]] += p
        assert marginal == reasoner.exact(name, {"time": "morning"})
    assert joint != {v: prod(reasoner.exact(n, {"time": "morning"})[x] for n, x in zip(names, v, strict=True))
                     for v in joint}  # fmt: skip


def test_batches_and_likelihoods():
    circuit = Reasoner(HOUSE).compile(["time", "person"], "?item, person")
    rows = circuit({"time": ["noon", "am", None], "person": [None, "bob", None]})
    assert rows[0] == pytest.approx([float(p) for p in NOON], abs=1e-12)
    assert rows[1] == pytest.approx([0, 0.5, 0, 0.5], abs=1e-12)
    soft = Likelihood(("am", "noon"), np.array([1.0, 0.25]))
    mixed = circuit({"time": soft})
    parts = [circuit({"time": time}).probabilities for time in ("am", "noon")]
    assert mixed.probabilities == pytest.approx(0.8 * parts[0] + 0.2 * parts[1], abs=1e-12)
    assert Reasoner(HOUSE).posterior(["item", "person"], {"time": soft}).probabilities == pytest.approx(
        mixed.probabilities, abs=1e-12
    )
    both = Reasoner(HOUSE).compile(["time"], [["item", "person"], "time"])({"time": "noon"})
    assert both["?item, person"]["cup", "ann"] == pytest.approx(0.15)
    assert both["time"]["noon"] == 1


def test_cached_joints_are_the_same_answer():
    reasoner = Reasoner(HOUSE)
    first = reasoner.posterior(["item", "person"], {"time": "noon"})
    assert reasoner.posterior(("item", "person"), {"time": "noon"}) is first
    assert reasoner.posterior(["person", "item"], {"time": "noon"})["ann", "cup"] == first["cup", "ann"]


def test_stored_circuits_of_joints(tmp_path):
    circuit = Reasoner(HOUSE).compile(["time"], "?item, person")
    save_circuit(circuit, tmp_path / "joint.npz")
    again = load_circuit(tmp_path / "joint.npz")
    assert again.queries == ("?item, person",)
    assert again({"time": "noon"}).values == tuple(PAIRS)
    assert again.exact({"time": "noon"}) == circuit.exact({"time": "noon"})
    assert set(again.most_probable({})[0].values) == {"item", "person", "time"}


def test_an_attribute_without_value():
    words = "partial.plog: q, p has no value with probability 1/2; ask for q=value, p=value instead"
    with pytest.raises(ProgramError) as caught:
        Reasoner(PARTIAL).exact(["q", "p"])
    assert str(caught.value) == words
    for answer in (Enumeration(PARTIAL).exact, Reasoner(PARTIAL).posterior, Enumeration(PARTIAL).posterior):
        with pytest.raises(ProgramError, match="q, p has no value with probability"):
            answer(["q", "p"])
    circuit = Reasoner(PARTIAL).compile(["p"], "?q, p")
    assert circuit({"p": "true"})["false", "true"] == 0.5
    with pytest.raises(ProgramError, match="row 1: q, p has no value with probability 1"):
        circuit({"p": ["true", "false"]})
    never = parse_plog("p, q : boolean. random(p). s = {a, b}. x : s -> boolean.")
    for engine in (Reasoner, Enumeration):
        with pytest.raises(ProgramError, match="has no value with probability 1;"):
            engine(never).exact(["p", "x(a)"])


def test_impossible_evidence():
    program = parse_plog("p, q : boolean. random(p). random(q). :- p, q.")
    for engine in (Reasoner, Enumeration):
        with pytest.raises(UndefinedError):
            engine(program).posterior(["p", "q"], {"p": "true", "q": "true"})


def test_cr_rules():
    program = read_plog(PLOG / "heart.plog")
    assert Reasoner(program).exact(["active", "diet"], {"slow": "true"}) == {
        ("true", "true"): Fraction(12, 43), ("true", "false"): Fraction(28, 43),
        ("false", "true"): Fraction(3, 43), ("false", "false"): 0,
    }  # fmt: skip


def test_samples_of_joints(monkeypatch):
    monkeypatch.setattr("lcorpp.reasoning.circuit.decision_diagram.build_decision_diagram.__defaults__", (1,))
    reasoner = Reasoner(HOUSE)
    with pytest.warns(ReasoningWarning):
        found = reasoner.posterior(["item", "person"], {"time": "noon"})
    for interval, p in zip(found.intervals, NOON, strict=True):
        assert interval.low < p < interval.high < interval.low + 0.03
    assert "(cup, ann): " in repr(found)
    assert "(cup, ann)" in found._repr_html_()
    with pytest.warns(ReasoningWarning):
        assert set(reasoner.ask(parse_query("item, person", HOUSE))) == set(PAIRS)


def test_joints_that_are_too_large():
    program = parse_plog("n = {1..101}. a, b : n. random(a). random(b).", file="large.plog")
    for engine in (Reasoner, Enumeration):
        with pytest.raises(TooLargeError, match=r"large\.plog: a, b together have 10201 values"):
            engine(program).posterior(["a", "b"])


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("item, item", "the query names item twice; expected different attributes"),
        ("item, weather", "'weather' is not declared"),
        ("item, person=ann", "'true' is not a member of the sort items"),
    ],
)
def test_wrong_queries(query, words):
    with pytest.raises(ParseError, match=words):
        parse_query(query, HOUSE)
    assert outcome(lambda: Reasoner(HOUSE).posterior(query.split(", "))) is ProgramError


def test_filters_answer_joint_queries():
    program = parse_plog(
        "moments = {0, 1}. rooms = {hall, office}. at, seen : moments -> rooms. random(at(0)). random(at(1))."
        " random(seen(1)). pr(at(1)=R | at(0)=R) = 0.9. pr(seen(1)=R | at(1)=R) = 0.8."
    )
    filter = Reasoner(program).filter({"at(0)": "at(1)"}, ["seen(1)"], ["?at(0), at(1)", "at(1)"])
    answers = filter.step({"seen(1)": "hall"})
    assert answers["?at(0), at(1)"].probabilities == pytest.approx([0.72, 0.02, 0.08, 0.18], abs=1e-12)
    exact = Reasoner(program).exact(["at(0)", "at(1)"], {"seen(1)": "hall"})
    assert answers["?at(0), at(1)"].probabilities == pytest.approx([float(p) for p in exact.values()])
