"""Returns of learnt policies: against the solver's value, simulation, and the truth."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.errors import ModelError
from lcorpp.model_learning import (
    Episodes,
    Step,
    estimate_return,
    format_report,
    learn_model,
    plan_robustly,
)
from lcorpp.model_learning.returns import find_causes
from lcorpp.planning import simulate

from .test_model_learning import make_people


def test_the_estimate_is_the_value_of_the_policy():
    learnt = learn_model(make_people(200, seed=0), reports="bring_{wish}", draws=20)
    found = estimate_return(learnt)
    assert found.solution.lower - 1e-3 <= found.estimate <= found.solution.upper + 1e-6
    own = simulate(learnt.pomdp, found.solution.policy, trials=20_000, seed=0).returns
    assert found.estimate == pytest.approx(own.mean(), abs=4 * own.std() / np.sqrt(len(own)))
    assert found.unfollowed < 0.01


def test_draws_are_returns_in_other_models():
    """The policy of the estimate is simulated in one of the draws."""
    learnt = learn_model(make_people(60, seed=1), reports="bring_{wish}", draws=3)
    found = estimate_return(learnt)
    world = replace(learnt, planned=learnt.draws[1]).pomdp
    own = simulate(learnt.pomdp, found.solution.policy, world=world, trials=20_000, seed=0).returns
    assert found.drawn[1] == pytest.approx(own.mean(), abs=4 * own.std() / np.sqrt(len(own)))


def test_the_interval_covers_the_true_return():
    """Of 15 data sets with 100 people; the truth by the policy in the true model."""
    covered = 0
    for seed in range(15):
        learnt = learn_model(make_people(100, seed=100 + seed), reports="bring_{wish}", draws=60)
        found = estimate_return(learnt)
        truth = make_truth(learnt)
        true = simulate(learnt.pomdp, found.solution.policy, world=truth, trials=4000, seed=0).mean
        covered += found.low <= true <= found.high
    assert covered >= 12


def make_truth(learnt):
    """Return the model of `make_people` in the learnt order."""
    own, episodes = learnt.model.parameters, learnt.episodes
    ask, tea = episodes.action_names.index("ask"), learnt.states.index("tea")
    start = np.where(np.arange(2) == tea, 0.7, 0.3)
    observation, transition = own.observation.copy(), own.transition.copy()
    for k, wish in enumerate(learnt.states):
        other = {"tea": "milk", "milk": "tea"}[wish]
        observation[ask, k] = 0.0
        observation[ask, k, episodes.observation_names.index(f"hear_{wish}")] = 0.85
        observation[ask, k, episodes.observation_names.index(f"hear_{other}")] = 0.15
    transition[ask] = np.eye(2, 3)
    values = list(episodes.reward_values)
    reward = np.zeros_like(own.reward)
    reward[ask, :, values.index(-1.0)] = 1.0
    for action, name in enumerate(episodes.action_names):
        for k, wish in enumerate(learnt.states):
            if name != "ask":
                reward[action, k, values.index(10.0 if name == f"bring_{wish}" else -10.0)] = 1.0
                transition[action, k] = [0, 0, 1]
    true = replace(own, start=start, observation=observation, transition=transition, reward=reward)
    return replace(learnt, planned=true).pomdp


def test_a_certain_world_is_in_the_interval():
    """Where nothing is left to chance, most draws are worse than the truth; the interval has it still."""
    steps = [Step("push", "open", 0.0), Step("go", "out", 1.0)]
    wrong = [Step("go", "shut", 0.0), Step("push", "open", 0.0), Step("go", "out", 1.0)]
    learnt = learn_model(Episodes.of([steps, wrong] * 40, [True] * 80))
    found = estimate_return(learnt)
    assert np.median(found.drawn) < 0.95
    assert found.low < 0.95 <= found.high


def test_a_robust_plan_has_the_better_quantile():
    learnt = learn_model(make_people(25, seed=3), reports="bring_{wish}", draws=60)
    robust = plan_robustly(learnt, 0.1)
    one, other = (np.quantile(estimate_return(own).drawn, 0.1) for own in (learnt, robust))
    assert other >= one - 1e-6
    with pytest.raises(ModelError, match=r"the quantile is 1\.5; expected a number between 0 and 1"):
        plan_robustly(learnt, 1.5)


def test_what_the_spread_depends_on_is_named():
    """Rewards are known, answers are few: the return depends on the answers."""
    learnt = learn_model(make_people(60, seed=4), reports="bring_{wish}")
    report = format_report(learnt, estimate_return(learnt))
    assert "## Return" in report
    assert report.partition("record more steps that show them:\n\n- ")[2].startswith("observations of ask: ")


def test_numbers_without_effect_do_not_hide_the_cause():
    """The return follows one rate; four others that nothing determines vary more."""
    learnt = learn_model(make_people(60, seed=5), reports="bring_{wish}", draws=1)
    rng, own = np.random.default_rng(0), learnt.model.parameters
    ask, tea = learnt.episodes.action_names.index("ask"), learnt.states.index("tea")
    draws, returns = [], []
    for _ in range(100):
        start, observation = own.start.copy(), own.observation.copy()
        start[:] = rng.dirichlet(np.ones(len(start)))
        observation[:, 1 - tea] = rng.dirichlet(np.ones(observation.shape[2]), size=len(observation))
        rate = rng.normal(0.8, 0.02)
        observation[ask, tea] = [rate, 1 - rate, 0]
        draws.append(replace(own, start=start, observation=observation))
        returns.append(10 * rate)
    causes = find_causes(replace(learnt, draws=tuple(draws)), np.array(returns))
    assert [name for name, _ in causes] == ["observations of ask"]
    assert causes[0][1] > 0.7
