"""Channels of any name and number, three classes: described, run and learnt from like motion."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from lcorpp.learning import load_classifier, save_dataset
from lcorpp.values import Dataset
from tests.cli.test_bad_input import refused

pytestmark = pytest.mark.usefixtures("unrendered")

ROOMS = Path(__file__).parents[1] / "domains/rooms"
CLASSES = ("lab", "office", "store")


def write_series(path: Path, channels: int, cases: int = 60) -> Path:
    """Noise in all channels and, in the last, a wave whose period depends on the class; lengths differ."""
    rng = np.random.default_rng(channels)
    truth, lengths = np.arange(cases) % 3, rng.integers(30, 50, cases)
    tracks = rng.normal(scale=0.5, size=(cases, channels, 50))
    tracks[:, -1] += np.sin(2 * np.pi * np.arange(50) / np.array([6, 10, 16])[truth, None])
    tracks[np.arange(50) >= lengths[:, None, None] + np.zeros((cases, channels, 1), dtype=int)] = np.nan
    names = tuple(f"sensor {i}" for i in range(channels))
    save_dataset(Dataset(tracks, tuple(CLASSES[i] for i in truth), channels=names, interval=0.1), path)
    return path


def test_series_are_described_and_their_default_learner_is_the_recommended_one(lcorpp, tmp_path):
    file = write_series(tmp_path / "series.npz", 12, cases=36)
    described = lcorpp("data", "describe", file)
    assert described.code == 0, described.err
    assert "36 cases of 36 people; 12 channels; 2.9 to 4.8 s every 0.1 s" in described.out
    assert "recommended learner: minirocket, because it has the highest mean accuracy" in described.out
    ended = lcorpp(
        "run", ROOMS, "--data", file, "--trials", 30, "--jobs", 1, "--strategy", "L+R", "--evidence", "soft",
        "--out", tmp_path / "out",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    assert "minirocket, five-fold cross-validation on" in ended.out
    assert "true class store (9 cases); predicted" in ended.out
    stored = load_classifier(tmp_path / "out/classifier.npz")
    assert (stored.classes, len(stored.inputs)) == (CLASSES, 12)


def test_algorithm_1_learns_from_series(lcorpp, tmp_path):
    file = write_series(tmp_path / "series.npz", 6)
    ended = lcorpp(
        "learn", ROOMS, "--data", file, "--learner", "summaries", "--max-batches", 1, "--batch-size", 10,
        "--jobs", 1, "--out", tmp_path / "out",
    )  # fmt: skip
    assert ended.code == 0, ended.err


def test_a_threshold_of_one_of_three_classes(lcorpp, tmp_path):
    file = write_series(tmp_path / "series.npz", 6)
    common = ("--data", file, "--trials", 30, "--jobs", 1, "--strategy", "L+R", "--learner", "summaries")
    refused(lcorpp("run", ROOMS, *common, "--threshold", "f1"), "heading has 3 classes: name one of them")
    folder = tmp_path / "rooms"
    shutil.copytree(ROOMS, folder)
    domain = folder / "domain.toml"
    domain.write_text(domain.read_text().replace("tracks = 60", 'tracks = 60\npositive = "lab"'))
    ended = lcorpp("run", folder, *common, "--threshold", 0)
    assert ended.code == 0, ended.err
    assert "decision threshold: lab from probability 0.000 on" in ended.out
    assert "true class store (14 cases); predicted: lab 1.000" in ended.out
    assert lcorpp("run", folder, *common, "--threshold", "f1").code == 0
