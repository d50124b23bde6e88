from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sklearn.metrics import roc_auc_score
from sklearn.pipeline import make_pipeline

from lcorpp.errors import DataError
from lcorpp.learning import (
    Motion,
    PredictionTimeline,
    calibrate_prefixes,
    cross_predict_over_time,
    cross_validate,
    learner,
    predict_over_time,
    truncate,
    with_prefixes,
)
from lcorpp.learning.streaming.plots import draw_timeline, plot_timeline
from lcorpp.values import Dataset, stack_signals, strip_padding
from tests.learning.walkers import walkers

from .people import ByWay, by_way, lstm

DATA = walkers(60)


@pytest.mark.parametrize(("fraction", "points"), [(0.25, 10), (0.5, 20), (0.51, 20), (1.0, 40), (0.05, 2)])
def test_truncate_returns_the_first_points_of_every_track(fraction, points):
    part = truncate(DATA, fraction)
    assert np.array_equal(part.trajectories, DATA.trajectories[:, :, :points])
    assert (part.labels, part.groups, part.interval) == (DATA.labels, DATA.groups, DATA.interval)


def shortened(data: Dataset) -> Dataset:
    """The same tracks, of 20, 30 and 40 points in turn."""
    lengths = (20, 30, 40)
    tracks = [track[:, : lengths[case % 3]] for case, track in enumerate(data.trajectories)]
    return replace(data, trajectories=stack_signals(tracks))


def test_truncate_takes_a_fraction_of_the_own_length_of_each_track():
    data = shortened(DATA)
    half = truncate(data, 0.5)
    assert half.lengths.tolist() == [10, 15, 20] * 20
    for part, track in zip(half.trajectories, DATA.trajectories, strict=True):
        assert np.array_equal(strip_padding(part), track[:, : len(strip_padding(part)[0])])
    assert np.array_equal(truncate(data, 1).trajectories, data.trajectories, equal_nan=True)
    with pytest.raises(DataError, match="1 of 20 time points show no motion"):
        truncate(data, 0.05)


def test_prefixes_and_whole_tracks_are_one_data_set():
    data = shortened(DATA)
    both = with_prefixes(data, (0.6, 1))
    assert both.lengths.tolist() == [*[12, 18, 24] * 20, *[20, 30, 40] * 20]
    assert (both.labels, both.groups) == (data.labels * 2, data.groups * 2)
    assert np.array_equal(both.take(range(60, 120)).trajectories, data.trajectories, equal_nan=True)
    weighted = with_prefixes(replace(data, weights=np.linspace(0.1, 1, 60)))
    assert np.array_equal(weighted.weights, np.tile(np.linspace(0.1, 1, 60), 4))
    held_out = cross_validate(learner("summaries"), both, folds=3).folds
    assert held_out[:60] == held_out[60:]
    for fractions, words in (((), "there are no fractions"), ((0.5, 2), "not 2")):
        with pytest.raises(DataError, match=words):
            with_prefixes(data, fractions)


@pytest.mark.parametrize(
    ("fraction", "words"),
    [
        (0.0, r"must lie in \(0, 1\], not 0.0"),
        (1.1, "not 1.1"),
        (float("nan"), "not nan"),
        (0.03, "1 of 40 time points show no motion"),
    ],
)
def test_a_fraction_out_of_range_is_an_error(fraction, words):
    with pytest.raises(DataError, match=words):
        truncate(DATA, fraction)


@pytest.mark.parametrize("pipeline", [lstm(), by_way()], ids=["lstm", "by way"])
def test_predictions_over_time_equal_those_of_each_prefix(pipeline):
    data = Dataset(DATA.trajectories, tuple(["interested", "not_interested"] * 30), DATA.groups)
    said = predict_over_time(pipeline, data)
    assert said.probabilities.shape == (60, 40, 2)
    assert np.isnan(said.probabilities[:, :11]).all()
    for fraction in (0.3, 0.5, 1.0):
        expected = pipeline.predict_proba(truncate(data, fraction).trajectories)
        at = round(fraction * 40) - 1
        np.testing.assert_allclose(said.probabilities[:, at], expected, atol=1e-6)
        positive = [label == "not_interested" for label in data.labels]
        assert said.auc_at(fraction) == pytest.approx(roc_auc_score(positive, expected[:, 1]), abs=0.01)
    assert said.seconds[-1] == pytest.approx(39 * 0.033)


@pytest.mark.parametrize("pipeline", [lstm(), by_way()], ids=["lstm", "by way"])
def test_predictions_end_with_the_track(pipeline):
    data = shortened(two_labels())
    said, whole = predict_over_time(pipeline, data), predict_over_time(pipeline, two_labels())
    assert said.points == whole.points
    assert np.array_equal(said.lengths, data.lengths)
    is_running = np.arange(40) < data.lengths[:, None]
    np.testing.assert_allclose(said.probabilities[is_running], whole.probabilities[is_running], atol=1e-6)
    assert np.isnan(said.probabilities[~is_running]).all()
    positive = [label == "not_interested" for label in data.labels]
    at_end = said.probabilities[np.arange(60), data.lengths - 1, 1]
    assert said.auc_at(1) == pytest.approx(roc_auc_score(positive, at_end), abs=1e-12)
    last = roc_auc_score(positive[2::3], said.probabilities[2::3, 39, 1])
    assert said.auc[39] == pytest.approx(last, abs=1e-12)


