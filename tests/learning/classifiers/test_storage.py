from __future__ import annotations

import io
import json
from copy import deepcopy
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from lcorpp.errors import DataError, FileError
from lcorpp.learning import (
    DecisionThreshold,
    TrainedClassifier,
    learner,
    load_classifier,
    paper_pipeline,
    save_classifier,
    train_and_validate,
)
from tests.learning.walkers import walkers

pytestmark = pytest.mark.skipif(
    find_spec("torch") is None, reason="the LSTM needs torch: pip install 'lcorpp[torch]'"
)
skops = pytest.mark.skipif(find_spec("skops") is None, reason="skops is not installed")


@pytest.fixture(scope="module")
def forest() -> TrainedClassifier:
    estimator = learner("forest").set_params(forest__n_estimators=5)
    return train_and_validate(estimator, walkers(), folds=2)[0]


@pytest.fixture(scope="module")
def trained() -> TrainedClassifier:
    pipeline = paper_pipeline(epochs=2, rate=4.0)
    pipeline.set_params(lstm__units=5)
    return train_and_validate(pipeline, walkers(), folds=2)[0]


def test_a_loaded_classifier_predicts_as_the_saved_one(trained, tmp_path):
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


STORED = {
    "lstm": (0.4182388578871293, 0.5529081906260833, 0.5462184441825706, 0.4318028885930398),
    "summaries": (0.0946499028696845, 0.10497635240525151, 0.07211092743885812, 0.9266068985297264),
}
"""Probabilities of the first class, by the version that wrote the files in stored/ (before the renames)."""


@pytest.mark.parametrize("name", STORED)
def test_a_file_of_an_earlier_version_is_read(name):
    loaded = load_classifier(Path(__file__).parent / "stored" / f"{name}.npz")
    found = loaded.probabilities(walkers(6, seed=9).trajectories)[:4, 0]
    np.testing.assert_allclose(found, STORED[name], atol=1e-6)  # float32 in the LSTM, other instruction sets
    assert loaded.threshold == DecisionThreshold("slow", 0.3)
    assert loaded.estimator[0].features[0] == "x"
    assert repr(loaded).startswith("<TrainedClassifier: ")
    assert f"<td>{loaded.classes[0]}</td><td>0." in loaded._repr_html_()


def test_the_names_in_the_file_do_not_change(tmp_path):
    for name in STORED:
        stored = Path(__file__).parent / "stored" / f"{name}.npz"
        save_classifier(load_classifier(stored), tmp_path / "again.npz")
        with np.load(stored) as before, np.load(tmp_path / "again.npz") as after:
            old, new = (json.loads(str(archive["classifier"])) for archive in (before, after))
            for former, step in zip(old["steps"], new["steps"], strict=True):
                former["parameters"] = {**step["parameters"], **former["parameters"]}  # some are newer
            assert old == new
            assert before.files == after.files


def test_calibration_and_threshold_come_back(trained, tmp_path):
    thresholded = replace(trained, threshold=DecisionThreshold("slow", 0.3))
    save_classifier(thresholded, tmp_path / "c")
    loaded = load_classifier(tmp_path / "c")
    assert loaded.threshold == thresholded.threshold
    tracks = walkers(30, seed=9).trajectories
    pairs = [
        (dict(a), dict(b))
        for a, b in zip(*(c.soft().classify_many(tracks) for c in (loaded, thresholded)), strict=True)
    ]
    assert all(a == b for a, b in pairs)


@pytest.mark.parametrize("name", ["summaries", "minirocket", pytest.param("forest", marks=skops)])
def test_other_learners_are_stored_like_the_lstm(name, forest, tmp_path):
    tracks = walkers(30, seed=9).trajectories
    trained = forest if name == "forest" else train_and_validate(learner(name), walkers(), folds=2)[0]
    save_classifier(trained, tmp_path / "c")
    found = load_classifier(tmp_path / "c").probabilities(tracks)
    assert np.array_equal(found, trained.probabilities(tracks))


@pytest.mark.skipif(find_spec("skops") is not None, reason="skops is installed")
def test_without_skops_the_error_names_the_installation(tmp_path):
    other = TrainedClassifier(make_pipeline(LogisticRegression()))
    with pytest.raises(DataError, match=r"LogisticRegression can be stored only with skops: pip install"):
        save_classifier(other, tmp_path / "c")
    assert not list(tmp_path.iterdir())


class Mine(LogisticRegression):
    """Of a type that skops does not trust."""


