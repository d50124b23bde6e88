"""Shared values: checked at construction, read-only, short `repr`."""

import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st

from lcorpp.errors import DataError, ModelError
from lcorpp.values import (
    ConfusionMatrix,
    Dataset,
    Distribution,
    Episode,
    Instance,
    Interval,
    Likelihood,
    Step,
    measure_lengths,
    stack_signals,
    track_hash,
)


def test_effective_cases_of_a_confusion_matrix():
    """By default the sums of the rows; JSON keeps them; each rate shares its own."""
    counts = np.array([[30.0, 10], [5, 15]])
    plain = ConfusionMatrix(("a", "b"), counts)
    assert plain.effective_counts.tolist() == [[[30, 10], [10, 30]], [[5, 15], [15, 5]]]
    assert "effective_cases" not in plain.to_json()
    fewer = ConfusionMatrix(("a", "b"), counts, np.array([[20.0, 8], [0, 20]]))
    assert fewer.effective_counts.tolist() == [[[15, 5], [2, 6]], [[0, 0], [15, 5]]]
    assert fewer.rates() == plain.rates()
    for own in (plain, fewer):
        again = ConfusionMatrix.from_json(own.to_json())
        assert again.to_json() == own.to_json()
    for wrong in ([[41, 8], [0, 20]], [[-1, 8], [0, 20]], [[np.nan, 8], [0, 20]], [[1, 2]]):
        with pytest.raises(DataError, match=r"from 0 to the sums of its rows, \[40.0, 20.0\]; not"):
            ConfusionMatrix(("a", "b"), counts, np.array(wrong))


def test_distribution():
    d = Distribution(("a", "b"), np.array([0.25, 0.75]))
    assert (d["a"], d.most_likely(), dict(d)) == (0.25, "b", {"a": 0.25, "b": 0.75})
    with pytest.raises(ModelError, match="unknown value 'c'; expected one of a, b"):
        d["c"]
    with pytest.raises(ModelError, match="unknown value 'c'"):
        Distribution.certain("c", ("a", "b"))


@pytest.mark.parametrize("p", [[0.5, 0.4], [1.5, -0.5], [np.nan, 1], [1], []])
def test_invalid_distributions(p):
    with pytest.raises(ModelError, match=r"distribution|shape"):
        Distribution(("a", "b"), np.array(p))


@given(st.lists(st.lists(st.integers(0, 1000), min_size=3, max_size=3), min_size=3, max_size=3))
def test_smoothed_rates_are_exact_distributions_without_0_and_1(counts):
    rates = ConfusionMatrix(("a", "b", "c"), np.array(counts)).rates()
    assert all(sum(row) == 1 for row in rates)
    assert all(0 < rate < 1 for row in rates for rate in row)


def test_jeffreys_and_laplace():
    matrix = ConfusionMatrix(("a", "b"), np.array([[63, 0], [1, 2]]))
    assert matrix.rates()[0] == (Fraction(127, 128), Fraction(1, 128))
    assert matrix.rates(Fraction(1))[1] == (Fraction(2, 5), Fraction(3, 5))
    with pytest.raises(DataError, match="a class without cases needs smoothing"):
        ConfusionMatrix(("a", "b"), np.array([[0, 0], [1, 2]])).rates(Fraction(0))


@pytest.mark.parametrize("counts", [[[1, 2]], [[1, -1], [1, 1]], [[1, np.inf], [1, 1]]])
def test_invalid_confusion_matrices(counts):
    with pytest.raises(DataError, match="confusion matrix"):
        ConfusionMatrix(("a", "b"), np.array(counts, float))


def test_dataset():
    data = Dataset(np.arange(12.0).reshape(3, 2, 2), ("a", "b", "a"))
    assert data.groups == ("0", "1", "2")
    part = data.take([2, 0])
    assert (part.labels, part.groups) == (("a", "a"), ("2", "0"))
    np.testing.assert_array_equal(part.trajectories[0], data.trajectories[2])
    with pytest.raises(ValueError, match="read-only"):
        data.trajectories[0, 0, 0] = 1
    with pytest.raises(DataError, match="3 labels and 3 groups need trajectories of shape"):
        Dataset(np.zeros((2, 2, 2)), ("a", "b", "a"))


def test_a_dataset_keeps_its_interval_and_channels():
    data = Dataset(np.zeros((2, 3, 4)), ("a", "b"), interval=0.4, channels=("x", "y", "heading"))
    longer = data.append([(np.ones((3, 4)), "a")], ["g"])
    for derived in (data, data.take([1]), longer, longer.take([2, 0])):
        assert (derived.interval, derived.channels) == (0.4, ("x", "y", "heading"))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"interval": 0.0}, "the interval is 0.0 s; expected a finite number above 0"),
        ({"interval": float("nan")}, "the interval is nan s"),
        ({"interval": float("inf")}, "the interval is inf s"),
        ({"channels": ("x", " ")}, "a channel is named ' '; expected a text that is not blank"),
        ({"channels": ("x", "x")}, "expected every name once"),
        ({"channels": ("x", "y", "facing")}, r"3 channels \(x, y, facing\) need .* \(2, 3, time points\)"),
    ],
)
def test_invalid_datasets(changed, words):
    with pytest.raises(DataError, match=words):
        Dataset(np.zeros((2, 2, 4)), ("a", "b"), **changed)


