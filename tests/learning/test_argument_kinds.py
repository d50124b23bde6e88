"""Every public function of learning, of stopping and of Algorithm 1 on simulated people, with bad arguments.

Whatever an argument is, the call succeeds or raises an `LcorppError`; any other error fails the test.
"""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from itertools import product

import numpy as np
import pytest

import lcorpp.learning
from lcorpp import learning
from lcorpp.decision import stopping
from lcorpp.domains import load_domain
from lcorpp.errors import LcorppError
from lcorpp.runs import ActiveLearningOptions, drift, run_active_learning, set_up_learning
from lcorpp.runs.corrected_labels import correct_labels
from lcorpp.runs.senses import find_learning_senses
from lcorpp.runs.untrained import is_trainable
from lcorpp.values import ConfusionMatrix
from tests.learning.test_bad_arguments import CALLS, DATA, RECORDING, SCHEMA, TIMES, TRAINED, VALIDATION

DOMAIN = load_domain("intention")
TIMELINE = learning.cross_predict_over_time(TRAINED.estimator, DATA, folds=2)
SEARCH = learning.search_trigger(TIMELINE)
PREFIX_SETS = learning.fit_prefix_sets(TIMELINE)
SETS, CALIBRATION = TRAINED.prediction_sets, TRAINED.calibration
PROBABILITIES = VALIDATION.probabilities
MATRIX = ConfusionMatrix(("a", "b"), [[8, 2], [3, 7]])
TRACK, MISSING_FILE = DATA.trajectories[0], "/nowhere/a"
MOTION = {"rate": 3.0, "interval": 0.1, "features": ("x", "y"), "inputs": ("x", "y")}
REPORT = learning.build_report(VALIDATION)


def fit(kind, tracks=DATA.trajectories):
    """Return a function that makes an estimator, trains and uses it."""
    return lambda **options: kind(**options).fit(tracks, np.array(DATA.labels))


