from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import beta
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from lcorpp.errors import DataError
from lcorpp.learning import ChannelStandardizer, Motion, Validation, cross_validate, estimate_rates, split
from lcorpp.values import ConfusionMatrix, Dataset
from tests.learning.walkers import walkers


def flat(tracks):
    return np.abs(tracks).mean(axis=2)


def quick_pipeline():
    return make_pipeline(
        Motion(rate=15.0), ChannelStandardizer(), FunctionTransformer(flat), LogisticRegression()
    )


class Recorder(ClassifierMixin, BaseEstimator):
    """Remembers which cases it was trained on and asked about; the first number of a track is its case."""

    seen: list[tuple[set[int], set[int]]] = []  # noqa: RUF012

    def fit(self, X, y):
        self.classes_ = np.unique(y)
        self.trained_ = set(X[:, 0, 0].astype(int).tolist())
        return self

    def predict_proba(self, X):
        self.seen.append((self.trained_, set(X[:, 0, 0].astype(int).tolist())))
        return np.full((len(X), len(self.classes_)), 1 / len(self.classes_))


def test_no_group_is_on_both_sides_and_every_case_is_predicted_once():
    data = walkers(90)
    tracks = np.array(data.trajectories)
    tracks[:, 0, 0] = np.arange(90)
    Recorder.seen.clear()
    validation = cross_validate(Recorder(), Dataset(tracks, data.labels, data.groups))
    assert len(Recorder.seen) == 5
    for train, test in Recorder.seen:
        assert not {data.groups[i] for i in train} & {data.groups[i] for i in test}
        assert train | test == set(range(90))
    assert sorted(i for _, test in Recorder.seen for i in test) == list(range(90))
    assert sorted(set(validation.folds)) == [0, 1, 2, 3, 4]


def test_separable_classes_are_predicted_correctly():
    data = walkers()
    validation = cross_validate(quick_pipeline(), data)
    assert validation.classes == ("fast", "slow")
    assert validation.confusion.counts.tolist() == [[30, 0], [0, 30]]
    assert validation.predictions == data.labels
    assert (validation.auc, validation.accuracy) == (1, 1)


def test_labels_without_meaning_are_near_chance():
    rng = np.random.default_rng(0)
    labels = tuple(np.array(["a", "b"])[rng.integers(0, 2, 300)].tolist())
    data = Dataset(rng.normal(size=(300, 2, 6)), labels)
    assert abs(cross_validate(quick_pipeline(), data).auc - 0.5) < 0.1  # 3 standard errors


def test_three_classes_have_no_auc():
    validation = cross_validate(quick_pipeline(), walkers(90, classes=3))
    assert validation.auc is None
    assert validation.probabilities.shape == (90, 3)
    np.testing.assert_allclose(validation.probabilities.sum(axis=1), 1)


def test_the_result_does_not_depend_on_the_processes():
    from lcorpp.learning import paper_pipeline

    pipeline = paper_pipeline(epochs=2, rate=4.0)
    ignored, calls = [], []
    pipeline.set_params(lstm__progress=lambda *done: ignored.append(done))
    one = cross_validate(pipeline, walkers(), jobs=1)
    two = cross_validate(pipeline, walkers(), jobs=2, progress=lambda *done: calls.append(done))
    assert np.array_equal(one.probabilities, two.probabilities)
    assert one.folds == two.folds
    assert calls == [(i, 5) for i in range(1, 6)]
    assert ignored == []  # the estimator's own progress is not called
    assert pipeline.get_params()["lstm__progress"] is not None  # and it was not changed


def test_the_seed_determines_the_folds():
    first, same, other = (cross_validate(quick_pipeline(), walkers(), seed=s).folds for s in (3, 3, 4))
    assert first == same != other


