"""Compilation: names of inputs and queries, and programs that cannot be compiled."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import ProgramError, TooLargeError, UndefinedError
from lcorpp.reasoning import Reasoner, parse_plog, read_plog

LCORPP = read_plog(Path(__file__).parents[2] / "plog" / "lcorpp.plog")
REASONER = Reasoner(LCORPP)
INPUTS = ["time", "location", "classifier"]


def test_attributes_named_without_arguments():
    program = parse_plog(
        "d = {1, 2}. e = {g, h}. f : d, e -> boolean. random(f(D,E)). random(p). p : boolean."
    )
    circuit = Reasoner(program).compile(["f", "p", "f(1,h)"], "f(2,g)")
    assert circuit.inputs == ("f(1,g)", "f(1,h)", "f(2,g)", "f(2,h)", "p")
    assert circuit({"f(2,g)": "false"})["true"] == 0.0


def test_a_node_that_only_an_arc_of_probability_zero_reaches():
    """The last layer has one output although the layer before it has two."""
    program = parse_plog("a, b, c : boolean. random(a). pr(a) = 1. b=V :- a=V. c=V :- a=V.")
    circuit = Reasoner(program).compile(["b"], "b")
    assert circuit({})["true"] == circuit({"b": "true"})["true"] == 1
    with pytest.raises(UndefinedError):
        circuit({"b": "false"})


def test_evidence_for_a_program_whose_terms_have_no_value():
    circuit = Reasoner(parse_plog("p, q : boolean. p=V :- p=V.")).compile(["p"], "q")
    for answer in (circuit, circuit.exact, circuit.most_probable):
        with pytest.raises(UndefinedError):
            answer({"p": "true"})


def test_a_node_without_arcs_of_positive_probability():
    program = parse_plog("a, b, c : boolean. random(a). pr(a) = 1. :- a. b=V :- a=V. c=V :- a=V.")
    with pytest.raises(UndefinedError, match=r"no possible world of positive measure"):
        Reasoner(program).compile(["b"], "c")({})


def test_terms_may_have_spaces():
    program = parse_plog("d = {1, 2}. f : d, d -> boolean. random(f(D,E)). #domain d(D;E).")
    assert Reasoner(program).compile(["f( 1 , 2 )"], "f(1, 1)").inputs == ("f(1,2)",)


def test_terms_without_rules():
    program = parse_plog("p, q : boolean. d = {1, 2}. f : d -> boolean. random(p).")
    circuit = Reasoner(program).compile(["q", "f"], "p")
    assert circuit({})["true"] == 0.5
    with pytest.raises(UndefinedError, match=r"no possible world of positive measure has q=true"):
        circuit({"q": "true"})
    assert np.isnan(circuit({"f(2)": ["true"]}, undefined="nan")).all()
    with pytest.raises(ProgramError, match=r"q has no value with probability 1"):
        Reasoner(program).compile([], "q")({})


@pytest.mark.parametrize(
    ("inputs", "query", "do", "words"),
    [
        (["weather"], "time", {}, "'weather'"),
        (["time"], "weather", {}, "'weather'"),
        (["time"], "time=morning", {}, "'time=morning'"),
        (["time"], "time(1)", {}, "time has no arguments|has 0 arguments"),
        (["time"], "Time", {}, "'Time' is not an attribute"),
        (["time"], "", {}, "''"),
        ([3], "time", {}, "expected the name of an attribute, not 3"),
        (["time"], [None], {}, "expected the name of an attribute, not None"),
        (["time"], "intention", {"time": "noon"}, "'noon' is not a value of time"),
        (["time"], "intention", {"weather": "wet"}, "'weather'"),
    ],
)
def test_wrong_compilation(inputs, query, do, words):
    with pytest.raises(ProgramError, match=words):
        REASONER.compile(inputs, query, do)


@pytest.mark.parametrize(
    ("text", "do", "words"),
    [
        ("random(p). q :- p.", {"q": "true"}, r"do\(q=\.\.\.\): q has no random selection in a\.plog"),
        ("[r] p +- . random(q) :- p. :- not p.", {}, "a program with cr-rules cannot be compiled: an obs"),
    ],
)
def test_programs_that_cannot_be_compiled(text, do, words):
    with pytest.raises(ProgramError, match=words):
        Reasoner(parse_plog(f"p, q : boolean. {text}", file="a.plog")).compile([], "p", do)


def test_too_many_inputs_are_refused():
    program = parse_plog("n = {1..1000}. f : n, n, n -> boolean. random(f(1,2,3)).")
    with pytest.raises(TooLargeError, match="f has 1000000000 terms; at most 100000 can be inputs"):
        Reasoner(program).compile(["f"], "f(1,2,3)")
    assert Reasoner(program).compile(["f(1,2,3)", "f(3,2,1)"], "f(1,2,3)")({})["true"] == 0.5


def test_too_many_states_are_refused(monkeypatch):
    monkeypatch.setattr("lcorpp.reasoning.diagram.decision_diagram.build_decision_diagram.__defaults__", (5,))
    with pytest.raises(TooLargeError, match=r"lcorpp\.plog: more than \S+ MiB of arcs in the decision"):
        REASONER.compile(INPUTS, "intention")
