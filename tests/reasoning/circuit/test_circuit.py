"""Calls of circuits: batches, several queries, impossible evidence, pickling, threads."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning import Reasoner, parse_plog, read_plog

LCORPP = read_plog(Path(__file__).parents[2] / "plog" / "lcorpp.plog")
REASONER = Reasoner(LCORPP)
INPUTS = ["time", "location", "classifier"]

# x has no value if p is false; q=true excludes x=w
PARTIAL = parse_plog(
    "s = {u, v, w}. p, q : boolean. x : s. random(p). random(q). random(x) :- p. :- q, x=w.",
    file="partial.plog",
)


def evidences(circuit):
    """Yield every evidence for some of the inputs."""
    every = product(*([None, *circuit.values[name]] for name in circuit.inputs))
    for values in every:
        yield {n: v for n, v in zip(circuit.inputs, values, strict=True) if v is not None}


@pytest.fixture
def circuit():
    return REASONER.compile(INPUTS, "intention")


def test_a_batch_equals_single_answers(circuit):
    rows = list(evidences(circuit))
    columns = {name: [row.get(name) for row in rows] for name in INPUTS}
    batch = circuit(columns)
    assert batch.shape == (len(rows), 2) == (4 * 3 * 3, 2)
    for row, p in zip(rows, batch, strict=True):
        assert circuit(row).probabilities == pytest.approx(p, abs=1e-12)
        assert [float(x) for x in circuit.exact(row).values()] == pytest.approx(p.tolist(), abs=1e-12)
    codes = circuit.encode(columns)
    assert codes.tolist()[:4] == [[-1, -1, -1], [-1, -1, 0], [-1, -1, 1], [-1, 0, -1]]
    for dtype in (np.int8, np.int64, np.intp):
        np.testing.assert_array_equal(circuit(codes.astype(dtype)), batch)


def test_equal_rows_of_a_batch_share_an_answer():
    """20,000 rows of 3^9 = 19,683 combinations."""
    program = parse_plog(
        "i = {1..9}. #domain i(I). a : i -> boolean. q : boolean. random(q). random(a(I))."
        " pr(a(I) | q) = 1/3."
    )
    circuit = Reasoner(program).compile(["a"], "q")
    codes = np.random.default_rng(0).integers(-1, 2, (20_000, 9))
    batch = circuit(codes)
    for row in (0, 777, 19_999):
        np.testing.assert_allclose(circuit(codes[row : row + 1])[0], batch[row], atol=1e-15)


def test_total_probability(circuit):
    """The answers to the values of an input, weighted with their probabilities, are the answer without it."""
    for name in INPUTS:
        weights = REASONER.compile([], name)({})
        parts = [p * circuit({name: value}).probabilities for value, p in weights]
        assert sum(parts) == pytest.approx(circuit({}).probabilities, abs=1e-12)


def test_several_queries_equal_single_queries():
    queries = ["intention", "identity", "time"]
    together = REASONER.compile(INPUTS, queries)
    for row in evidences(together):
        for query in queries:
            alone = REASONER.compile(INPUTS, query)
            assert together(row)[query].probabilities == pytest.approx(alone(row).probabilities, abs=1e-12)
    batch = together({"time": ["morning", None], "classifier": "one"})
    assert {query: rows.shape for query, rows in batch.items()} == {
        "intention": (2, 2), "identity": (2, 3), "time": (2, 3),
    }  # fmt: skip
    assert together.exact({})["identity"]["student"] == Fraction(1, 3)


def test_one_value_for_a_whole_column():
    circuit = REASONER.compile(INPUTS, "intention")
    found = circuit({"time": ["morning", "evening"], "location": "library"})
    assert found[1] == pytest.approx(circuit({"time": "evening", "location": "library"}).probabilities)
    as_arrays = circuit({"time": np.array(["morning", "evening"]), "location": np.str_("library")})
    np.testing.assert_array_equal(as_arrays, found)
    assert circuit({"time": np.str_("morning")})["interested"] == circuit({"time": "morning"})["interested"]


def test_an_input_may_be_the_query():
    circuit = REASONER.compile(["time", "intention"], "intention")
    assert list(circuit({"intention": "interested"})) == [("interested", 1.0), ("not_interested", 0.0)]
    found = circuit(np.array([[0, -1], [0, 0], [-1, 1]]))
    assert found[0] == pytest.approx(circuit({"time": "morning"}).probabilities)
    assert found[1:].tolist() == [[1, 0], [0, 1]]
    assert circuit.exact({"intention": "interested"})["not_interested"] == 0


def test_no_inputs():
    circuit = REASONER.compile([], "intention")
    assert circuit({})["interested"] == pytest.approx(0.4, abs=1e-12)
    found = circuit(np.zeros((3, 0), dtype=int))
    assert found == pytest.approx(np.array([[0.4, 0.6]] * 3))
    assert circuit(np.zeros((0, 0), dtype=int)).shape == (0, 2)
    with pytest.raises(ProgramError, match="'time' is not an input;"):
        circuit({"time": "morning"})


def test_an_empty_batch(circuit):
    assert circuit(np.zeros((0, 3), dtype=int)).shape == (0, 2)
    assert circuit({"time": []}).shape == (0, 2)


def test_small_integers_do_not_overflow():
    program = parse_plog(
        "n = {1..120}. x : n. p, q : boolean. random(x). random(p). random(q) :- x < 61. q :- x > 60."
    )
    circuit = Reasoner(program).compile(["x", "p"], "q")
    codes = np.array([[10, 0], [59, 1], [60, -1], [100, 0], [119, 1]])
    for dtype in (np.int8, np.uint8, np.int16, np.uint64, np.int64):
        given = np.where(codes < 0, 0, codes).astype(dtype)
        assert circuit(given)[:, 0].tolist() == pytest.approx([0.5, 0.5, 1, 1, 1])


def test_more_inputs_than_dimensions_of_an_array():
    program = parse_plog(
        "i = {1..100}. one = {u}. f : i -> one. random(f(I)). p : boolean. random(p). #domain i(I)."
    )
    circuit = Reasoner(program).compile(["f"], "p")
    assert circuit(np.zeros((2, 100), dtype=int)) == pytest.approx(np.full((2, 2), 0.5))
    assert circuit({f"f({i})": "u" for i in range(1, 101)})["true"] == 0.5


# impossible rows and rows without value


def test_impossible_rows_are_named_or_not_a_number():
    circuit = Reasoner(PARTIAL).compile(["q", "x"], "p")
    columns = {"q": ["true", None, "true"], "x": ["u", "w", "w"]}
    with pytest.raises(UndefinedError, match=r"partial\.plog: row 2: no possible world has this evidence"):
        circuit(columns)
    found = circuit(columns, undefined="nan")
    assert found[:2].tolist() == [[1, 0], [1, 0]]
    assert np.isnan(found[2]).all()
    with pytest.raises(UndefinedError, match=r"partial\.plog: no .* of positive measure has q=true, x=w$"):
        circuit({"q": "true", "x": "w"})
    with pytest.raises(ProgramError, match=r"undefined='zero'; expected 'raise' or 'nan'"):
        circuit(columns, undefined="zero")


def test_a_query_without_value_is_an_error_that_names_the_row():
    circuit = Reasoner(PARTIAL).compile(["p"], "x")
    assert circuit({"p": "true"})["w"] == pytest.approx(1 / 5)  # 2/3 of its weight is gone
    for undefined in ("raise", "nan"):
        with pytest.raises(ProgramError, match=r"row 1: x has no value with probability .*; ask for x=value"):
            circuit({"p": ["true", None]}, undefined=undefined)
    with pytest.raises(ProgramError, match=r"partial\.plog: x has no value with probability 6/11;"):
        circuit.exact({})


# pickling, threads, caches


def test_a_circuit_can_be_pickled():
    circuit = REASONER.compile(INPUTS, "intention", {"location": "library"})
    again = pickle.loads(pickle.dumps(circuit))
    for row in ({}, {"time": "morning"}):
        assert again(row)["interested"] == circuit(row)["interested"]
        assert again.exact(row) == circuit.exact(row)
        assert again.most_probable(row, 3)[2].values == circuit.most_probable(row, 3)[2].values


def test_a_long_circuit_can_be_pickled():
    chain = parse_plog(
        "t = {0..1000}. #domain t(T). x : t -> boolean. random(x(T)). pr(x(T+1) | x(T)) = 9/10."
    )
    circuit = Reasoner(chain).compile(["x(0)"], "x(1000)")
    assert pickle.loads(pickle.dumps(circuit))({"x(0)": "true"})["true"] == circuit({"x(0)": "true"})["true"]


def test_threads_can_share_a_circuit(circuit):
    rows = list(evidences(circuit)) * 20
    expected = [REASONER.compile(INPUTS, "intention")(row)["interested"] for row in rows[:36]] * 20
    with ThreadPoolExecutor(8) as pool:
        assert [found["interested"] for found in pool.map(circuit, rows)] == expected
        batches = pool.map(lambda row: circuit({n: [v] for n, v in row.items()}), rows[1:36])
        assert [rows[0, 0] for rows in batches] == pytest.approx(expected[1:36])


def test_answers_are_read_only(circuit):
    with pytest.raises(ValueError, match="read-only"):
        circuit({"time": "morning"}).probabilities[0] = 7
    batch = circuit({"time": ["morning"]})
    expected = batch.copy()
    batch[:] = 7
    np.testing.assert_array_equal(circuit({"time": ["morning"]}), expected)


def test_a_full_cache_is_cleared(monkeypatch):
    monkeypatch.setattr("lcorpp.reasoning.circuit.circuit.CACHE_SIZE", 4)
    circuit = REASONER.compile(INPUTS, "intention")
    rows = list(evidences(circuit))
    first = [circuit(row)["interested"] for row in rows]
    assert [circuit(row)["interested"] for row in rows] == first
