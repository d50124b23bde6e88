"""Prediction sets for the age of a track: coverage at each age, by hand at one age, and in streams."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import (
    PredictionTimeline,
    PrefixSets,
    StreamingClassifier,
    TrainedClassifier,
    cross_predict_over_time,
    fit_prediction_sets,
    fit_prefix_sets,
)
from lcorpp.learning.evaluation.validation import Validation, count_confusion
from lcorpp.values import Dataset

from .people import by_way, lstm, walk

CLASSES = ("interested", "not_interested")
N_LENGTHS = 6


def make_overconfident_timeline(seed: int, cases: int, *, tracks_each: int = 1) -> PredictionTimeline:
    """Scores as confident at first as at the end, though most of the evidence comes late; unequal lengths."""
    rng = np.random.default_rng(seed)
    truth = rng.random(cases) < 0.4
    evidence = np.where(truth, 1, -1)[:, None] * np.linspace(0.2, 2, N_LENGTHS)
    score = 1.5 * (evidence + rng.normal(size=(cases, N_LENGTHS)))
    lengths = rng.integers(N_LENGTHS // 2, N_LENGTHS + 1, cases)
    p = np.repeat(1 / (1 + np.exp(-score)), tracks_each, axis=0)
    p = np.where(np.arange(N_LENGTHS) < np.repeat(lengths, tracks_each)[:, None], p, np.nan)
    person = np.repeat(np.arange(cases), tracks_each)
    return PredictionTimeline(
        np.stack([p, 1 - p], axis=2),
        tuple(range(2, 2 + N_LENGTHS)),
        tuple(np.where(truth, *CLASSES)[person].tolist()),
        CLASSES,
        1.0,
        tuple((person % 5).tolist()),
        tuple(map(str, person)),
    )


def measure_coverage(sets: PrefixSets, timeline: PredictionTimeline) -> np.ndarray:
    """(ages, K) the fraction of the cases of each class whose set at each age contains it."""
    labels, found = np.array(timeline.labels), np.empty((N_LENGTHS, 2))
    for age, points in enumerate(timeline.points):
        p = timeline.probabilities[:, age]
        for column, name in enumerate(CLASSES):
            own = (labels == name) & np.isfinite(p).all(axis=1)
            found[age, column] = sets.at(points).contains(p[own])[:, column].mean()
    return found


@pytest.mark.parametrize(
    ("coverage", "tracks_each"), [(0.9, 1), pytest.param(0.8, 3, marks=pytest.mark.slow)]
)
def test_each_class_is_covered_at_each_age(coverage, tracks_each):
    by_age, whole = [], []
    for seed in range(100):
        timeline = make_overconfident_timeline(seed, 400, tracks_each=tracks_each)
        sets, new = fit_prefix_sets(timeline, coverage), make_overconfident_timeline(1000 + seed, 1000)
        by_age.append(measure_coverage(sets, new))
        whole.append(measure_coverage(PrefixSets(2, sets.sets[-1:]), new))
    found, error = np.mean(by_age, axis=0), np.std(by_age, axis=0) / np.sqrt(len(by_age))
    assert error.max() < 0.008
    assert (found > coverage - 3 * error).all()
    assert (found < coverage + 0.03).all()
    assert np.mean(whole, axis=0)[0].max() < coverage - 0.15  # sets of whole tracks after two points


def test_sets_shrink_with_age():
    sets = fit_prefix_sets(make_overconfident_timeline(0, 1000), 0.9).sets
    sizes = [each.mean_size for each in sets]
    assert len(sets) == N_LENGTHS
    assert sizes[0] > 1.6 > 1.1 > sizes[-1]
    assert sizes == sorted(sizes, reverse=True)


@pytest.mark.parametrize("by_class", [True, False])
def test_the_sets_of_an_age_are_those_of_its_cross_validation(by_class):
    timeline = make_overconfident_timeline(1, 100)
    sets = fit_prefix_sets(timeline, 0.8, by_class=by_class)
    for age, points in enumerate(timeline.points):
        known = np.flatnonzero(np.isfinite(timeline.probabilities[:, age, 0]))
        part = timeline.take(known)
        p = part.probabilities[:, age]
        predictions = tuple(CLASSES[column] for column in p.argmax(axis=1))
        confusion = count_confusion(CLASSES, part.labels, predictions, np.ones(len(known)))
        validation = Validation(confusion, predictions, p, None, part.folds, part.labels, part.groups)
        expected = fit_prediction_sets(validation, 0.8, by_class=by_class)
        assert sets.at(points).to_json() == expected.to_json()
    assert sets.at(100) is sets.sets[-1]


@pytest.mark.parametrize("pipeline", [lstm, by_way])
def test_a_stream_has_the_sets_of_the_age(pipeline):
    tracks = np.stack([walk(seed) for seed in range(24)])
    timeline = cross_predict_over_time(by_way(), Dataset(tracks, CLASSES * 12), folds=3)
    sets = fit_prefix_sets(timeline, 0.7)
    streams = StreamingClassifier.from_trained(TrainedClassifier(pipeline()), prefix_sets=sets)
    without = StreamingClassifier.from_trained(TrainedClassifier(pipeline()))
    for frame in range(60):
        sample = frame * timeline.interval, "p", *tracks[0, :, frame]
        prediction = streams.push(*sample)
        without.push(*sample)
        if prediction.probabilities is not None:
            classifier, own = streams.classifier("p"), sets.at(prediction.points)
            assert classifier.prediction_sets is own
            evidence = classifier.sets(0.7).classify(tracks[0])
            expected = own.likelihoods(prediction.probabilities[None])[0]
            assert np.array_equal(evidence.weights, expected.weights)
    with pytest.raises(DataError, match="evidence by sets needs a classifier with prediction sets"):
        without.classifier("p").sets()


def test_prefix_sets_survive_json():
    timeline = make_overconfident_timeline(2, 300)
    sets = fit_prefix_sets(timeline)
    again = PrefixSets.from_json(json.loads(json.dumps(sets.to_json())))
    assert again.to_json() == sets.to_json()
    assert repr(again) == "<PrefixSets of 0.95 for 2 to 7 points>"


def test_wrong_arguments():
    timeline = make_overconfident_timeline(0, 60)
    with pytest.raises(DataError, match="no folds; expected the result of cross_predict_over_time"):
        fit_prefix_sets(replace(timeline, folds=()))
    with pytest.raises(DataError, match="coverage"):
        fit_prefix_sets(timeline, 1.0)
    nothing = replace(timeline, probabilities=np.full_like(timeline.probabilities, np.nan))
    with pytest.raises(DataError, match="no predictions to form sets of: the tracks are too short"):
        fit_prefix_sets(nothing)
    sets = fit_prefix_sets(timeline)
    with pytest.raises(DataError, match="no prediction after 1 points; 2 are needed"):
        sets.at(1)
    with pytest.raises(DataError, match="the prefix sets are for interested, not_interested; the classifier"):
        StreamingClassifier.from_trained(TrainedClassifier(lstm(classes=3)), prefix_sets=sets)
