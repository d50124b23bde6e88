from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.svm import LinearSVC

from lcorpp.errors import DataError
from lcorpp.learning import (
    ChannelStandardizer,
    Motion,
    StreamingClassifier,
    TrainedClassifier,
    train_and_validate,
)
from lcorpp.learning.contract import SigmoidScores, fit_clone
from lcorpp.learning.features.motion_features import MOTION_FEATURES
from lcorpp.learning.features.resampling import resample
from lcorpp.protocols import Classifier
from tests.learning.walkers import walkers

from .people import ByWay, batch, by_way, lstm, minirocket, walk

INTERVAL = 0.033


def rich(*inputs):
    """The options of a pipeline with all features of some inputs."""
    features = [name for name, known in MOTION_FEATURES.items() if any(n <= {*inputs} for n in known.needs)]
    return {"inputs": inputs, "features": tuple(features), "robot": (1.0, 2.0, 0.5)}


RICH = rich("x", "y", "facing")
PIPELINES = {
    "lstm": lstm(),
    "three classes": lstm(classes=3, rate=2.5),
    "fast": lstm(rate=30.0),
    "rich": lstm(**RICH),
    "minirocket": minirocket(),
    "rich minirocket": minirocket(**RICH),
    "gaze": lstm(**rich("x", "y", "gaze_angle", "robot_angle", "face_distance")),
    "by way": by_way(),
}


def pushed(streams: StreamingClassifier, times, samples, person="p"):
    """The answers of one person, sample by sample."""
    return [
        streams.push(time, person, *sample)
        for time, sample in zip(np.asarray(times).tolist(), samples.T.tolist(), strict=True)
    ]


@pytest.mark.parametrize("name", PIPELINES)
def test_predictions_of_regular_samples_equal_the_batch_result(name):
    pipeline = PIPELINES[name]
    samples = walk(3, samples=120, inputs=len(pipeline[0].inputs))
    answers = pushed(StreamingClassifier(pipeline), np.arange(120) * INTERVAL, samples)
    changes = [end for end in range(1, 120) if answers[end] is not answers[end - 1]]
    assert len(changes) > 8
    for end in sorted({1, 120, *changes, *(end + 1 for end in changes)}):  # before and after each new point
        answer = answers[end - 1]
        if answer.points < 2:
            assert answer.probabilities is None
            with pytest.raises(DataError):
                pipeline.predict_proba(samples[None, :, :end])
        else:
            expected = pipeline.predict_proba(samples[None, :, :end])[0]
            np.testing.assert_allclose(answer.probabilities, expected, atol=1e-6)  # float32 in the LSTM


@settings(max_examples=20)
@given(
    seed=st.integers(0, 10**6),
    name=st.sampled_from(list(PIPELINES)),
    origin=st.sampled_from([0.0, -3.7, 1.7e9]),
)
def test_predictions_of_irregular_samples_equal_the_resampled_batch_result(seed, name, origin):
    pipeline = PIPELINES[name]
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 60))
    steps = np.where(rng.uniform(size=count) < 0.1, rng.uniform(0.1, 0.99, count), INTERVAL)
    times = origin + np.cumsum(steps * rng.uniform(0.5, 1.0, count))
    samples = walk(seed, samples=count, inputs=len(pipeline[0].inputs))
    answer = pushed(StreamingClassifier(pipeline), times, samples)[-1]
    motion = pipeline[0].transform_stamped(times, samples)
    assert (answer.points, answer.track) == (motion.shape[2], 1)
    if answer.points < 2:
        assert answer.probabilities is None
    else:
        np.testing.assert_allclose(answer.probabilities, batch(pipeline, times, samples), atol=1e-6)
        assert answer.time == pytest.approx(times[0] + (answer.points - 1) / pipeline[0].rate)
        assert answer.time <= times[-1] + 1e-6


