"""Circuits against the enumeration of worlds: two independent groundings and two ways to sum."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import islice, product
from math import inf

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from tests.reasoning.circuit.maps import maps
from tests.reasoning.circuit.mixtures import mixtures
from tests.reasoning.circuit.programs import Case, cases
from tests.reasoning.circuit.trees import trees
from tests.reasoning.engines import force_tables

from lcorpp.errors import NoValueError, ProgramError, UndefinedError
from lcorpp.reasoning import Enumeration, parse_plog, parse_query
from lcorpp.reasoning.circuit.circuit import Circuit
from lcorpp.reasoning.diagram import decision_diagram
from lcorpp.reasoning.reasoner import Reasoner
from lcorpp.reasoning.transitions import order_search
from lcorpp.values import Distribution, Likelihood


@pytest.fixture(autouse=True, params=["diagram", "reordered", "tables"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The decision diagram, as for programs of this size; with another order; or tables where possible."""
    if request.param == "reordered":
        monkeypatch.setattr(decision_diagram, "TRIALS", ((0, 1e4),))
        monkeypatch.setattr(order_search, "MIN_GAIN", -inf)
    if request.param == "tables":
        force_tables(monkeypatch)


SUITE = settings(max_examples=15, suppress_health_check=list(HealthCheck))


def outcome(answer: Callable[[], object]) -> object:
    """Return the answer, or the type of the error; no value is an error of the program like others."""
    try:
        return answer()
    except (ProgramError, UndefinedError) as error:
        return ProgramError if isinstance(error, NoValueError) else type(error)


def close(found: object, expected: object) -> None:
    if isinstance(expected, dict):
        assert isinstance(found, Distribution), found
        np.testing.assert_allclose(found.probabilities, [float(p) for p in expected.values()], atol=1e-12)
    else:
        assert found == expected


def given_all(circuit: Circuit) -> Iterator[dict[str, str]]:
    """Yield up to 30 evidences for all inputs of a circuit."""
    every = product(*(circuit.values[name] for name in circuit.inputs))
    return (dict(zip(circuit.inputs, values, strict=True)) for values in islice(every, 30))


def check(case: Case) -> None:
    """Compare the circuit with the enumeration, in fractions and in floating point."""
    program = parse_plog(case.text)
    worlds, reasoner = Enumeration(program), Reasoner(program)
    evidence, do = dict(case.evidence), dict(case.do)
    check_question(case, reasoner, worlds)
    if not case.query.startswith("?"):  # a joint is not a term of the worlds
        check_soft(case, reasoner, worlds)
    expected = outcome(lambda: worlds.exact(case.query, evidence, do))
    circuit = outcome(lambda: Reasoner(program).compile(case.inputs, case.query, do))
    if not isinstance(circuit, Circuit):
        assert expected == circuit
        return
    assert outcome(lambda: circuit.exact(evidence)) == expected
    close(outcome(lambda: circuit(evidence)), expected)
    assert outcome(lambda: reasoner.exact(case.query, evidence, do)) == expected
    check_batch(circuit, worlds, do)
    if not do:
        check_worlds(circuit, worlds, evidence)


def check_question(case: Case, reasoner: Reasoner, worlds: Enumeration) -> None:
    """Compare the probability of a conjunction given literals.

    The reasoner checks the conditions of P-log only in worlds that agree with the observations, as if these
    were part of the program.
    """
    question = parse_query(case.question, reasoner.program)
    found = outcome(lambda: reasoner.ask(question))
    expected = outcome(lambda: worlds.ask(question))
    if expected is ProgramError is not found:
        observed = "\n".join(map(str, question.observations))
        program = parse_plog(f"{case.text}\n{observed}")
        expected = outcome(lambda: Enumeration(program).ask(replace(question, observations=())))
    assert outcome(lambda: reasoner.ask(question, exact=True)) == expected
    if isinstance(expected, Fraction):
        assert abs(found - float(expected)) < 1e-12
    else:
        assert found == expected