@skops
def test_unknown_types_are_not_stored(tmp_path):
    mine = make_pipeline(FunctionTransformer(np.ravel), Mine())
    with pytest.raises(DataError, match="cannot be stored safely: it contains"):
        save_classifier(TrainedClassifier(make_pipeline(Mine())), tmp_path / "c")
    with pytest.raises(DataError, match="cannot be stored"):
        save_classifier(TrainedClassifier(mine), tmp_path / "c")
    assert not list(tmp_path.iterdir())


@skops
def test_a_forged_forest_is_refused(forest, tmp_path):
    """Links that lead out of a tree, and bytes of another type."""
    from skops import io as skops_io

    step = deepcopy(forest.estimator[-1])
    state = step.estimators_[0].tree_.__getstate__()
    state["nodes"]["left_child"][0] = 10**6
    step.estimators_[0].tree_.__setstate__(state)
    for content, words in [
        (skops_io.dumps(step), "a tree in it is damaged"),
        (skops_io.dumps(Mine()), "loaded"),
    ]:
        rewrite_stored(
            forest,
            tmp_path / "c",
            lambda head, arrays, c=content: arrays.update({"forest/skops": np.frombuffer(c, np.uint8)}),
        )
        with pytest.raises(DataError, match=words):
            load_classifier(tmp_path / "c")


def test_a_classifier_without_a_matrix(trained, tmp_path):
    save_classifier(TrainedClassifier(trained.estimator), tmp_path / "c")
    assert load_classifier(tmp_path / "c").confusion is None


def test_progress_is_not_stored(trained, tmp_path):
    trained.estimator.set_params(lstm__progress=print)
    save_classifier(trained, tmp_path / "c")
    trained.estimator.set_params(lstm__progress=None)
    assert load_classifier(tmp_path / "c").estimator.get_params()["lstm__progress"] is None


def test_a_classifier_that_cannot_be_stored_is_an_error(tmp_path):
    with pytest.raises(DataError, match="only a pipeline can be stored, not LogisticRegression"):
        save_classifier(TrainedClassifier(LogisticRegression()), tmp_path / "c")
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


def test_a_missing_file_is_an_error(tmp_path):
    with pytest.raises(FileError, match="cannot be read"):
        load_classifier(tmp_path / "nothing")


def rewrite_stored(trained: TrainedClassifier, path, change) -> None:
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
        (lambda head, arrays: head.update(version=1), "version is 1; this lcorpp reads version 2"),
        (lambda head, arrays: head.update(format="other"), "format is 'other'"),
        (
            lambda head, arrays: head["steps"][0].update(kind="os.system"),
            "unknown kind 'os.system'; expected",
        ),
        (lambda head, arrays: head["steps"][0]["parameters"].update(extra=1), "damaged"),
        (lambda head, arrays: head["steps"][2]["parameters"].update(units=7), "do not fit an LSTM of 7"),
        (lambda head, arrays: arrays.pop("lstm/dense_bias"), "an LSTM has the weights"),
        (lambda head, arrays: arrays.pop("scaling/mean"), "damaged"),
        (lambda head, arrays: arrays["scaling/scale"].fill(0), "a positive standard deviation"),
        (lambda head, arrays: arrays["lstm/dense_bias"].fill(np.nan), "finite weights"),
        (lambda head, arrays: head["confusion"].update(counts=[[1]]), "cannot have shape"),
        (
            lambda head, arrays: head["confusion"].update(classes=["a", "b"]),
            "classes of its last step are .*fast",
        ),
        (
            lambda head, arrays: head["calibration"].update(classes=["a", "b"]),
            "calibration or threshold is for others",
        ),
        (lambda head, arrays: head["calibration"].update(slope=-1), "slope above 0"),
        (lambda head, arrays: head["calibration"].pop("shares"), "damaged"),
        (lambda head, arrays: head.update(cut=["slowly", 0.5]), "calibration or threshold is for others"),
        (lambda head, arrays: head.update(cut=["slow", 7]), "the threshold of slow is 7"),
        (lambda head, arrays: head["steps"].pop(), "classes of its last step are missing"),
        (lambda head, arrays: head["steps"].clear(), "damaged"),
        (lambda head, arrays: head.clear(), "damaged"),
    ],
)
def test_a_file_that_was_changed_is_refused(trained, tmp_path, change, words):
    rewrite_stored(trained, tmp_path / "c", change)
    with pytest.raises(DataError, match=words):
        load_classifier(tmp_path / "c")


def test_a_pickle_inside_is_never_run(tmp_path):
    np.savez(tmp_path / "c.npz", classifier=np.array([{"a": 1}], dtype=object))
    with pytest.raises(DataError, match="not a stored classifier"):
        load_classifier(tmp_path / "c.npz")
