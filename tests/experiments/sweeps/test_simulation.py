"""Exact and simulated scores agree in random configurations, and the intervals cover as often as they say."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.experiments.sweeps.axes import Problem, Setting, hash_domain
from lcorpp.experiments.sweeps.evaluation import evaluate_configuration
from lcorpp.values import Z95

RANGES = {
    ("noise",): (0.05, 0.45),
    ("discount",): (0.9, 0.99),
    ("cost", "greet"): (0.5, 6),
    ("reward", "wrong"): (-120, -40),
    ("classifier", "interested"): (0.5, 0.95),
    ("true", "classifier", "not_interested"): (0.5, 0.95),
    ("prevalence", "interested"): (0.2, 0.8),
    ("known", "pr", "time=morning|identity=professor"): (0.5, 0.85),
}
EXACT = Problem(
    "intention", "paper", ("P", "L+R", "R+P", "LCORPP"), None, 0, hash_domain(load_domain("intention"))
)


def find_errors(count: int, trials: int) -> np.ndarray:
    """Return how many standard errors the simulated means are from the exact ones, in random configurations.

    The means are the accuracy, cost and return of each strategy, and the differences to the next one.
    """
    rng, errors = np.random.default_rng(14), []
    for _ in range(count):
        axes = rng.permutation(len(RANGES))[: rng.integers(1, 5)]
        pairs = [list(RANGES.items())[k] for k in axes]
        configuration = tuple(Setting(axis, round(rng.uniform(*ends), 4)) for axis, ends in pairs)
        exact = evaluate_configuration(EXACT, configuration)
        simulated = evaluate_configuration(replace(EXACT, trials=trials), configuration)
        for true, row in zip(exact, simulated, strict=True):
            for name in ("cost", "return", "cost_difference", "return_difference"):
                if row[name] is not None:
                    width = (row[f"{name}_high"] - row[f"{name}_low"]) / (2 * Z95)
                    if width:  # else there are no actions before the report, hence no cost
                        errors.append((row[name] - true[name]) / width)
    return np.array(errors)


def test_simulated_means_are_near_the_exact_ones():
    assert np.abs(find_errors(5, 200)).max() <= 4


@pytest.mark.slow
def test_intervals_cover_in_200_random_configurations():
    """Show 2: normal errors beyond 4 have a chance of 6e-5 each; the coverage has a standard error of .4 %.

    With few people the intervals are too narrow where wrong reports are rare.
    """
    errors = find_errors(200, 2000)
    assert len(errors) > 2000
    assert np.abs(errors).max() <= 4
    assert 0.93 <= np.mean(np.abs(errors) <= Z95) <= 0.97
