"""MiniRocket: its features are those of the paper, for any channels and lengths."""

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning import cross_validate, learner, load_classifier, save_classifier, train
from lcorpp.learning.classifiers.minirocket import KERNELS, MiniRocket
from lcorpp.values import Dataset


def make_waves(cases=60, channels=1, points=80, seed=0):
    """Three classes, waves of different periods with a random phase in the last channel, and noise."""
    rng = np.random.default_rng(seed)
    truth = np.arange(cases) % 3
    period = np.array([6, 10, 16])[truth]
    phase = rng.uniform(0, 2 * np.pi, cases)
    waves = np.sin(2 * np.pi * np.arange(points) / period[:, None] + phase[:, None])
    tracks = rng.normal(scale=0.7, size=(cases, channels, points))
    tracks[:, -1] += waves
    return tracks, np.array(["fast", "medium", "slow"])[truth]


def pad(tracks, lengths):
    """Replace what follows the first `lengths` time points of each track by NaN."""
    return np.where(np.arange(tracks.shape[2]) < lengths[:, None, None], tracks, np.nan)


def test_a_feature_is_the_fraction_of_time_above_the_bias():
    tracks, labels = make_waves(channels=3)
    model = MiniRocket(features=840).fit(tracks, labels)
    numbers = np.repeat(np.arange(len(model.channels_)), np.repeat(model.counts_, len(KERNELS)))
    found = model._transform(tracks)
    for feature in range(0, len(numbers), 37):
        layer, kernel = divmod(numbers[feature], len(KERNELS))
        dilation = model.dilations_[layer]
        weights = np.full(9, -1.0)
        weights[list(KERNELS[kernel])] = 2
        spaced = np.zeros(8 * dilation + 1)
        spaced[::dilation] = weights
        mode = "valid" if (layer + kernel) % 2 else "same"
        for case in (0, 7):
            signal = tracks[case, model.channels_[numbers[feature]]].sum(axis=0)
            if mode == "same":
                signal = np.pad(signal, 4 * dilation)
            high = np.convolve(signal, spaced[::-1], "valid") > model.biases_[feature]
            assert found[case, feature] == pytest.approx(high.mean(), abs=0.02)  # float32 at the bias


def test_kernels_and_dilations_are_those_of_the_paper():
    assert len(KERNELS) == 84
    tracks, labels = make_waves(points=150)
    model = MiniRocket().fit(tracks, labels)
    assert len(model.biases_) == 9996
    assert (model.dilations_[0], model.dilations_[-1]) == (1, 18)  # (150 - 1) / 8
    assert model.counts_[0] == model.counts_.max()


def test_waves_in_one_of_many_channels_are_recognised():
    tracks, labels = make_waves(90, channels=12)
    data = Dataset(tracks, tuple(labels), channels=tuple(f"c{i}" for i in range(12)))
    validation = cross_validate(learner("minirocket", inputs=data.channels, kind="series"), data, folds=2)
    assert validation.classes == ("fast", "medium", "slow")
    assert validation.accuracy > 0.8  # a third is chance


def test_a_padded_track_counts_as_far_as_it_goes():
    tracks, labels = make_waves(channels=2)
    lengths = np.random.default_rng(1).integers(8, 80, len(tracks))
    lengths[:3] = 80
    model = MiniRocket(features=840).fit(pad(tracks, lengths), labels)
    together = model.predict_proba(pad(tracks, lengths))
    for case in (0, 5, int(lengths.argmin())):
        alone = model.predict_proba(tracks[case : case + 1, :, : lengths[case]])[0]
        np.testing.assert_allclose(together[case], alone, atol=1e-6)


def test_the_seed_decides():
    tracks, labels = make_waves()
    one, same, other = (MiniRocket(features=420, random_state=seed).fit(tracks, labels) for seed in (0, 0, 1))
    new, truth = make_waves(seed=5)
    assert np.array_equal(one.predict_proba(new), same.predict_proba(new))
    assert not np.array_equal(one.predict_proba(new), other.predict_proba(new))
    assert min(np.mean(model.predict(new) == truth) for model in (one, other)) > 0.8


def test_weights_balance_with_the_classes():
    tracks, labels = make_waves()
    weights = np.where(labels == "fast", 3.0, 1.0)
    by_class, unweighted = (
        MiniRocket(features=840).fit(tracks, labels, given).predict_proba(tracks) for given in (weights, None)
    )
    np.testing.assert_allclose(by_class, unweighted, atol=1e-5)  # all classes count equally anyway
    half = np.where(np.arange(len(labels)) < 30, 1.0, 1e-9)
    some = MiniRocket(features=840).fit(tracks, labels, half).predict_proba(tracks)
    assert np.abs(some - unweighted).max() > 0.01


def test_a_stored_one_predicts_the_same(tmp_path):
    tracks, labels = make_waves(channels=2)
    data = Dataset(tracks, tuple(labels), channels=("pitch", "loudness"))
    trained = train(learner("minirocket", inputs=data.channels, kind="series"), data)
    save_classifier(trained, tmp_path / "c.npz")
    again = load_classifier(tmp_path / "c.npz")
    assert again.inputs == data.channels
    assert np.array_equal(again.probabilities(tracks), trained.probabilities(tracks))


def test_wrong_use_is_an_error():
    tracks, labels = make_waves()
    with pytest.raises(DataError, match="at least 84 features, not 10"):
        MiniRocket(features=10).fit(tracks, labels)
    model = MiniRocket(features=84).fit(tracks, labels)
    with pytest.raises(DataError, match="trained on tracks of 1 channels, given 2"):
        model.predict_proba(np.repeat(tracks, 2, axis=1))
    stored = model.to_arrays()
    for name in stored:
        with pytest.raises(DataError, match="do not match each other"):
            MiniRocket(features=84).restore_arrays({**stored, name: stored[name][:-1]})
