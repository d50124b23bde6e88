from __future__ import annotations

import json

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import (
    PredictionTimeline,
    PrefixCalibration,
    StreamingClassifier,
    TrainedClassifier,
    calibrate_prefixes,
    predict_over_time,
    truncate,
)
from lcorpp.learning.evaluation.calibration import fit_calibration
from lcorpp.values import Dataset

from .people import by_way, lstm, walk

LABELS = tuple(["interested", "not_interested"] * 40)
CLASSES = ("interested", "not_interested")


def make_timeline(seed: int = 0) -> PredictionTimeline:
    """Too sure and leaning to the first class at every time; right about nobody at 2 points, most at 3."""
    rng = np.random.default_rng(seed)
    truth = np.array([label == "interested" for label in LABELS])
    nothing = rng.normal(2.0, 1.0, 80)
    much = np.where(truth, 2.0, -2.0) + rng.normal(2.0, 1.0, 80)
    scores = np.stack([np.full(80, np.nan), nothing, nothing, much], axis=1)
    p = 1 / (1 + np.exp(-scores))
    return PredictionTimeline(np.stack([p, 1 - p], axis=2), (1, 2, 2, 3), LABELS, CLASSES, 0.2)


def brier(of: PredictionTimeline, time: int) -> float:
    truth = np.array([label == "interested" for label in of.labels])
    return float(np.mean((of.probability_of("interested")[:, time] - truth) ** 2))


def test_calibrated_early_predictions_are_near_the_class_frequencies():
    early = calibrate_prefixes(make_timeline())
    assert (early.min_points, len(early.calibrations)) == (2, 2)
    new = make_timeline(1)
    right = early.calibrate(new)
    assert brier(new, 1) > 0.35
    assert brier(right, 1) == pytest.approx(0.25, abs=0.01)  # nothing can be known then
    assert np.array_equal(right.probabilities[:, 1], right.probabilities[:, 2])
    assert brier(right, 3) < 0.75 * brier(new, 3)
    assert np.isnan(right.probabilities[:, 0]).all()
    assert right.auc[3] == new.auc[3]  # the order of people stays


def test_each_number_of_points_has_the_calibration_of_that_prefix_length():
    tracks = np.stack([walk(seed) for seed in range(80)])
    told = predict_over_time(by_way(), Dataset(tracks, LABELS))
    early = calibrate_prefixes(told)
    for points in (2, 4, 6):
        samples = int((points - 1) / 3 / 0.033) + 2
        shorter = truncate(Dataset(tracks, LABELS), samples / 60)
        expected = fit_calibration(CLASSES, by_way().predict_proba(shorter.trajectories), LABELS)
        found = early.at(points)
        assert found.slope == pytest.approx(expected.slope, abs=1e-3)
        np.testing.assert_allclose(found.offsets, expected.offsets, atol=1e-3)  # of the optimiser
    assert early.at(99) is early.calibrations[-1]
    with pytest.raises(DataError, match="there is no prediction after 1 points; 2 are needed"):
        early.at(1)


def test_a_stream_gives_the_likelihood_for_its_number_of_points():
    tracks = np.stack([walk(seed) for seed in range(80)])
    early = calibrate_prefixes(predict_over_time(lstm(), Dataset(tracks, LABELS)))
    streams = StreamingClassifier.from_trained(TrainedClassifier(lstm()), prefix_calibration=early)
    for frame, values in enumerate(tracks[0].T.tolist()):
        answer = streams.push(frame * 0.033, "p", *values)
        if answer.probabilities is not None:
            expected = early.at(answer.points).likelihoods(answer.probabilities[None])[0]
            found = streams.classifier("p").soft().classify(np.zeros((2, 0)))
            np.testing.assert_allclose(found.weights, expected.weights)


def test_a_prefix_calibration_is_restored_from_json():
    early = calibrate_prefixes(make_timeline())
    again = PrefixCalibration.from_json(json.loads(json.dumps(early.to_json())))
    assert np.array_equal(
        again.calibrate(make_timeline(1)).probabilities,
        early.calibrate(make_timeline(1)).probabilities,
        equal_nan=True,
    )


def test_a_timeline_without_predictions_cannot_be_calibrated():
    nothing = PredictionTimeline(np.full((2, 3, 2), np.nan), (1, 1, 1), ("a", "b"), ("a", "b"), 0.1)
    with pytest.raises(DataError, match="there is no prediction to calibrate: the tracks are too short"):
        calibrate_prefixes(nothing)
    with pytest.raises(DataError, match="there is no prediction to calibrate"):
        PrefixCalibration(2, ())
