"""Recordings of simulated people: as many of each class as asked, and nothing but motion tells them apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.errors import DomainError
from lcorpp.learning import measure_leakage
from lcorpp.simulation.recordings import simulate_recording


@pytest.fixture(scope="module")
def intention():
    return load_domain("intention")


def test_the_paper_s_shares_and_another(intention):
    recording = simulate_recording(intention, np.random.default_rng(0), tracks=80)
    assert (len(recording), recording.labels.count("interested")) == (80, 2)
    recording = simulate_recording(
        intention, np.random.default_rng(0), tracks=20, positives=20, seconds=(3, 4)
    )
    assert recording.labels.count("interested") == 20
    assert all(2.9 < track.duration < 4.1 for track in recording.tracks)
    assert {"x", "y", "velocity", "heading", "facing"} <= set(recording.tracks[0].columns)


def test_a_seed_makes_the_same_people(intention):
    one, same, other = (
        simulate_recording(intention, np.random.default_rng(seed), tracks=6, positives=3)
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.tracks[2].positions, same.tracks[2].positions)
    assert one.labels == same.labels
    assert not np.array_equal(one.tracks[2].positions[:, :9], other.tracks[2].positions[:, :9])


def test_impossible_recordings_are_rejected(intention):
    rng = np.random.default_rng(0)
    with pytest.raises(DomainError, match="7 of 6 tracks cannot be positive"):
        simulate_recording(intention, rng, tracks=6, positives=7)
    unlabelled = replace(intention, senses=(replace(intention.senses[0], positive=None),))
    with pytest.raises(DomainError, match="positive is missing"):
        simulate_recording(unlabelled, rng, tracks=6)
    still = replace(intention, simulation=replace(intention.simulation, recordings=None))
    with pytest.raises(DomainError, match=r"no people\.py with recordings"):
        simulate_recording(still, rng, tracks=6)


@pytest.mark.slow
def test_no_feature_but_motion_reveals_the_intention(intention):
    """End position, duration and sampling alone, mean of 5 seeds; .49 to .54 measured over 20."""
    areas = []
    for seed in range(5):
        recording = simulate_recording(intention, np.random.default_rng(seed), tracks=800, positives=400)
        areas.append([leak.auc.estimate for leak in measure_leakage(recording, n_splits=3, seed=seed)])
    assert np.all(np.mean(areas, axis=0) <= 0.58)
