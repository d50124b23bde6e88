from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from lcorpp.errors import ModelError, ObservationError
from lcorpp.planning import Planner, parse_pomdp, solve
from lcorpp.planning.belief import update
from lcorpp.planning.solvers.exact.value_iteration import solve_exact
from lcorpp.planning.solvers.pomcp import ParticlePlanner, PomcpPlanner
from lcorpp.planning.solvers.pomcp.simulator import LEAF_VALUES, TableSimulator
from tests.planning.models import LCORPP, TIGER

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)


def mean_return(pomdp, act, *, trials: int, steps: int, seed: int = 0) -> float:
    """The mean discounted reward of simulated trials."""
    world, rng, earned = TableSimulator(pomdp, seed=seed), np.random.default_rng(seed), 0.0
    for _ in range(trials):
        belief = pomdp.start
        state = int(rng.choice(len(belief), p=belief))
        for step in range(steps):
            action = act(belief)
            state, observation, reward = world.step(state, action)
            earned += pomdp.discount**step * reward
            belief = update(pomdp, belief, action, observation)
    return earned / trials


def remember(planner):
    """The planner's actions, with one search per belief."""
    known = {}

    def act(belief):
        key = np.round(belief, 6).tobytes()
        if key not in known:
            known[key] = planner.search(belief).action
        return known[key]

    return act


def test_the_tiger_is_solved_nearly_optimally():
    exact = solve_exact(tiger).policy
    optimal = mean_return(tiger, exact.action, trials=100, steps=50)
    found = mean_return(tiger, remember(PomcpPlanner(tiger, seed=1)), trials=100, steps=50)
    rng = np.random.default_rng(0)
    blind = mean_return(tiger, lambda belief: int(rng.integers(3)), trials=25, steps=50)
    assert blind < -300
    # equal random numbers for both; the standard error of either is below 3
    assert found > optimal - 5


def test_certain_beliefs_have_the_obvious_actions():
    planner = PomcpPlanner(tiger)
    assert planner.action(np.array([0.5, 0.5])) == "listen"
    assert planner.action(np.array([1.0, 0.0])) == "open-right"
    assert planner.action(np.array([0.0, 1.0])) == "open-left"


def test_values_of_many_simulations_approach_known_values():
    """With a fully observed state the values are known: reward 1 in every step, or 2 once."""
    text = "discount: 0.9\nvalues: reward\nstates: s end\nactions: a b\nobservations: o\nstart: s\n"
    text += "T: a identity\nT: b\n0 1\n0 1\nO: * uniform\nR: a : s : * : * 1\nR: b : s : * : * 2\n"
    result = PomcpPlanner(parse_pomdp(text), simulations=4000).search(np.array([1.0, 0]))
    # always a has value 10, b ends with reward 2
    assert result.values[1] == pytest.approx(2)
    assert result.values[0] == pytest.approx(10, rel=0.1)
    assert result.action == 0
    assert result.simulations == result.visits.sum() == 4000


def test_a_search_continues_in_its_tree():
    planner = PomcpPlanner(tiger, simulations=1000)
    assert planner.search(tiger.start).simulations == 1000
    assert planner.search(tiger.start).simulations == 0
    after = planner.update(tiger.start, "listen", "tiger-left")
    assert 0 < planner.search(after).simulations < 1000
    assert planner.search(np.array([0.3, 0.7])).simulations == 1000


def test_equal_seeds_have_equal_results():
    looks = [PomcpPlanner(lcorpp, simulations=500, seed=seed).search(lcorpp.start) for seed in (1, 1, 2)]
    assert np.array_equal(looks[0].values, looks[1].values)
    assert not np.array_equal(looks[0].values, looks[2].values)


def test_it_satisfies_the_planner_protocol():
    planner, other = (
        PomcpPlanner(lcorpp, simulations=50),
        Planner(solve(lcorpp)),
    )
    assert np.array_equal(planner.start, other.start)
    after = planner.update(planner.start, "move_forward", "pos")
    assert after == pytest.approx(other.update(other.start, "move_forward", "pos"))
    assert planner.action(after) in lcorpp.actions


def test_the_time_limit_ends_a_search():
    result = PomcpPlanner(tiger, simulations=10**9, seconds=0.05).search(tiger.start)
    assert 0 < result.simulations < 10**9


