"""Search by bounded amounts of work: the same result as in one go, and within the bounds of the solver."""

from math import inf

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.errors import PolicyError
from lcorpp.planning import Planner, solve
from lcorpp.planning.planner import TransferPlanner
from lcorpp.planning.sarsop.paced_search import PacedSearch


@pytest.fixture(scope="module")
def problem():
    domain = load_domain("intention")
    return domain.pomdp, domain.start_beliefs()


def test_instalments_give_the_policy_of_one_search(problem):
    pomdp, starts = problem
    one, parts = PacedSearch(pomdp, starts, 0.1), PacedSearch(pomdp, starts, 0.1)
    one.advance()
    calls = 0
    while not parts.converged:
        before, trials = parts.work, parts.trials
        parts.advance(work=5000)
        calls += 1
        assert parts.converged or parts.work - before >= 5000
        assert 0 < parts.trials - trials <= 5  # a trial counts as at least 1000
    assert calls > 3
    assert one.converged
    assert (one.trials, one.work, one.gap) == (parts.trials, parts.work, parts.gap)
    np.testing.assert_array_equal(one.make_policy().vectors, parts.make_policy().vectors)
    again = PacedSearch(pomdp, starts, 0.1)
    again.advance(trials=7)
    assert again.trials == 7
    again.advance(trials=7)
    assert again.trials == 7


def test_the_policy_is_as_good_as_that_of_the_solver(problem):
    pomdp, starts = problem
    search = PacedSearch(pomdp, starts, 0.1)
    search.advance()
    policy, solution = search.make_policy(), solve(pomdp, starts, precision=1e-3)
    for start in starts:
        assert solution.policy.value(start) - policy.value(start) <= 0.1 + 1e-9
        assert policy.gap(start) <= 0.1 + 1e-9


def test_the_improvement_estimates_the_loss_long_before_the_gap_does(problem):
    pomdp, starts = problem
    best, search = solve(pomdp, starts, precision=1e-3).policy, PacedSearch(pomdp, starts, 0.01)
    search.advance(trials=2 * len(starts) - 1)
    assert search.improvement == inf
    lower_bounds = []
    for doublings in (1, 2):
        search.advance(trials=2**doublings * len(starts))
        policy = search.make_policy()
        lower_bounds.append(np.array([policy.value(start) for start in starts]))
        loss = max(best.value(start) - policy.value(start) for start in starts)
        assert loss <= search.improvement + 1e-3
        assert search.improvement < search.gap / 3
    assert search.improvement == pytest.approx((lower_bounds[1] - lower_bounds[0]).max(), abs=1e-9)


def test_ctrl_c_interrupts_and_the_search_goes_on(problem, monkeypatch):
    search = PacedSearch(*problem, 0.1)
    search.advance(trials=3)

    def interrupt(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(search._search, "sample", interrupt)
        with pytest.raises(KeyboardInterrupt):
            search.advance()
    search.advance()
    assert search.converged


def test_a_policy_acts_on_the_beliefs_of_another_model(problem):
    pomdp, starts = problem
    policy = solve(pomdp, starts, precision=0.1).policy
    museum = load_domain("museum").pomdp
    with pytest.raises(PolicyError, match="names"):
        TransferPlanner(policy, museum)
    planner = TransferPlanner(policy, pomdp)
    for start in starts:
        assert planner.action(start) == Planner(policy, pomdp).action(start)
