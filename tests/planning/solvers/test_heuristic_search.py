from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from lcorpp.errors import ModelError, ObservationError, PolicyError
from lcorpp.planning import parse_pomdp, solve
from lcorpp.planning.solvers import heuristic_search as online
from lcorpp.planning.solvers.exact.value_iteration import solve_exact
from lcorpp.planning.solvers.heuristic_search import OnlinePlanner
from tests.planning.models import LCORPP, TIGER, pomdps
from tests.planning.sarsop.kernels import random_model
from tests.planning.sarsop.questions import exchangeable_values, values_without_end
from tests.planning.solvers.brute_force import corners, earned

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)


def test_the_authors_first_steps():
    planner, belief = OnlinePlanner(lcorpp, seconds=600, precision=1e-2), np.array([0.22, 0.78, 0, 0, 0])
    for action in ("move_forward", "move_forward", "greet"):
        assert planner.action(belief) == action
        belief = planner.update(belief, action, "pos")
    assert planner.action(belief) == "report_interested"


def test_bounds_contain_the_value():
    result = OnlinePlanner(lcorpp, seconds=600, precision=1e-2).search(lcorpp.start)
    assert 51.64 <= result.lower <= 51.657
    assert 51.656 <= result.upper <= 51.67


def test_a_repeated_search_needs_no_trials():
    planner = OnlinePlanner(tiger, seconds=600, precision=0.1)
    assert planner.search(tiger.start).trials > 0
    assert planner.search(tiger.start).trials == 0


@given(pomdps(discounts=(0.5, 0.8)))
@settings(max_examples=6)
def test_exact_is_between_the_bounds(pomdp):
    planner, exact = OnlinePlanner(pomdp, trials=5), solve_exact(pomdp, precision=1e-3, time_limit=1)
    for belief in (pomdp.start, *corners(pomdp)):
        result = planner.search(belief)
        assert result.lower <= exact.policy.upper_bound.value(belief) + 1e-9
        assert result.upper >= exact.policy.value(belief) - 1e-9


@given(pomdps(discounts=(0.3, 0.5)))
@settings(max_examples=7)
def test_searching_at_every_step_earns_the_lower_bound(pomdp):
    planner, steps = OnlinePlanner(pomdp, trials=3), 4
    low = planner.search(pomdp.start).lower
    most = pomdp.discount**steps / (1 - pomdp.discount) * pomdp.reward.max()
    got = earned(pomdp, lambda belief, _: planner.search(belief / belief.sum()).action, pomdp.start, steps)
    assert got + most >= low - 1e-9


def test_equal_calls_have_equal_results():
    answers = []
    for _ in range(2):
        planner = OnlinePlanner(lcorpp, trials=4, seconds=60)
        result = [planner.search(belief) for belief in (lcorpp.start, np.array([0.5, 0.5, 0, 0, 0]))]
        answers.append([(each.action, each.lower, each.upper, each.trials) for each in result])
    assert answers[0] == answers[1]


def test_a_search_of_fixed_work_depends_on_the_belief_alone():
    beliefs = [lcorpp.start, np.array([0.5, 0.5, 0, 0, 0]), np.array([0.1, 0.2, 0.3, 0.4, 0])]
    answers = []
    for order in ((0, 1, 2), (2, 1, 0)):
        planner = OnlinePlanner(lcorpp, work=200_000, policy=solve(lcorpp, precision=5).policy)
        found = {i: planner.search(beliefs[i]) for i in order}
        answers.append([(found[i].action, found[i].lower, found[i].upper, found[i].trials) for i in range(3)])
    assert answers[0] == answers[1]