def test_intervals_are_those_of_jeffreys():
    counts = np.array([[48.0, 15.0], [0.0, 60.0]])
    validation = Validation(ConfusionMatrix(("no", "yes"), counts), (), np.empty((0, 2)), None, ())
    no, yes = validation.recalls
    assert (no.true, no.predicted, no.count, no.cases, no.value) == ("no", "no", 48, 63, 48 / 63)
    assert (round(no.interval.low, 2), round(no.interval.high, 2)) == (
        0.65,
        0.85,
    )  # LEARNING.md: 48 of 63 is .65 to .85
    np.testing.assert_allclose([no.interval.low, no.interval.high], beta.ppf([0.025, 0.975], 48.5, 15.5))
    assert yes.interval.high == 1
    assert 0.9 < yes.interval.low < 1
    wrong = validation.rates[1][0]
    assert (wrong.true, wrong.predicted, wrong.value, wrong.interval.low) == ("yes", "no", 0, 0)
    np.testing.assert_allclose(wrong.interval.high, 1 - yes.interval.low)
    narrow = estimate_rates(validation.confusion, level=0.5)[0][0]
    assert no.interval.low < narrow.interval.low < narrow.interval.high < no.interval.high
    assert (no.interval.confidence, narrow.interval.confidence) == (0.95, 0.5)
    with pytest.raises(DataError, match="the level of an interval is 95; expected a number between 0 and 1"):
        estimate_rates(validation.confusion, level=95)


def test_too_few_groups_are_an_error():
    with pytest.raises(
        DataError, match=r"5 folds need every class in at least 5 groups; .* fast in 2, slow in 2"
    ):
        cross_validate(quick_pipeline(), walkers(12), folds=5)
    with pytest.raises(DataError, match="at least 2 folds, not 1"):
        cross_validate(quick_pipeline(), walkers(), folds=1)


def test_each_of_few_people_is_held_out_alone():
    data = walkers(24)  # eight people
    validation = cross_validate(quick_pipeline(), data)
    assert len(set(validation.folds)) == 8
    assert len(set(zip(validation.folds, data.groups, strict=True))) == 8
    assert len(set(cross_validate(quick_pipeline(), walkers(36)).folds)) == 5  # of twelve people


def test_cases_of_several_people_are_trained_without_those_who_are_held_out():
    n, groups = 40, 10 * ["ann"] + 10 * ["bob"] + 10 * ["cy"] + 10 * ["ann + bob"]
    tracks = np.tile(np.arange(n, dtype=float)[:, None, None], (1, 2, 3))
    Recorder.seen = []
    cross_validate(Recorder(), Dataset(tracks, n // 2 * ["a", "b"], groups))
    ann, bob, cy, both = (set(range(start, start + 10)) for start in (0, 10, 20, 30))
    assert Recorder.seen == [(bob | cy, ann), (cy, both), (ann | cy, bob), (ann | bob | both, cy)]


def test_people_of_whom_all_others_know_one_are_an_error():
    groups = 4 * ["ann + bob"] + 4 * ["bob + cy"] + 4 * ["cy + ann"]
    data = Dataset(np.random.default_rng(0).normal(size=(12, 2, 3)), 6 * ["a", "b"], groups)
    with pytest.raises(
        DataError,
        match=r"without the cases of ann \+ bob, and of others with these people, there is no case of a, b",
    ):
        cross_validate(Recorder(), data)


def test_a_split_leaves_people_of_the_test_data_out_of_the_training_data():
    groups = 10 * ["ann"] + 10 * ["bob"] + 10 * ["cy"] + 10 * ["ann + bob"]
    data = Dataset(np.random.default_rng(0).normal(size=(40, 2, 3)), 20 * ["a", "b"], groups)
    for seed in range(8):
        training, test = split(data, test=0.25, seed=seed)
        (held_out,) = set(test.groups)
        assert not {name for group in training.groups for name in group.split(" + ")} & {
            *held_out.split(" + ")
        }
        assert len(training) == {"ann": 20, "bob": 20, "cy": 30, "ann + bob": 10}[held_out]


def test_an_interrupt_passes_through():
    def interrupt(done: int, of: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cross_validate(quick_pipeline(), walkers(), progress=interrupt)
