from __future__ import annotations

import numpy as np
import pytest
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from lcorpp.errors import DataError
from lcorpp.learning import ChannelStandardizer, Motion, StreamingClassifier, predict_over_time, truncate
from lcorpp.learning.streaming.prefix_ensemble import PrefixEnsemble, with_prefix_ensemble
from lcorpp.values import Dataset

from .people import ByWay, lstm, walk

LABELS = np.array(["interested", "not_interested"] * 20)
TRACKS = np.stack([walk(seed) for seed in range(40)])
DATA = Dataset(TRACKS, tuple(LABELS))


class Length(ByWay):
    """Says with how many points it was trained, whatever it is asked: p / (1 - p) = that number."""

    def fit(self, X, y):
        self.length_ = X.shape[2]
        return super().fit(X, y)

    def predict_proba(self, X):
        assert X.shape[2] >= 2
        return np.tile(np.array([self.length_, 1]) / (1 + self.length_), (len(X), 1))


class Steps:
    """The state of `Carrying`: (n,) how far each track has come."""

    def __init__(self, way):
        self.way = way

    def __len__(self):
        return len(self.way)

    def take(self, rows):
        return Steps(self.way[rows])

    def put(self, rows, state):
        self.way[rows] = state.way


class Carrying(ByWay):
    """A classifier by the last x, and by how many points it was trained with; it carries a state."""

    def fit(self, X, y):
        self.length_ = X.shape[2]
        return super().fit(X, y)

    def predict_proba(self, X):
        odds = np.exp(np.sin(X[:, 0].sum(axis=1)) * self.length_ / 10)
        return np.stack([odds, np.ones_like(odds)], axis=1) / (1 + odds)[:, None]

    def begin(self, n=1):
        return Steps(np.zeros(n))

    def advance(self, state, points):
        state.way += points[:, 0]
        return self.predict_proba(state.way[:, None, None])


def test_the_two_nearest_prefix_lengths_are_interpolated():
    """Trained with 5, 10 and 20 points; the odds of a mixture are the geometric mean."""
    ages = PrefixEnsemble(Length(), fractions=(0.25, 0.5, 1.0)).fit(
        np.random.default_rng(0).normal(size=(40, 1, 20)), LABELS
    )
    assert ages.lengths_.tolist() == [5, 10, 20]
    for points, odds in (
        (2, 5),
        (5, 5),
        (7, 5**0.6 * 10**0.4),
        (10, 10),
        (15, 10**0.5 * 20**0.5),
        (20, 20),
        (99, 20),
    ):
        p = ages.predict_proba(np.zeros((3, 1, points)))
        np.testing.assert_allclose(p, np.tile([odds / (1 + odds), 1 / (1 + odds)], (3, 1)))
    assert set(ages.predict(np.zeros((3, 1, 9)))) == {"interested"}


def test_at_a_trained_length_the_ensemble_equals_the_copy_of_that_length():
    ages = with_prefix_ensemble(make_pipeline(Motion(), Carrying()), fractions=(0.5, 1.0)).fit(TRACKS, LABELS)
    young = make_pipeline(Motion(), Carrying()).fit(TRACKS[:, :, :25], LABELS)  # three of six points
    np.testing.assert_allclose(
        ages.predict_proba(TRACKS[:, :, :25]), young.predict_proba(TRACKS[:, :, :25]), rtol=1e-9
    )


@pytest.mark.parametrize("carried", [True, False])
def test_streamed_predictions_of_an_ensemble_equal_those_of_the_pipeline(carried):
    classifier = Carrying() if carried else ByWay()
    ages = with_prefix_ensemble(make_pipeline(Motion(), classifier)).fit(TRACKS, LABELS)
    assert StreamingClassifier(ages).constant_cost is carried
    assert hasattr(ages[-1], "begin") is carried
    said = predict_over_time(ages, DATA)
    for fraction in (0.3, 0.6, 1.0):
        expected = ages.predict_proba(truncate(DATA, fraction).trajectories)
        np.testing.assert_allclose(said.probabilities[:, round(60 * fraction) - 1], expected, atol=1e-9)


def test_an_ensemble_of_lstms_is_streamed():
    pipeline = lstm()
    ages = PrefixEnsemble(pipeline[-1], fractions=(0.5, 1.0))
    ages.classifiers_, ages.lengths_ = [pipeline[-1], lstm(rate=4.0)[-1]], np.array([3.0, 6.0])
    ages.classes_ = pipeline.classes_
    pipeline.steps[-1] = ("ages", ages)
    assert StreamingClassifier(pipeline).constant_cost
    said = predict_over_time(pipeline, DATA)
    for fraction in (0.3, 0.6, 1.0):
        expected = pipeline.predict_proba(truncate(DATA, fraction).trajectories)
        np.testing.assert_allclose(said.probabilities[:, round(60 * fraction) - 1], expected, atol=1e-6)


def test_each_copy_has_its_own_feature_steps():
    pipeline = make_pipeline(
        Motion(), ChannelStandardizer(), FunctionTransformer(length), LinearDiscriminantAnalysis()
    )
    ages = with_prefix_ensemble(pipeline, fractions=(0.5, 1.0)).fit(TRACKS, LABELS)
    assert [type(step).__name__ for _, step in ages.steps] == [
        "Motion",
        "ChannelStandardizer",
        "PrefixEnsemble",
    ]
    assert ages.predict_proba(TRACKS).shape == (40, 2)
    with pytest.raises(DataError, match="no classifier after its preprocessing"):
        with_prefix_ensemble(make_pipeline(Motion(), ChannelStandardizer()))


def length(X):
    return np.hypot(X[:, 0, -1], X[:, 1, -1])[:, None]


@pytest.mark.parametrize(
    ("fractions", "words"),
    [
        ((), r"the prefix lengths are fractions in \(0, 1\], not \(\)"),
        ((0.5, 1.5), r"not \(0.5, 1.5\)"),
        ((0.5, 0.25), r"are \[10, 5\] points; expected rising numbers"),
        ((0.5, 0.51), r"are \[10, 10\] points"),
    ],
)
def test_fractions_out_of_range_are_errors(fractions, words):
    with pytest.raises(DataError, match=words):
        PrefixEnsemble(Length(), fractions=fractions).fit(
            np.random.default_rng(0).normal(size=(40, 1, 20)), LABELS
        )
