"""Search over particle beliefs with bounds: exact values without chance, tables, and its limits."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import ModelError, ObservationError
from lcorpp.planning import GenerativeModel, GenerativePlanner, SearchOptions, parse_pomdp, solve
from lcorpp.planning.solvers.pomcp.bounded import BoundedParticleSearch
from lcorpp.planning.solvers.pomcp.generative_planner import make_batch
from lcorpp.planning.solvers.pomcp.particles import Particles
from tests.planning.models import DOOR

VALUES = tuple(f"v{i}" for i in range(8))


class Search:
    """Find one of eight values: questions about its bits cost 1, a right report earns 10, a wrong one -20."""

    discount = 0.9
    actions = ("bit_0", "bit_1", "bit_2", *(f"report_{value}" for value in VALUES))
    observations = ("no", "yes")

    def start(self, value, rng):
        return VALUES.index(value)

    def shared(self, state):
        return None if state < 0 else VALUES[state]

    def step(self, state, action, rng):
        if action.startswith("bit"):
            return state, self.observations[state >> int(action[4:]) & 1], -1.0
        return -1, "no", 10.0 if action == f"report_{VALUES[state]}" else -20.0

    def likelihood(self, observation, state, action, after):
        return float(self.step(state, action, None)[1] == observation)

    def lower(self, state):
        return -10.0  # one question forever

    def upper(self, state):
        return 10.0


class ManySearch(Search):
    """The same with arrays of states (N, 1)."""

    vectorised = True

    def start(self, value, count, rng):
        return np.full((count, 1), VALUES.index(value))

    def shared(self, states):
        return states[:, 0]

    def step(self, states, actions, rng):
        values, is_report = states[:, 0], actions >= 3
        seen = np.where(is_report, 0, values >> np.minimum(actions, 2) & 1)
        rewards = np.where(is_report, np.where(actions - 3 == values, 10.0, -20.0), -1.0)
        return np.where(is_report, -1, values)[:, None], seen, rewards

    def likelihood(self, observations, states, actions, after):
        return (self.step(states, actions, None)[1] == observations).astype(float)

    def lower(self, states):
        return np.full(len(states), -10.0)

    def upper(self, states):
        return np.full(len(states), 10.0)


@pytest.mark.parametrize("kind", [Search, ManySearch])
def test_bounds_meet_at_the_exact_value_without_chance(kind):
    planner = GenerativePlanner(
        GenerativeModel(kind(), VALUES), SearchOptions(particles=64, expansions=2000, samples=64)
    )
    found = planner.search(planner.start)
    exact = -1 - 0.9 - 0.9**2 + 0.9**3 * 10  # halve three times, then report
    assert found.values.max() == pytest.approx(exact, abs=1e-12)
    assert found.upper.max() == pytest.approx(exact, abs=1e-12)
    assert found.simulations < 200  # the bounds meet before the work ends


@pytest.mark.parametrize("kind", [Search, ManySearch])
def test_decisions_end_with_the_right_report(kind):
    model = GenerativeModel(kind(), VALUES)
    planner = GenerativePlanner(model, SearchOptions(particles=64, expansions=100, samples=64))
    for value in VALUES:
        belief, state, actions = planner.start, model.interaction.start(value, np.random.default_rng(0)), []
        while model.interaction.shared(state) is not None:
            actions.append(planner.action(belief))
            state, seen, _ = model.interaction.step(state, actions[-1], np.random.default_rng(0))
            belief = planner.update(belief, actions[-1], seen)
        assert actions[3:] == [f"report_{value}"]
        assert belief.tolist() == [0.0] * 8 + [1.0]
        assert planner.search(belief).values.tolist() == [0.0] * len(model.actions)  # nothing is left


class NoisyDoor:
    """`tests.planning.models.DOOR` as arrays (N, 1): 0 and 1 are the sides, 2 is the end."""

    vectorised, discount = True, 0.95
    actions, observations = ("listen", "open_left", "open_right"), ("l", "r")

    def start(self, value, count, rng):
        return np.full((count, 1), ("left", "right").index(value))

    def shared(self, states):
        return np.where(states[:, 0] == 2, -1, states[:, 0])

    def step(self, states, actions, rng):
        side = states[:, 0]
        heard = np.where(rng.random(len(side)) < 0.8, side, 1 - side)
        rewards = np.where(actions == 0, -1.0, np.where(actions - 1 == side, 10.0, -20.0))
        return np.where(actions == 0, side, 2)[:, None], np.where(actions == 0, heard, 0), rewards

    def likelihood(self, observations, states, actions, after):
        heard = np.where(observations == states[:, 0], 0.8, 0.2)
        return np.where(actions == 0, heard, observations == 0)

    def lower(self, states):
        return np.full(len(states), -20.0)

    def upper(self, states):
        return np.full(len(states), 10.0)


@pytest.mark.parametrize("right", [0.5, 0.2, 0.03])
def test_bounds_are_about_the_value_by_tables(right):
    tables = parse_pomdp(DOOR)
    belief, policy = np.array([1 - right, right, 0.0]), solve(tables, precision=1e-4).policy
    planner = GenerativePlanner(
        GenerativeModel(NoisyDoor(), ("left", "right")),
        SearchOptions(particles=1000, expansions=400, samples=1000),
    )
    found = planner.search(belief)
    assert found.action == policy.action(belief)
    # the shares of observations of 1000 particles have an error of .013, the values of what follows differ
    assert found.values.max() == pytest.approx(policy.value(belief), abs=0.25)
    assert found.upper.max() == pytest.approx(policy.value(belief), abs=0.25)


class Angles(NoisyDoor):
    """The same with a normal number as observation, in chances of an end after each listening."""

    observations = None

    def __init__(self, quits=0.0):
        self.quits = quits

    def step(self, states, actions, rng):
        after, _, rewards = super().step(states, actions, rng)
        leaves = (actions == 0) & (rng.random(len(states)) < self.quits)
        after = np.where(leaves[:, None], 2, after)
        heard = rng.normal(np.where(states[:, 0] == 0, -1.0, 1.0))
        return after, np.where(actions == 0, heard, 0.0), rewards

    def likelihood(self, observations, states, actions, after):
        density = np.exp(-0.5 * (observations - np.where(states[:, 0] == 0, -1.0, 1.0)) ** 2)
        return np.where(actions == 0, density, observations == 0)


def make_search(interaction, values=("left", "right"), **options):
    model = GenerativeModel(interaction, values)
    planner = GenerativePlanner(model, SearchOptions(**{"particles": 400, "samples": 400, **options}))
    return planner.search(planner.start)


def test_of_many_observations_some_are_considered():
    found = make_search(Angles(), expansions=60)
    assert found.action == 0  # listens
    # by hand: with d' = 2, one observation and a report earn 10 - 30 * .159 = 5.2 less the cost of 1
    assert 0.95 * 5.2 - 1 - 0.3 < found.values[0] < found.upper[0] < 10


def test_people_who_leave_are_worth_nothing_afterwards():
    """Everybody leaves after the first question: asking costs 1 and earns nothing, whatever the bounds."""
    found = make_search(Angles(quits=1.0), expansions=200)
    assert [found.values[0], found.upper[0]] == pytest.approx([-1, -1], abs=1e-12)
    half = make_search(Angles(quits=0.5), expansions=200)
    stays = make_search(Angles(quits=0.0), expansions=200)
    assert found.values[0] < half.values[0] < stays.values[0]


def test_a_search_that_cannot_expand_ends():
    class Patient(NoisyDoor):
        discount = 1e-3  # trials end at the first action, with the bounds apart

    found = make_search(Patient(), expansions=10_000)
    assert found.simulations < 10
    assert found.values.max() == pytest.approx(-1, abs=0.05)


def test_equal_seeds_have_equal_results_and_others_differ():
    model = GenerativeModel(Angles(), ("left", "right"))
    one, other, third = (
        BoundedParticleSearch(make_batch(model, np.random.default_rng(seed)), 50, np.random.default_rng(seed))
        for seed in (1, 1, 2)
    )
    start = Particles.of(np.arange(100)[:, None] % 2)
    found = [search.search(start, 30).values.tolist() for search in (one, other, third)]
    assert found[0] == found[1] != found[2]


def test_improbable_values_are_not_forgotten():
    """A wrong door costs 10,000: with a probability of .4 % of the right side, the left is no good choice."""

    class Risk(NoisyDoor):
        def step(self, states, actions, rng):
            after, seen, rewards = super().step(states, actions, rng)
            return after, seen, np.where(rewards == -20, -1e4, rewards)

    for right in (1e-6, 0.0005, 0.002, 0.004):
        model = GenerativeModel(Risk(), ("left", "right"))
        found = GenerativePlanner(model).search(np.array([1 - right, right, 0.0]))
        assert found.values[1] == pytest.approx(10 * (1 - right) - 1e4 * right, abs=1e-9)


class Staircase:
    """Twice "a" earns `later` at the second step, "b" 8 at once; bounds of the first state by `first`."""

    vectorised, actions, observations = True, ("a", "b"), ("nothing",)

    def __init__(self, later, discount, first):
        self.later, self.discount, self.first = later, discount, first

    def start(self, value, count, rng):
        return np.zeros((count, 1), dtype=int)

    def shared(self, states):
        return np.where(states[:, 0] == 2, -1, 0)

    def step(self, states, actions, rng):
        is_last = (actions == 1) | (states[:, 0] == 1)
        rewards = np.where(actions == 1, 8.0, np.where(is_last, self.later, 0.0))
        return np.where(is_last, 2, 1)[:, None], actions * 0, rewards

    def likelihood(self, observations, states, actions, after):
        return np.ones(len(states))

    def lower(self, states):
        return np.where(states[:, 0] == 0, self.first[0], 0.0)

    def upper(self, states):
        return np.where(states[:, 0] == 0, self.first[1], self.later)


@pytest.mark.parametrize(
    ("later", "discount", "first"),
    [
        (10.0, 0.9, (9.0, 9.0)),  # bounds that meet at the first state choose no action
        (1000.0, 0.03, (0.0, 1000.0)),  # a small discount is no reason not to look ahead
        (10.0, 0.9, (0.0, 100.0)),
    ],
)
def test_the_second_step_is_worth_waiting_for(later, discount, first):
    found = make_search(Staircase(later, discount, first), values=("only",), expansions=100)
    assert found.action == 0
    assert found.values.tolist() == pytest.approx([discount * later, 8.0])
    assert found.upper[0] == pytest.approx(discount * later)


@pytest.mark.parametrize(
    ("text", "width", "expected"),
    [
        ("[0, 0]", 0, "a number"),
        ("0.0", 2, "2 numbers"),
        ("[0, [1, 2]]", 2, "2 numbers"),
        ("[1, 2, 3]", 2, "2 numbers"),
        ("1" + 400 * "0", 0, "a number"),
    ],
)
def test_observations_of_another_form_are_refused(text, width, expected):
    class Pairs(Angles):
        def step(self, states, actions, rng):
            after, seen, rewards = super().step(states, actions, rng)
            return after, np.stack([seen, seen], axis=1) if width else seen, rewards

        def likelihood(self, observations, *rest):
            return super().likelihood(observations[:, 0] if width else observations, *rest)

    planner = GenerativePlanner(GenerativeModel(Pairs(), ("left", "right")))
    with pytest.raises(ObservationError, match=f"expected {expected}"):
        planner.update(planner.start, "listen", text)


def test_integers_as_observations_remain_integers():
    class Indexed(NoisyDoor):
        observations = None

        def likelihood(self, observations, states, actions, after):
            table = np.array([[0.8, 0.2], [0.2, 0.8]])
            return np.where(actions == 0, table[states[:, 0], observations], observations == 0)

    planner = GenerativePlanner(GenerativeModel(Indexed(), ("left", "right")), SearchOptions(expansions=5))
    belief = planner.update(planner.start, "listen", "1")
    assert belief[1] == pytest.approx(0.8, abs=1e-12)
    assert planner.action(belief) != "open_left"  # which is wrong with probability .8


def test_steps_cannot_change_the_particles_of_a_belief():
    class Rewriting(NoisyDoor):
        def step(self, states, actions, rng):
            after, seen, rewards = super().step(states, actions, rng)
            states[:] = after
            return states, seen, rewards

    with pytest.raises(ValueError, match="read-only"):
        GenerativeModel(Rewriting(), ("left", "right"))


def copy_step(self, states, actions, rng):
    after, seen, rewards = NoisyDoor.step(self, states, actions, rng)
    return np.repeat(after, states.shape[1], axis=1), seen, rewards


def change(**methods):
    return type("Changed", (NoisyDoor,), methods)()


@pytest.mark.parametrize(
    ("interaction", "message"),
    [
        (change(lower=None), "has upper() alone; expected both of lower, upper"),
        (
            change(lower=lambda _, s: np.full(len(s), 11.0)),
            "lower() and upper() returned 11.0 and 10.0 for the",
        ),
        (change(upper=lambda _, s: 10.0), "upper() returned 10.0; expected an array of finite numbers (1,)"),
        (change(upper=lambda _, s: np.full(len(s), np.nan)), "expected an array of finite numbers (1,)"),
        (
            change(start=lambda _, v, n, r: np.zeros(n)),
            "start() returned array([0.]) of shape (1,); expected an",
        ),
        (change(step=lambda _, s, a, r: s), "step() returned array([[0]]) of shape (1, 1); expected (next"),
        (change(step=lambda _, s, a, r: (s[0], a, a)), "expected next states, an array of numbers (1, 1)"),
        (change(step=lambda _, s, a, r: (s, a + 5, a * 1.0)), "observations, integers (1,) from 0 to 1"),
        (
            change(step=lambda _, s, a, r: (s, a * 0, [0.0, 1.0])),
            "expected rewards, an array of finite numbers (1,)",
        ),
        (change(likelihood=lambda _, o, s, a, n: np.full(len(o), -1.0)), "expected numbers of at least 0"),
        (change(vectorised=1), "vectorised = 1; expected True or False"),
        (change(lower=None, upper=None), "is vectorised, without lower and upper; expected both methods"),
        (
            change(
                start=lambda _, v, n, r: np.full((n, 1 + (v == "right")), int(v == "right")), step=copy_step
            ),
            "start() returned arrays (N, D) of several D: [1, 2]",
        ),
        (
            change(step=lambda _, s, a, r: (s + 0.5, a, a * 1.0)),
            "expected next states of type int64, as those of",
        ),
        (change(shared=lambda _, s: s[:, 0] + 0.5), "expected integers (1,) from -1 to 1"),
        (
            change(shared=lambda self, s: NoisyDoor.shared(self, s)[:1]),
            "shared() returned array([0]) of shape (1,); expected integers (3,)",
        ),
        (
            change(observations=None, step=lambda _, s, a, r: (s, "x", a * 1.0)),
            "expected observations, an array",
        ),
    ],
)
def test_mistakes_of_vectorised_classes_are_found(interaction, message):
    with pytest.raises(ModelError) as error:
        GenerativeModel(interaction, ("left", "right"))
    assert message in str(error.value)
    assert str(error.value).startswith("Changed: ")


def test_an_observation_without_likelihood_is_an_error():
    model = GenerativeModel(NoisyDoor(), ("left", "right"))
    model.vectorised.interaction.likelihood = lambda o, s, a, n: np.where(o == 0, s[:, 0], 0.5)
    with pytest.raises(ModelError, match=r"likelihood\(\) returned 0 for the observation 0"):
        GenerativePlanner(model).search(np.array([0.5, 0.5, 0.0]))
