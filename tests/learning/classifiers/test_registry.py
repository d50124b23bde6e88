"""The table of learners and learner plug-ins: each keeps the contract; violations are one-line errors."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.base import BaseEstimator
from sklearn.ensemble import RandomForestClassifier
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import LogisticRegression, Perceptron, RidgeClassifier
from sklearn.neighbors import NearestCentroid
from sklearn.pipeline import make_pipeline

from lcorpp import load_robot
from lcorpp.assembly import TrainingOptions
from lcorpp.errors import DataError
from lcorpp.learning import (
    LEARNERS,
    Motion,
    SummaryFeatures,
    cross_validate,
    learner,
    train,
    train_and_validate,
)
from lcorpp.learning.classifiers import makers
from lcorpp.learning.classifiers.forest import Forest
from lcorpp.learning.classifiers.learner_table import default_features
from lcorpp.learning.classifiers.logistic import QuadraticLogistic
from lcorpp.learning.contract import SigmoidScores, ensure_predict_proba
from lcorpp.values import Dataset
from tests.learning.walkers import walkers

DATA = walkers(60)
MADE = [
    ("lstm", {"epochs": 3}),
    ("lstm-fast", {"epochs": 3}),
    ("summaries", {}),
    ("forest", {}),
    ("minirocket", {}),
]


@pytest.mark.parametrize(("name", "extra"), MADE)
def test_each_learner_is_validated_alike(name, extra):
    """Shows 6."""
    data = walkers(60, points=304)  # ten seconds
    estimator = learner(name, interval=data.interval, inputs=data.channels, seed=1, **extra)
    if name == "forest":
        estimator.set_params(forest__n_estimators=20)
    trained, validation = train_and_validate(estimator, data, folds=2)
    assert validation.classes == ("fast", "slow")
    np.testing.assert_allclose(validation.probabilities.sum(axis=1), 1)
    assert validation.confusion.counts.sum() == 60
    if not extra:
        assert validation.auc > 0.95
    one = trained.classify(data.trajectories[7])
    assert [one] == trained.classify_many(data.trajectories[7:8])
    said = trained.soft().classify(data.trajectories[7])
    assert said.values == ("fast", "slow")


def test_the_table_names_makers_that_exist():
    assert [row.maker for row in LEARNERS.values() if not callable(getattr(makers, row.maker, None))] == []


def test_the_fast_lstm_makes_few_passes_unless_the_data_are_few():
    for options, expected in (({}, (6, 300)), ({"epochs": 4}, (4, 0))):
        network = learner("lstm-fast", **options)[-1]
        assert (network.epochs, network.min_updates) == expected
    series = learner("lstm-fast", inputs=("pitch",))
    assert [name for name, _ in series.steps] == ["segments", "scaling", "lstm"]
    assert (series[-1].min_updates, series[-1].dropout) == (600, 0.2)


def test_the_same_seed_is_the_same_classifier():
    def probabilities(seed):
        forest = learner("forest", features=("x", "y"), seed=seed).set_params(forest__n_estimators=5)
        return train(forest, DATA).probabilities(DATA.trajectories)

    assert np.array_equal(probabilities(3), probabilities(3))
    assert not np.array_equal(probabilities(3), probabilities(4))


@pytest.mark.parametrize("name", ["summaries", "forest"])
def test_learners_of_summaries_do_not_depend_on_where_a_person_is_seen(name):
    trained = train(learner(name), DATA)
    seen = walkers(30, seed=3).trajectories
    turned = np.stack([5 - seen[:, 1], seen[:, 0] - 3], axis=1)
    np.testing.assert_allclose(trained.probabilities(seen), trained.probabilities(turned), atol=1e-9)


def test_the_forest_predicts_as_scikit_learn_does():
    """Number for number, of three classes, with weights."""
    data, rng = walkers(90, classes=3), np.random.default_rng(0)
    X, y = rng.normal(size=(90, 5)), np.array(data.labels)
    forest = Forest(20, random_state=0).fit(X, y, rng.uniform(0.5, 2, 90))
    assert np.array_equal(forest.predict_proba(X), RandomForestClassifier.predict_proba(forest, X))
    assert np.array_equal(forest.predict(X), RandomForestClassifier.predict(forest, X))
    with pytest.raises(DataError, match=r"trained on 5 features, given shape \(90, 4\)"):
        forest.predict_proba(X[:, :4])
    with pytest.raises(NotFittedError):
        Forest().predict_proba(X)


def test_without_chosen_features_each_learner_has_its_own():
    for name in LEARNERS:
        if name != "logistic":
            assert learner(name)[0].features == default_features(name)
    assert default_features("lstm") == default_features("my.py:own") == ("x", "y")
    assert (
        default_features("summaries")
        == default_features("lstm-fast")
        == ("velocity", "acceleration", "turn_rate")
    )
    assert learner("summaries", features=["x", "y", "heading"])[1].rate == 3.0
    assert learner("summaries", features=["velocity", "ahead"])[1].rate is None


def test_more_cases_than_the_limit_do_not_weaken_the_regularization():
    rng = np.random.default_rng(0)
    X, y = rng.normal(size=(40, 3)), np.array(["a", "b"] * 20)
    once, twice = (
        QuadraticLogistic(C=0.1, max_cases=40).fit(np.tile(X, (times, 1)), np.tile(y, times))
        for times in (1, 2)
    )
    np.testing.assert_allclose(once.weights_, twice.weights_, atol=1e-5)
    unlimited = QuadraticLogistic(C=0.1).fit(np.tile(X, (2, 1)), np.tile(y, 2))
    assert np.abs(unlimited.weights_).sum() > 1.2 * np.abs(twice.weights_).sum()
    limits = [learner("summaries", new_places=new)[-1].max_cases for new in (True, False)]
    assert limits == [25, None]
    with pytest.raises(DataError, match="max_cases must be above 0, not 0"):
        QuadraticLogistic(max_cases=0).fit(X, y)


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("fast", {}, "learner 'fast' is now called 'lstm-fast'"),
        (
            "lstn",
            {},
            "unknown learner 'lstn'; expected one of lstm, lstm-fast, summaries, forest, logistic",
        ),
        ("forest", {"epochs": 3}, "'forest' makes no passes over the data; epochs are for lstm, lstm-fast"),
        ("summaries", {"device": "cuda"}, "'summaries' runs on the cpu only"),
        ("no_such_module_here:make", {}, "No module named 'no_such_module_here'"),
        ("sklearn.svm:nothing", {}, "sklearn.svm has no function 'nothing'; expected one of"),
        ("sklearn.svm:", {}, "expected MODULE:FUNCTION or FILE.py:FUNCTION"),
        ("no_such_file.py:make", {}, "no_such_file.py: there is no such file"),
        (
            "sklearn.metrics:accuracy_score",
            {},
            "accuracy_score needs the argument 'y_true'; expected one of interval",
        ),
        ("sklearn.neighbors:NearestNeighbors", {}, "neither predict_proba nor decision_function"),
        ("json:JSONDecoder", {}, "is not an estimator; expected an object with fit"),
    ],
)
def test_unknown_and_unfit_learners_are_errors(name, options, words):
    with pytest.raises(DataError, match=words):
        learner(name, **options)


OWN = '''
from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.linear_model import SGDClassifier
from sklearn.pipeline import make_pipeline
from lcorpp.learning import Motion, SummaryFeatures

@dataclass
class Edge:
    at: float

class BySpeed(ClassifierMixin, BaseEstimator):
    """Who gets farther is faster."""
    def __init__(self, seed=0):
        self.seed = seed
    def fit(self, X, y):
        self.classes_ = np.unique(y)
        self.edge_ = Edge(float(np.median(self.way(X))))
        return self
    def way(self, X):
        return np.hypot(*(X[:, :, -1] - X[:, :, 0]).T)
    def predict_proba(self, X):
        fast = 1 / (1 + np.exp(self.edge_.at - self.way(X)))
        return np.stack([fast, 1 - fast], axis=1)

def by_speed(seed):
    return BySpeed(seed)

def sgd(interval):
    return make_pipeline(Motion(interval=interval), SummaryFeatures(), SGDClassifier())

def broken():
    raise ValueError("no luck")

def list_of_them():
    return [1, 2]
'''


@pytest.fixture
def own(tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    return str(tmp_path / "mine.py")


def test_a_classifier_from_a_file_of_ones_own(own):
    estimator = learner(f"{own}:by_speed", seed=5)
    assert estimator.seed == 5
    assert cross_validate(estimator, DATA, jobs=2).accuracy > 0.9  # and the workers know its class


def test_a_classifier_with_scores_only_is_wrapped(own):
    estimator = learner(f"{own}:sgd", seed=5)
    assert isinstance(estimator, SigmoidScores)
    assert estimator.get_params()["classifier__sgdclassifier__random_state"] == 5  # it was left open
    assert cross_validate(estimator, DATA, folds=3).auc > 0.9


def test_an_option_that_a_learner_lacks_is_an_error(own):
    with pytest.raises(DataError, match=r"epochs is set, but .*mine\.py:by_speed has no parameter of that"):
        learner(f"{own}:by_speed", epochs=3)


def test_mistakes_in_ones_own_file_are_located(own, tmp_path):
    line = OWN.splitlines().index('    raise ValueError("no luck")') + 1
    with pytest.raises(DataError, match=rf"mine\.py:{line}: broken\(\) failed: ValueError: no luck"):
        learner(f"{own}:broken")
    with pytest.raises(DataError, match=r"\[1, 2\] is not an estimator"):
        learner(f"{own}:list_of_them")
    (tmp_path / "bad.py").write_text("x = 1\ndef f(:\n")
    with pytest.raises(DataError, match=r"bad\.py:2: cannot be loaded: SyntaxError"):
        learner(f"{tmp_path / 'bad.py'}:f")
    (tmp_path / "worse.py").write_text("import sys\nsys.exit(3)\n")
    with pytest.raises(DataError, match=r"worse\.py:2: cannot be loaded: SystemExit: 3"):
        learner(f"{tmp_path / 'worse.py'}:f")


@pytest.mark.parametrize("classifier", [Perceptron(), RidgeClassifier()])
def test_scores_of_several_classes_become_distributions(classifier):
    data = walkers(90, classes=3)
    pipeline = make_pipeline(Motion(rate=15.0), SummaryFeatures(rate=15.0), ensure_predict_proba(classifier))
    validation = cross_validate(pipeline, data, folds=3)
    np.testing.assert_allclose(validation.probabilities.sum(axis=1), 1)
    assert validation.accuracy > 0.6  # a third is chance


class Odd(BaseEstimator):
    """Breaks the contract in the way that is asked of it."""

    def __init__(self, way="right"):
        self.way = way

    def fit(self, X, y):
        if self.way == "fails":
            raise ZeroDivisionError("by zero")
        if self.way != "classless":
            self.classes_ = np.unique(y) if self.way != "short" else np.unique(y)[:1]
        return self

    def predict_proba(self, X):
        if self.way == "cannot":
            raise IndexError("out of range")
        given = np.full((len(X), 2), 0.5)
        if self.way == "nan":
            given[3, 1] = np.nan
        if self.way == "sums":
            given[2] = 0.7
        return given[:, :1] if self.way == "narrow" else given


@pytest.mark.parametrize(
    ("way", "words"),
    [
        ("fails", "Odd failed in fit: ZeroDivisionError: by zero"),
        ("cannot", "Odd failed in predict_proba: IndexError: out of range"),
        ("classless", "Odd has no classes_ after fit"),
        ("short", r"learnt the classes \['fast'\]; expected \['fast', 'slow'\]"),
        ("nan", r"gave \[0.5, nan\] in predict_proba for case 3 .*; expected a distribution"),
        ("sums", r"gave \[0.7, 0.7\] in predict_proba for case 2"),
        ("narrow", r"gave shape \(\d+, 1\) in predict_proba; expected \(\d+, 2\)"),
    ],
)
def test_estimators_that_break_the_contract_are_errors(way, words):
    with pytest.raises(DataError, match=words):
        cross_validate(Odd(way), DATA, folds=2)


def test_objects_that_are_no_estimators_are_errors():
    for thing in (LogisticRegression, "lstm", None):
        with pytest.raises(DataError, match="is not an estimator"):
            ensure_predict_proba(thing)
    with pytest.raises(DataError, match="Motion has neither"):
        ensure_predict_proba(Motion())
    assert ensure_predict_proba(NearestCentroid()).get_params() is not None


def test_tracks_with_more_channels():
    tracks = np.concatenate([DATA.trajectories, np.ones((60, 1, 40))], axis=1)
    data = Dataset(tracks, DATA.labels, DATA.groups, channels=("x", "y", "velocity"))
    seen = learner("summaries", inputs=data.channels, features=("x", "y", "velocity"))
    assert cross_validate(seen, data, folds=3).auc > 0.95
    with pytest.raises(DataError, match="the inputs are x, y, but the tracks have 3 channels"):
        cross_validate(learner("summaries"), data, folds=3)


@pytest.mark.parametrize("name", ["lstm-fast", "summaries", "forest", "minirocket"])
def test_without_class_weights_a_rare_class_has_smaller_probabilities(name):
    """The classes do not differ: their probabilities are equal with weights, else their shares."""
    data = walkers(120, seed=1)
    data = Dataset(data.trajectories, ["rare" if i % 8 == 0 else "common" for i in range(len(data))])
    others, means = walkers(120, seed=2).trajectories, {}
    for weight in ("balanced", None):
        trained = train(learner(name, class_weight=weight), data).estimator
        means[weight] = trained.predict_proba(others)[:, list(trained.classes_).index("rare")].mean()
    assert means["balanced"] > means[None] + 0.05
    assert means[None] < 0.35


def test_other_class_weights_are_refused(tmp_path):
    with pytest.raises(DataError, match="class_weight is 'equal'; expected 'balanced' or None"):
        learner("summaries", class_weight="equal")
    (tmp_path / "own.py").write_text(
        "from sklearn.dummy import DummyClassifier\n\ndef make():\n    return DummyClassifier()\n"
    )
    with pytest.raises(DataError, match="class_weight"):
        learner(f"{tmp_path / 'own.py'}:make", class_weight=None)
    with pytest.raises(DataError, match="balance is 'cases'; expected one of classes, none"):
        load_robot(
            "intention", classifiers={"motion": TrainingOptions("summaries", balance="cases", tracks=20)}
        )
