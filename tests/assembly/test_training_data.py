"""Recorded tracks of any length and rate, and how they are read."""

import shutil

import numpy as np
import pytest

from lcorpp.assembly import TrainingOptions, train_classifier
from lcorpp.assembly.classifier_training import load_trained
from lcorpp.assembly.options import ReadingOptions, StoredOptions
from lcorpp.assembly.recorded_data import read_training_data
from lcorpp.assembly.training_data import make_training_data
from lcorpp.domains import load_domain
from lcorpp.domains.loading import SHIPPED_FOLDER
from lcorpp.errors import DataError, DomainError
from lcorpp.learning import Recording, Track, save_classifier, write_recording
from lcorpp.simulation.people import CutSignals, RecordedSignals
from lcorpp.values import Dataset

TABLE = Dataset(np.ones((1, 4)), ("interested",))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Forty people for six seconds, sampled 20 times per second; one walks twice as fast as the other."""
    file, rng = tmp_path_factory.mktemp("tracks") / "people.csv", np.random.default_rng(0)
    times = np.arange(121) / 20
    tracks = [
        Track(
            f"p{i}",
            times,
            {"x": (1 + i % 2) * times + rng.normal(0, 0.02, 121), "y": rng.normal(0, 0.02, 121)},
            ["interested", "not_interested"][i % 2],
        )
        for i in range(40)
    ]
    write_recording(Recording(tuple(tracks)), file)
    return file


def copy_domain(folder, recorded, extra):
    """The paper's domain with recorded data and further lines of [learning]."""
    shutil.copytree(SHIPPED_FOLDER / "intention", folder)
    shutil.copy(recorded, folder)
    toml = folder / "domain.toml"
    toml.write_text(
        toml.read_text().replace("[learning]\n", f'[learning]\ndata = "people.csv"\n{extra}\n', 1)
    )
    return folder


@pytest.mark.parametrize(
    ("extra", "points", "interval"),
    [
        ("seconds = 3\nrate = 10", 31, 0.1),
        ("seconds = 3", 92, 0.033),
        ("seconds = 1.5\nrate = 20", 31, 0.05),
    ],
)
def test_tracks_are_cut_and_resampled(tmp_path, recorded, extra, points, interval):
    domain = load_domain(copy_domain(tmp_path / "d", recorded, extra))
    sense = domain.senses[0]
    data = read_training_data(domain, sense, sense.data, 0).dataset
    assert data.trajectories.shape[1:] == (2, points)
    assert data.interval == pytest.approx(interval)
    duration = (points - 1) * interval
    moved = data.trajectories[:, 0, -1] - data.trajectories[:, 0, 0]
    speeds = [2.0 if label == "not_interested" else 1.0 for label in data.labels]
    np.testing.assert_allclose(moved / duration, speeds, atol=0.1)


def test_the_domain_s_recordings_train_its_classifier(tmp_path, recorded):
    domain = load_domain(copy_domain(tmp_path / "d", recorded, "seconds = 3\nrate = 10"))
    setup = train_classifier(domain, domain.senses[0], TrainingOptions("summaries"))
    assert (setup.data, setup.unit, setup.n_tracks) == (tmp_path / "d" / "people.csv", "tracks", 28)
    assert setup.report.accuracy.estimate == 1


def test_the_option_seconds_takes_precedence_and_shorter_tracks_are_used_whole(tmp_path, recorded):
    domain = load_domain(copy_domain(tmp_path / "d", recorded, "seconds = 3\nrate = 10"))
    sense = domain.senses[0]
    for seconds, points in ((2, 21), (5.95, 61), (30, 61)):
        options = TrainingOptions("summaries", seconds=seconds)
        data = make_training_data(domain, sense, options, 0)
        assert data.dataset.trajectories.shape[2] == points
        assert (
            data.signals.simulate([{"intention": "interested"}], np.random.default_rng(0)).shape[2] == points
        )
    (notes,) = [note for note in data.dataset.notes if "shorter" in note]
    assert notes == "40 of 40 tracks are shorter than 30 s and used whole: 20 interested, 20 not_interested"


def test_the_last_seconds_of_simulated_tracks(tmp_path, recorded):
    domain = load_domain("intention")
    sense, people = domain.senses[0], [{"intention": "interested"}] * 3
    whole = make_training_data(domain, sense, TrainingOptions(tracks=20), 0)
    last = make_training_data(domain, sense, TrainingOptions(tracks=20, seconds=2), 0)
    assert np.array_equal(last.dataset.trajectories, whole.dataset.trajectories[:, :, -62:])
    assert np.array_equal(last.dataset.trajectories, whole.dataset.last(2).trajectories)
    signals = [data.signals.simulate(people, np.random.default_rng(0)) for data in (whole, last)]
    assert np.array_equal(signals[0][:, :, -62:], signals[1])
    stored = tmp_path / "classifier.npz"
    trained = train_classifier(
        domain, sense, TrainingOptions("summaries", features=("x", "y"), tracks=40, rate=5)
    ).trained
    assert (trained.estimator[0].rate, trained.estimator[1].rate) == (5, 5)
    save_classifier(trained, stored)
    loaded = load_trained(domain, sense, StoredOptions(stored, seconds=2))
    assert np.array_equal(loaded.signals.simulate(people, np.random.default_rng(0)), signals[1])
    with pytest.raises(DataError, match="features have no duration"):
        CutSignals(RecordedSignals("intention", TABLE), slice(-3, None)).simulate(
            people, np.random.default_rng(0)
        )
    with pytest.raises(DataError, match="features have no duration"):
        TABLE.last(2)


@pytest.mark.parametrize(
    ("extra", "error", "words"),
    [
        (
            "rate = 0.1",
            DataError,
            r"people.csv: every track is shorter than 10 s; the longest lasts 6.000 s",
        ),
        ("seconds = 0", DomainError, r"\[learning\] seconds: expected a number from 0.001 to 3600"),
        ("rate = -1", DomainError, r"\[learning\] rate: expected a number from"),
    ],
)
def test_durations_that_do_not_fit_are_refused(tmp_path, recorded, extra, error, words):
    folder = copy_domain(tmp_path / "d", recorded, extra)
    with pytest.raises(error, match=words):
        train_classifier(load_domain(folder), load_domain(folder).senses[0], TrainingOptions("summaries"))


def test_reading_options_reach_the_reader(tmp_path, recorded):
    domain = load_domain(copy_domain(tmp_path / "d", recorded, "seconds = 3"))
    sense = domain.senses[0]
    turned = ReadingOptions(robot=(0.0, 0.0, np.pi / 2))
    plain, other = (
        read_training_data(domain, sense, sense.data, 0, reading=reading).dataset.trajectories
        for reading in (ReadingOptions(), turned)
    )
    np.testing.assert_allclose(other[:, 1], -plain[:, 0], atol=1e-9)
    with pytest.raises(DataError, match="silence is 0 s; expected a number above 0"):
        read_training_data(domain, sense, sense.data, 0, reading=ReadingOptions(gap=0))
