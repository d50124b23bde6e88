"""Triggers: decisions by hand, batch equal to streams, scores out of fold, laws; the table behind them."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from lcorpp.errors import DataError, FileError
from lcorpp.learning import (
    EarlyDecision,
    EarlyScore,
    PredictionTimeline,
    StreamingClassifier,
    TrainedClassifier,
    Trigger,
    calibrate_prefixes,
    cross_calibrate_prefixes,
    cross_predict_over_time,
    fit_trigger,
    plot_trigger,
    predict_over_time,
    search_trigger,
    write_timeline,
)
from lcorpp.learning.evaluation.calibration import Calibration
from lcorpp.learning.streaming.timeline import PrefixCalibration
from lcorpp.learning.streaming.trigger import TriggerState
from lcorpp.values import Dataset

from .people import by_way, lstm, walk

CLASSES = ("interested", "not_interested")
IDENTITY = Calibration(CLASSES, 1.0, np.zeros(2), np.zeros(2), np.full(2, 0.5))


def make_timeline(seed: int, cases: int = 300, ages: int = 8, *, lengths=None) -> PredictionTimeline:
    """Evidence about a fair class that grows with age: the score of a case is a random walk with drift."""
    rng = np.random.default_rng(seed)
    truth = rng.random(cases) < 0.5
    steps = np.where(truth, 0.25, -0.25)[:, None] + rng.normal(0, 0.7, (cases, ages))
    p = 1 / (1 + np.exp(-steps.cumsum(axis=1)))
    p = np.repeat(p, 2, axis=1)  # two samples for each point
    if lengths is not None:
        p = np.where(np.arange(2 * ages) < 2 * lengths[:, None], p, np.nan)
    labels = tuple(np.where(truth, *CLASSES).tolist())
    points = tuple(2 + t // 2 for t in range(2 * ages))
    folds = tuple((np.arange(cases) % 5).tolist())
    groups = tuple(f"person {case}" for case in range(cases))
    return PredictionTimeline(np.stack([p, 1 - p], axis=2), points, labels, CLASSES, 0.5, folds, groups)


def make_trigger(floors, consecutive: int = 1, last_points: int = 100) -> Trigger:
    return Trigger(PrefixCalibration(2, (IDENTITY,)), np.array(floors), consecutive, last_points)


def test_lists_of_names_are_those_of_tuples():
    timeline = make_timeline(0, cases=40)
    names = ("points", "labels", "classes", "folds", "groups")
    listed = replace(timeline, **{name: list(getattr(timeline, name)) for name in names})
    assert [getattr(listed, name) for name in names] == [getattr(timeline, name) for name in names]
    calibration = replace(IDENTITY, classes=list(CLASSES))
    trigger = Trigger(PrefixCalibration(2, (calibration,)), [[0.7, 0.7]], 1, 100)
    assert trigger.decide(listed) == make_trigger([[0.7, 0.7]]).decide(timeline)


@pytest.mark.parametrize(
    ("floors", "consecutive", "last_points", "points", "label"),
    [
        ([[0.7, 0.7]], 1, 100, 3, "interested"),
        ([[0.7, 0.7]], 2, 100, 6, "not_interested"),
        ([[0.7, 0.85]], 2, 100, 7, "not_interested"),  # at 5 points .8 does not reach the floor
        ([[0.62, 0.62]], 3, 100, 7, "not_interested"),
        ([[0.9, 0.9], [0.9, 0.9], [0.6, 0.6]], 1, 100, 4, "interested"),
        ([[0.95, 0.95]], 1, 5, 5, "not_interested"),  # waiting ends
        ([[1, 1]], 1, 100, 7, "not_interested"),  # the end of the track
    ],
)
def test_decisions_by_hand(floors, consecutive, last_points, points, label):
    interested = np.array([0.6, 0.8, 0.65, 0.2, 0.1, 0.05])  # after 2 to 7 points
    timeline = PredictionTimeline(
        np.stack([interested, 1 - interested], axis=1)[None], (2, 3, 4, 5, 6, 7), CLASSES[:1], CLASSES, 0.5
    )
    trigger = make_trigger(floors, consecutive, last_points)
    (decision,) = trigger.decide(timeline)
    assert (decision.points, decision.label) == (points, label)
    at = interested[points - 2]
    assert decision.probability == pytest.approx(at if label == "interested" else 1 - at)
    state = TriggerState()
    assert trigger.advance(state, 1, np.array([0.5, 0.5])) == state  # too few points
    for number, p in enumerate(interested, start=2):
        state = trigger.advance(state, number, np.array([p, 1 - p]))
    decides_before_the_end = floors != [[1, 1]]
    assert state.decision == (decision if decides_before_the_end else None)


@pytest.mark.parametrize("pipeline", [lstm, by_way])
@pytest.mark.parametrize(  # eleven samples for a point, three points for a sample
    ("interval", "rule"), [(0.033, "threshold"), (1.0, "teaser")]
)
def test_streams_decide_as_recorded_tracks(rule, pipeline, interval):
    samples = 100 if interval < 1 else 16
    tracks = np.stack([walk(seed, samples=samples) for seed in range(40)])
    labels, trained = CLASSES * 20, pipeline(interval=interval)
    timeline = predict_over_time(trained, Dataset(tracks, labels, interval=interval))
    folds = tuple(case // 2 % 2 for case in range(40))
    trigger = fit_trigger(replace(timeline, folds=folds), rule=rule, waiting_cost=0.01)
    trigger = replace(trigger, consecutive=2)
    decisions = trigger.decide(timeline)
    limits = {"max_gap": 3.0, "max_duration": 1000}
    streams = StreamingClassifier.from_trained(TrainedClassifier(trained), trigger=trigger, **limits)
    for t in range(samples):
        for case, prediction in streams.push_many(
            [(t * timeline.interval, case, *tracks[case, :, t]) for case in range(40)]
        ).items():
            expected = decisions[case]
            if prediction.points < expected.points:
                assert prediction.decision is None
            else:
                assert prediction.decision.label == expected.label
                assert prediction.decision.points == expected.points
                assert prediction.decision.probability == pytest.approx(expected.probability, abs=1e-6)
    assert "; decided: " in repr(streams.predictions[0])
    last = streams.predictions[0]
    values = "".join(f"<td>{p:.3f}</td>" for p in last.probabilities)
    row = f"<td>{last.points}</td><td>{last.time:.2f}</td>{values}<td>{last.decision.label}</td>"
    assert row in streams._repr_html_()
    assert row in last._repr_html_()
    assert f"<td>39</td><td>{samples} samples" in streams.report()._repr_html_()
    again = streams.push(1000, 0, *tracks[0, :, 0])  # another track of the same id
    assert (again.track, again.decision) == (2, None)
    first = streams.predictions[1]
    assert streams.classifier(1).calibration is trigger.calibration.at(first.points)


@pytest.mark.parametrize("seed", range(5))
def test_laws_of_the_threshold(seed):
    """A threshold of 1 waits for the end, one of chance never waits, a higher one never decides earlier."""
    timeline = make_timeline(seed, 60, lengths=np.random.default_rng(seed).integers(1, 9, 60))
    calibration = calibrate_prefixes(timeline)
    before = np.zeros(60)
    for threshold in (0.5, 0.6, 0.8, 0.99, 1):
        trigger = Trigger(calibration, np.full((1, 2), threshold), 1, 9)
        points = np.array([decision.points for decision in trigger.decide(timeline)])
        assert (points >= before).all()
        before = points
        if threshold == 0.5:
            assert (points == 2).all()
    assert (before == 1 + timeline.lengths // 2).all()


@pytest.mark.slow
@pytest.mark.parametrize(("rule", "cost"), [("threshold", 0.005), ("teaser", None)])
def test_the_expected_score_is_that_of_other_people(rule, cost):
    expected, reached = [], []
    for seed in range(4):
        trigger = fit_trigger(make_timeline(seed), rule=rule, waiting_cost=cost)
        new = make_timeline(100 + seed, 1000)
        decisions = trigger.decide(new)
        correct = [each.label == label for each, label in zip(decisions, new.labels, strict=True)]
        seconds = [(each.points - 2) for each in decisions]  # one point a second, the first at 0
        expected.append((trigger.expected.accuracy, trigger.expected.seconds))
        reached.append((np.mean(correct), np.mean(seconds)))
    accuracy, seconds = np.mean(expected, axis=0) - np.mean(reached, axis=0)
    assert abs(accuracy) < 0.04  # 4 x 300 cases have a standard error of .013
    assert abs(seconds) < 0.5


@pytest.mark.slow
def test_dearer_waiting_decides_earlier():
    timeline = make_timeline(0, 200)
    for rule in ("threshold", "teaser"):
        searches = [search_trigger(timeline, rule=rule, waiting_cost=cost) for cost in (0, 0.03, 1)]
        seconds = [search.scores[search.chosen].seconds for search in searches]
        assert seconds == sorted(seconds, reverse=True)
        assert seconds[0] > 1.5 * seconds[1]
    assert seconds[-1] < 0.5
    best = search_trigger(timeline)
    assert best.scores[best.chosen].harmonic_mean == max(score.harmonic_mean for score in best.scores)
    assert best.scores[-1].accuracy == pytest.approx(best.accuracy[-1])  # a threshold of 1: all at the end
    assert best.scores[-1].earliness == 0


@pytest.mark.parametrize("rule", ["threshold", "teaser"])
def test_a_search_on_tracks_of_unequal_length(rule):
    lengths = np.random.default_rng(0).integers(2, 9, 300)
    timeline = make_timeline(0, lengths=lengths)
    search = search_trigger(timeline, rule=rule, waiting_cost=0)
    if rule == "threshold":
        at_the_end = search.scores[-1]
        assert at_the_end.seconds == pytest.approx((lengths - 1).mean())
        assert at_the_end.earliness == 0
    for decision, length in zip(search.trigger.decide(timeline), lengths, strict=True):
        assert 2 <= decision.points <= 1 + length
    assert 0.5 < search.trigger.expected.accuracy < 0.8


def test_a_trigger_is_better_than_one_age_for_all():
    search = search_trigger(make_timeline(1, 2000, 6), waiting_cost=0.01)
    at_one_age = search.accuracy - 0.01 * search.seconds
    assert search.trigger.expected.value(0.01) > at_one_age.max() + 0.01


def test_predictions_are_calibrated_out_of_fold():
    timeline = make_timeline(3, 100, 3)
    calibrated = cross_calibrate_prefixes(timeline)
    folds = np.array(timeline.folds)
    for fold in range(5):
        others = calibrate_prefixes(timeline.take(np.flatnonzero(folds != fold)))
        part = others.calibrate(timeline.take(np.flatnonzero(folds == fold)))
        assert np.array_equal(calibrated.probabilities[folds == fold], part.probabilities)


@pytest.mark.parametrize("rule", ["threshold", "teaser"])
def test_samples_may_be_farther_apart_than_points(rule):
    """With three points for each sample, every age has the calibration and the floors of its own."""
    timeline = make_timeline(0, 100, 3)
    sparse = replace(timeline, points=tuple(3 * points for points in timeline.points))
    calibrated = [calibrate_prefixes(each).calibrate(each).probabilities for each in (timeline, sparse)]
    assert np.array_equal(*calibrated)
    decisions = [fit_trigger(each, rule=rule, waiting_cost=0.01).decide(each) for each in (timeline, sparse)]
    assert [replace(each, points=3 * each.points) for each in decisions[0]] == list(decisions[1])


def test_the_folds_and_groups_are_those_of_the_data_set():
    tracks = np.stack([walk(seed) for seed in range(20)])
    groups = tuple(f"person {case // 2}" for case in range(20))
    labels = tuple(CLASSES[case // 2 % 2] for case in range(20))
    timeline = cross_predict_over_time(by_way(), Dataset(tracks, labels, groups=groups), folds=2)
    assert timeline.groups == groups
    assert timeline.folds[::2] == timeline.folds[1::2]
    assert set(timeline.folds) == {0, 1}


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_the_table_has_a_row_for_each_track_and_age(tmp_path, suffix):
    timeline = make_timeline(0, 4, 3, lengths=np.array([3, 1, 2, 3]))
    path = tmp_path / f"timeline{suffix}"
    if suffix == ".parquet":
        parquet = pytest.importorskip("pyarrow.parquet")
    write_timeline(timeline, path)
    if suffix == ".parquet":
        rows = parquet.read_table(path).to_pylist()
    else:
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
    assert [(int(row["case"]), float(row["age"]), int(row["points"])) for row in rows] == [
        (case, age, 2 + int(age)) for case, n in enumerate((3, 1, 2, 3)) for age in range(n)
    ]
    for row in rows:
        case, time = int(row["case"]), int(2 * float(row["age"]))
        assert (row["label"], row["group"]) == (timeline.labels[case], f"person {case}")
        assert int(row["fold"]) == case
        for column, name in enumerate(CLASSES):
            assert float(row[f"probability {name}"]) == timeline.probabilities[case, time, column]
    bare = replace(timeline, folds=(), groups=())
    write_timeline(bare, tmp_path / "bare.csv")
    header = (tmp_path / "bare.csv").read_text().splitlines()[0]
    assert header == "case,label,age,points,probability interested,probability not_interested"
    with pytest.raises(FileError, match=r"table.txt: not the name of a table; expected one of .csv"):
        write_timeline(timeline, tmp_path / "table.txt")


def test_a_trigger_survives_json():
    timeline = make_timeline(0, 100, 3)
    for rule in ("threshold", "teaser"):
        trigger = fit_trigger(timeline, rule=rule)
        again = Trigger.from_json(json.loads(json.dumps(trigger.to_json())))
        assert again.decide(timeline) == trigger.decide(timeline)
    assert repr(trigger).startswith("<Trigger: probability 0.")
    assert "; expected accuracy 0." in repr(trigger)


def test_three_classes_and_tracks_without_a_prediction():
    rng = np.random.default_rng(0)
    p = rng.dirichlet(np.ones(3), (60, 4))
    p[0] = np.nan
    classes = ("a", "b", "c")
    timeline = PredictionTimeline(
        p, (2, 3, 4, 5), classes * 20, classes, 1.0, tuple(case % 4 for case in range(60))
    )
    search = search_trigger(timeline, rule="teaser", waiting_cost=0)
    assert 0.1 < search.trigger.expected.accuracy < 0.6
    decisions = search.trigger.decide(timeline)
    assert decisions[0] is None
    assert all(isinstance(each, EarlyDecision) for each in decisions[1:])


def test_the_figure_is_drawn(tmp_path):
    timeline = make_timeline(0, 100, 3)
    plot_trigger(
        {rule: search_trigger(timeline, rule=rule) for rule in ("threshold", "teaser")}, tmp_path / "t.svg"
    )
    text = (tmp_path / "t.svg").read_text()
    assert "mean age at the decision, s" in text
    assert "teaser: accuracy 0." in text
    with pytest.raises(DataError, match="no search of a trigger to draw"):
        plot_trigger({}, tmp_path / "t.svg")


def test_wrong_arguments():
    timeline = make_timeline(0, 20)
    with pytest.raises(
        DataError, match=r"the rule of a trigger is 'soon'; expected one of threshold, teaser"
    ):
        fit_trigger(timeline, rule="soon")
    with pytest.raises(DataError, match=r"waiting_cost is '0.1'; expected a number or None"):
        fit_trigger(timeline, waiting_cost="0.1")
    for cost in (-1, float("nan"), float("inf")):
        with pytest.raises(
            DataError, match=r"(the cost of a second|waiting_cost) is .*; expected a (finite )?number"
        ):
            fit_trigger(timeline, waiting_cost=cost)
    for function in (fit_trigger, cross_calibrate_prefixes):
        with pytest.raises(DataError, match="no folds; expected the result of cross_predict_over_time"):
            function(replace(timeline, folds=()))
    nothing = replace(timeline, probabilities=np.full_like(timeline.probabilities, np.nan))
    with pytest.raises(DataError, match="there is no prediction to calibrate: the tracks are too short"):
        fit_trigger(nothing)
    trigger = make_trigger([[0.5, 0.5]])
    with pytest.raises(DataError, match=r"the trigger is for .*, the timeline for"):
        trigger.decide(replace(timeline, classes=("a", "b")))
    with pytest.raises(
        DataError, match=r"have shape \(1, 3\); expected one row for each number of points and 2"
    ):
        make_trigger([[0.5, 0.5, 0.5]])
    with pytest.raises(DataError, match="at least one point"):
        make_trigger([[0.5, 0.5]], 0)
    trained = TrainedClassifier(lstm(classes=3))
    with pytest.raises(DataError, match="the trigger is for interested, not_interested; the classifier for"):
        StreamingClassifier.from_trained(trained, trigger=trigger)


def test_the_harmonic_mean():
    assert EarlyScore(0.8, 3.0, 0.4).harmonic_mean == pytest.approx(2 * 0.8 * 0.4 / 1.2)
    assert EarlyScore(0.0, 9.0, 0.0).harmonic_mean == 0
    assert EarlyScore(0.8, 3.0, 0.4).value(0.1) == pytest.approx(0.5)