def test_tracks_of_unequal_length_out_of_fold():
    data = shortened(two_labels())
    long = [case for case in range(60) if case % 3 == 2][:12]
    few = data.take([case for case in range(60) if case % 3 < 2 or case in long])
    said = cross_predict_over_time(by_way(), few, folds=3)
    assert said.points == predict_over_time(by_way(), DATA).points[:40]
    assert np.array_equal(said.lengths, few.lengths)
    early = calibrate_prefixes(said)
    assert early.min_points + len(early.calibrations) - 1 == said.points[29]  # 12 tracks last longer
    right = early.calibrate(said)
    assert np.array_equal(np.isnan(right.probabilities), np.isnan(said.probabilities))
    assert right.auc_at(0.5) == pytest.approx(said.auc_at(0.5), abs=1e-9)
    figure = draw_timeline(said, examples=3)
    assert all(len(line.get_xdata()) for line in figure.axes[0].lines)


def test_long_tracks_and_slow_samples_are_predicted_to_their_end():
    tracks = np.cumsum(np.full((2, 2, 200), 1.0), axis=2) * np.array([1.0, 2.0])[:, None, None]
    data = Dataset(tracks, ("interested", "not_interested"), interval=1.5)
    pipeline = lstm(interval=1.5)
    said = predict_over_time(pipeline, data)
    np.testing.assert_allclose(said.probabilities[:, -1], pipeline.predict_proba(tracks), atol=1e-6)


def test_tracks_with_other_inputs_are_an_error():
    with pytest.raises(DataError, match="the pipeline takes x, y, facing, the tracks are x, y"):
        predict_over_time(lstm(inputs=("x", "y", "facing")), DATA)
    broken = np.array(DATA.trajectories)
    broken[1, 0, 2] = np.nan
    with pytest.raises(DataError, match="case 1, channel 0, time point 2"):
        predict_over_time(lstm(), Dataset(broken, DATA.labels))


def test_out_of_fold_predictions_use_other_people_only():
    class Strict(ByWay):
        def predict_proba(self, X):
            assert not self.learnt_ & set(X[:, 0, 1])
            return super().predict_proba(X)

    said = cross_predict_over_time(make_pipeline(Motion(), Strict()), two_labels(), folds=3)
    assert np.isnan(said.auc[:11]).all()
    assert said.auc_at(1.0) > 0.95
    again = cross_predict_over_time(by_way(), two_labels(), folds=3)
    assert np.array_equal(said.probabilities, again.probabilities, equal_nan=True)


def test_the_last_prediction_is_that_of_cross_validation_with_weights():
    weighted = replace(two_labels(), weights=np.linspace(0.1, 3, 60))
    timeline = cross_predict_over_time(learner("summaries"), weighted, folds=3)
    expected = cross_validate(learner("summaries"), weighted, folds=3)
    np.testing.assert_allclose(timeline.probabilities[:, -1], expected.probabilities, atol=1e-9)


def two_labels() -> Dataset:
    labels = tuple({"fast": "interested", "slow": "not_interested"}[label] for label in DATA.labels)
    return Dataset(DATA.trajectories, labels, DATA.groups)


def test_auc_needs_two_classes_and_an_unknown_class_is_an_error():
    said = PredictionTimeline(np.full((2, 3, 3), 1 / 3), (1, 2, 3), ("a", "b"), ("a", "b", "c"), 0.1)
    with pytest.raises(DataError, match="an AUC needs two classes, not 3"):
        said.auc  # noqa: B018
    with pytest.raises(DataError, match="unknown class 'd'; expected one of a, b, c"):
        said.probability_of("d")


def test_the_figure_shows_the_classes_and_the_auc(tmp_path):
    said = predict_over_time(by_way(), two_labels())
    figure = draw_timeline(said, examples=3)
    top, bottom = figure.axes
    assert [text.get_text() for text in top.get_legend().get_texts()] == [
        "interested (30)",
        "not interested (30)",
    ]
    assert len(top.lines) == 2 * (1 + 3)
    assert bottom.get_ylabel() == "AUC so far"
    three = PredictionTimeline(np.full((2, 5, 3), 1 / 3), (1, 2, 2, 3, 3), ("a", "b"), ("a", "b", "c"), 0.1)
    assert len(draw_timeline(three, class_name="c").axes) == 1
    plot_timeline(said, tmp_path / "said.png")
    assert (tmp_path / "said.png").read_bytes().startswith(b"\x89PNG")
