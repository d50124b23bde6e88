"""Archives of numbers run nothing when they are read, and cannot fill the memory."""

import io
import pickle
import zipfile

import numpy as np
import pytest

from lcorpp import archives
from lcorpp.archives import read_arrays
from lcorpp.errors import DataError
from lcorpp.learning import load_classifier, load_dataset
from lcorpp.reasoning.circuit.storage import load_circuit
from lcorpp.versioned_json import JsonFormat


class Attack:
    """Its pickle calls a function."""

    def __reduce__(self):
        return pytest.fail, ("code was run",)


def pack(**arrays):
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def test_arrays_are_read():
    assert read_arrays(pack(a=np.arange(3.0)))["a"].tolist() == [0, 1, 2]


@pytest.mark.parametrize("load", [load_classifier, load_dataset, load_circuit])
@pytest.mark.parametrize(
    "content",
    [
        pack(dataset=np.array([Attack()], dtype=object), classifier=np.array([Attack()])),
        pickle.dumps(Attack()),
    ],
)
def test_no_pickle_is_loaded(load, content, tmp_path):
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(DataError, match=r"a\.npz: not a"):
        load(tmp_path / "a.npz")


@pytest.mark.parametrize("load", [load_classifier, load_dataset, load_circuit])
def test_a_small_file_of_huge_content(load, tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "FREE_BYTES", 10**6)
    (tmp_path / "a.npz").write_bytes(pack(dataset=np.zeros(10**6)))
    with pytest.raises(DataError, match=r"its content is 7 MB in a file of \d+ bytes"):
        load(tmp_path / "a.npz")


def test_a_header_of_more_than_the_memory(tmp_path):
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f8", "fortran_order": False, "shape": (10**17,)})
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("dataset.npy", buffer.getvalue())
    with pytest.raises(DataError, match=r"a\.npz: not a stored data set, or a damaged one"):
        load_dataset(tmp_path / "a.npz")


def test_a_document_is_read_only_in_its_format_and_version():
    form = JsonFormat("lcorpp circuit", 3, older=(1,))
    assert form.read('{"format": "lcorpp circuit", "version": 1, "x": 2}')["x"] == 2
    for text, words in (
        ("[", "not JSON"),
        ("[]", 'an object with "format": "lcorpp circuit"'),
        ('{"format": "other"}', "its format is 'other'; expected 'lcorpp circuit'"),
        ('{"format": "lcorpp circuit", "version": 2}', "its version is 2; this lcorpp reads versions 1, 3"),
        ("[" * 9999, "damaged"),
    ):
        with pytest.raises(DataError, match=words):
            form.read(text)
