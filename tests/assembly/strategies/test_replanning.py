"""Policies for estimated models: when they are computed, what acts meanwhile, and going on from a state."""

import json

import numpy as np
import pytest

from lcorpp.assembly.strategies import replanning
from lcorpp.assembly.strategies.replanning import MAX_VARIATION, Replanner
from lcorpp.domains import load_domain
from lcorpp.domains.dialogue import DomainDialogue
from lcorpp.planning import Planner, solve


@pytest.fixture(scope="module")
def intention():
    domain = load_domain("intention")
    return domain, Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.1))


def make(intention):
    domain, planner = intention
    dialogue = DomainDialogue(domain)
    dialogue.planners = Replanner(planner, domain.start_beliefs(), 0.1, dialogue.tables)
    return dialogue, dialogue.planners


def add_noise(tables, noise):
    return (1 - noise) * tables + noise * tables.mean(axis=1, keepdims=True)


def test_the_stated_policy_acts_within_the_tolerance(intention):
    dialogue, _ = make(intention)
    assert dialogue.make_planner(dialogue.tables).policy is intention[1].policy
    near = dialogue.make_planner(add_noise(dialogue.tables, MAX_VARIATION))
    assert near.policy is intention[1].policy
    # beliefs are those of the present model
    start = intention[0].pomdp.start
    after, stated = (planner.update(start, "greet", "pos") for planner in (near, intention[1]))
    assert 0 < np.abs(after - stated).max() < MAX_VARIATION


def test_the_policy_of_the_estimated_model_takes_over(intention, monkeypatch):
    monkeypatch.setattr(replanning, "WORK_PER_PERSON", 2000)
    dialogue, replan = make(intention)
    tables = add_noise(dialogue.tables, 0.5)
    calls = 1
    while (planner := dialogue.make_planner(tables)).policy is intention[1].policy:
        calls += 1
    assert calls > 3
    domain = intention[0]
    variation = np.abs(planner.pomdp.observation.dense - domain.pomdp.observation.dense).sum(axis=2).max() / 2
    assumed_loss = 0.16 + variation / 3 * np.ptp(domain.pomdp.reward)
    starts = domain.start_beliefs()
    best = solve(planner.pomdp, starts, precision=0.01)
    losses = [best.policy.value(start) - planner.policy.value(start) for start in starts]
    assert max(losses) <= assumed_loss / 2 < max(map(planner.policy.gap, starts))  # good long before proven
    while replan.state()["trials"] is not None:
        planner = dialogue.make_planner(tables)
    assert max(map(planner.policy.gap, starts)) <= 0.161
    for start in starts:
        assert planner.policy.value(start) >= best.policy.value(start) - 0.161
    assert dialogue.make_planner(tables) is planner


def test_a_search_that_takes_too_long_is_given_up(intention, monkeypatch):
    monkeypatch.setattr(replanning, "WORK_PER_PERSON", 100)
    monkeypatch.setattr(replanning, "MAX_SEARCH_WORK", 300)
    dialogue, replan = make(intention)
    for _ in range(20):
        planner = dialogue.make_planner(add_noise(dialogue.tables, 0.5))
    assert planner.policy is intention[1].policy
    assert replan.state()["trials"] is None


def test_a_usable_policy_acts_though_its_search_ends_without_the_precision(intention, monkeypatch):
    monkeypatch.setattr(replanning, "WORK_PER_PERSON", 2000)
    monkeypatch.setattr(replanning, "PRECISION_SHARE", 1e-9)
    domain, stated = intention
    dialogue = DomainDialogue(domain)
    replan = dialogue.planners = Replanner(stated, domain.start_beliefs(), 1e-9, dialogue.tables)
    tables = add_noise(dialogue.tables, 0.5)
    monkeypatch.setattr(replanning, "MAX_SEARCH_WORK", 100_000)
    planner = dialogue.make_planner(tables)
    while replan.state()["trials"] is not None:
        planner = dialogue.make_planner(tables)
    best = solve(planner.pomdp, domain.start_beliefs(), precision=0.01)
    for start in domain.start_beliefs():
        loss = best.policy.value(start) - planner.policy.value(start)
        assert loss <= 0.01 * np.ptp(domain.pomdp.reward)  # half of .07, the variation, a third
    assert max(map(planner.policy.gap, domain.start_beliefs())) > 1e-9


@pytest.mark.parametrize("n_before", [1, 4, 12, 30])
def test_a_restored_replanner_goes_on_exactly(intention, monkeypatch, n_before):
    monkeypatch.setattr(replanning, "WORK_PER_PERSON", 5000)
    dialogue, replan = make(intention)
    tables = [add_noise(dialogue.tables, noise) for noise in np.repeat([0.0, 0.3, 0.31, 0.6], 10)]
    for each in tables[:n_before]:
        dialogue.make_planner(each)
    state = json.loads(json.dumps(dialogue.state()))
    restored, _ = make(intention)
    planner = restored.restore(state)
    beliefs = [np.array([p, 1 - p, 0, 0, 0]) for p in np.linspace(0.01, 0.99, 50)]
    assert [planner.action(b) for b in beliefs] == [replan.planner.action(b) for b in beliefs]
    for each in tables[n_before:]:
        one, two = dialogue.make_planner(each), restored.make_planner(each)
        np.testing.assert_array_equal(one.policy.vectors, two.policy.vectors)
        np.testing.assert_array_equal(one.pomdp.observation.dense, two.pomdp.observation.dense)
    assert dialogue.state() == restored.state()
