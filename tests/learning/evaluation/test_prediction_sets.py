"""Conformal prediction sets: quantiles by hand, coverage over many data sets, Bayes with measured rates."""

import json
from dataclasses import replace

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression

from lcorpp.errors import DataError
from lcorpp.learning import (
    TrainedClassifier,
    build_report,
    cross_validate,
    fit_prediction_sets,
    learner,
    load_classifier,
    save_classifier,
    train_and_validate,
)
from lcorpp.learning.evaluation.prediction_sets import PredictionSets
from lcorpp.learning.evaluation.validation import Validation, count_confusion
from lcorpp.values import Dataset, EvidenceKind


def make_validation(probabilities, labels, folds, groups=(), weights=None) -> Validation:
    classes = tuple("abcdefgh"[: np.shape(probabilities)[1]])
    p, labels = np.array(probabilities, dtype=float), tuple(labels)
    weights = np.ones(len(labels)) if weights is None else weights
    predictions = tuple(classes[i] for i in p.argmax(axis=1))
    confusion = count_confusion(classes, labels, predictions, weights)
    return Validation(confusion, predictions, p, None, tuple(folds), labels, tuple(groups), weights)


def two_classes(of_own_class, labels="ab") -> Validation:
    """Cases of both classes with these probabilities of their own class, in two folds."""
    p = np.concatenate([[(q, 1 - q) for q in of_own_class], [(1 - q, q) for q in of_own_class]])
    n = len(of_own_class)
    return make_validation(p, labels[0] * n + labels[1] * n, [i % 2 for i in range(2 * n)])


def test_a_floor_is_the_quantile_with_the_new_case():
    scores = np.linspace(0.5, 0.95, 19)  # of 19 people all are needed for 95 %, and 10 for a half
    for order in (scores, scores[::-1]):
        validation = two_classes(order)
        assert fit_prediction_sets(validation, 0.95).floors == pytest.approx([scores[0]] * 2)
        assert fit_prediction_sets(validation, 0.5).floors == pytest.approx([scores[9]] * 2)
    assert fit_prediction_sets(validation, 0.951).floors.tolist() == [0, 0]  # too few: in every set
    assert fit_prediction_sets(two_classes(scores[1:]), 0.95).floors.tolist() == [0, 0]


def test_classes_together_have_one_floor():
    p = [(0.9, 0.1)] * 30 + [(0.6, 0.4)] * 10
    validation = make_validation(p, "a" * 30 + "b" * 10, [0, 1] * 20)
    together = fit_prediction_sets(validation, 0.7, by_class=False)
    assert together.floors.tolist() == [0.9, 0.9]
    apart = fit_prediction_sets(validation, 0.7)
    assert apart.floors.tolist() == [0.9, 0.4]
    assert together.predict(np.array(p[-1:])) == [()]
    assert apart.predict(np.array(p[-1:])) == [("b",)]
    assert apart.predict(np.array([(0.95, 0.05), (0.05, 0.95), (0.9, 0.9)])) == [("a",), ("b",), ("a", "b")]


def test_a_person_with_many_cases_counts_once():
    rng = np.random.default_rng(0)
    q = rng.uniform(0.3, 0.9, 40)
    p = np.stack([q, 1 - q], axis=1)
    labels, folds, groups = "ab" * 20, np.arange(40) % 4 // 2, [str(i) for i in range(40)]
    once = make_validation(p, labels, folds, groups)
    repeated = np.repeat(np.arange(40), rng.integers(1, 9, 40))
    often = make_validation(
        p[repeated], [labels[i] for i in repeated], folds[repeated], [groups[i] for i in repeated]
    )
    for by_class in (True, False):
        expected = fit_prediction_sets(once, 0.8, by_class=by_class).floors
        sets = fit_prediction_sets(often, 0.8, by_class=by_class)
        assert sets.floors.tolist() == expected.tolist()
        assert sets.counts.sum(axis=0) == pytest.approx([20, 20])
    halves = replace(often, groups=(), weights=np.full(len(repeated), 0.5))
    assert fit_prediction_sets(halves, 0.8).counts.sum() == len(repeated) / 2


