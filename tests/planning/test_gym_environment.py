from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import ModelError
from lcorpp.planning import Policy, parse_pomdp, update
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from tests.planning.models import LCORPP, TIGER

gymnasium = pytest.importorskip("gymnasium", reason="gymnasium is not installed: pip install 'lcorpp[gym]'")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from lcorpp.planning.gym_environment import ID, PomdpEnvironment  # noqa: E402

FREE = "".join(f"R: {a} : term : * : * 0\n" for a in ("move_forward", "greet", "turn"))
tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP + FREE)


@pytest.mark.parametrize("options", [{}, {"render_mode": "ansi"}])
@pytest.mark.parametrize("pomdp", [tiger, lcorpp], ids=["tiger", "the authors' model"])
def test_gymnasium_env_checker_passes(pomdp, options):
    check_env(gymnasium.make(ID, pomdp=pomdp, **options).unwrapped)


def test_an_episode_follows_bayes_rule_and_the_rewards():
    world = PomdpEnvironment(lcorpp, render_mode="ansi")
    nothing, info = world.reset(seed=4)
    assert nothing == len(lcorpp.observations)
    assert info["belief"] == pytest.approx(lcorpp.start)
    belief = lcorpp.start
    for action in (1, 0, 1, 3):
        state = info["state"]
        observation, reward, terminated, truncated, info = world.step(np.int64(action))
        assert world.observation_space.contains(observation)
        assert reward == lcorpp.reward[action, state]
        assert lcorpp.transition[action, state, info["state"]] > 0
        belief = update(lcorpp, belief, action, int(observation))
        assert info["belief"] == pytest.approx(belief)
        assert not truncated
        assert terminated == (info["state"] == 4)
        if terminated:
            break
    assert terminated
    assert world.render().endswith("observed none, now in term")


def test_a_state_with_costs_is_not_terminal():
    world = PomdpEnvironment(parse_pomdp(LCORPP))
    world.reset(seed=0)
    assert not world.step(3)[2]


def test_the_same_seed_gives_the_same_episode():
    def episode(seed):
        world = PomdpEnvironment(tiger)
        world.reset(seed=seed)
        return [tuple(world.step(a % 3)[:2]) for a in range(40)]

    assert episode(3) == episode(3)
    assert episode(3) != episode(4)


def test_returns_agree_with_policy_evaluation():
    doors = Policy.of(tiger, [[0.0, 0.0], [-90.0, 10.0], [10.0, -90.0]], [0, 1, 2])
    world, returns = PomdpEnvironment(tiger), []
    world.reset(seed=1)
    for _ in range(150):
        _, info = world.reset()
        total = 0.0
        for step in range(60):
            _, reward, _, _, info = world.step(doors.action(info["belief"]))
            total += 0.95**step * reward
        returns.append(total)
    exact = evaluate(tiger, doors).interval.estimate
    # five standard errors, plus the truncation after 60 steps of at most 200
    assert abs(np.mean(returns) - exact) < 5 * np.std(returns) / 150**0.5 + 0.95**60 * 200


def test_reset_uses_the_given_start_and_copies_the_belief():
    world = PomdpEnvironment(tiger, [1.0, 0.0])
    _, info = world.reset(seed=0)
    assert (info["state"], info["belief"].tolist()) == (0, [1.0, 0.0])
    info["belief"][:] = 0.5
    assert world.reset()[1]["belief"].tolist() == [1.0, 0.0]


def test_invalid_use():
    world = PomdpEnvironment(tiger)
    with pytest.raises(ModelError, match="call reset before the first step"):
        world.step(0)
    world.reset(seed=0)
    with pytest.raises(ModelError, match="an action is a whole number from 0 to 2, not 3"):
        world.step(3)
    with pytest.raises(ModelError, match=r"unknown options \['speed'\]"):
        world.reset(options={"speed": 1})
    with pytest.raises(ModelError, match="the render mode is None or 'ansi', not 'human'"):
        PomdpEnvironment(tiger, render_mode="human")
    with pytest.raises(ModelError, match="is not a distribution"):
        PomdpEnvironment(tiger, [0.5, 0.6])