@settings(max_examples=8)
@given(seed=st.integers(0, 10**6), name=st.sampled_from(["lstm", "rich", "rich minirocket", "by way"]))
def test_people_do_not_influence_each_other(seed, name):
    """With gaps, jumps, NaN and late samples; all together, in any mixture, they say what each says alone."""
    pipeline = PIPELINES[name]
    rng = np.random.default_rng(seed)
    lines = []
    for person in range(5):
        samples = walk(seed + person, inputs=len(pipeline[0].inputs))
        samples[0] += np.cumsum(rng.choice([0, 40], 60, p=[0.98, 0.02]))
        samples[:, rng.uniform(size=60) < 0.05] = np.nan
        steps = np.where(rng.uniform(size=60) < 0.03, 1.3, INTERVAL)
        times = 7 + np.cumsum(steps) + rng.normal(0, 0.02, 60)
        lines.append([(t, person, *s) for t, s in zip(times.tolist(), samples.T.tolist(), strict=True)])
    options = {"allowed_lateness": float(rng.choice([0.0, 0.1])), "max_silence": 100.0}
    alone = []
    for line in lines:
        streams = StreamingClassifier(pipeline, **options)
        alone.append([streams.push(*sample) for sample in line])
    together = StreamingClassifier(pipeline, **options)
    at = [0] * 5
    while min(at) < 60:
        before = list(at)
        several = []
        for person in rng.choice([p for p in range(5) if at[p] < 60], rng.integers(1, 12)):
            if at[person] < 60:
                several.append(lines[person][at[person]])
                at[person] += 1
        for person, answer in together.push_many(several).items():
            same = alone[person][at[person] - 1]
            assert at[person] > before[person]
            assert (answer.track, answer.points, answer.time) == (same.track, same.points, same.time)
            if same.probabilities is None:
                assert answer.probabilities is None
            else:
                np.testing.assert_allclose(answer.probabilities, same.probabilities, atol=1e-6)


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6), lateness=st.floats(0.02, 0.5), name=st.sampled_from(["lstm", "by way"]))
def test_the_order_of_arrival_within_the_allowed_lateness_does_not_matter(seed, lateness, name):
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.01, 0.06, 60))
    samples = walk(seed)
    arrival = np.argsort(times + rng.uniform(0, 0.99 * lateness, 60))
    streams = StreamingClassifier(PIPELINES[name], allowed_lateness=lateness)
    pushed(streams, times[arrival], samples[:, arrival])
    assert streams.report().people["p"].late == 0
    last = streams.remove("p")
    np.testing.assert_allclose(last.probabilities, batch(PIPELINES[name], times, samples), atol=1e-6)


def test_a_prediction_changes_only_with_a_new_point():
    answers = pushed(StreamingClassifier(PIPELINES["lstm"]), np.arange(22) * INTERVAL, walk(0)[:, :22])
    assert [answer.points for answer in answers] == [1] * 11 + [2] * 10 + [3]
    assert answers[11] is answers[20]
    assert answers[11].probabilities.sum() == pytest.approx(1)
    assert answers[0].time == 0
    with pytest.raises(ValueError, match="read-only"):
        answers[11].probabilities[0] = 1


def test_a_long_gap_begins_a_new_track():
    samples = walk(0, samples=40)
    times = np.arange(40) * INTERVAL + (np.arange(40) >= 20) * 3.0
    streams = StreamingClassifier(PIPELINES["lstm"])
    answers = pushed(streams, times, samples)
    assert (answers[19].track, answers[20].track) == (1, 2)
    assert answers[20].probabilities is None
    expected = batch(PIPELINES["lstm"], times[20:], samples[:, 20:])
    np.testing.assert_allclose(answers[-1].probabilities, expected, atol=1e-6)


@pytest.mark.parametrize("unit", [1e3, 1e9])
def test_stamps_in_another_unit_are_a_warning(unit):
    """In milliseconds every sample comes after a gap: no track has a second point, and no prediction."""
    streams = StreamingClassifier(PIPELINES["lstm"])
    samples, times = walk(3, samples=40), np.arange(40) * INTERVAL * unit
    pushed(streams, times[:5], samples[:, :5])
    with pytest.warns(
        UserWarning, match=r"the last 5 samples of 'p' .* expected seconds: are these milli"
    ) as found:
        answers = pushed(streams, times[5:], samples[:, 5:])
    assert (len(found), answers[-1].probabilities) == (1, None)


@pytest.mark.parametrize(
    "stamp", [lambda t: 5.0, lambda t: float(np.float32(1.7e9 + t)), lambda t: float(int(t))]
)
def test_stamps_that_stand_still_are_one_warning(stamp):
    """Frozen, of 32 bits, or in whole seconds: most samples are dropped as duplicates."""
    streams = StreamingClassifier(PIPELINES["lstm"])
    with pytest.warns(UserWarning, match="most of the last 20 samples of 'a' have no later time") as warned:
        pushed(streams, [stamp(0.1 * k) for k in range(100)], walk(0, samples=100), "a")
    assert len(warned) == 1


