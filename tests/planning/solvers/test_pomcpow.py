"""POMCPOW: widening over observations, and particles by the likelihood of observations."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest

from lcorpp.errors import ModelError, ObservationError
from lcorpp.planning import load_solver, parse_pomdp
from lcorpp.planning.belief import update
from lcorpp.planning.solvers.pomcp import ParticlePlanner, TableSimulator, Widening
from lcorpp.planning.solvers.pomcp.batches import Loop, as_objects
from lcorpp.planning.solvers.pomcp.particles import Particles, filter_particles
from lcorpp.planning.solvers.pomcp.search import History, TreeSearch
from tests.planning.models import DOOR, TIGER

tiger = parse_pomdp(TIGER)
LISTEN, OPEN_LEFT, OPEN_RIGHT = range(3)


class Door:
    """The tiger behind a door at -1 or 1, heard with Gaussian noise; opening ends."""

    actions, discount = 3, 0.95

    def __init__(self, seed: int, noise: float = 1.0) -> None:
        self.rng, self.noise = np.random.default_rng(seed), noise

    def start(self) -> int:
        return int(self.rng.choice((-1, 1)))

    def step(self, state, action):
        if action == LISTEN:
            return state, float(self.rng.normal(state, self.noise)), -1.0
        opened = -1 if action == OPEN_LEFT else 1
        return 0, 0.0, -100.0 if opened == state else 10.0

    def likelihood(self, observation, state, action, next_state):
        if action != LISTEN:
            return float(observation == 0.0)
        return exp(-0.5 * ((observation - next_state) / self.noise) ** 2)

    def value(self, state):
        return 0.0

    def terminal(self, state):
        return state == 0


def test_particles_follow_bayes_rule_for_continuous_observations():
    door = Door(1)
    planner = ParticlePlanner(door, door.start, particles=40_000, widening=Widening(), seed=2)
    odds = 1.0
    for heard in (0.3, -0.1, 0.5):
        planner.update(LISTEN, heard)
        odds *= exp(2 * heard)  # ratio of two normal densities at 1 and -1
        right = np.array(planner.particles.states) == 1
        assert planner.particles.weights[right].sum() == pytest.approx(odds / (1 + odds), abs=0.015)


def test_particles_follow_the_exact_belief_of_a_table():
    simulator = TableSimulator(tiger, seed=3)
    draw = simulator.state_sampler(tiger.start)
    planner = ParticlePlanner(simulator, draw, particles=40_000, widening=Widening(), seed=4)
    belief = tiger.start
    for observation in (0, 0, 1):
        planner.update(LISTEN, observation)
        belief = update(tiger, belief, LISTEN, observation)
        first = np.array(planner.particles.states) == 0
        assert planner.particles.weights[first].sum() == pytest.approx(belief[0], abs=0.015)


def test_the_robot_listens_until_it_has_heard_enough():
    door = Door(5)
    planner = ParticlePlanner(
        door, door.start, simulations=3000, particles=500, exploration=0.5, widening=Widening(3, 0.2), seed=6
    )
    assert planner.action() == LISTEN
    for _ in range(3):  # the odds are then exp(9) for the tiger behind the right door
        planner.update(LISTEN, 1.5)
    assert planner.action() == OPEN_LEFT


def test_without_widening_each_continuous_observation_is_a_child():
    door = Door(7)
    for widening, width in ((Widening(factor=2, power=0), 2), (Widening(factor=1, power=1), 1000)):
        search = TreeSearch(door, keep_particles=True, widening=widening, seed=8)
        root = History(door.actions)
        search.search(root, door.start, simulations=1000)
        heard = [key for key in root.children if key[0] == LISTEN]
        assert len(heard) == min(width, root.visits[LISTEN])


def test_the_states_beyond_an_observation_are_weighed_by_its_likelihood():
    door = Door(9)
    search = TreeSearch(door, widening=Widening(factor=1, power=0), seed=10)
    root = History(door.actions)
    search.search(root, door.start, simulations=20_000)
    (heard,) = [key for key in root.children if key[0] == LISTEN]
    child = root.children[heard]
    weights = np.diff(child.sums, prepend=0.0)
    share = weights[np.array(child.particles) == 1].sum() / weights.sum()
    assert share == pytest.approx(1 / (1 + exp(-2 * heard[1])), abs=0.02)


def test_equal_seeds_have_equal_results():
    found = []
    for _ in range(2):
        door = Door(11)
        planner = ParticlePlanner(
            door, door.start, simulations=300, particles=50, widening=Widening(), seed=12
        )
        planner.update(LISTEN, 0.4)
        particles = planner.particles
        found.append(
            (planner.search().values.tolist(), particles.states.tolist(), particles.weights.tolist())
        )
    assert found[0] == found[1]


def test_bad_arguments():
    door = Door(13)
    for arguments, message in (
        ({"factor": 0}, "the factor of widening is 0; expected a finite positive number"),
        ({"power": 1.5}, "the power of widening is 1.5; expected a number from 0 to 1"),
    ):
        with pytest.raises(ModelError, match=message):
            Widening(**arguments)
    silent = type("Silent", (), {"actions": 3, "discount": 0.95})()
    with pytest.raises(ModelError, match="widening needs a simulator with likelihood"):
        ParticlePlanner(silent, door.start, widening=Widening())
    planner = ParticlePlanner(door, door.start, particles=10, widening=Widening())
    with pytest.raises(
        ObservationError, match=r"observation 3\.0 after action 1 is impossible in all 10 particles"
    ):
        planner.update(OPEN_LEFT, 3.0)
    for wrong in (float("nan"), -1.0, 1e300, None, "likely"):
        door.likelihood = lambda *_, wrong=wrong: wrong
        with pytest.raises(ModelError, match=r"returned .* for observation 0\.0; expected a number from 0"):
            planner.update(LISTEN, 0.0)
        with pytest.raises(ModelError, match=r"returned .* for observation .*; expected a number from 0"):
            planner.action()
    with pytest.raises(ModelError, match="an observation of the simulator is a list; expected"):
        planner.update(LISTEN, [0.0])
    with pytest.raises(ModelError, match="the power of widening must be"):
        Widening(3, "0.2")
    with pytest.raises(ModelError, match="widening must be"):
        ParticlePlanner(door, door.start, widening=4)


def test_likelihoods_may_be_as_small_as_numbers_get():
    door = Door(14)
    door.likelihood = lambda *_: 5e-324
    planner = ParticlePlanner(door, door.start, simulations=2000, particles=20, widening=Widening(1, 0))
    assert planner.action() in range(3)
    planner.update(LISTEN, 0.5)
    assert abs(len(planner.particles.states) - 20) <= 1  # two groups, whose shares are rounded


def test_particles_in_a_terminal_state_stay_there():
    door = Door(15)

    def step(state, action):
        assert state != 0
        return Door.step(door, state, action)

    door.step, door.likelihood = step, lambda *_: 1.0
    planner = ParticlePlanner(door, lambda: 0, simulations=10, particles=10, widening=Widening())
    planner.update(LISTEN, 0.5)
    assert set(planner.particles.states) == {0}


def test_backups_by_the_best_action_find_the_value_of_asking_twice():
    """At 0.8 a further question is worth 5.65, and opening 4: by hand, as the exact solver says."""
    model = parse_pomdp(DOOR)
    belief = np.array([0.8, 0.2, 0.0])
    exact = load_solver("exact")(model, belief).policy.value(belief)
    found = []
    for seed in range(5):
        simulator = TableSimulator(model, leaf_values="random", seed=seed)
        search = TreeSearch(simulator, exploration=1, backup="max")
        result = search.search(History(3), simulator.state_sampler(belief), simulations=5000)
        assert result.action == LISTEN
        found.append(result.values[LISTEN])
        assert result.values[OPEN_LEFT] == pytest.approx(0.8 * 10 - 0.2 * 20, abs=1.5)
    assert np.mean(found) == pytest.approx(exact, abs=0.3)


def test_both_backups_agree_where_nothing_is_chosen():
    """With one action there is no best one, so that the mean return and the sum of the parts are the same."""
    model = parse_pomdp(
        """discount: 0.9
        values: reward
        states: a b
        actions: wait
        observations: x y
        T: wait
        0.5 0.5
        0.3 0.7
        O: wait
        0.9 0.1
        0.4 0.6
        R: wait : a : * : * 1
        R: wait : b : * : * -2
        """
    )
    values = []
    for backup in ("mean", "max"):
        simulator = TableSimulator(model, seed=1)
        search = TreeSearch(simulator, backup=backup, seed=2)
        result = search.search(History(1), simulator.state_sampler(model.start), simulations=3000)
        values.append(result.values[0])
    assert values[0] == pytest.approx(values[1], abs=1e-9)


def test_unknown_backups_are_refused():
    with pytest.raises(ModelError, match="unknown backup 'worst'; expected one of mean, max"):
        TreeSearch(TableSimulator(tiger), backup="worst")


def test_few_different_states_are_updated_by_bayes_rule():
    door = Door(1)
    door.likelihood = lambda observation, state, action, after: 0.999 if state == observation else 0.001
    start = Particles(np.array([-1, *[1] * 9]), np.full(10, 0.1))
    particles, odds = start, 1 / 9
    for observation in (1, 1, 1, -1, -1, -1, -1, -1):  # for a while, the first state has 1e-10
        particles = filter_particles(
            Loop(door), particles, LISTEN, observation, count=10, rng=np.random.default_rng(0)
        )
        odds *= 999.0**-observation
        share = particles.weights[np.array(particles.states) == -1].sum()
        assert share == pytest.approx(odds / (1 + odds), rel=1e-9)


def test_states_that_cannot_be_compared_are_resampled():
    door = Door(1)
    door.step = lambda state, action: (state, 0.0, 0.0)
    door.terminal = lambda state: False
    door.likelihood = lambda observation, state, action, after: 0.75 if state[0] else 0.25
    start = Particles.of(as_objects([[int(i < 500)] for i in range(1000)]))
    after = filter_particles(Loop(door), start, LISTEN, 0, count=1000, rng=np.random.default_rng(0))
    assert np.mean([state[0] for state in after.states]) == pytest.approx(0.75, abs=0.002)
    assert np.ptp(after.weights) == 0