def check_soft(case: Case, reasoner: Reasoner, worlds: Enumeration) -> None:
    """Compare a posterior given likelihoods with the weighted worlds; a likelihood excludes no value."""
    soft = {term: dict(weights) for term, weights in case.soft if any(weight for _, weight in weights)}
    hard = {term: value for term, value in case.evidence if term not in soft}
    evidence = hard | {term: Likelihood(tuple(own), list(own.values())) for term, own in soft.items()}
    found = outcome(lambda: reasoner.posterior(case.query, evidence))
    every = outcome(lambda: worlds.worlds)
    if isinstance(every, type):
        assert found == every
        return
    sums: dict[object, Fraction] = {}
    for world in every:
        weight = world.measure * all(world.values.get(term) == value for term, value in hard.items())
        for term, own in soft.items():
            weight *= own.get(world.values.get(term, ""), 0)
        values = tuple(world.values.get(term, "") for term in case.query.removeprefix("?").split(", "))
        value = "" if not all(values) else values if case.query.startswith("?") else values[0]
        sums[value] = sums.get(value, Fraction(0)) + weight
    total = sum(sums.values())
    if not total:
        assert found == UndefinedError
    elif sums.get(""):
        assert found == ProgramError
    else:
        close(found, {value: sums.get(value, 0) / total for value in found.values})


def check_batch(circuit: Circuit, worlds: Enumeration, do: dict[str, str]) -> None:
    """Compare each row of a batch with the enumeration; no row hides the error of another."""
    rows = list(given_all(circuit))
    expected = [outcome(lambda row=row: worlds.exact(*circuit.queries, row, do)) for row in rows]
    codes = np.array([[circuit.values[n].index(v) for n, v in row.items()] for row in rows], dtype=np.intp)
    found = outcome(lambda: circuit(codes.reshape(len(rows), -1), undefined="nan"))
    if ProgramError in expected:
        assert found == ProgramError
        return
    unknown = [float("nan")] * len(circuit.values[circuit.queries[0]])
    wanted = [[float(p) for p in row.values()] if isinstance(row, dict) else unknown for row in expected]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def check_worlds(circuit: Circuit, worlds: Enumeration, evidence: dict[str, str]) -> None:
    """Compare the most probable worlds with those of the enumeration: worlds, measures, order."""
    found = outcome(lambda: circuit.most_probable(evidence, 4))
    every = outcome(lambda: worlds.worlds)
    if isinstance(every, type):
        assert found == every
        return
    kept = [
        (tuple(world.values.items()), world.measure)
        for world in every
        if all(world.values.get(term) == value for term, value in evidence.items())
    ]
    total = sum((measure for _, measure in kept), Fraction(0))
    if not total:
        assert found == UndefinedError
        return
    measures = {world: measure / total for world, measure in kept if measure}
    best = sorted(measures.values(), reverse=True)[:4]
    assert [world.measure for world in found] == best
    assert len({tuple(world.values.items()) for world in found}) == len(best)
    for world in found:
        assert measures[tuple(world.values.items())] == world.measure


@given(case=cases())
@SUITE
def test_circuit_and_enumeration_agree(case: Case) -> None:
    check(case)


@given(case=maps())
@SUITE
def test_circuit_and_enumeration_agree_on_maps(case: Case) -> None:
    check(case)


@given(case=trees())
@SUITE
def test_circuit_and_enumeration_agree_on_trees(case: Case) -> None:
    check(case)


@given(case=mixtures())
@SUITE
def test_circuit_and_enumeration_agree_on_mixtures(case: Case) -> None:
    check(case)


@pytest.mark.slow
@given(case=cases() | maps() | trees() | mixtures())
@settings(SUITE, max_examples=10_000)
def test_circuit_and_enumeration_agree_on_thirty_thousand_programs(case: Case) -> None:
    check(case)