@pytest.mark.parametrize(
    ("classes", "many", "data_sets"),
    [
        (2, 20, 16),
        *(pytest.param(*p, 40, marks=pytest.mark.slow) for p in [(2, 1), (2, 20), (3, 1), (3, 20)]),
    ],
)
def test_coverage_over_many_data_sets(classes, many, data_sets):
    """Of classifiers trained on all cases, for new people; and of the reported out-of-fold sets.

    Some people have many cases that are alike, and other ones than people with one.
    """
    rng = np.random.default_rng(classes)
    names, covered, reported = np.array(list("abc"[:classes])), [], []

    def draw(n):
        truth = rng.choice(classes, n, p=[0.2, 0.8] if classes == 2 else [0.2, 0.3, 0.5])
        x = rng.normal(size=(n, 2)) + np.array([(0, 0), (1.5, 0), (0, 1.5)])[truth]
        cases = np.where(rng.random(n) < 0.2, many, 1)
        person = np.repeat(np.arange(n), cases)
        x[cases > 1] /= 3
        return x[person] + (many > 1) * rng.normal(0, 0.3, (len(person), 2)), truth[person], person

    for _ in range(data_sets):
        x, truth, person = draw(300)
        new_x, new_truth, new_person = draw(1500)
        share = 1 / np.bincount(new_person)[new_person]
        dataset = Dataset(x, tuple(names[truth]), groups=tuple(map(str, person)), channels=("u", "v"))
        trained, validation = train_and_validate(LogisticRegression(), dataset)
        for sets in (trained.prediction_sets, fit_prediction_sets(validation, 0.95)):
            assert sets.counts.sum() == pytest.approx(300)
        members = trained.prediction_sets.contains(trained.probabilities(new_x))
        covered.append(
            [np.average(members[new_truth == c, c], weights=share[new_truth == c]) for c in range(classes)]
        )
        reported.append([part.estimate for part in trained.prediction_sets.coverages])
    for each in (covered, reported):
        means = np.mean(each, axis=0)
        assert ((means > 0.93) & (means < 0.97)).all(), means


def test_the_likelihood_is_bayes_with_the_measured_rates():
    """With many cases it is P(outcome | class) of new cases, and the posterior is calibrated."""
    rng = np.random.default_rng(1)

    def draw(n):
        labels = rng.choice(["a", "b", "c"], n)
        scores = np.eye(3)[np.searchsorted(["a", "b", "c"], labels)] + rng.normal(size=(n, 3))
        return np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True), labels

    p, labels = draw(15000)
    sets = fit_prediction_sets(make_validation(p, labels.tolist(), rng.integers(0, 5, 15000)), 0.8)
    new_p, new_labels = draw(15000)
    weights = np.array([each.weights for each in sets.likelihoods(new_p)])
    posterior = weights / weights.sum(axis=1, keepdims=True)  # the classes are equally frequent
    for row in np.unique(posterior.round(6), axis=0):
        same = (np.abs(posterior - row) < 1e-5).all(axis=1)
        if same.sum() > 500:
            frequency = [(new_labels[same] == name).mean() for name in "abc"]
            assert row == pytest.approx(frequency, abs=4 * 0.5 / same.sum() ** 0.5)


def test_the_likelihood_by_hand_and_of_an_outcome_never_seen():
    sets = PredictionSets(
        ("a", "b"),
        0.9,
        np.array([0.3, 0.4]),
        np.array([0, 1]),
        np.array([[True, False], [True, True]]),
        np.array([[6, 1], [3, 9]]),
    )
    a_only, both, b_only, none = sets.likelihoods(
        np.array([[0.8, 0.2], [0.45, 0.55], [0.2, 0.8], [0.2, 0.3]])
    )
    assert [each.observed for each in (a_only, both.rename({"a": "A", "b": "B"}), b_only, none)] == [
        "prediction set of 0.9: a",
        "prediction set of 0.9: b, a (don't know)",
        "prediction set of 0.9: b",
        "prediction set of 0.9: empty, unlike the people of every class; most probable b",
    ]
    best = np.array([[6.5 / 10, 1.5 / 11], [3.5 / 10, 9.5 / 11]])
    inside = np.array([[9.5 / 10, 10.5 / 11], [3.5 / 10, 9.5 / 11]])
    prior = best[0] * inside[0] * (1 - inside[1])
    expected = (np.array([6, 1]) + prior) / [10, 11]
    assert a_only.weights == pytest.approx(expected / expected.max())
    expected = (np.array([3, 9]) + best[1] * inside[0] * inside[1]) / [10, 11]
    assert both.weights == pytest.approx(expected / expected.max())
    expected = best[1] * (1 - inside[0]) * inside[1] / [10, 11]
    assert b_only.weights == pytest.approx(expected / expected.max())


