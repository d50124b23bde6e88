"""A fixed policy for estimated answers: exact returns, the start that they choose, and what stays."""

import json
from copy import copy

import numpy as np
import pytest

from lcorpp.assembly.strategies.fixed_policy import FixedPolicy, sum_rewards
from lcorpp.domains import load_domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.planning import Planner, solve
from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.planner import TransferPlanner


@pytest.fixture(scope="module")
def intention():
    domain = load_domain("intention")
    return domain, Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.1))


def add_noise(tables, noise):
    return (1 - noise) * tables + noise * tables.mean(axis=1, keepdims=True)


def estimate(intention, noise):
    """Return the factory and its planner for noisy answers."""
    fixed = FixedPolicy(intention[1], intention[0])
    dialogue = DomainDialogue(intention[0], fixed)
    return fixed, dialogue.make_planner(add_noise(dialogue.tables, noise))


def reach(planner, start):
    graph = BeliefGraph(planner.pomdp, planner.policy)
    frontier = root = graph.add(SparseBeliefs.of(start[None]))
    while len(frontier):
        known = len(graph)
        graph.expand(frontier)
        frontier = known + np.flatnonzero(~graph.absorbing[known:])
    return graph, int(root[0])


def test_the_return_of_certain_answers_by_hand(intention):
    domain, planner = intention
    graph, root = reach(planner, domain.pomdp.start)
    observation = domain.pomdp.observation.dense.copy()
    observation[:, :4, 2] = 0  # every question is heard ...
    observation[:, [0, 2], :2], observation[:, [1, 3], :2] = [1, 0], [0, 1]  # ... and never misunderstood
    values = sum_rewards(graph, observation)[root]
    belief, cost = domain.pomdp.start, 0.0
    while domain.reported_value(action := planner.action(belief)) is None:
        cost += domain.pomdp.reward[domain.pomdp.action_index(action), 0]
        belief = planner.update(belief, action, "pos")
    assert values[0] == pytest.approx(80 + cost)


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_returns_are_those_of_simulated_people(intention, noise):
    domain, planner = intention
    _, moved = estimate(intention, noise)
    rng, start = np.random.default_rng(2), domain.prior(domain.marginal(domain.pomdp.start))
    graph, root = reach(planner, start)
    returns = sum_rewards(graph, moved.pomdp.observation.dense)[root]
    model = moved.pomdp
    for state in (0, 1):
        sums = []
        for _ in range(1200):
            belief, s, total = start, state, 0.0
            while not domain.is_terminal(belief):
                a = model.action_index(action := planner.action(belief))
                total += model.reward[a, s]
                if domain.reported_value(action) is not None:
                    break
                s = int(rng.choice(len(model.states), p=model.transition.dense[a, s]))
                o = int(rng.choice(len(model.observations), p=model.observation.dense[a, s]))
                belief = planner.update(belief, action, model.observations[o])
            sums.append(total)
        assert abs(np.mean(sums) - returns[state]) < 4 * np.std(sums) / len(sums) ** 0.5 + 1e-9


@pytest.mark.parametrize(
    ("noise", "chance", "min_gain", "max_gain"),
    # answers as stated: the prior is the best start; noisier ones: ask more; much noisier ones: ask nothing
    [(1e-9, 0.5, 0, 0.1), (1e-9, 0.9, 0, 0.1), (0.2, 0.6, 0.4, 1), (0.6, 0.9, 10, 12)],
)
def test_the_start_with_the_largest_return_is_chosen(intention, noise, chance, min_gain, max_gain):
    _, moved = estimate(intention, noise)
    prior = np.array([chance, 1 - chance, 0, 0, 0])
    returns = moved._returns @ prior[:2]
    start = moved.find_start(prior)
    gain = returns[np.abs(moved._starts - start).sum(axis=1).argmin()]
    gain -= returns[np.abs(moved._starts - prior).sum(axis=1).argmin()]
    assert min_gain <= gain <= max_gain
    if noise == 0.2:
        assert start[0] < chance
    if noise == 0.6:
        assert moved.action(prior) == "report_interested" != intention[1].action(prior)


def test_the_policy_stays_and_beliefs_follow_the_estimated_model(intention):
    planner = intention[1]
    _, moved = estimate(intention, 0.5)
    prior = np.array([0.8, 0.2, 0, 0, 0])
    start = moved.find_start(prior)
    assert not np.array_equal(start, prior)
    template = moved
    for _ in range(2):  # each person has a copy
        moved = copy(template)
        action = moved.action(prior)
        assert action == planner.action(start)
        after = moved.update(prior, action, "pos")
        np.testing.assert_array_equal(
            after, TransferPlanner(planner.policy, moved.pomdp).update(prior, action, "pos")
        )
        assert moved.action(after) == planner.action(planner.update(start, action, "pos"))
        assert moved.action(after.copy()) == moved.action(after)  # beliefs are values


def test_a_restored_policy_goes_on_exactly(intention):
    fixed, moved = estimate(intention, 0.4)
    dialogue = DomainDialogue(intention[0], FixedPolicy(intention[1], intention[0]))
    again = dialogue.restore(json.loads(json.dumps(fixed.state())))
    np.testing.assert_array_equal(again._returns, moved._returns)
    np.testing.assert_array_equal(again.pomdp.observation.dense, moved.pomdp.observation.dense)


def test_with_more_values_the_policy_acts_on_the_beliefs_of_the_estimated_model():
    domain = load_domain("museum")
    planner = Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.1))
    _, moved = estimate((domain, planner), 0.5)
    assert isinstance(moved, TransferPlanner)
    assert moved.policy is planner.policy
    assert moved.pomdp is not domain.pomdp
