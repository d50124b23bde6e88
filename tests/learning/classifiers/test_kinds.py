"""Learners of tables and of channels of a domain's own; data that they cannot use are refused."""

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import TrackSchema, learner, load_classifier, save_classifier, train, train_and_validate
from lcorpp.learning.classifiers.learner_table import DEFAULTS, LEARNERS
from lcorpp.values import Dataset

CLASSES = ("tea", "coffee", "water")
FAST = {"lstm": {"epochs": 2}, "lstm-fast": {"epochs": 2}}


def make_table(cases=60, seed=0):
    """Three classes, each with a feature of its own that is larger."""
    rng = np.random.default_rng(seed)
    truth = np.arange(cases) % 3
    return Dataset(
        rng.normal(size=(cases, 3)) + 2 * np.eye(3)[truth],
        tuple(CLASSES[i] for i in truth),
        channels=("yaw", "pitch", "dwell"),
    )


def make_series(cases=60, seed=0):
    """Channels over time with the means of `make_table`."""
    table = make_table(cases, seed)
    noise = np.random.default_rng(seed + 1).normal(size=(cases, 3, 12))
    return Dataset(table.trajectories[:, :, None] + noise, table.labels, channels=("f0", "loudness", "rate"))


def test_every_learner_of_a_table_or_a_series_is_better_than_chance():
    for data in (make_table(), make_series()):
        for name, row in LEARNERS.items():
            if data.kind not in row.kinds:
                continue
            estimator = learner(name, inputs=data.channels, kind=data.kind, **FAST.get(name, {}))
            classifier, validation = train_and_validate(estimator, data, folds=3)
            assert np.trace(validation.confusion.counts) > 0.45 * len(data), name
            assert classifier.inputs == data.channels
            assert classifier.classify(data.trajectories[0]) in CLASSES


def test_the_default_learner_suits_the_data():
    for kind, name in DEFAULTS.items():
        assert kind in LEARNERS[name].kinds


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        (
            "lstm",
            {"kind": "table", "inputs": ("yaw",)},
            "'lstm' needs tracks over time; the data are features",
        ),
        (
            "lstm-fast",
            {"kind": "table"},
            "features without time are for summaries, forest, logistic, or a lea",
        ),
        ("logistic", {"kind": "motion"}, "'logistic' needs features without time; the data are tracks over"),
        ("logistic", {"epochs": 3}, "'logistic' makes no passes"),
        ("summaries", {"kind": "table", "features": ("velocity",)}, "features are computed from motion; the"),
        ("lstm", {"kind": "series", "features": ("x",)}, "the data are channels over time"),
    ],
)
def test_data_that_a_learner_cannot_use_are_refused(name, options, words):
    with pytest.raises(DataError, match=words):
        learner(name, **options)


@pytest.mark.parametrize("channels", [1, 12])
def test_channels_of_any_name_need_no_kind(channels):
    rng = np.random.default_rng(0)
    names = tuple(f"sensor {i}" for i in range(channels))
    data = Dataset(rng.normal(size=(15, channels, 20)), CLASSES * 5, channels=names)
    for name, row in LEARNERS.items():
        if "series" in row.kinds:
            trained = train(learner(name, inputs=names, **FAST.get(name, {})), data)
            assert trained.probabilities(data.trajectories).shape == (15, 3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"interval": "0.033"}, "interval is '0.033'; expected a number"),
        ({"interval": 0}, "interval must be a finite number of seconds above 0, not 0"),
        ({"inputs": "x,y"}, r"inputs is 'x,y'; expected a sequence, each a text"),
        ({"features": "x"}, r"features is 'x'; expected a sequence, each a text"),
        ({"seed": -1}, "seed must be a whole number of at least 0, not -1"),
        ({"epochs": 2.5}, "epochs is 2.5; expected a whole number"),
        ({"kind": "picture"}, "unknown kind of data 'picture'; expected one of motion, series, table"),
    ],
)
def test_a_wrong_argument_is_named(options, words):
    for name in ("lstm-fast", "sklearn.dummy:DummyClassifier"):
        with pytest.raises(DataError, match=words):
            learner(name, **options)


def test_motion_without_x_and_y_is_refused_by_the_features():
    rng = np.random.default_rng(0)
    data = Dataset(rng.normal(size=(4, 1, 40)), tuple("abab"), channels=("velocity",))
    estimator = learner("summaries", inputs=data.channels, kind=data.kind)
    words = "feature 'turn_rate' needs the input velocity and heading or x and y; the inputs are velocity"
    with pytest.raises(DataError, match=words):
        train(estimator, data)


def test_a_classifier_of_features_is_stored_with_their_names(tmp_path):
    for data, name in ((make_table(), "logistic"), (make_series(), "summaries")):
        trained = train(learner(name, inputs=data.channels, kind=data.kind), data)
        save_classifier(trained, tmp_path / "c.npz")
        again = load_classifier(tmp_path / "c.npz")
        assert again.inputs == data.channels
        expected, found = (c.probabilities(data.trajectories) for c in (trained, again))
        assert found.tolist() == expected.tolist()


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ([[1.0, np.nan], [2, 3]], r"case 0, feature 1 \(counted from 0\) is nan"),
        ([[1.0, 2], [1, 2]], "all 2 cases are the same"),
    ],
)
def test_features_that_nothing_can_be_learnt_from(numbers, words):
    with pytest.raises(DataError, match=words):
        train(learner("logistic"), Dataset(np.array(numbers), ("a", "b")))


def test_a_store_has_the_features_of_a_table():
    schema = TrackSchema.from_dataset(make_table(), CLASSES)
    assert (schema.is_table, schema.channels, schema.unit) == (True, ("yaw", "pitch", "dwell"), "cases")
