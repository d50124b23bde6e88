"""Tests and intervals of the audit have the stated rates if the knowledge is right."""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from lcorpp.audit.audit import audit_people
from lcorpp.audit.intervals import match_chi_squared
from lcorpp.audit.logged_people import read_people
from lcorpp.decision import strategies
from lcorpp.domains import load_domain
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.planning.policy_cache import find_cache_folder


def test_equal_weights_are_a_scaled_chi_squared_variable():
    assert match_chi_squared(np.ones(3)) == (1, 3)
    assert match_chi_squared(np.full(2, 2.5)) == (2.5, 2)


def test_a_weighted_sum_exceeds_the_quantile_of_its_match_as_often_as_stated():
    weights = np.array([3.0, 1.0, 1.0, 0.5])
    scale, degrees = match_chi_squared(weights)
    drawn = np.random.default_rng(0).chisquare(1, (100_000, 4)) @ weights
    for level in (0.1, 0.05):  # two moments are matched; at .01 the match is a quarter too low
        assert (drawn > scale * chi2.isf(level, degrees)).mean() == pytest.approx(level, rel=0.1)


@pytest.mark.slow  # 200 logs of 500 people
def test_p_values_and_intervals_of_right_knowledge(tmp_path: Path):
    """An attribute of six weakly determined numbers, too; 200 logs have a standard error of 1.5 %."""
    domain, cache = load_domain("intention"), find_cache_folder()
    p_values, covered, changes = dict[str, list[float]](), list[bool](), 0
    for seed in range(200):
        log = tmp_path / f"{seed}"
        options = ComparisonOptions(
            strategies(["LCORPP"]), trials=500, seed=10_000 + seed, log=log, cache=cache
        )
        compare_strategies(domain, options)
        result = audit_people(read_people(log))
        changes += bool(result.changes)
        for attribute in result.attributes:
            p_values.setdefault(attribute.name, []).append(attribute.p_value)
        for x in result.numbers:
            if x.interval is not None:
                covered.append(x.interval[0] <= x.stated <= x.interval[1])
    assert {len(own) for own in p_values.values()} == {200}
    for name, own in p_values.items():
        assert np.mean(np.array(own) < 0.05) <= 0.095, name  # 3 standard errors above .05
        assert np.mean(np.array(own) < 0.5) == pytest.approx(0.5, abs=0.12), name
    assert 0.93 < np.mean(covered) < 0.97
    assert changes <= 6  # of 200, at a level of 1 %: 3 standard errors above