def test_the_sets_of_a_fold_have_the_floors_of_the_others():
    first, second = [(0.9, 0.1)] * 10, [(0.6, 0.4)] * 10
    others = [(0.1, 0.9)] * 20
    folds = [0] * 10 + [1] * 10 + [0, 1] * 10
    validation = make_validation(first + second + others, "a" * 20 + "b" * 20, folds)
    sets = fit_prediction_sets(validation, 0.5)
    assert sets.floors.tolist() == [0.6, 0.9]
    assert [part.estimate for part in sets.coverages] == [0.5, 1]  # .9 is above .6, .6 is below .9
    assert (sets.mean_size, sets.full, sets.empty) == (0.75, 0, 0.25)
    assert repr(sets) == (
        "<PredictionSets of 0.5: a covered 0.500 [0.293, 0.707], b covered 1.000 [0.883, 1.000];"
        " mean size 0.75, 0.000 full, 0.250 empty>"
    )


def test_a_trained_classifier_gives_each_kind_of_evidence(tmp_path):
    rng = np.random.default_rng(2)
    x = rng.normal(size=(80, 2)) + np.repeat([[0, 0], [1, 1]], 40, axis=0)
    dataset = Dataset(x, ("no",) * 40 + ("yes",) * 40, channels=("u", "v"))
    estimator = learner("logistic", inputs=dataset.channels, kind="table")
    trained, validation = train_and_validate(estimator, dataset, coverage=0.8)
    assert trained.as_evidence(EvidenceKind()) is trained
    assert trained.as_evidence(EvidenceKind("soft")).evidence == EvidenceKind("soft")
    sets = trained.as_evidence(EvidenceKind.parse("set:0.8"))
    assert sets.evidence == EvidenceKind("set")
    expected = trained.prediction_sets.likelihoods(trained.probabilities(x[:1]))[0]
    assert sets.classify(x[0]).weights.tolist() == expected.weights.tolist()
    save_classifier(trained, tmp_path / "classifier.npz")
    loaded = load_classifier(tmp_path / "classifier.npz").sets()
    assert [each.weights.tolist() for each in loaded.classify_many(x)] == [
        each.weights.tolist() for each in sets.classify_many(x)
    ]
    assert PredictionSets.from_json(json.loads(json.dumps(sets.source.to_json()))).to_json() == (
        sets.source.to_json()
    )
    with pytest.raises(DataError, match=r"prediction sets of coverage 0.8, not 0.9; train it again"):
        trained.sets(0.9)
    with pytest.raises(DataError, match="this one was trained without"):
        TrainedClassifier(trained.estimator).sets()
    report = build_report(validation, coverage=0.8)
    assert report.sets.to_json() == trained.prediction_sets.to_json()
    rows = {(row.class_name, row.quantity): row.interval for row in report.rows()}
    assert rows["yes", "prediction sets of coverage 0.8: true class in the set"].estimate > 0.7
    assert rows["", "prediction sets of coverage 0.8: mean size"].estimate == report.sets.mean_size


@pytest.mark.parametrize("coverage", [0, 1, 1.5, -0.1, float("nan"), "0.9", None, True])
def test_the_coverage_lies_between_0_and_1(coverage):
    validation = cross_validate(
        LogisticRegression(),
        Dataset(np.eye(2)[[0, 1] * 10], ("a", "b") * 10, channels=("u", "v")),
        folds=2,
    )
    with pytest.raises(DataError, match=r"coverage.* is .*; expected a number"):
        fit_prediction_sets(validation, coverage)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sets", "evidence 'sets': expected one of hard, soft, set"),
        ("soft:0.9", "evidence 'soft:0.9': expected set:COVERAGE, as set:0.95"),
        ("set:", "evidence 'set:': expected set:COVERAGE, as set:0.95"),
        ("set:95", "evidence 'set:95': expected set:COVERAGE, as set:0.95"),
    ],
)
def test_words_of_a_wrong_kind_of_evidence(text, message):
    with pytest.raises(DataError) as error:
        EvidenceKind.parse(text)
    assert str(error.value) == message


def test_a_kind_of_evidence_is_its_text():
    for text in ("hard", "soft", "set", "set:0.9"):
        assert str(EvidenceKind.parse(text)) == text
