"""Wrong evidence: each error names the input, the value and what was expected."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import ProgramError
from lcorpp.reasoning import Reasoner, read_plog

LCORPP = read_plog(Path(__file__).parents[2] / "plog" / "lcorpp.plog")
REASONER = Reasoner(LCORPP)
INPUTS = ["time", "location", "classifier"]


@pytest.fixture
def circuit():
    return REASONER.compile(INPUTS, "intention")


@pytest.mark.parametrize(
    ("evidence", "words"),
    [
        ({"weather": "wet"}, "'weather' is not an input; expected one of time, location"),
        ({"intention": "interested"}, "'intention' is not an input;"),
        ({"time": "noon"}, "'noon' is not a value of time; expected one of morning, afternoon, evening"),
        ({"time": ["morning", "noon"]}, "row 1: 'noon' is not a value of time"),
        ({"time": ["morning", 3]}, "row 1: 3 is not a value of time"),
        ({"time": [["morning"]]}, r"row 0: \['morning'\] is not a value of time"),
        ({"time": 3}, "3 is not a value of time"),
        ({"time": None}, "None is not a value of time"),
        ({"time": b"morning"}, "is not a value of time"),
        ({b"time": "morning"}, "b'time' is not an input"),
        ({3: "morning"}, "3 is not an input"),
        ({None: "morning"}, "None is not an input"),
        ({"time": ["morning"], "location": ["library"] * 2}, r"one length, not \[1, 2\]"),
        (None, "expected a mapping from inputs to values, or codes, not None"),
        ([[0, 0, 0]], "expected a mapping from inputs to values, or codes, not"),
        ("morning", "expected a mapping"),
        (np.zeros((2, 2), dtype=int), r"integer codes of shape \(B, 3\), not int64 \(2, 2\)"),
        (np.zeros(3, dtype=int), r"not int64 \(3,\)"),
        (np.zeros((1, 3)), r"integer codes of shape \(B, 3\), not float64"),
        (np.zeros((1, 3), dtype=bool), "not bool"),
        (np.array([["morning", "library", "one"]]), "not <U7"),
        (np.array([[0, 0, 0], [0, 2, 0]]), "row 1: code 2 of location; expected -1 to 1"),
        (np.array([[0, 0, -2]]), "row 0: code -2 of classifier; expected -1 to 1"),
        (np.array([[2**63, 0, 0]], dtype=np.uint64), "row 0: code 9223372036854775808 of time"),
    ],
)  # fmt: skip
def test_wrong_evidence(circuit, evidence, words):
    with pytest.raises(ProgramError, match=words):
        circuit(evidence)
    circuit({"time": "morning"})  # also with cached answers
    with pytest.raises(ProgramError, match=words):
        circuit(evidence)


@pytest.mark.parametrize("evidence", [{"time": "noon"}, {"weather": "wet"}, {"time": 3}])
def test_wrong_evidence_for_worlds(circuit, evidence):
    for answer in (
        circuit.exact,
        circuit.most_probable,
        lambda given: circuit.sample(np.random.default_rng(0), given),
    ):
        with pytest.raises(ProgramError, match="is not a"):
            answer(evidence)
