"""Segment statistics: as computed one by one, for padded series as for each alone, and of prefixes."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import LstmClassifier, learner, load_classifier, save_classifier, train
from lcorpp.learning.features.segments import SegmentStatistics
from lcorpp.values import Dataset, stack_signals
from tests.learning.classifiers.test_minirocket import make_waves


def test_a_segment_has_four_statistics_of_each_channel():
    series = np.arange(28.0).reshape(1, 2, 14)
    found = SegmentStatistics(points=4).fit(series).transform(series)
    assert found.shape == (1, 8, 4)  # segments of 4, 4, 4 and 2 points
    for channel in range(2):
        parts = [series[0, channel, start : start + 4] for start in (0, 4, 8, 12)]
        for row, reduce in enumerate((np.mean, np.std, np.min, np.max)):
            np.testing.assert_allclose(found[0, 2 * row + channel], [reduce(part) for part in parts])


def test_short_series_stay_as_they_are():
    series = np.random.default_rng(0).normal(size=(3, 2, 30))
    assert np.array_equal(SegmentStatistics().fit(series).transform(series), series)


def test_padding_and_prefixes():
    rng = np.random.default_rng(0)
    series = [rng.normal(size=(2, length)) for length in (100, 61, 10, 40)]
    whole = stack_signals(series)
    segments = SegmentStatistics(points=20).fit(whole)
    found = segments.transform(whole)
    assert (segments.width_, found.shape) == (5, (4, 8, 20))
    for one, together in zip(series, found, strict=True):
        alone = segments.transform(one[None])[0]
        np.testing.assert_array_equal(together[:, : alone.shape[1]], alone)
        assert np.isnan(together[:, alone.shape[1] :]).all()
    np.testing.assert_array_equal(segments.transform(whole[:1, :, :45]), found[:1, :, :9])


def test_the_fast_lstm_learns_long_series_and_is_stored(tmp_path):
    rng, truth = np.random.default_rng(0), np.arange(60) % 3
    is_loud = np.arange(300) // 100 == truth[:, None]
    tracks = rng.normal(scale=np.where(is_loud, 2, 1)[:, None], size=(60, 2, 300))
    labels = ("first", "second", "third")
    data = Dataset(tracks, tuple(labels[third] for third in truth), channels=("pitch", "loudness"))
    trained = train(learner("lstm-fast", inputs=data.channels), data.take(range(30)))
    found = trained.classify_many(tracks[30:])
    assert np.mean(np.array(found) == data.labels[30:]) > 0.8  # a third is chance
    save_classifier(trained, tmp_path / "c.npz")
    again = load_classifier(tmp_path / "c.npz")
    assert np.array_equal(again.probabilities(tracks), trained.probabilities(tracks))


def test_small_data_sets_get_more_passes():
    tracks, labels = make_waves(60, points=20)
    passes = []
    for cases, options in (
        (60, {}),
        (60, {"min_updates": 9}),
        (6, {"min_updates": 9}),
        (60, {"min_updates": 3}),
    ):
        done: list[int] = []
        LstmClassifier(units=2, epochs=3, **options, progress=lambda at, _, done=done: done.append(at)).fit(
            tracks[:cases], labels[:cases]
        )
        passes.append(len(done))
    assert passes == [3, 5, 9, 3]  # two updates a pass over 60 cases, one over 6
    with pytest.raises(DataError, match="min_updates must be at least 0, not -1"):
        LstmClassifier(min_updates=-1).fit(tracks, labels)
