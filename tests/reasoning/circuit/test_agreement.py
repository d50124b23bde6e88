"""The compiled engine against the enumeration of worlds: two groundings, two ways to count, one answer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from tests.reasoning.circuit.programs import Case, cases

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning import Enumeration, parse_plog
from lcorpp.reasoning.circuit.compiled import compiled


def outcome(answer: Callable[[], object]) -> object:
    """The answer, or the kind of error."""
    try:
        return answer()
    except (ProgramError, UndefinedError) as error:
        return type(error)


def check(case: Case) -> None:
    """Hold the circuit against the enumeration, in fractions and in numbers."""
    program = parse_plog(case.text)
    evidence, do = dict(case.evidence), dict(case.do)
    expected = outcome(lambda: Enumeration(program).exact(case.query, evidence, do))
    circuit = outcome(lambda: compiled(program, case.inputs, case.query, do))
    if isinstance(circuit, type):
        assert expected == circuit
        return
    assert outcome(lambda: circuit.exact(evidence)) == expected
    found = outcome(lambda: circuit(evidence))
    if isinstance(expected, dict):
        np.testing.assert_allclose(found.probabilities, list(map(float, expected.values())), atol=1e-12)
    else:
        assert found == expected


@given(case=cases())
@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
def test_circuit_and_enumeration_agree(case: Case) -> None:
    check(case)


@pytest.mark.slow
@given(case=cases())
@settings(max_examples=10_000, deadline=None, suppress_health_check=list(HealthCheck))
def test_circuit_and_enumeration_agree_on_ten_thousand_programs(case: Case) -> None:
    check(case)
