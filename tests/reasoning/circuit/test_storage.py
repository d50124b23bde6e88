"""Stored circuits: round trips, damaged files, files of earlier versions."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import DataError, FileError, LcorppError
from lcorpp.reasoning import Reasoner, load_circuit, parse_plog, read_plog, save_circuit

PLOG = Path(__file__).parents[2] / "plog"


@pytest.fixture
def circuit():
    return Reasoner(read_plog(PLOG / "lcorpp.plog")).compile(
        ["time", "location", "classifier"], ["intention", "identity"]
    )


def rewrite_header(path, change, arrays=None):
    """Rewrite the file with another header."""
    with np.load(path) as archive:
        content = {name: archive[name] for name in archive.files}
    head = json.loads(str(content["circuit"]))
    change(head)
    content |= arrays or {}
    np.savez(path, **(content | {"circuit": np.array(json.dumps(head))}))


def test_a_loaded_circuit_answers_the_same(circuit, tmp_path):
    save_circuit(circuit, tmp_path / "a.circuit")
    again = load_circuit(tmp_path / "a.circuit")
    assert (again.inputs, again.queries, again.single) == (circuit.inputs, circuit.queries, False)
    codes = np.stack(np.meshgrid([-1, 0, 1, 2], [-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 3)
    for query, rows in circuit(codes).items():
        np.testing.assert_array_equal(again(codes)[query], rows)
    evidence = {"time": "morning"}
    assert again(evidence)["identity"]["visitor"] == circuit(evidence)["identity"]["visitor"]
    assert again.exact(evidence) == circuit.exact(evidence)
    assert [(w.values, w.measure) for w in again.most_probable(evidence, 3)] == [
        (w.values, w.measure) for w in circuit.most_probable(evidence, 3)
    ]
    draws = [c.sample(np.random.default_rng(0), evidence) for c in (again, circuit)]
    assert draws[0] == draws[1]


@pytest.mark.parametrize(
    ("text", "inputs", "query", "do"),
    [
        ("p, q : boolean. random(p). random(q). pr(q|p)=1/3.", ["q"], "p", {"q": "true"}),
        ("#semantics 2018. p, q : boolean. random(p). random(q) :- p.", [], "p", {"q": "true"}),
        (
            "sorts #s = {f(a), b}. attributes x : #s. q : #boolean. statements random(x). q :- x = f(a).",
            ["x"],
            "x",
            {},
        ),
        ("p, q : boolean. random(p).", ["q"], "p", {}),
        ("p : boolean. random(p). :- p. :- p=false.", ["p"], "p", {}),
        ("n = {1..300}. x : n. random(x). y : n. y = V :- x = V.", ["x"], "y", {}),
    ],
)
def test_all_kinds_of_circuits_can_be_saved(text, inputs, query, do, tmp_path):
    circuit = Reasoner(parse_plog(text)).compile(inputs, query, do)
    save_circuit(circuit, tmp_path / "a")
    again = load_circuit(tmp_path / "a")
    assert again.single
    codes = np.array([[-1] * len(inputs), [0] * len(inputs)], dtype=int)
    np.testing.assert_array_equal(again(codes, undefined="nan"), circuit(codes, undefined="nan"))


def test_the_file_is_small_and_contains_no_pickle(circuit, tmp_path):
    path = tmp_path / "a"
    save_circuit(circuit, path)
    assert path.stat().st_size < 20_000
    with zipfile.ZipFile(path) as archive:
        assert all(b"pickle" not in archive.read(name)[:200] for name in archive.namelist())


def test_missing_folder_and_missing_file(circuit, tmp_path):
    with pytest.raises(FileError):
        save_circuit(circuit, tmp_path / "none" / "a")
    with pytest.raises(FileError):
        load_circuit(tmp_path / "a")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"\x93NUMPY", b"hello", bytes(1000)])
def test_foreign_files(content, tmp_path):
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(DataError, match="not a stored circuit, or a damaged one"):
        load_circuit(tmp_path / "a")


def test_other_archives(circuit, tmp_path):
    np.savez(tmp_path / "a.npz", ending=np.zeros(3))
    with pytest.raises(DataError, match="not a stored circuit"):
        load_circuit(tmp_path / "a.npz")
    buffer = io.BytesIO()
    np.savez(buffer, circuit=np.array([{"format": "lcorpp circuit"}], dtype=object))
    (tmp_path / "b").write_bytes(buffer.getvalue())
    with pytest.raises(DataError, match="not a stored circuit"):
        load_circuit(tmp_path / "b")


def test_an_array_with_a_truncated_header(tmp_path):
    """numpy parses headers as Python, and raises the errors of Python's tokenizer."""
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (3L,\n"
    with zipfile.ZipFile(tmp_path / "a", "w") as archive:
        archive.writestr("ending.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head)
    with pytest.raises(DataError, match="not a stored circuit, or a damaged one"):
        load_circuit(tmp_path / "a")


def test_truncated_and_damaged_files(circuit, tmp_path):
    path = tmp_path / "a"
    save_circuit(circuit, path)
    content = path.read_bytes()
    for end in range(0, len(content), 97):
        path.write_bytes(content[:end])
        with pytest.raises(DataError):
            load_circuit(path)
    rng = np.random.default_rng(0)
    for _ in range(300):
        damaged = bytearray(content)
        for place in rng.integers(len(content), size=3):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        with suppress(LcorppError):  # a change may hit a byte without meaning
            load_circuit(path)({"time": "morning"})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": "lcorpp policy"}, "its format is 'lcorpp policy'"),
        ({"version": 4}, "its version is 4; this lcorpp reads versions 1, 2, 3"),
        ({"program": "p : boolean."}, "time"),
        ({"program": "p"}, "not a circuit that can be used"),
        ({"inputs": ["weather"]}, "weather"),
        ({"inputs": 3}, "damaged"),
        ({"inputs": ["time", "time", "classifier"]}, "its inputs are"),
        ({"queries": []}, "it has no queries"),
        ({"queries": "intention"}, "'i'"),
        ({"do": 3}, "do is 3; expected Mapping"),
        ({"do": {"time": "noon"}}, "noon"),
        ({"semantics": "1999"}, "semantics is '1999'; expected 2009 or 2018"),
        ({"layers": []}, "its layers are those of"),
        ({"layers": None}, "damaged"),
        ({"file": 3}, "file is 3; expected str"),
    ],
)
def test_inconsistent_headers(circuit, change, words, tmp_path):
    save_circuit(circuit, tmp_path / "a.npz")
    rewrite_header(tmp_path / "a.npz", lambda head: head.update(change))
    with pytest.raises(DataError, match=words):
        load_circuit(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"variable": 17}, "its layers are those of"), ({"variable": -7}, "its layers are those of"),
        ({"variable": None}, "damaged"), ({"variable": "time"}, "damaged"), ({"shape": [3]}, "damaged"),
        ({"shape": [-1, 4, 1]}, "has the shape"), ({"shape": [10**12, 4, 1]}, "has the shape"),
        ({"shape": [1, 99, 1]}, "its layers are those of"), ({"sources": [0]}, "damaged"),
        ({"variable": 1}, "its layers are those of"),
    ],
)  # fmt: skip
def test_inconsistent_layers(circuit, change, words, tmp_path):
    save_circuit(circuit, tmp_path / "a.npz")
    rewrite_header(tmp_path / "a.npz", lambda head: head["layers"][0].update(change))
    with pytest.raises(DataError, match=words):
        load_circuit(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("name", "make", "words"),
    [
        ("0/weights", lambda own: own * np.nan, "weights that are not positive"),
        ("0/weights", lambda own: -own, "weights that are not positive"),
        ("0/weights", lambda own: own / 0, "weights that are not positive"),
        ("0/weights", lambda own: own * 0, "weights that are not positive"),
        ("0/weights", lambda own: own[1:], "wrong shape"),
        ("0/first", lambda own: own[::-1], "entries out of range"),
        ("0/first", lambda own: own + 1, "entries out of range"),
        ("0/first", lambda own: own[1:], "wrong shape"),
        ("0/entries", lambda own: own + 77, "outcomes out of range"),
        ("0/entries", lambda own: own - 1, "outcomes out of range"),
        ("1/from/0", lambda own: own + 77, "inputs that are no outputs of the layer before it"),
        ("1/from/0", lambda own: own[:0], "does not fit the layers before it"),
    ],
)
def test_inconsistent_arrays(circuit, name, make, words, tmp_path):
    path = tmp_path / "a.npz"
    save_circuit(circuit, path)
    with np.load(path) as archive, np.errstate(divide="ignore"):
        changed = make(archive[name])
    rewrite_header(path, lambda head: None, {name: changed})
    with pytest.raises(DataError, match=words):
        load_circuit(path)


