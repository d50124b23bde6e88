from __future__ import annotations

import io
import json

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline

from lcorpp.errors import DataError, FileError
from lcorpp.learning import TrainedClassifier, load_classifier, save_classifier, train_and_validate

from .data import walkers

pytest.importorskip("torch", reason="the LSTM needs torch: pip install 'lcorpp[torch]'")

from lcorpp.learning import paper_pipeline


@pytest.fixture(scope="module")
def trained() -> TrainedClassifier:
    pipeline = paper_pipeline(epochs=2, points=6)
    pipeline.set_params(lstm__units=5)
    return train_and_validate(pipeline, walkers(), folds=2)[0]


def test_what_is_loaded_classifies_as_what_was_saved(trained, tmp_path):
    save_classifier(trained, tmp_path / "lstm.npz")
    loaded = load_classifier(tmp_path / "lstm.npz")
    tracks = walkers(30, seed=9).trajectories
    assert np.array_equal(loaded.estimator.predict_proba(tracks), trained.estimator.predict_proba(tracks))
    assert loaded.classify_many(tracks) == trained.classify_many(tracks)
    assert loaded.confusion.classes == trained.confusion.classes
    assert np.array_equal(loaded.confusion.counts, trained.confusion.counts)
    assert {k: v for k, v in loaded.estimator.get_params().items() if "__" in k} == {
        k: v for k, v in trained.estimator.get_params().items() if "__" in k
    }
    assert [path.name for path in tmp_path.iterdir()] == ["lstm.npz"]


def test_a_classifier_without_a_matrix(trained, tmp_path):
    save_classifier(TrainedClassifier(trained.estimator), tmp_path / "c")
    assert load_classifier(tmp_path / "c").confusion is None


def test_progress_is_not_kept(trained, tmp_path):
    told = []
    trained.estimator.set_params(lstm__progress=told.append)
    save_classifier(trained, tmp_path / "c")
    trained.estimator.set_params(lstm__progress=None)
    assert load_classifier(tmp_path / "c").estimator.get_params()["lstm__progress"] is None


def test_what_cannot_be_stored_is_told(tmp_path):
    with pytest.raises(DataError, match="only a pipeline can be stored, not LogisticRegression"):
        save_classifier(TrainedClassifier(LogisticRegression()), tmp_path / "c")
    with pytest.raises(DataError, match="kind LogisticRegression cannot be stored; expected one of Motion"):
        save_classifier(TrainedClassifier(make_pipeline(LogisticRegression())), tmp_path / "c")
    with pytest.raises(DataError, match="step 'motion' is not trained"):
        save_classifier(TrainedClassifier(paper_pipeline()), tmp_path / "c")
    assert not list(tmp_path.iterdir())


def test_every_damaged_byte_is_noticed_or_harmless(trained, tmp_path):
    path = tmp_path / "c"
    save_classifier(trained, path)
    content = path.read_bytes()
    tracks = walkers(9).trajectories
    rng = np.random.default_rng(0)
    for at in rng.integers(0, len(content), 60):
        path.write_bytes(content[:at] + bytes([content[at] ^ 0xFF]) + content[at + 1 :])
        try:
            loaded = load_classifier(path)
        except DataError:
            continue
        assert loaded.classify_many(tracks) == trained.classify_many(tracks)
    for end in rng.integers(0, len(content), 20):
        path.write_bytes(content[:end])
        with pytest.raises(DataError):
            load_classifier(path)


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04", b"\x80\x04\x95", b"\x93NUMPY\x01\x00"])
def test_a_foreign_file_is_refused(tmp_path, content):
    (tmp_path / "c").write_bytes(content)
    with pytest.raises(DataError, match="not a stored classifier"):
        load_classifier(tmp_path / "c")


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(FileError, match="cannot be read"):
        load_classifier(tmp_path / "nothing")


def changed(trained: TrainedClassifier, path, change) -> None:
    """Save with `change` applied to the head and the arrays."""
    save_classifier(trained, path)
    with np.load(path) as archive:
        arrays = dict(archive)
    head = json.loads(str(arrays.pop("classifier")))
    change(head, arrays)
    buffer = io.BytesIO()
    np.savez(buffer, classifier=np.array(json.dumps(head)), **arrays)
    path.write_bytes(buffer.getvalue())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda head, arrays: head.update(version=2), "version is 2; this lcorpp reads version 1"),
        (lambda head, arrays: head.update(format="other"), "format is 'other'"),
        (
            lambda head, arrays: head["steps"][0].update(kind="os.system"),
            "unknown kind 'os.system'; expected",
        ),
        (lambda head, arrays: head["steps"][0]["parameters"].update(extra=1), "damaged"),
        (lambda head, arrays: head["steps"][2]["parameters"].update(units=7), "an LSTM of 7 units needs"),
        (lambda head, arrays: arrays.pop("lstm/dense.bias"), "needs finite weights"),
        (lambda head, arrays: arrays.pop("scaling/mean"), "damaged"),
        (lambda head, arrays: arrays["scaling/scale"].fill(0), "one positive deviation"),
        (lambda head, arrays: arrays["lstm/dense.bias"].fill(np.nan), "finite weights"),
        (lambda head, arrays: head["confusion"].update(counts=[[1]]), "cannot have shape"),
        (lambda head, arrays: head["confusion"].update(classes=["a", "b"]), "tells .*fast.* apart"),
        (lambda head, arrays: head["steps"].pop(), "tells no classes apart"),
        (lambda head, arrays: head["steps"].clear(), "damaged"),
        (lambda head, arrays: head.clear(), "damaged"),
    ],
)
def test_a_file_that_was_changed_is_refused(trained, tmp_path, change, words):
    changed(trained, tmp_path / "c", change)
    with pytest.raises(DataError, match=words):
        load_classifier(tmp_path / "c")


def test_a_pickle_inside_is_never_run(tmp_path):
    np.savez(tmp_path / "c.npz", classifier=np.array([{"a": 1}], dtype=object))
    with pytest.raises(DataError, match="not a stored classifier"):
        load_classifier(tmp_path / "c.npz")
