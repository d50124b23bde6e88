"""Weighted cases: weight 2 counts as two equal cases, and an uncertain person is a case of each class."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression, RidgeClassifier
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from lcorpp.early_decision.stream_model import fit_stream_model
from lcorpp.errors import DataError
from lcorpp.learning import (
    LstmClassifier,
    build_report,
    calibrate_prefixes,
    cross_calibrate,
    cross_validate,
    fit_prefix_sets,
    fit_trigger,
    learner,
    load_dataset,
    measure_leakage,
    save_dataset,
    train,
    train_and_validate,
)
from lcorpp.learning.classifiers.learner_table import LEARNERS
from lcorpp.learning.classifiers.registry import check_weighted
from lcorpp.learning.contract import SigmoidScores, accepts_weights
from lcorpp.learning.evaluation.calibration import fit_calibration
from lcorpp.learning.evaluation.metrics import compute_auc
from lcorpp.learning.label_noise.uncertain_labels import split_by_class
from lcorpp.learning.streaming.timeline import PredictionTimeline
from lcorpp.values import Dataset

KNOWN = "expected one of lstm, lstm-fast, summaries, forest, logistic"


def table(weights=(), *, repeated=False, seed=0):
    """200 cases of two overlapping classes; every third has weight 2, or is there twice."""
    rng = np.random.default_rng(seed)
    index = np.arange(200)
    features = rng.normal(size=(200, 3)) + (index % 2)[:, None] * [1.0, 0.5, 0]
    labels = np.where(index % 2, "yes", "no")
    if repeated:
        index = np.sort(np.concatenate([index, index[::3]]))
    return Dataset(
        features[index], tuple(labels[index].tolist()), tuple(f"person {i}" for i in index), weights=weights
    )


def doubled():
    return np.where(np.arange(200) % 3, 1.0, 2.0)


@pytest.mark.parametrize(
    "estimator",
    [
        learner("logistic", kind="table"),
        make_pipeline(StandardScaler(), LogisticRegression()),
        make_pipeline(StandardScaler(), SigmoidScores(RidgeClassifier())),
        SigmoidScores(make_pipeline(StandardScaler(), RidgeClassifier())),
    ],
)
def test_a_weight_of_two_is_a_repeated_case(estimator):
    weighted, repeated = (train(estimator, data) for data in (table(doubled()), table(repeated=True)))
    points = table().trajectories
    # the two sums are rounded differently, and the solver stops at a gradient of 1e-4
    np.testing.assert_allclose(weighted.probabilities(points), repeated.probabilities(points), atol=1e-4)
    unweighted = train(estimator, table()).probabilities(points)
    assert np.abs(weighted.probabilities(points) - unweighted).max() > 1e-3


def test_confusion_matrix_auc_and_calibration_count_by_weight():
    data = table(doubled())
    classifier, validation = train_and_validate(learner("logistic", kind="table"), data)
    labels, predictions = np.array(data.labels), np.array(validation.predictions)
    expected = [
        [doubled()[(labels == true) & (predictions == given)].sum() for given in ("no", "yes")]
        for true in ("no", "yes")
    ]
    assert validation.confusion.counts.tolist() == expected
    rows = np.repeat(np.arange(200), doubled().astype(int))
    calibration = fit_calibration(
        validation.classes, validation.probabilities[rows], [data.labels[i] for i in rows]
    )
    assert classifier.calibration.slope == pytest.approx(calibration.slope, rel=1e-4)
    np.testing.assert_allclose(classifier.calibration.shares, calibration.shares)
    assert validation.auc != cross_validate(learner("logistic", kind="table"), table()).auc
    scores = validation.probabilities[:, 1]
    pairs = [
        (doubled()[i] * doubled()[j], scores[i] > scores[j])
        for i in np.flatnonzero(labels == "yes")
        for j in np.flatnonzero(labels == "no")
    ]
    total = sum(weight for weight, _ in pairs)
    assert validation.auc == pytest.approx(sum(weight * won for weight, won in pairs) / total)
    assert validation.with_predictions(data.labels).confusion.counts.sum() == doubled().sum()


def test_cross_calibration_counts_by_weight_as_the_calibration_of_the_classifier():
    """Positive cases of weight 10: the weighted mean of calibrated probabilities is their weighted share."""
    data = replace(table(), weights=np.where(np.arange(200) % 2, 10.0, 1.0))
    classifier, validation = train_and_validate(learner("logistic", kind="table"), data)
    means = [
        float(np.average(p[:, 1], weights=data.weights))
        for p in (cross_calibrate(validation), classifier.calibration.calibrate(validation.probabilities))
    ]
    assert means == pytest.approx([10 / 11, 10 / 11], abs=0.02)
    rest = np.array(validation.folds) != 0
    fold = fit_calibration(
        validation.classes,
        validation.probabilities[rest],
        np.array(data.labels)[rest].tolist(),
        data.weights[rest],
    )
    expected = fold.calibrate(validation.probabilities[~rest])
    np.testing.assert_allclose(cross_calibrate(validation)[~rest], expected)


def test_leakage_counts_by_weight():
    """The end position shows the class of the light cases only."""
    rng = np.random.default_rng(0)
    tracks, is_second = rng.normal(size=(120, 2, 12)), np.arange(120) % 2
    light = np.arange(120) < 60
    tracks[:, 0, -1] += 6 * is_second * light
    labels = tuple("ab"[k] for k in is_second)
    scores = [
        {score.name: score for score in measure_leakage(Dataset(tracks, labels, weights=weights), n_splits=1)}
        for weights in (np.ones(120), np.where(light, 1e-6, 1.0))
    ]
    plain, weighted = (each["end position"] for each in scores)
    assert plain.is_suspicious
    assert not weighted.is_suspicious
    assert weighted.auc.high < plain.auc.estimate


def test_timelines_count_by_weight_and_triggers_refuse_weights():
    weights = np.where(np.arange(40) % 3, 1.0, 2.0)
    rng = np.random.default_rng(0)
    is_second = np.arange(40) % 2
    scores = np.clip(0.5 + 0.15 * (2 * is_second - 1) + rng.normal(0, 0.2, 40), 0.01, 0.99)
    probabilities = np.stack([1 - scores, scores], axis=1)[:, None]
    folds = tuple((np.arange(40) // 2 % 4).tolist())
    labels = tuple("ab"[k] for k in is_second)
    groups = tuple(map(str, range(40)))
    made = {"labels": labels, "classes": ("a", "b"), "interval": 0.1, "folds": folds, "groups": groups}
    timeline = PredictionTimeline(probabilities, (2,), **made, weights=weights)
    assert timeline.take([0, 1]).weights.tolist() == [2, 1]
    assert timeline.auc_at(1.0) == compute_auc(scores, is_second == 1, weights[None])[0]
    fit = fit_calibration(("a", "b"), probabilities[:, 0], labels, weights)
    assert calibrate_prefixes(timeline).at(2).slope == pytest.approx(fit.slope)
    assert calibrate_prefixes(timeline).at(2).shares.tolist() == fit.shares.tolist()
    assert fit_prefix_sets(timeline).at(2).counts.sum() == pytest.approx(weights.sum())
    for refuse, name in ((fit_trigger, "a trigger"), (fit_stream_model, "a stream model")):
        with pytest.raises(DataError, match=f"{name} is of cases of weight 1; these are weighted"):
            refuse(timeline)


def test_copies_of_an_uncertain_person_stay_in_one_fold():
    data = table()
    other = {"yes": "no", "no": "yes"}
    soft, _ = split_by_class(data, [{label: 0.9, other[label]: 0.1} for label in data.labels])
    assert (len(soft), soft.n_people, soft.labels[:2]) == (400, 200, ("no", "yes"))
    groups = soft.groups
    validation = cross_validate(learner("logistic", kind="table"), soft)
    folds = dict(zip(groups, validation.folds, strict=True))
    assert tuple(folds[group] for group in groups) == validation.folds
    assert validation.confusion.counts.sum() == pytest.approx(200)
    assert validation.predictions[::2] == validation.predictions[1::2]
    # a tenth of each class counts as the other: the counts are mixed, the predictions nearly the same
    hard = cross_validate(learner("logistic", kind="table"), data)
    mixed = np.array([[0.9, 0.1], [0.1, 0.9]]) @ hard.confusion.counts
    np.testing.assert_allclose(validation.confusion.counts, mixed, atol=8)


def test_the_lstm_multiplies_weights_of_cases_and_classes():
    rng = np.random.default_rng(1)
    tracks, labels = rng.normal(size=(40, 2, 8)), np.array(["a", "b"] * 20)
    weights = np.where(labels == "a", 3.0, 1.0)
    by_case = LstmClassifier(epochs=2).fit(tracks, labels, weights).predict_proba(tracks)
    by_class = (
        LstmClassifier(epochs=2, class_weight={"a": 3, "b": 1}).fit(tracks, labels).predict_proba(tracks)
    )
    np.testing.assert_array_equal(by_case, by_class)
    # balanced weights undo those of the classes
    balanced = [
        LstmClassifier(epochs=2, class_weight="balanced").fit(tracks, labels, given).predict_proba(tracks)
        for given in (None, weights)
    ]
    np.testing.assert_allclose(balanced[0], balanced[1], atol=1e-6)
    with pytest.raises(DataError, match="40 cases need as many finite weights from 0, not"):
        LstmClassifier().fit(tracks, labels, weights[:-1])


def test_every_learner_takes_weights():
    for name in LEARNERS:
        assert accepts_weights(learner(name)), name
    with pytest.raises(DataError, match=f"learner 'k' cannot learn .* its fit has no sample_weight; {KNOWN}"):
        check_weighted("k", KNeighborsClassifier())
    with pytest.raises(DataError, match="KNeighborsClassifier has no sample_weight in fit"):
        cross_validate(KNeighborsClassifier(), table(doubled()))
    cross_validate(KNeighborsClassifier(), table())  # unweighted cases need no weights


def test_reports_are_of_unweighted_cases():
    validation = cross_validate(learner("logistic", kind="table"), table(doubled()))
    with pytest.raises(DataError, match="a report is of cases of weight 1; these are weighted"):
        build_report(validation)


def test_weights_of_a_data_set(tmp_path):
    data = table(doubled())
    assert (data.is_weighted, table().is_weighted) == (True, False)
    assert data.take([0, 1]).weights.tolist() == [2, 1]
    assert data.append([(np.zeros(3), "no")], ["someone"]).weights.tolist()[-2:] == [1, 1]
    save_dataset(data, tmp_path / "data.npz")
    np.testing.assert_array_equal(load_dataset(tmp_path / "data.npz").weights, doubled())
    for wrong in ([1.0], np.zeros(200), np.full(200, np.nan)):
        with pytest.raises(DataError, match="200 cases need as many weights, finite and above 0"):
            table(wrong)
