"""Show 5 in small: the policy earns more than deciding at a quarter, and than waiting for the whole track."""

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.early_decision.comparison import (
    choose_best,
    score_rules,
    score_watching,
    simulate_study,
)
from lcorpp.early_decision.evaluation import EarlyReturns


def test_the_best_variant_depends_on_the_cost():
    variants = [
        EarlyReturns(np.array([50.0]), np.array([1.0])),
        EarlyReturns(np.array([52.0]), np.array([5.0])),
    ]
    assert [float(choose_best(variants, cost)[0]) for cost in (0.1, 1.0)] == [51.5, 49.0]


@pytest.mark.slow
def test_the_policy_earns_more_than_a_quarter_and_the_whole_track():
    study = simulate_study(load_domain("intention", preset="paper"), 7, tracks=800, people=300)
    rules = score_rules(study)
    policy = score_watching(study, 1.0).subtract_cost(1.0)
    for rule in ("quarter", "whole"):
        difference = policy - choose_best(rules[rule], 1.0)
        assert difference.mean() > 1.96 * difference.std() / np.sqrt(len(difference))