STORED = Path(__file__).parent / "stored"
"""Files written by earlier versions of lcorpp."""


def test_old_files_can_be_read(circuit):
    old = load_circuit(STORED / "version_1.circuit")
    assert (old.inputs, old.queries) == (circuit.inputs, circuit.queries)
    codes = np.stack(np.meshgrid([-1, 0, 1, 2], [-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 3)
    for query, rows in circuit(codes).items():
        np.testing.assert_allclose(old(codes)[query], rows, rtol=1e-13)


def test_old_files_with_sparse_matrices_can_be_read():
    """Three tosses of a coin that shows heads with probability x/65, with x from 1 to 65."""
    old = load_circuit(STORED / "version_1_sparse.circuit")
    assert (old.inputs, old.do) == (("p(1)", "p(2)"), {"q": "true"})
    squares, cubes = (sum(x**k for x in range(1, 66)) for k in (2, 3))
    given = {"p(1)": "true", "p(2)": "true"}
    assert old(given)["true"] == pytest.approx(cubes / squares / 65, abs=1e-12)
    assert old.exact(given)["true"] == Fraction(cubes, 65 * squares)


def test_old_files_with_exponents_can_be_read(tmp_path):
    """A weight of 10^-598, which needs an exponent of 2 in new files, too."""
    old = load_circuit(STORED / "version_2_exponents.circuit")
    save_circuit(old, tmp_path / "a")
    for circuit in (old, load_circuit(tmp_path / "a")):
        assert circuit({"c": "true"})["true"] == 1
        assert circuit({"c": "false"})["true"] == pytest.approx(1e-299, rel=1e-12, abs=0)