def test_leaf_values_of_the_mdp_and_of_random_actions():
    assert LEAF_VALUES["mdp"](tiger) == pytest.approx([200, 200], abs=0.2)
    # random actions: (-1 + 10 - 100) / 3 in each of 20 discounted steps
    assert LEAF_VALUES["random"](tiger) == pytest.approx([-91 / 3 * 20] * 2, abs=0.2)


def test_a_simulator_draws_from_the_tables():
    world = TableSimulator(tiger, seed=5)
    heard = [world.step(0, 0) for _ in range(4000)]
    assert {(state, reward) for state, _, reward in heard} == {(0, -1.0)}
    # the standard error of a share of .85 in 4000 is .006
    assert np.mean([observation == 0 for _, observation, _ in heard]) == pytest.approx(0.85, abs=0.025)
    draw = world.state_sampler(np.array([0.25, 0.75]))
    assert np.mean([draw() for _ in range(4000)]) == pytest.approx(0.75, abs=0.03)
    assert not TableSimulator(lcorpp).terminal(0)


@dataclass
class Corridor:
    """A simulator without tables: walk to one of a billion places; the observation is the direction."""

    size: int = 10**9
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    actions: int = 3  # down, up, stop
    discount: float = 0.95

    def start(self) -> tuple[int, int]:
        middle = self.size // 2
        return middle, middle + (2 if self.rng.random() < 0.5 else -2)

    def step(self, state, action):
        place, goal = state
        if action == 2:
            return (-1, -1), "over", 100.0 if place == goal else -100.0
        place += 2 * action - 1
        side = "here" if place == goal else ("up" if goal > place else "down")
        return (place, goal), side, -1.0

    def value(self, state) -> float:
        return 0.0

    def terminal(self, state) -> bool:
        return state == (-1, -1)


@pytest.mark.parametrize("goal", [2, -2])
def test_a_simulator_without_tables(goal):
    world = Corridor()
    planner = ParticlePlanner(world, world.start, simulations=2000, particles=100, seed=2)
    middle = world.size // 2
    state, taken, earned = (middle, middle + goal), 0, 0.0
    while not world.terminal(state):
        action = planner.action()
        state, observation, reward = world.step(state, action)
        earned += reward
        taken += 1
        if not world.terminal(state):
            planner.update(action, observation)
            assert len(planner.particles.states) >= 100
            assert state in planner.particles.states.tolist()
    # the first step may go in either direction
    assert taken in (3, 5)
    assert earned == 100 - (taken - 1)


def test_particles_follow_bayes_rule():
    world = TableSimulator(tiger, seed=3)
    planner = ParticlePlanner(
        world, world.state_sampler(tiger.start), simulations=200, particles=4000, seed=1
    )
    planner.search()
    planner.update(0, 0)
    # the standard error of a share of .85 in 4000 is .006
    assert np.mean(np.array(planner.particles.states) == 0) == pytest.approx(0.85, abs=0.03)


def test_an_observation_that_no_particle_produces():
    world = TableSimulator(tiger)
    planner = ParticlePlanner(world, world.state_sampler(tiger.start), simulations=10, particles=5)
    with pytest.raises(
        ObservationError, match="none of 500 simulations of action 0 from 5 particles produced observation 7"
    ):
        planner.update(0, 7)
    with pytest.raises(ModelError, match="the action must be 0 to 2, not 3"):
        planner.update(3, 0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"simulations": 0}, "simulations must be an integer of at least 1, not 0"),
        ({"seed": 0.5}, "seed must be an integer of at least 0, not 0.5"),
        ({"seconds": 0.0}, "seconds must be positive, not 0.0"),
        ({"exploration": -1}, "exploration must be a finite number of at least 0, not -1"),
        ({"leaf_values": "oak"}, "unknown leaf_values 'oak'; expected one of mdp, random"),
    ],
)
def test_bad_arguments(arguments, words):
    with pytest.raises(ModelError, match=words):
        PomcpPlanner(tiger, **arguments)
    if "leaf_values" not in arguments:
        world = TableSimulator(tiger)
        with pytest.raises(ModelError, match=words):
            ParticlePlanner(world, world.state_sampler(tiger.start), **arguments)


def test_zero_particles_raise_an_error():
    world = TableSimulator(tiger)
    with pytest.raises(ModelError, match="particles must be an integer of at least 1, not 0"):
        ParticlePlanner(world, world.state_sampler(tiger.start), particles=0)
