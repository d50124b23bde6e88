from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import Calibration, DecisionThreshold, TrainedClassifier, train, train_and_validate
from lcorpp.protocols import Classifier
from lcorpp.values import Dataset
from tests.learning.walkers import walkers


class ByLength:
    """A stand-in for a fitted estimator: long ways are fast."""

    classes_ = np.array(["fast", "slow"])

    def predict_proba(self, tracks):
        fast = np.where(np.hypot(*(tracks[:, :2, -1] - tracks[:, :2, 0]).T) > 2, 0.9, 0.2)
        return np.stack([fast, 1 - fast], axis=1)


def test_one_and_many_agree():
    data = walkers()
    classifier: Classifier = TrainedClassifier(ByLength())
    many = TrainedClassifier(ByLength()).classify_many(data.trajectories)
    assert many == list(data.labels)
    assert all(type(label) is str for label in many)
    assert [classifier.classify(t) for t in data.trajectories] == many


@pytest.mark.parametrize(("name", "probability"), [("fast", 0.1), ("slow", 0.05)])
def test_a_low_threshold_predicts_its_class_always(name, probability):
    classifier = TrainedClassifier(ByLength(), threshold=DecisionThreshold(name, probability))
    assert set(classifier.classify_many(walkers().trajectories)) == {name}


def test_soft_evidence_is_the_calibrated_likelihood():
    calibration = Calibration(
        ("fast", "slow"), 0.5, np.array([0.3, 0.0]), np.array([0.1, 0.05]), np.array([0.1, 0.9])
    )
    trained = TrainedClassifier(ByLength(), calibration=calibration)
    tracks = walkers(12).trajectories
    likelihoods = trained.soft().classify_many(tracks)
    right = calibration.calibrate(ByLength().predict_proba(tracks))
    for likelihood, row in zip(likelihoods, right, strict=True):
        weight = dict(likelihood)
        assert weight["fast"] / weight["slow"] == pytest.approx(row[0] / row[1] * 0.9 / 0.1)
    assert dict(trained.soft().classify(tracks[0])) == dict(likelihoods[0])
    with pytest.raises(DataError, match="trained without cross-validation"):
        TrainedClassifier(ByLength()).soft()


def test_importing_the_package_loads_neither_torch_nor_scikit_learn():
    program = (
        "import sys, lcorpp.learning; print([m for m in ('torch', 'sklearn', 'joblib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_unknown_names_are_no_attributes():
    import lcorpp.learning

    with pytest.raises(AttributeError, match="attribute nothing"):
        lcorpp.learning.nothing  # noqa: B018
    assert all(hasattr(lcorpp.learning, name) for name in lcorpp.learning.__all__)


def test_the_papers_pipeline_learns_and_its_matrix_is_kept():
    from lcorpp.learning import paper_pipeline

    data = walkers(60)
    pipeline = paper_pipeline(epochs=40, rate=9.0, learning_rate=0.01, batch_size=16)
    classifier, validation = train_and_validate(pipeline, data, folds=2)
    assert classifier.confusion is validation.confusion
    assert validation.accuracy > 0.9
    alone = train(pipeline, data)
    assert alone.confusion is None
    assert alone.classify_many(data.trajectories) == classifier.classify_many(data.trajectories)


def test_data_of_one_class_cannot_be_learnt():
    with pytest.raises(DataError, match="at least two classes"):
        train(None, Dataset(walkers().trajectories, ("slow",) * 60))


def test_the_papers_parameters():
    from lcorpp.learning import paper_pipeline

    found = paper_pipeline().get_params()
    paper = {"units": 50, "dropout": 0.2, "epochs": 300, "batch_size": 32, "learning_rate": 1e-3}
    assert (found["motion__rate"], found["motion__interval"]) == (3.0, 0.033)
    assert {name: found[f"lstm__{name}"] for name in paper} == paper
