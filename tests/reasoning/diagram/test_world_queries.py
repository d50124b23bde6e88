"""Queries about whole worlds: the most probable ones, and samples."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from tests.reasoning.circuit.maps import maps
from tests.reasoning.circuit.programs import cases

from lcorpp.errors import LcorppError, ProgramError, UndefinedError
from lcorpp.reasoning import Enumeration, Reasoner, parse_plog, read_plog

PLOG = Path(__file__).parents[2] / "plog"
NAMES = ["lcorpp", "dice", "monty_hall", "simpson", "rat", "robot", "tree", "firing_squad"]


def conditioned(program, evidence):
    """Return the worlds of the enumeration given evidence, with their measures, best first."""
    kept = [
        world
        for world in Enumeration(program).worlds
        if world.measure and all(world.values.get(term) == value for term, value in evidence.items())
    ]
    total = sum(world.measure for world in kept)
    found = [(tuple(world.values.items()), world.measure / total) for world in kept]
    return sorted(found, key=lambda pair: -pair[1])


@pytest.mark.parametrize("name", NAMES)
def test_the_most_probable_worlds_are_those_of_the_enumeration(name):
    program = read_plog(PLOG / f"{name}.plog")
    expected = conditioned(program, {})
    found = Reasoner(program).compile([], program_query(program)).most_probable({}, len(expected) + 1)
    assert [world.measure for world in found] == [measure for _, measure in expected]
    assert {(tuple(world.values.items()), world.measure) for world in found} == set(expected)
    assert sum(world.measure for world in found) == 1


def program_query(program):
    """Return a term that a circuit can query."""
    return next(name for name, attribute in program.attributes.items() if not attribute.arguments) if any(
        not attribute.arguments for attribute in program.attributes.values()
    ) else next(iter(Enumeration(program).worlds[0].values))  # fmt: skip


def test_the_most_probable_worlds_given_evidence():
    program = read_plog(PLOG / "lcorpp.plog")
    circuit = Reasoner(program).compile(["time", "classifier"], "intention")
    evidence = {"time": "morning", "classifier": "one"}
    expected = conditioned(program, evidence)
    for count in (1, 3, len(expected)):
        found = circuit.most_probable(evidence, count)
        assert [world.measure for world in found] == [measure for _, measure in expected][:count]
    best = circuit.most_probable(evidence)[0]
    assert (best.values["identity"], best.values["time"], best.values["classifier"]) == (
        "professor",
        "morning",
        "one",
    )


@settings(max_examples=17, suppress_health_check=list(HealthCheck))
@given(cases() | maps())
def test_all_worlds_of_random_programs_in_order(case):
    program = parse_plog(case.text)
    try:
        expected = conditioned(program, dict(case.evidence))
        circuit = Reasoner(program).compile(case.inputs, case.query)
    except LcorppError:
        return
    if not expected:
        return
    found = circuit.most_probable(dict(case.evidence), len(expected) + 5)
    assert [world.measure for world in found] == [measure for _, measure in expected]
    assert {tuple(world.values.items()) for world in found} == {values for values, _ in expected}
    again = Reasoner(program).compile(case.inputs, case.query).most_probable(dict(case.evidence), 7)
    assert [world.values for world in again] == [world.values for world in found[:7]]


def test_many_worlds_of_a_long_chain():
    """The best worlds leave the best one in few places; each of n places costs a factor of 1/2."""
    program = parse_plog(
        "i = {1..150}. x : i -> boolean. random(x(I)). pr(x(I)) = 2/3. #domain i(I)."
        " y : i -> boolean. random(y(I)). pr(y(I) | x(I)) = 1."
    )
    found = Reasoner(program).compile([], "x(1)").most_probable({}, 1000)
    best = Fraction(2, 3) ** 150
    assert [world.measure for world in found] == [best] + [best / 4] * 300 + [best / 16] * 699
    assert len({tuple(world.values.values()) for world in found}) == 1000
    assert sum(value == "false" for value in found[1].values.values()) in (1, 2)


def test_ties_are_complete_and_distinct():
    program = parse_plog("i = {1..5}. p : i -> boolean. random(p(I)). :- p(1), p(2). #domain i(I).")
    circuit = Reasoner(program).compile(["p(3)"], "p(1)")
    found = circuit.most_probable({}, 100)
    assert {world.measure for world in found} == {Fraction(1, 24)}
    assert len({tuple(world.values.items()) for world in found}) == 24
    assert len(circuit.most_probable({"p(3)": "true"}, 5)) == 5


def test_the_best_of_a_long_chain():
    program = parse_plog("i = {1..1500}. p : i -> boolean. random(p(I)). pr(p(I)) = 1/3. #domain i(I).")
    circuit = Reasoner(program).compile(["p"], "p(1)")
    first, second = circuit.most_probable({"p(7)": "true"}, 2)
    assert first.measure == Fraction(2, 3) ** 1499
    assert [term for term, value in first.values.items() if value == "true"] == ["p(7)"]
    assert second.measure == Fraction(2, 3) ** 1498 / 3


def test_worlds_of_probability_zero_are_left_out():
    program = parse_plog("p, q : boolean. random(p). pr(p) = 0. random(q).")
    circuit = Reasoner(program).compile(["p"], "q")
    assert [world.measure for world in circuit.most_probable({}, 9)] == [Fraction(1, 2)] * 2
    rng = np.random.default_rng(0)
    for answer in (circuit, circuit.exact, circuit.most_probable, lambda given: circuit.sample(rng, given)):
        with pytest.raises(UndefinedError, match=r"no possible world of positive measure has p=true"):
            answer({"p": "true"})


@pytest.mark.parametrize("count", [0, -1, 10**9])
def test_wrong_number_of_worlds(count):
    circuit = Reasoner(parse_plog("p : boolean. random(p).")).compile([], "p")
    with pytest.raises(ProgramError, match=f"expected 1 to 100000 worlds, not {count}"):
        circuit.most_probable({}, count)


@pytest.mark.parametrize(
    ("name", "evidence"),
    [("lcorpp", {"classifier": "one"}), ("monty_hall", {"open": "2"}), ("robot", {"broken": "true"})],
)
def test_samples_follow_the_measure(name, evidence):
    program = read_plog(PLOG / f"{name}.plog")
    circuit = Reasoner(program).compile(list(evidence), next(iter(evidence)))
    expected, draws, rng = dict(conditioned(program, evidence)), 4000, np.random.default_rng(0)
    counts = Counter(tuple(circuit.sample(rng, evidence).items()) for _ in range(draws))
    assert set(counts) <= set(expected)
    for world, measure in expected.items():
        p = float(measure)
        # five standard deviations: one in two million worlds fails by chance, and the seed is fixed
        assert abs(counts[world] - draws * p) <= 5 * sqrt(draws * p * (1 - p)) + 1


def test_samples_given_improbable_evidence():
    """Only a fair coin can be drawn, though such a series is 2^2000 times likelier of the loaded one."""
    program = parse_plog(
        "i = {1..2000}. kind = {fair, loaded}. #domain i(I). coin : kind. random(coin)."
        " heads : i -> boolean. random(heads(I)). pr(heads(I) | coin=loaded) = 1. free : boolean."
        " random(free)."
    )
    circuit = Reasoner(program).compile(["coin", "heads"], "free")
    seen = {"coin": "fair", **{f"heads({i})": "true" for i in range(1, 2001)}}
    drawn = circuit.sample(np.random.default_rng(0), seen)
    assert {term: drawn[term] for term in seen} == seen
    assert drawn["free"] in ("true", "false")


def test_the_same_seed_draws_the_same_worlds():
    circuit = Reasoner(read_plog(PLOG / "dice.plog")).compile([], "roll(d1)")
    draws = [[circuit.sample(np.random.default_rng(3), {}) for _ in range(2)] for _ in range(2)]
    assert draws[0] == draws[1]