def test_silent_people_are_removed_and_stay_in_the_report():
    streams = StreamingClassifier(PIPELINES["lstm"], max_silence=2.0)
    streams.push(0.0, "a", 0, 0)
    streams.push(0.0, "a", 0, 0)
    for frame in range(70):
        streams.push(frame * INTERVAL, "b", 0, frame * 0.03)
    assert list(streams.predictions) == ["b"]
    report = streams.report()
    assert (report.removals, report.removed.samples, report.removed.duplicates) == (1, 2, 1)
    assert report.total.samples == 72
    assert str(report) == "b: 70 samples\n1 no longer tracked: 2 samples; duplicates dropped: 1"
    assert streams.push(2.5, "a", 0, 0).track == 1


def test_memory_is_bounded_by_the_number_of_tracked_people():
    for name in ("lstm", "by way"):
        streams = StreamingClassifier(PIPELINES[name])
        for person in range(500):
            for frame in range(2):
                streams.push(person * 0.2 + frame * 0.1, person, 0, frame * 0.03)
        assert len(streams.predictions) <= 27  # five seconds of five people, and rounding
        assert streams._predictor.slots == 32
        assert streams.report().removals == 500 - len(streams.predictions)


def test_a_wrong_stamp_does_not_affect_other_people():
    streams = StreamingClassifier(PIPELINES["lstm"])
    samples = walk(0, samples=60)
    for frame in range(60):
        streams.push(1e6 if frame == 30 else frame * INTERVAL, "wrong", 0, 0)
        answer = streams.push(frame * INTERVAL, "right", *samples[:, frame])
    expected = PIPELINES["lstm"].predict_proba(samples[None])[0]
    np.testing.assert_allclose(answer.probabilities, expected, atol=1e-6)
    wrong = streams.report().people["wrong"]
    assert (wrong.long_gaps, wrong.clock_resets, streams.predictions["wrong"].track) == (1, 1, 3)


def test_a_pause_of_all_people_removes_nobody():
    streams = StreamingClassifier(PIPELINES["lstm"])
    for start in (-100.0, 0.0, 1e6, 50.0):  # the last time a recording begins again
        for frame in range(30):
            streams.push_many([(start + frame * INTERVAL, person, 0, 0) for person in range(50)])
        assert {answer.points for answer in streams.predictions.values()} == {3}
        assert streams.report().removals == 0


def test_remove_returns_the_final_prediction():
    streams = StreamingClassifier(PIPELINES["lstm"], allowed_lateness=0.3)
    pushed(streams, np.arange(12) * INTERVAL, walk(0)[:, :12])
    assert streams.predictions["p"].points == 1
    last = streams.remove("p")
    assert (last.points, last.probabilities is None) == (2, False)
    assert not streams.predictions
    with pytest.raises(DataError, match="there is no person 'p'"):
        streams.remove("p")


def test_a_freed_slot_is_reset():
    for name in ("lstm", "by way"):
        streams = StreamingClassifier(PIPELINES[name])
        pushed(streams, np.arange(40) * INTERVAL, walk(0, samples=40), "first")
        streams.remove("first")
        answer = pushed(streams, np.arange(40) * INTERVAL, walk(1, samples=40), "second")[-1]
        expected = PIPELINES[name].predict_proba(walk(1, samples=40)[None])[0]
        np.testing.assert_allclose(answer.probabilities, expected, atol=1e-6)


def test_only_a_classifier_with_a_state_has_constant_cost():
    for name in ("lstm", "minirocket"):
        assert StreamingClassifier(PIPELINES[name]).constant_cost
    pipeline = by_way()
    streams = StreamingClassifier(pipeline)
    assert not streams.constant_cost
    pipeline[-1].asked.clear()
    streams.push_many([(frame * INTERVAL, person, 0, 0) for frame in range(22) for person in "abc"])
    assert pipeline[-1].asked == [(3, 2, 2), (3, 2, 3)]


def test_an_lstm_after_another_step_predicts_from_all_points():
    steps = lstm().steps
    pipeline = make_pipeline(steps[0][1], make_pipeline(steps[1][1]), steps[2][1])
    streams = StreamingClassifier(pipeline)
    assert not streams.constant_cost
    samples = walk(2)
    answer = pushed(streams, np.arange(60) * INTERVAL, samples)[-1]
    np.testing.assert_allclose(answer.probabilities, lstm().predict_proba(samples[None])[0], atol=1e-6)