def test_equal_trajectories_and_no_others_share_a_hash():
    track = np.arange(6.0).reshape(2, 3)
    assert track_hash(track) == track_hash(np.asfortranarray(track.astype(np.float32)).tolist())
    for other in (track.T, track.reshape(1, 6), track + 1e-12, track[:, :2]):
        assert track_hash(other) != track_hash(track)
    assert track_hash(np.pad(track, ((0, 0), (0, 4)), constant_values=np.nan)) == track_hash(track)


def test_tracks_of_unequal_length():
    tracks = [np.ones((2, points)) for points in (61, 1801, 400)]
    data = Dataset(stack_signals(tracks), ("a", "b", "a"), interval=1 / 30)
    assert data.lengths.tolist() == [61, 1801, 400]
    assert data.take([2, 0]).lengths.tolist() == [400, 61]
    assert ", 2 to 60 s of x, y every 0.0333333 s, 3 groups)" in repr(data)
    assert "), 61 points of x, y" in repr(data.take([0]))
    assert Dataset(np.ones((3, 4)), ("a", "b", "a")).lengths.tolist() == [1, 1, 1]
    assert data.take([]).extent == "1801 points"
    instance = Instance({"motion": data.trajectories[0], "posture": np.ones(3)}, {})
    assert [signal.shape for signal in instance.signals.values()] == [(2, 61), (3,)]
    assert measure_lengths(np.full((2, 2, 5), np.nan)).tolist() == [0, 0]
    assert measure_lengths(np.zeros((2, 2, 0))).tolist() == [0, 0]


def test_interval():
    interval = Interval(0.6341, 0.6009, 0.6662)
    assert str(interval) == "0.634 [0.601, 0.666]"
    assert f"{interval:.1f}" == "0.6 [0.6, 0.7]"
    assert repr(interval) == "Interval(0.634 [0.601, 0.666], 0.95)"
    assert Interval.exact(2.0) == Interval(2.0, 2.0, 2.0)


def test_repr_and_html_are_short_and_escaped():
    many = tuple(f"<v{i}>" for i in range(500))
    step = Step("ask", "yes", np.array([0.25, 0.75]))
    values = [
        Distribution(("a", "b"), np.array([0.25, 0.75])),
        Distribution(many, np.full(500, 1 / 500)),
        Likelihood(("a", "b"), np.array([1, 2])),
        ConfusionMatrix(("a", "b"), np.array([[3, 1], [0, 2]])),
        Dataset(np.zeros((300, 2, 304)), ("a", "b") * 150),
        Instance({"motion": np.zeros((2, 304))}, {"time": "noon"}),
        step,
        Episode({"motion": "a"}, {"c": "a"}, None, np.full(1000, 1e-3), (step,) * 200, "a"),
    ]
    for value in values:
        assert len(repr(value)) < 300
        assert "\n" not in repr(value)
        assert "array" not in repr(value)
        if hasattr(value, "_repr_html_"):
            html = value._repr_html_()
            assert re.search("<table><caption>[^<]", html)
            assert "<v0>" not in html
            assert "<th></th>" not in html
            assert len(html) < 6000
    assert "<td>a</td><td>150</td><td>150</td>" in values[4]._repr_html_()
    assert repr(values[0]) == "Distribution(a: 0.25, b: 0.75)"
    assert repr(values[3]) == "ConfusionMatrix(a: 3 of 4 correct, b: 2 of 2 correct)"
    assert repr(step) == "Step('ask', 'yes', belief [0.25, 0.75])"


@pytest.mark.parametrize("signal", [None, "track", 3.0, [["a"]], [[1.0], [1.0, 2.0]], np.zeros((1, 2, 3))])
def test_a_signal_has_one_or_two_dimensions(signal):
    words = r"the signal of the sense 'motion' is .*\(channels, time points\) or \(features,\)"
    with pytest.raises(DataError, match=words):
        Instance({"motion": signal}, {})


def test_an_instance_has_a_signal_of_each_sense():
    person = Instance({"motion": np.zeros((2, 3)), "gaze": [0.5, 1.0]}, {"time": "noon"})
    assert repr(person) == "Instance(signals: motion (2, 3), gaze (2,), context: time=noon)"
    assert not person.signals["gaze"].flags.writeable
    assert repr(Instance({}, {})) == "Instance(signals: none, context: empty)"
    with pytest.raises(DataError, match=r"the signals of an instance: array.*; expected sense -> numbers"):
        Instance(np.zeros((2, 3)), {})
    with pytest.raises(DataError, match="the context of an instance: None; expected attribute -> value"):
        Instance({}, None)