MORE_CALLS = {
    "Calibration.calibrate": (CALIBRATION.calibrate, {"probabilities": PROBABILITIES}),
    "Calibration.likelihoods": (CALIBRATION.likelihoods, {"probabilities": PROBABILITIES}),
    "ChannelStandardizer": (learning.ChannelStandardizer().fit, {"X": DATA.trajectories}),
    "DecisionThreshold": (learning.DecisionThreshold, {"name": "a", "probability": 0.5}),
    "LstmClassifier": (fit(learning.LstmClassifier), {
        "epochs": 1, "units": 5, "dropout": 0.1, "batch_size": 32, "learning_rate": 0.01,
        "schedule": "constant", "class_weight": None, "min_updates": 0, "random_state": 0}),
    "Motion": (fit(learning.Motion), {**MOTION, "robot": (0, 0, 0)}),
    "NewTrack": (learning.NewTrack, {"trajectory": TRACK, "label": "a", "source": "robot", "belief": None,
                                     "context": {}, "group": None, "id": None}),
    "PredictionSets": (learning.PredictionSets, {
        name: getattr(SETS, name)
        for name in ("classes", "coverage", "floors", "best", "members", "counts")}),
    "PredictionSets.contains": (SETS.contains, {"probabilities": PROBABILITIES}),
    "PredictionSets.predict": (SETS.predict, {"probabilities": PROBABILITIES}),
    "PredictionSets.likelihoods": (SETS.likelihoods, {"probabilities": PROBABILITIES}),
    "PredictionSets.from_json": (SETS.from_json, {"numbers": SETS.to_json()}),
    "PredictionTimeline": (learning.PredictionTimeline, {
        name: getattr(TIMELINE, name)
        for name in ("probabilities", "points", "labels", "classes", "interval", "folds", "groups")}),
    "PredictionTimeline.auc_at": (TIMELINE.auc_at, {"fraction": 0.5}),
    "PredictionTimeline.probability_of": (TIMELINE.probability_of, {"name": "fast"}),
    "PredictionTimeline.take": (TIMELINE.take, {"cases": [0, 1]}),
    "PrefixCalibration.at": (SEARCH.trigger.calibration.at, {"points": 9}),
    "PrefixCalibration.calibrate": (SEARCH.trigger.calibration.calibrate, {"timeline": TIMELINE}),
    "PrefixCalibration.from_json": (learning.PrefixCalibration.from_json,
                                    {"numbers": SEARCH.trigger.calibration.to_json()}),
    "PrefixSets": (learning.PrefixSets, {"min_points": 2, "sets": PREFIX_SETS.sets}),
    "PrefixSets.at": (PREFIX_SETS.at, {"points": 9}),
    "PrefixSets.from_json": (learning.PrefixSets.from_json, {"numbers": PREFIX_SETS.to_json()}),
    "PrefixEnsemble": (fit(learning.PrefixEnsemble), {
        "classifier": learning.LstmClassifier(epochs=1), "fractions": (0.5, 1.0)}),
    "QuadraticLogistic": (fit(learning.QuadraticLogistic, DATA.trajectories[:, 0, :3]), {
        "C": 0.1, "max_cases": None}),
    "SoftClassifier.classify": (TRAINED.soft().classify, {"signal": TRACK}),
    "SoftClassifier.classify_many": (TRAINED.soft().classify_many, {"trajectories": DATA.trajectories}),
    "Store": (learning.Store, {"path": MISSING_FILE, "schema": SCHEMA}),
    "StreamingClassifier.push": (learning.StreamingClassifier(TRAINED.estimator).push, {
        "time": 0.0, "person": "a"}),
    "SummaryFeatures": (fit(learning.SummaryFeatures), {"rate": 3.0}),
    "TrackSchema": (learning.TrackSchema, {"channels": ("x", "y"), "interval": 0.1, "classes": ("a", "b"),
                                           "points": None}),
    "TrainedClassifier": (learning.TrainedClassifier, {
        "estimator": TRAINED.estimator, "confusion": TRAINED.confusion, "calibration": CALIBRATION,
        "threshold": None, "inputs": ("x", "y"), "prediction_sets": SETS}),
    "TrainedClassifier.classify": (TRAINED.classify, {"signal": TRACK}),
    "TrainedClassifier.classify_many": (TRAINED.classify_many, {"trajectories": DATA.trajectories}),
    "TrainedClassifier.sets": (TRAINED.sets, {"coverage": 0.95}),
    "Trigger": (learning.Trigger, {"calibration": SEARCH.trigger.calibration,
                                   "floors": SEARCH.trigger.floors, "consecutive": 1, "last_points": 9}),
    "Trigger.decide": (SEARCH.trigger.decide, {"timeline": TIMELINE}),
    "Trigger.from_json": (learning.Trigger.from_json, {"numbers": SEARCH.trigger.to_json()}),
    "EarlyScore.value": (SEARCH.scores[0].value, {"waiting_cost": 0.1}),
    "Validation": (learning.Validation, {
        name: getattr(VALIDATION, name)
        for name in ("confusion", "predictions", "probabilities", "auc", "folds", "labels", "groups",
                     "weights")}),
    "Validation.with_predictions": (VALIDATION.with_predictions, {"predictions": VALIDATION.predictions}),
    "apply_threshold": (learning.apply_threshold, {
        "classes": ("a", "b"), "probabilities": PROBABILITIES,
        "threshold": learning.DecisionThreshold("a", 0.5)}),
    "build_report": (learning.build_report, {
        "validation": VALIDATION, "positive": "fast", "prevalence": None, "costs": (1.0, 2.0),
        "learner": "", "source": "", "coverage": 0.9}),
    "calibrate_prefixes": (learning.calibrate_prefixes, {"timeline": TIMELINE}),
    "choose_threshold": (learning.choose_threshold, {
        "scores": PROBABILITIES[:, 0], "positive": np.arange(20) % 2 == 0, "folds": VALIDATION.folds,
        "prevalence": 0.5, "goal": "f1"}),
    "convert_snapshot": (learning.convert_snapshot, {"snapshot": None}),
    "count_repairs": (learning.count_repairs, {"repairs": ()}),
    "cross_calibrate_prefixes": (learning.cross_calibrate_prefixes, {"timeline": TIMELINE}),
    "cross_predict_over_time": (learning.cross_predict_over_time, {
        "estimator": TRAINED.estimator, "dataset": DATA, "folds": 2, "seed": 0, "min_points": 2,
        "window": None}),
    "estimate_rates": (learning.estimate_rates, {"confusion": MATRIX, "level": 0.9,
                                                 "smoothing": Fraction(1, 2)}),
    "fast_pipeline": (lambda **given: fit(learning.fast_pipeline)(**given, epochs=1), {
        "min_updates": 1, "dropout": 0.1, "learning_rate": 0.01, "schedule": "one-cycle",
        "features": ("velocity",)}),
    "fit_calibration": (learning.fit_calibration, {
        "classes": VALIDATION.classes, "probabilities": PROBABILITIES, "labels": VALIDATION.labels,
        "weights": VALIDATION.weights}),
    "fit_prediction_sets": (learning.fit_prediction_sets, {"validation": VALIDATION, "coverage": 0.9,
                                                           "by_class": True}),
    "fit_prefix_sets": (learning.fit_prefix_sets, {"timeline": TIMELINE, "coverage": 0.9, "by_class": True}),
    "fit_trigger": (learning.fit_trigger, {"timeline": TIMELINE, "rule": "threshold", "waiting_cost": 0.1}),
    "learner": (learning.learner, {"name": "summaries", "interval": 0.1, "inputs": ("x", "y"),
                                   "features": ("x", "y"), "seed": 0, "epochs": None, "device": "cpu"}),
    "load_classifier": (learning.load_classifier, {"path": MISSING_FILE}),
    "paper_pipeline": (lambda **given: fit(learning.paper_pipeline)(**given, epochs=1),
                       {**MOTION, "class_weight": None}),
    "plot_report": (learning.plot_report, {"report": REPORT, "path": MISSING_FILE}),
    "plot_timeline": (learning.plot_timeline, {"timeline": TIMELINE, "path": MISSING_FILE,
                                               "class_name": "fast", "examples": 2}),
    "plot_tracks": (learning.plot_tracks, {"recording": RECORDING, "title": "", "max_tracks": 3}),
    "plot_trigger": (learning.plot_trigger, {"searches": {"a": SEARCH}, "path": MISSING_FILE}),
    "predict_over_time": (learning.predict_over_time, {"pipeline": TRAINED.estimator, "dataset": DATA,
                                                       "min_points": 2, "window": None}),
    "read_authors": (learning.read_authors, {"folder": MISSING_FILE, "labels": {"1": "a", "0": "b"}}),
    "read_store": (learning.read_store, {"path": MISSING_FILE}),
    "resample": (learning.resample, {"times": TIMES, "samples": np.zeros((2, 3)), "rate": 3.0,
                                     "angles": (1,)}),
    "save_classifier": (learning.save_classifier, {"classifier": TRAINED, "path": MISSING_FILE}),
    "search_trigger": (learning.search_trigger, {"timeline": TIMELINE, "rule": "threshold",
                                                 "waiting_cost": None}),
    "train_and_validate": (learning.train_and_validate, {
        "estimator": TRAINED.estimator, "dataset": DATA, "folds": 2, "seed": 0, "jobs": 1, "coverage": 0.9}),
    "with_prefixes": (learning.with_prefixes, {"dataset": DATA, "fractions": (0.5, 1.0)}),
    "write_report": (learning.write_report, {"report": REPORT, "folder": MISSING_FILE}),
    "write_timeline": (learning.write_timeline, {"timeline": TIMELINE, "path": MISSING_FILE}),
    "stopping.check_stopping": (stopping.check_stopping, {"epsilon": 0.1, "confidence": 0.5}),
    "stopping.choose_epsilon": (stopping.choose_epsilon, {"epsilon": None, "n_classes": 2}),
    "stopping.compute_change": (stopping.compute_change, {"before": MATRIX, "after": MATRIX,
                                                          "confidence": 0.5}),
    "stopping.compute_ssub": (stopping.compute_ssub, {"first": MATRIX.counts, "second": MATRIX.counts}),
    "drift.DriftMonitor": (drift.DriftMonitor, {"senses": ("motion",), "seed": 0}),
    "drift.agrees_with": (drift.agrees_with, {"label": "a", "reported": "a"}),
    "drift.compute_capital": (drift.compute_capital, {"p_values": [0.1, 0.5]}),
    "drift.calibrate": (drift.calibrate, {"p": 0.1}),
    "correct_labels": (correct_labels, {"domain": DOMAIN, "sense": "motion", "dataset": DATA,
                                        "predictions": DATA.labels}),
    "find_learning_senses": (find_learning_senses, {"domain": DOMAIN, "classifiers": {}}),
    "set_up_learning": (set_up_learning, {"domain": None, "options": ActiveLearningOptions()}),
    "run_active_learning": (run_active_learning, {"domain": DOMAIN, "senses": None, "planner": None,
                                                  "options": ActiveLearningOptions()}),
    "is_trainable": (is_trainable, {"dataset": DATA, "classes": DATA.labels[:2], "folds": 2}),
    "ActiveLearningOptions": (ActiveLearningOptions, {
        "classifiers": {}, "labels": "hard", "batch_size": 9, "epsilon": None, "confidence": 0.5,
        "max_batches": 2, "seed": 0, "jobs": 1}),
}  # fmt: skip
RESULTS = {
    "ClassReport", "EarlyDecision", "EarlyScore", "EvaluationReport", "LabelRecord", "LstmState",
    "Prediction", "Rate", "Repair", "ShortcutScore", "Snapshot", "StoredTrack", "StreamReport",
    "ThresholdChoice", "TriggerSearch", "LEARNERS", "SoftClassifier",
}  # fmt: skip
"""Public names that calls return, not made by callers."""

BAD_VALUES = {
    "fraction": 2.5, "zero": 0, "negative": -1, "nothing": None, "NaN": float("nan"),
    "infinity": float("inf"), "truth": True, "text": "unknown", "no text": "", "empty list": [],
    "list of None": [None], "ragged list": [[1, 2], [3]], "wrong shape": np.zeros((2, 0, 1, 1)),
    "object": object(),
}  # fmt: skip


def test_every_public_name_is_called():
    called = {name.split(".")[0] for name in {**CALLS, **MORE_CALLS}}
    assert set(lcorpp.learning.__all__) - called - RESULTS == {"fetch_authors"}  # which downloads
    with pytest.raises(LcorppError, match=r"folder is 2\.5; expected a text or a Path"):
        learning.fetch_authors(2.5)


@pytest.mark.parametrize("name", {**CALLS, **MORE_CALLS})
def test_a_bad_argument_is_used_or_a_typed_error(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # some names of files are good
    call, good = {**CALLS, **MORE_CALLS}[name]
    for argument, (kind, value) in product(good, BAD_VALUES.items()):
        try:
            with suppress(LcorppError):
                call(**{**good, argument: value})
        except Exception as error:
            error.add_note(f"{argument} was {kind}")
            raise