def test_a_failing_classifier_removes_the_people_of_its_samples_only():
    pipeline = by_way()
    streams, samples = StreamingClassifier(pipeline), walk(0)
    for frame in range(15):
        streams.push_many([(frame * INTERVAL, person, *samples[:, frame]) for person in "ab"])
    pipeline[-1].least = 99
    later = [(frame * INTERVAL, "a", *samples[:, frame]) for frame in range(15, 30)]
    with pytest.raises(DataError, match="at least 99 points"):
        streams.push_many(later)
    assert list(streams.predictions) == ["b"]
    pipeline[-1].least = 1
    later = [streams.push(frame * INTERVAL, "b", *samples[:, frame]) for frame in range(15, 60)][-1]
    np.testing.assert_allclose(later.probabilities, pipeline.predict_proba(samples[None])[0], atol=1e-9)
    assert streams.push(30 * INTERVAL, "a", 0, 0).points == 1


def test_predictions_begin_with_min_points():
    words = "ByWay failed .* at least 4 points .*; the tracks had 2 points.* as `min_points` and as `window`"
    with pytest.raises(DataError, match=words):
        pushed(StreamingClassifier(by_way(least=4)), np.arange(12) * INTERVAL, walk(0)[:, :12])
    answers = pushed(
        StreamingClassifier(by_way(least=4), min_points=4), np.arange(32) * INTERVAL, walk(0)[:, :32]
    )
    assert [answer.points for answer in answers if answer.probabilities is not None] == [4]


@pytest.mark.parametrize("name", ["lstm", "rich", "by way"])
def test_a_window_predicts_as_if_the_track_began_there(name):
    pipeline = PIPELINES[name]
    streams = StreamingClassifier(pipeline, min_points=4, window=5)
    assert not streams.constant_cost
    samples = walk(1, samples=110, inputs=len(pipeline[0].inputs))
    times = np.arange(110) * INTERVAL
    points = resample(times, samples, 3.0, angles=pipeline[0].angles)
    for answer in pushed(streams, times, samples):
        if answer.points < 4:
            assert answer.probabilities is None
        else:
            last = points[None, :, max(0, answer.points - 5) : answer.points]
            expected = pipeline[1:].predict_proba(pipeline[0].transform_points(last))[0]
            np.testing.assert_allclose(answer.probabilities, expected, atol=1e-6)


def test_a_classifier_with_scores_only_is_streamed():
    margin = make_pipeline(Motion(), FunctionTransformer(length), LinearSVC())
    scored = fit_clone(SigmoidScores(margin), walkers(60).trajectories, np.array(walkers(60).labels))
    track = walkers(60).trajectories[0]
    answer = pushed(StreamingClassifier(scored), np.arange(40) * INTERVAL, track)[-1]
    np.testing.assert_allclose(answer.probabilities, scored.predict_proba(track[None])[0])


def length(X):
    return np.hypot(X[:, 0, -1], X[:, 1, -1])[:, None]


def test_a_trained_classifier_is_streamed_with_its_calibration():
    streams = StreamingClassifier.from_trained(TrainedClassifier(PIPELINES["lstm"]), allowed_lateness=0.1)
    assert streams.classes == ("interested", "not_interested")


@pytest.mark.parametrize(
    ("pipeline", "words"),
    [
        (LogisticRegression(), "a Pipeline of Motion, .*; this one begins with LogisticRegr"),
        (make_pipeline(ChannelStandardizer(), ByWay()), "this one begins with ChannelStandardizer"),
        (make_pipeline(Motion()), "a Pipeline of Motion, which"),
    ],
)
def test_a_pipeline_without_motion_is_an_error(pipeline, words):
    with pytest.raises(DataError, match=words):
        StreamingClassifier(pipeline)


def test_an_unfitted_pipeline_is_an_error():
    with pytest.raises(DataError, match="streaming needs a fitted pipeline: This Motion instance is not"):
        StreamingClassifier(make_pipeline(Motion(), ByWay()))