@pytest.mark.parametrize("seed", range(4))
def test_no_search_of_fixed_work_changes_another(seed):
    pomdp = random_model(seed, hidden=4, signals=3)
    beliefs = np.random.default_rng(seed).dirichlet(np.ones(4), size=3)
    answers = []
    for order in ((0, 1, 2), (2, 1, 0)):
        planner = OnlinePlanner(pomdp, work=100_000)
        found = {i: planner.search(beliefs[i]) for i in order}
        answers.append([(found[i].action, found[i].lower, found[i].upper, found[i].trials) for i in range(3)])
    assert answers[0] == answers[1]


def test_the_work_of_a_search_is_limited():
    pomdp = exchangeable_values((4, 4), discount=0.95)
    for work in (10_000, 1_000_000):
        planner = OnlinePlanner(pomdp, work=work, precision=1e-3)
        planner.search(pomdp.start)
        assert planner._bounds.tree.work < work + 1_000_000  # the last path is not cut


def test_a_search_of_fixed_work_ends_under_a_slow_discount():
    pomdp = values_without_end(3, 0.9, 0.999)
    planner = OnlinePlanner(pomdp, work=1_000_000)
    found = planner.search(pomdp.start)
    assert solve(pomdp, precision=5000).lower <= found.upper


def test_an_interrupted_search_is_made_again(monkeypatch):
    planner = OnlinePlanner(lcorpp, work=200_000)
    sample = online.Trials.sample

    def interrupt(trials, max_work):
        if trials._search.trials == 3:
            raise KeyboardInterrupt
        sample(trials, max_work)

    monkeypatch.setattr(online.Trials, "sample", interrupt)
    assert planner.search(lcorpp.start).trials == 3
    monkeypatch.setattr(online.Trials, "sample", sample)
    assert planner.search(lcorpp.start).trials > 3


def test_a_search_that_begins_with_a_policy_earns_no_less():
    policy = solve(lcorpp, precision=5).policy
    planner = OnlinePlanner(lcorpp, work=200_000, policy=policy)
    best = solve(lcorpp).policy
    for belief in (lcorpp.start, np.array([0.5, 0.5, 0, 0, 0]), np.array([0.9, 0.1, 0, 0, 0])):
        found = planner.search(belief)
        assert policy.value(belief) - 1e-9 <= found.lower <= found.upper
        assert best.value(belief) - 1e-9 <= found.upper


def test_more_work_gives_closer_bounds():
    few, many = (OnlinePlanner(lcorpp, work=work).search(lcorpp.start) for work in (1, 2_000_000))
    assert many.upper - many.lower < 0.1 * (few.upper - few.lower)


def test_a_reset_keeps_the_bounds(monkeypatch):
    planner = OnlinePlanner(lcorpp, seconds=600, precision=1e-2)
    before = planner.search(lcorpp.start)
    monkeypatch.setattr(online, "MAX_NODES", 0)
    after = planner.search(lcorpp.start)
    assert after.lower >= before.lower - 1e-9
    assert after.upper <= before.upper + 1e-2
    assert after.trials <= before.trials


def test_bad_arguments():
    for arguments in ({"seconds": 0}, {"precision": -1}, {"preparation": 0}):
        with pytest.raises(ModelError, match=r"expected a .*positive number"):
            OnlinePlanner(tiger, **arguments)
    with pytest.raises(ModelError, match="trials must be an integer of at least 1, not 0"):
        OnlinePlanner(tiger, trials=0)
    with pytest.raises(ModelError, match="work must be an integer of at least 1, not 0"):
        OnlinePlanner(tiger, work=0)
    with pytest.raises(PolicyError):
        OnlinePlanner(tiger, policy=solve(lcorpp, precision=5).policy)
    planner = OnlinePlanner(tiger, trials=1)
    with pytest.raises(ModelError, match="not a distribution"):
        planner.action(np.array([0.5, 0.6]))
    with pytest.raises(ModelError, match="unknown action 'dance'"):
        planner.update(planner.start, "dance", "tiger-left")
    with pytest.raises(ObservationError):
        OnlinePlanner(lcorpp, trials=1).update(np.array([1.0, 0, 0, 0, 0]), "greet", "none")
