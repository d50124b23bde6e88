"""The resampler, motion features and LSTM of the page are those of the library, sample by sample."""

import random

import pytest

from lcorpp.learning import DecisionThreshold, StreamingClassifier, TrainedClassifier
from lcorpp.web.model import describe_classifier
from tests.learning.streaming.people import lstm

FEATURES = (
    "x",
    "y",
    "velocity",
    "heading",
    "acceleration",
    "turn_rate",
    "ahead",
    "left",
    "approach",
    "distance",
    "distance_rate",
    "bearing",
    "bearing_rate",
)
"""All motion features of positions."""


def make_samples(seed, count=120):
    """Make a walk with late, repeated and missing samples, jumps, halts, and clocks that go back."""
    rng = random.Random(seed)
    time, x, y, samples = rng.choice([0.0, 1.7e9]), rng.uniform(-3, 3), rng.uniform(-3, 3), []
    for _ in range(count):
        time += rng.choices([0.1, 0.033, 0.0, -0.05, 0.9, 1.0, 1.3, -2.5], [20, 8, 1, 1, 1, 1, 0.5, 0.3])[0]
        if rng.random() < 0.8:
            x, y = x + rng.gauss(0.1, 0.1), y + rng.gauss(0, 0.1)
        jump = rng.choices([0, 40, 2e9], [100, 1, 0.5])[0]
        samples.append([time, x + jump, y])
    return samples


def check(trained, node, samples, sizes):
    """Compare predictions after parts of some samples."""
    node(classifier=describe_classifier(trained))
    streams, begin = StreamingClassifier.from_trained(trained), 0
    for size in sizes:
        part = samples[begin : begin + size]
        begin += size
        expected = streams.push_many((time, "Ada", *values) for time, *values in part)["Ada"]
        found = node(samples=part)
        assert (found["points"], found["track"]) == (expected.points, expected.track)
        if expected.probabilities is None:
            assert found["probabilities"] is None
            assert found["class"] is None
        else:
            assert found["probabilities"] == pytest.approx(list(expected.probabilities), rel=0, abs=1e-6)
            assert found["class"] == streams.classifier("Ada").classify([0.0])


@pytest.mark.parametrize(("classes", "rate"), [(2, 10.0), (3, 4.0)])
def test_all_features_sample_by_sample(node, classes, rate):
    pipeline = lstm(classes=classes, features=FEATURES, rate=rate, robot=(0.3, -0.2, 0.7))
    for seed in range(3):
        check(TrainedClassifier(pipeline), node, make_samples(seed), [1] * 120)


def test_samples_that_arrive_together(node):
    for seed in range(8):
        check(TrainedClassifier(lstm()), node, make_samples(seed), [1, 5, 30, 2, 64, 18])


def test_a_track_that_lasts_too_long_begins_again(node):
    samples = [[i / 5, 0.01 * i, 1.0] for i in range(320)]  # 64 s, of which 60 are one track
    check(TrainedClassifier(lstm()), node, samples, [64] * 5)
    assert node(samples=[[64.0, 3.2, 1.0]])["track"] == 2


def test_a_threshold_decides_the_class(node):
    pipeline = lstm(classes=3)
    for name, probability in (("undecided", 0.2), ("interested", 0.9)):
        trained = TrainedClassifier(pipeline, threshold=DecisionThreshold(name, probability))
        check(trained, node, make_samples(3), [1] * 120)
