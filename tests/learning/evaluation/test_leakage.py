from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import Recording, Track, format_leakage_warning, measure_leakage
from lcorpp.learning.evaluation.leakage import _compute_mean_auc, compute_shortcut_features
from lcorpp.values import Dataset, stack_signals
from tests.learning.data.texts import crowd
from tests.learning.walkers import walkers


def by_name(data, **options):
    return {leak.name: leak for leak in measure_leakage(data, **options)}


def ending_at(ends: np.ndarray) -> Dataset:
    """Tracks from the origin to the given ends (cases, 2), labels in turn."""
    return Dataset(ends[:, :, None] * np.linspace(0, 1, 4), ("in", "out") * (len(ends) // 2))


def test_a_nonlinear_leak_by_end_position_is_detected():
    angle = np.random.default_rng(0).uniform(0, 2 * np.pi, 80)
    radius = np.where(np.arange(80) % 2 == 0, 1.0, 5.0)
    data = ending_at(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))
    end = by_name(data, n_splits=2)["end position"]
    assert end.auc.estimate > 0.99
    assert end.auc.low > 0.97
    assert end.is_suspicious
    assert "predicted from end position alone (AUC 1.00)" in (format_leakage_warning(data) or "")


def beginning_at(starts: np.ndarray) -> Dataset:
    """Tracks from the given starts (cases, 2) to ends that do not depend on them, labels in turn."""
    ends = np.random.default_rng(1).normal(0, 0.1, starts.shape)
    steps = np.linspace(0, 1, 4)
    tracks = starts[:, :, None] * (1 - steps) + ends[:, :, None] * steps
    return Dataset(tracks, ("in", "out") * (len(starts) // 2))


def test_a_leak_by_start_position_is_detected():
    """All end at the same place, one class comes from the left and the other from the right."""
    rng = np.random.default_rng(0)
    side = np.where(np.arange(80) % 2 == 0, -1.0, 1.0)
    data = beginning_at(np.stack([side * rng.uniform(2, 8, 80), rng.normal(0, 3, 80)], axis=1))
    found = by_name(data, n_splits=2)
    assert [name for name, leak in found.items() if leak.is_suspicious] == ["start position"]
    assert found["start position"].auc.estimate > 0.98
    assert "predicted from start position alone (AUC " in (format_leakage_warning(data) or "")


def test_the_way_that_slow_people_leave_between_start_and_end_is_no_leak():
    """All end at the same place, one class walks slowly: where it begins is its speed."""
    rng = np.random.default_rng(0)
    angle, way = rng.uniform(0, 2 * np.pi, 300), rng.uniform(2, 6, 300) + 2 * (np.arange(300) % 2)
    data = beginning_at(np.stack([way * np.cos(angle), way * np.sin(angle)], axis=1))
    start = by_name(data, n_splits=2)["start position"]
    assert 0.4 < start.auc.estimate < 0.65  # .73 without strata
    assert not start.is_suspicious


def test_classes_of_equal_distribution_do_not_leak():
    leaks = by_name(crowd(300), n_splits=2)
    assert list(leaks) == ["start position", "end position", "duration", "sampling"]
    for leak in leaks.values():
        assert abs(leak.auc.estimate - 0.5) < 0.1  # three standard errors
        assert leak.auc.low <= leak.auc.estimate <= leak.auc.high
        assert not leak.is_suspicious
    assert format_leakage_warning(crowd(60)) is None


@pytest.mark.parametrize("walks", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_chance_raises_an_alarm_in_at_most_five_percent_of_small_data_sets(walks):
    """Labels drawn at random for each of 20 people, who always walk to the same place."""
    rng, scores = np.random.default_rng(0), []
    person = np.repeat(np.arange(20), walks)
    for seed in range(40):
        ends = rng.normal(size=(20, 2))[person] + rng.normal(0, 1e-3, (len(person), 2))
        labels = rng.permutation(["in", "out"] * 10)[person]
        tracks = ends[:, :, None] * np.linspace(0, 1, 4)
        data = Dataset(tracks, tuple(labels.tolist()), tuple(map(str, person)))
        scores.append(by_name(data, n_splits=1, seed=seed)["end position"])
    assert sum(score.auc.estimate >= 0.7 and score.auc.low > 0.5 for score in scores) >= 3  # 7 % and more
    assert sum(score.is_suspicious for score in scores) <= 2
    for level in (0.05, 0.2, 0.5):
        assert abs(np.mean([score.p_value <= level for score in scores]) - level) < 0.16  # 2 errors at .5


def test_a_weak_dependence_is_significant_and_no_leak():
    ends = np.random.default_rng(0).normal(size=(600, 2)) + 0.4 * (np.arange(600) % 2)[:, None]
    end = by_name(ending_at(ends), n_splits=1)["end position"]
    assert 0.58 < end.auc.estimate < 0.7  # .66 by the best classifier
    assert (end.p_value, end.is_suspicious) == (1 / 200, False)


def change_second_class(change) -> Recording:
    """A crowd whose tracks of class "out", every second one, are changed."""
    return Recording(tuple(change(t) if t.label == "out" else t for t in crowd(60).tracks))


def resample_twice_as_fast(track: Track) -> Track:
    """Resample to twice the rate by linear interpolation."""
    times = np.linspace(track.times[0], track.times[-1], 2 * len(track) - 1)
    columns = {name: np.interp(times, track.times, values) for name, values in track.columns.items()}
    return Track(track.id, times, columns, track.label)


def drop_first_samples(track: Track) -> Track:
    columns = {name: values[8:] for name, values in track.columns.items()}
    return Track(track.id, track.times[8:], columns, track.label)


def make_times_even(track: Track) -> Track:
    times = np.linspace(track.times[0], track.times[-1], len(track))
    return Track(track.id, times, track.columns, track.label)


def round_to_millimetres(track: Track) -> Track:
    columns = {name: np.round(values, 3) for name, values in track.columns.items()}
    return Track(track.id, track.times, columns, track.label)


@pytest.mark.parametrize(
    ("change", "leaks"),
    [
        (resample_twice_as_fast, ["duration", "sampling"]),  # the number of samples, too
        (drop_first_samples, ["duration"]),
        (make_times_even, ["sampling"]),
        (round_to_millimetres, ["sampling"]),
    ],
)
def test_processing_of_one_class_is_detected_by_its_shortcut(change, leaks):
    found = by_name(change_second_class(change), n_splits=1)
    assert [name for name, leak in found.items() if leak.is_suspicious] == leaks


def test_smoothness_does_not_affect_the_sampling_features():
    """Two classes that differ in speed and noise, but not in numerical traces."""
    rng = np.random.default_rng(0)
    noise = np.where(np.arange(60) % 2, 0.1, 0.001)[:, None, None]
    tracks = np.cumsum(rng.normal(0, 1, (60, 2, 100)) * noise, axis=2)
    sampling = by_name(Dataset(tracks, ("in", "out") * 30), n_splits=1)["sampling"]
    assert (sampling.auc.estimate, sampling.auc.low, sampling.auc.high) == (0.5, 0.5, 0.5)


def test_shortcut_features_of_a_known_track():
    times = np.array([0.0, 1, 2, 3, 4, 5.5])
    x = np.array([0.0, 1, 2, 3, 3, 3.0004])
    traces = compute_shortcut_features(Track("a", times, {"x": x, "y": np.zeros(6)}, "in"))
    assert traces["end position"].tolist() == [3.0004, 0]
    assert traces["duration"].tolist() == [5.5, 6]
    np.testing.assert_allclose(traces["sampling"], [1.1, 1.0, 0.2, 1.5, 2 / 4, 2, 1 / 5, 5 / 6], atol=1e-9)


def test_folds_keep_groups_whole():
    """Three walks per person to one place: it predicts the person's other walks, but nobody else's."""
    rng = np.random.default_rng(0)
    ends = np.repeat(rng.normal(size=(60, 2)), 3, axis=0) + rng.normal(0, 1e-3, (180, 2))
    labels = tuple(np.repeat(rng.permutation(["in", "out"] * 30), 3).tolist())
    tracks = ends[:, :, None] * np.linspace(0, 1, 4)
    people = tuple(str(row // 3) for row in range(180))
    assert by_name(Dataset(tracks, labels, people), n_splits=1)["end position"].auc.estimate < 0.7
    assert by_name(Dataset(tracks, labels), n_splits=1)["end position"].auc.estimate > 0.75


@pytest.mark.parametrize("channels", [("x", "y"), ("pitch", "loudness"), ("x", "velocity")])
def test_a_leak_by_the_length_of_tracks_is_detected(channels):
    rng = np.random.default_rng(0)
    tracks = rng.normal(size=(40, 2, 20)).cumsum(axis=2)
    data = Dataset(tracks, ("a", "b") * 20, channels=channels)
    lengths = np.where(rng.random(40) < 0.1, 5, 12) + 8 * (np.arange(40) % 2)
    cut = replace(data, trajectories=stack_signals([t[:, :n] for t, n in zip(tracks, lengths, strict=True)]))
    assert by_name(data)["duration"].auc.estimate == 0.5
    assert by_name(cut)["duration"].is_suspicious
    assert len(by_name(cut)) == (4 if channels == ("x", "y") else 1)
    warning = format_leakage_warning(cut)
    assert "from duration alone (AUC 1.00)" in warning
    assert warning.endswith("a classifier may learn how long tracks last.")
    assert format_leakage_warning(data) is None


def test_three_classes_are_measured_and_missing_requirements_are_errors():
    assert by_name(walkers(90, classes=3), n_splits=1)["end position"].auc.estimate < 0.75
    with pytest.raises(DataError, match="two classes; all 6 tracks are slow"):
        measure_leakage(walkers(6, classes=1))
    with pytest.raises(DataError, match="every class in two groups; fast is in 1"):
        measure_leakage(walkers(6))
    first, second = crowd(2).tracks
    with pytest.raises(DataError, match="needs labels; track '1' has none"):
        measure_leakage(Recording((first, Track("1", second.times, second.columns))))
    with pytest.raises(DataError, match="at least 1 split, not 0"):
        measure_leakage(walkers(), n_splits=0)
    with pytest.raises(DataError, match="seed must lie between 0 and 4294967291, not -1"):
        measure_leakage(walkers(), seed=-1)
    with pytest.raises(DataError, match="tracks over time; the data are features"):
        measure_leakage(Dataset(np.zeros((4, 1)), ("a", "b") * 2))
    with pytest.raises(DataError, match="two classes; there are no tracks"):
        measure_leakage(Recording(()))
    assert format_leakage_warning(walkers(6)) is None  # `check_trainable` has the better message


def test_auc_equals_that_of_scikit_learn():
    from sklearn.metrics import roc_auc_score

    rng = np.random.default_rng(0)
    labels = rng.integers(0, 3, 200)
    scores = rng.dirichlet([1, 1, 1], 200).round(1)  # with ties
    truth = labels[:, None] == np.arange(3)
    expected = np.mean([roc_auc_score(truth[:, k], scores[:, k]) for k in range(3)])
    everyone, once = np.zeros(200, dtype=int), np.ones((1, 200))
    assert _compute_mean_auc(scores, truth, everyone, once)[0] == pytest.approx(expected)
    two = scores[:, 1:2], truth[:, 1:2]
    assert _compute_mean_auc(*two, everyone, once)[0] == pytest.approx(
        roc_auc_score(truth[:, 1], scores[:, 1])
    )
    halves = [roc_auc_score(truth[rows, 1], scores[rows, 1]) for rows in (slice(100), slice(100, 200))]
    pairs = [truth[rows, 1].sum() * (~truth[rows, 1]).sum() for rows in (slice(100), slice(100, 200))]
    strata = np.arange(200) // 100
    assert _compute_mean_auc(*two, strata, once)[0] == pytest.approx(np.average(halves, weights=pairs))
