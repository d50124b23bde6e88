"""Controllers, the grid bound, randomised policies and their check."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from lcorpp import load_domain, solve
from lcorpp.errors import ObservationError, PolicyError
from lcorpp.planning import (
    Controller,
    Limit,
    Pomdp,
    RandomisedPlanner,
    RandomisedPolicy,
    read_limit,
    read_randomised_policy,
    solve_limited,
    verify_limits,
    write_randomised_policy,
)
from lcorpp.planning.limits.controller import evaluate_controller
from lcorpp.planning.limits.grid_bound import SimplexGrid, make_grid_bounds
from lcorpp.planning.limits.limited_model import build_limited_model
from tests.planning.limits.models import random_limit, random_model

POMDP = load_domain("intention").pomdp


@pytest.fixture(scope="module")
def solved():
    limit = read_limit(POMDP, "move_forward,greet|not_interested <= .1")
    return solve_limited(POMDP, [limit], precision=0.05)


def evaluate_all(model, controller):
    """Return the values of all nodes in all states."""
    n, n_states = len(controller), len(model.base)
    unknown = np.full((len(model.discounts), n, n_states), np.nan)
    nodes, states = (own.ravel() for own in np.indices((n, n_states)))
    return evaluate_controller(model, controller, unknown, nodes, states)


def test_minimise_joins_nodes_with_the_same_plan():
    """Nodes 1 and 2 take the same actions after all observations, 0 does not; 3 is a copy of 0."""
    controller = Controller([0, 1, 1, 0], [[1, 2], [1, 1], [2, 2], [2, 1]])
    smaller, number = controller.minimise()
    assert len(smaller) == 2
    assert number[0] == number[3] != number[1] == number[2]
    assert smaller.actions[number].tolist() == [0, 1, 1, 0]
    kept, starts = controller.keep(np.array([1]))
    assert (len(kept), starts.tolist()) == (1, [0])


@pytest.mark.parametrize("seed", range(3))
def test_values_of_a_controller_by_following_it(seed):
    """Backward by linear equations, and forward step by step, in the model with counts and levels."""
    rng = np.random.default_rng(seed)
    pomdp = random_model(rng, states=3, actions=3, observations=2)
    limits = [random_limit(rng, pomdp, kind, kind) for kind in ("probability", "discounted")]
    model = build_limited_model(pomdp, limits, pomdp.start[None], np.ones(1))
    n = 5
    controller = Controller(rng.integers(3, size=n), rng.integers(n, size=(n, 2)))
    values = evaluate_all(model, controller)
    joint = np.zeros((n, len(model.base)))
    joint[0] = model.starts[0]
    totals, factor = np.zeros(3), np.ones(3)
    for _ in range(3000):
        costs = model.criteria[:, controller.actions]
        totals += factor * (costs * joint).sum(axis=(1, 2))
        factor *= model.discounts
        after = np.zeros_like(joint)
        for node in range(n):
            a = controller.actions[node]
            moved = joint[node] @ model.transitions[a].toarray()
            for o in range(2):
                after[controller.successors[node, o]] += moved * model.observations[a].toarray()[:, o]
        joint = after
    assert totals == pytest.approx((values[:, 0] * model.starts[0]).sum(axis=1), abs=1e-8)


def test_values_that_are_known_are_used():
    rng = np.random.default_rng(7)
    pomdp = random_model(rng)
    limit = random_limit(rng, pomdp, "l", "discounted")
    model = build_limited_model(pomdp, [limit], pomdp.start[None], np.ones(1))
    controller = Controller([0, 1, 1], [[0, 0], [0, 1], [1, 2]])
    whole = evaluate_all(model, controller)
    known = whole.copy()
    known[:, 2] = np.nan
    found = evaluate_controller(model, controller, known, np.full(3, 2), np.arange(3))
    assert np.allclose(found, whole, atol=1e-12)


def test_a_total_without_end_is_infinite():
    pomdp = Pomdp(("s",), ("a", "b"), ("none",), [[[1.0]]] * 2, [[[1.0]]] * 2, [[1.0], [0.0]], 0.5, [1.0])
    model = build_limited_model(
        pomdp, [Limit("t", [[1.0], [0.0]], 1.0, "total")], np.ones((1, 1)), np.ones(1)
    )
    values = evaluate_all(model, Controller([0, 1, 0], [[0], [1], [1]]))
    assert values[1, :, 0].tolist() == [np.inf, 0.0, 1.0]


def test_the_grid_interpolates():
    """Weights are distributions over points whose mean is the belief."""
    grid, rng = SimplexGrid(4, 5), np.random.default_rng(0)
    beliefs = np.vstack([rng.dirichlet(np.ones(4), size=200), np.eye(4), np.full((1, 4), 0.25)])
    weights, rows = grid.interpolate(2 * beliefs)
    assert weights.min() >= 0
    assert np.allclose(np.einsum("nk,nks->ns", weights, grid.points[rows]), 2 * beliefs)
    assert len(grid.points) == 56


def test_a_grid_over_many_states():
    """Numbers of points do not overflow."""
    grid, rng = SimplexGrid(30, 3), np.random.default_rng(0)
    beliefs = rng.dirichlet(np.full(30, 0.1), size=50)
    weights, rows = grid.interpolate(beliefs)
    assert np.allclose(np.einsum("nk,nks->ns", weights, grid.points[rows]), beliefs)


@pytest.mark.parametrize("n_states", [5, 36])
def test_grid_bounds_of_a_cycle(n_states):
    """One action, no observation: the bound is at least the only value, or there is no grid so large."""
    T = np.roll(np.eye(n_states), 1, axis=1)[None]
    reward = np.arange(n_states, dtype=float)[None] / n_states
    start = np.eye(n_states)[0]
    names = tuple(map(str, range(n_states))), ("go",), ("none",)
    pomdp = Pomdp(*names, T, np.ones((1, n_states, 1)), reward, 0.95, start)
    model = build_limited_model(pomdp, [Limit("c", reward, 1.0, "discounted")], start[None], np.ones(1))
    value = float(np.linalg.solve(np.eye(n_states) - 0.95 * T[0], reward[0])[0])
    for bound in [*make_grid_bounds(model), *make_grid_bounds(model, refinement=6)]:
        assert bound.bound(np.array([1.0, 0.0]))[0] >= value - 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_grid_bounds_are_above_and_close_to_the_optimum(seed):
    rng = np.random.default_rng(40 + seed)
    pomdp = random_model(rng, states=3, discount=0.8)
    kind = ("discounted", "probability")[seed % 2]
    limit = random_limit(rng, pomdp, "l", kind)
    model = build_limited_model(pomdp, [limit], pomdp.start[None], np.ones(1))
    factors = np.array([1.0, -1.5])
    solution = solve(
        model.make_problem(factors),
        model.place(model.starts),
        precision=1e-3 if kind == "discounted" else 0.5,
    )
    for bound in make_grid_bounds(model):
        (upper,) = bound.bound(factors)
        assert solution.lower - 1e-9 <= upper
    if kind == "discounted":
        assert min(own.bound(factors)[0] for own in make_grid_bounds(model)) <= solution.lower + 0.05


def test_a_policy_survives_its_file(solved, tmp_path):
    path = tmp_path / "a.json"
    write_randomised_policy(solved.policy, path)
    read = read_randomised_policy(path, POMDP)
    assert read.probabilities.tolist() == solved.policy.probabilities.tolist()
    assert read.controller.successors.tolist() == solved.policy.controller.successors.tolist()
    assert verify_limits(solved, read).verdict == "confirmed"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c["nodes"][0].update(action="dance"), "damaged"),
        (lambda c: c["nodes"][0]["next"].update(pos=10**6), "outside"),
        (lambda c: c["starts"][0]["nodes"].update({"0": 5.0}), "do not sum to 1"),
        (lambda c: c["starts"][0]["nodes"].update({"-1": 0.0}), "outside"),
        (lambda c: c.update(fingerprint="0"), "another model"),
        (lambda c: c["starts"][0].update(belief=[0.0] * 5), "the starts do not sum to 1"),
        (lambda c: c["starts"][0]["nodes"].update({"0": float("nan")}), "do not sum to 1"),
        (lambda c: c["nodes"][0]["next"].update(pos=1.5), "outside"),
        (lambda c: c.update(actions=["a"]), "damaged"),
        (lambda c: c.update(format="x"), "its format is 'x'"),
        (lambda c: c.pop("nodes"), "damaged"),
        (lambda c: c.update(starts=[]), "damaged"),
    ],
)
def test_damaged_files(solved, tmp_path, change, message):
    content = solved.policy.to_json()
    change(content)
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content))
    with pytest.raises(PolicyError, match=message) as error:
        read_randomised_policy(path, POMDP)
    assert str(error.value).startswith(str(path))


def test_a_policy_that_breaks_the_limit_is_refuted(solved):
    """The start node of another plan in place of that of the solver: it greets everybody."""
    n_observations = len(POMDP.observations)
    greeter = Controller([POMDP.action_index("greet")], [[0] * n_observations])
    policy = RandomisedPolicy.of(POMDP, greeter, solved.policy.starts, np.ones((1, 1)))
    with pytest.raises(PolicyError, match="begins from other beliefs"):
        verify_limits(solved, RandomisedPolicy.of(POMDP, greeter, np.eye(5)[:1], np.ones((1, 1))))
    checked = verify_limits(solved, policy)
    assert [own.verdict for own in checked.checks] == ["refuted", "refuted"]
    assert checked.checks[1].low == pytest.approx(1.0)
    assert "verdict: refuted" in checked.text


def test_a_check_without_time_is_open(solved):
    checked = verify_limits(solved, time_limit=1e-9)
    assert checked.verdict == "open"
    low, high = checked.checks[0].low, checked.checks[0].high
    assert low < solved.value < high


def test_a_planner_draws_once_and_follows(solved):
    """The shares of the first actions are those of the start nodes."""
    policy, rng = solved.policy, np.random.default_rng(0)
    firsts = []
    for _ in range(2000):
        planner = RandomisedPlanner(policy, POMDP, rng)
        firsts.append(planner.action(POMDP.start))
        assert planner.action(POMDP.start) == firsts[-1]
    expected = np.zeros(len(POMDP.actions))
    np.add.at(expected, policy.controller.actions, policy.probabilities[0])
    counts = np.array([firsts.count(action) for action in POMDP.actions])
    assert counts / 2000 == pytest.approx(expected, abs=0.04)
    with pytest.raises(ObservationError, match="before the first action"):
        RandomisedPlanner(policy, POMDP, rng).update(POMDP.start, "greet", "pos")


def test_a_policy_is_for_its_model(solved):
    other = replace(POMDP, discount=0.5)
    with pytest.raises(PolicyError, match="another model"):
        verify_limits(replace(solved, pomdp=other))