def test_options_out_of_range_are_errors():
    with pytest.raises(DataError, match="min_points must be 2 or more, not 1"):
        StreamingClassifier(PIPELINES["lstm"], min_points=1)
    with pytest.raises(DataError, match="window must be at least min_points, 5, not 4"):
        StreamingClassifier(PIPELINES["lstm"], min_points=5, window=4)
    with pytest.raises(DataError, match="allowed_lateness must be at least 0"):
        StreamingClassifier(PIPELINES["lstm"], allowed_lateness=-1.0)


@pytest.mark.parametrize(
    "sample", [(), (1.0, "p"), (1.0, "p", 1.0), (1.0, "p", 1.0, 2.0, 3.0), (1.0, [], 0, 0)]
)
def test_a_malformed_sample_is_an_error_and_no_sample_of_the_call_is_used(sample):
    streams = StreamingClassifier(PIPELINES["lstm"])
    with pytest.raises(DataError, match="; expected time, person, x, y"):
        streams.push_many([(0.0, "q", 0.0, 0.0), sample])
    assert not streams.predictions


@pytest.mark.parametrize("values", [("north", 1.0), (None, 1.0), (10**400, 1.0)])
def test_values_that_are_not_numbers_are_errors(values):
    with pytest.raises(DataError, match=r"sample \(1.0, 'p', .* expected time, person, x, y"):
        StreamingClassifier(PIPELINES["lstm"]).push(1.0, "p", *values)


def test_a_person_with_rejected_samples_only_has_no_prediction():
    streams = StreamingClassifier(PIPELINES["lstm"])
    answer = streams.push(float("nan"), "p", 0, 0)
    assert (answer.track, answer.points, answer.time, answer.probabilities) == (0, 0, None, None)
    assert str(streams.report()) == "p: 1 samples; rejected: 1 (the first: its time is nan)"


@pytest.mark.filterwarnings("ignore:most of the last:UserWarning")
@settings(max_examples=50)
@given(
    samples=st.lists(
        st.tuples(
            st.floats() | st.floats(0, 3), st.sampled_from("ab"), *[st.floats() | st.floats(-1, 1)] * 3
        ),
        max_size=40,
    ),
    name=st.sampled_from(["rich", "rich by way"]),
    lateness=st.sampled_from([0.0, 0.5]),
)
def test_any_samples_are_counted_and_predictions_are_distributions(samples, name, lateness):
    pipeline = PIPELINES["rich"] if name == "rich" else make_pipeline(PIPELINES["rich"][0], ByWay())
    if name != "rich":
        pipeline[-1].fit(np.zeros((2, 1, 2)), ["interested", "not_interested"])
    streams = StreamingClassifier(pipeline, allowed_lateness=lateness)
    for sample in samples:
        answer = streams.push(*sample)
        if answer.probabilities is not None:
            assert np.isfinite(answer.probabilities).all()
            assert answer.probabilities.sum() == pytest.approx(1)
    assert streams.report().total.samples == len(samples)


def test_the_decision_loop_classifies_one_person():
    streams = StreamingClassifier.from_trained(TrainedClassifier(PIPELINES["lstm"]))
    anything = np.zeros((0, 0))
    with pytest.raises(DataError, match="there is no prediction for 'p', who has no samples"):
        streams.classifier("p")
    streams.push(0.0, "p", 0, 0)
    with pytest.raises(DataError, match="who has 1 points, too few"):
        streams.classifier("p")
    for frame in range(1, 60):
        answer = streams.push(frame * INTERVAL, "p", *walk(0)[:, frame])
        if answer.probabilities is not None:
            classifier: Classifier = streams.classifier("p")
            assert classifier.classify(anything) == streams.classes[answer.probabilities.argmax()]
    with pytest.raises(DataError, match="soft evidence needs a calibrated classifier"):
        streams.classifier("p").soft()


def test_threshold_and_calibration_of_a_trained_classifier_are_used():
    trained, _ = train_and_validate(by_way(), walkers(60), folds=3)
    streams = StreamingClassifier.from_trained(trained)
    track = walkers(60).trajectories[0]
    for frame in range(40):
        streams.push(frame * INTERVAL, "p", *track[:, frame])
    heard, instance = streams.classifier("p"), track
    assert heard.classify(instance) == trained.classify(instance)
    assert heard.confusion is trained.confusion
    soft, expected = heard.soft().classify(instance), trained.soft().classify(instance)
    assert soft.values == expected.values
    np.testing.assert_allclose(soft.weights, expected.weights)
