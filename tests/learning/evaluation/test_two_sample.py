"""Two-sample tests of signals and of counts."""

import numpy as np
import pytest
from scipy.stats import binomtest, fisher_exact

from lcorpp.learning.evaluation import two_sample
from lcorpp.learning.evaluation.two_sample import compare_rates, compare_signals


def draw_tracks(rng, n):
    """Tracks of two channels, of four to nine time points."""
    return [rng.normal(size=(2, rng.integers(4, 10))) for _ in range(n)]


def draw_features(rng, n):
    return list(rng.normal(size=(n, 3)))


def draw_choices(rng, n):
    """Few different cases, so that many permutations are alike."""
    return list(rng.integers(0, 2, size=(n, 2)).astype(float))


@pytest.mark.parametrize("draw", [draw_tracks, draw_features, draw_choices])
def test_p_values_of_equal_distributions_are_uniform_or_larger(draw):
    """150 repetitions; the share of p-values up to a level may exceed it by chance alone."""
    rng = np.random.default_rng(1)
    p_values = np.array([compare_signals(draw(rng, 30), draw(rng, 12), rng) for _ in range(150)])
    for level in (0.05, 0.2, 0.5):
        hits = int((p_values <= level).sum())
        assert binomtest(hits, 150, level, alternative="greater").pvalue > 0.001
    assert p_values.min() > 0


@pytest.mark.parametrize("draw", [draw_tracks, draw_features])
def test_a_shift_and_a_spread_are_found(draw):
    rng = np.random.default_rng(0)
    first = draw(rng, 200)
    assert compare_signals(first, [signal + 1 for signal in draw(rng, 60)], rng) < 0.001
    assert compare_signals(first, [signal * 3 for signal in draw(rng, 60)], rng) < 0.001


def test_the_energy_distance_is_that_of_its_definition():
    rng = np.random.default_rng(0)
    cases = rng.normal(size=(9, 2))
    distances = np.linalg.norm(cases[:, None] - cases[None], axis=2)
    members = np.array([[1.0] * 4 + [0.0] * 5, [0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]])
    found = two_sample._compute_energy(distances, members)
    for row, energy in zip(members.astype(bool), found, strict=True):
        across, within = distances[row][:, ~row], (distances[row][:, row], distances[~row][:, ~row])
        assert energy == pytest.approx(2 * across.mean() - within[0].mean() - within[1].mean())


def test_equal_cases_are_no_evidence():
    rng = np.random.default_rng(0)
    assert compare_signals([np.ones(3)] * 5, [np.ones(3)] * 4, rng) == 1


def test_of_many_cases_a_random_part_is_compared(monkeypatch):
    monkeypatch.setattr(two_sample, "MAX_CASES", 50)
    rng = np.random.default_rng(0)
    first, second = draw_features(rng, 400), draw_features(rng, 30)
    assert compare_signals(first, second, rng) > 0.01
    assert compare_signals(first, [signal + 2 for signal in second], rng) < 0.001


def test_a_decrease_of_a_rate_is_tested_as_fisher_does():
    for before, after in (((70, 100), (55, 100)), ((70, 100), (85, 100)), ((0, 5), (0, 3))):
        (k, n), (k_after, n_after) = before, after
        table = [[k_after, n_after - k_after], [k, n - k]]
        assert compare_rates(before, after) == pytest.approx(fisher_exact(table, "less").pvalue)
