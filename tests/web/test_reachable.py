"""A policy without the alpha vectors that no decision uses acts as the whole one."""

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.assembly.solving import solve_domain
from lcorpp.planning.belief import observation_probabilities, update
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.web import reachable
from lcorpp.web.reachable import prune_policy


@pytest.fixture(scope="module", params=["museum", "shopping"])
def solved(request):
    """A domain with its policy: of one set of vectors, or of several."""
    domain = load_domain(request.param, preset="small" if request.param == "shopping" else None)
    solution = solve_domain(domain, domain.planning.solver, any_prior=True, cache=find_cache_folder())
    return domain, solution.policy


def make_priors(domain, count, seed=0):
    shared = np.random.default_rng(seed).dirichlet(np.ones(len(domain.values)), count)
    return shared @ domain.planning.initial_states


def walk(domain, policy, belief, rng):
    """Yield the beliefs of a dialogue with arbitrary answers, up to the report."""
    pomdp = domain.pomdp
    while not domain.is_terminal(belief):
        yield belief
        action = policy.action(belief)
        if pomdp.actions[action] in domain.planning.reports:
            return
        possible = np.flatnonzero(observation_probabilities(pomdp, belief, action) > 1e-9)
        belief = update(pomdp, belief, action, int(rng.choice(possible)))


def test_the_same_actions_and_values_at_reachable_beliefs(solved):
    domain, policy = solved
    priors, rng = make_priors(domain, 4), np.random.default_rng(1)
    pruned = prune_policy(domain, policy, priors)
    assert len(pruned) < len(policy) / 2
    beliefs = [belief for _ in range(25) for prior in priors for belief in walk(domain, policy, prior, rng)]
    for belief in beliefs:
        assert pruned.action(belief) == policy.action(belief)
        assert pruned.value(belief) == pytest.approx(policy.value(belief), abs=1e-12)


def test_values_of_all_actions_at_probable_beliefs(solved):
    domain, policy = solved
    priors = make_priors(domain, 4)
    pruned = prune_policy(domain, policy, priors)
    for prior in priors:
        for a, name in enumerate(domain.pomdp.actions):
            if name not in domain.planning.reports:
                for o in np.flatnonzero(observation_probabilities(domain.pomdp, prior, a) > 1e-9):
                    after = update(domain.pomdp, prior, a, int(o))
                    assert pruned.value(after) == pytest.approx(policy.value(after), abs=1e-12)


def test_fewer_beliefs_give_a_lower_bound(solved, monkeypatch):
    domain, policy = solved
    priors = make_priors(domain, 4)
    whole = prune_policy(domain, policy, priors)
    monkeypatch.setattr(reachable, "MAX_BELIEFS", 4)
    pruned = prune_policy(domain, policy, priors)
    assert 1 <= len(pruned) < len(whole)
    for belief in make_priors(domain, 50, seed=2):
        assert pruned.value(belief) <= policy.value(belief) + 1e-9
    assert all(pruned.action(prior) == policy.action(prior) for prior in priors)
