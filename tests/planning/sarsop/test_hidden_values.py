"""Bounds for hidden values that do not change: below no exact value, and as close as the models permit."""

from __future__ import annotations

from dataclasses import replace
from math import log

import numpy as np
import pytest

from lcorpp.planning import Pomdp, solve
from lcorpp.planning._native import Tree, find_symmetries, maximise_gain, mdp_bound
from lcorpp.planning.sarsop import trials
from lcorpp.planning.sarsop.hidden_values import HiddenBounds, find_hidden_values
from lcorpp.planning.sarsop.kernel_model import build_model
from lcorpp.planning.sarsop.paced_search import PacedSearch
from lcorpp.planning.sarsop.potentials import PairPotentials
from lcorpp.planning.solvers.exact.value_iteration import solve_exact
from tests.planning.sarsop.kernels import SECONDS
from tests.planning.sarsop.questions import (
    exchangeable_values,
    random_questions,
    sharpening_sensor,
    two_hidden_blocks,
    values_without_end,
)

ROUNDING = 1e-6


def bare_tree(pomdp: Pomdp, hidden: HiddenBounds = HiddenBounds()) -> Tree:  # noqa: B008
    """A tree whose only upper bounds are the given ones, beside one that is far above."""
    A, S = len(pomdp.actions), len(pomdp.states)
    lowest = float(pomdp.reward.min()) / (1 - pomdp.discount)
    tree = Tree(build_model(pomdp), np.full((A, S), 1e6), np.full((A, S), lowest))
    hidden.apply(tree)
    return tree


def draw_beliefs(pomdp: Pomdp, count: int, seed: int) -> list:
    """Draw beliefs without the final state, some near a corner and some without all states."""
    rng, n = np.random.default_rng(seed), len(pomdp.states) - 1
    beliefs = [pomdp.start]
    for i in range(count):
        b = rng.dirichlet(np.full(n, [1.0, 0.1, 0.03][i % 3]))
        b[b < 1e-6] = 0
        beliefs.append(np.append(b / b.sum(), 0))
    return beliefs


def check_sound(seed: int, trials_each: int) -> None:
    pomdp = random_questions(
        seed, values=2 + seed % 3, questions=1 + seed % 2, signals=2 + seed // 3 % 2, moves=seed % 5 == 0
    )
    model, beliefs = build_model(pomdp), draw_beliefs(pomdp, 12, seed)
    hidden = find_hidden_values(pomdp, model, [pomdp.start], SECONDS)
    # many backups give nearly exact lower bounds, without any of the bounds that are checked
    paced = PacedSearch(pomdp, np.array(beliefs), 1e-3)
    paced.advance(trials=trials_each * len(beliefs))
    policy = paced.make_policy()
    lower = [policy.value(b) for b in beliefs]
    for potential in hidden.potentials:
        tree = bare_tree(pomdp, HiddenBounds(potentials=[potential]))
        for b, least in zip(beliefs, lower, strict=True):
            assert tree.upper_bound(tree.find_or_add_node(b)) >= least - ROUNDING
    tree = bare_tree(pomdp, hidden)
    if not hidden.found:
        tree.add_graph([])
    for b, least in zip(beliefs[:6], lower[:6], strict=True):
        root = tree.find_or_add_node(b)
        tree.search_graph(root, 0.5, 1e-3, 500_000, SECONDS)
        for _ in range(3):
            tree.refresh(root)
            tree.backup(root)
        assert tree.upper_bound(root) >= least - ROUNDING
    for b, least in zip(beliefs, lower, strict=True):  # points and potentials together
        assert tree.upper_bound(tree.find_or_add_node(b)) >= least - ROUNDING


@pytest.mark.parametrize("seed", range(20))
def test_no_bound_is_below_the_value_of_a_policy(seed):
    check_sound(seed, 10)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20, 1020))
def test_no_bound_of_a_thousand_models_is_below_the_value_of_a_policy(seed):
    check_sound(seed, 40)


def test_no_bound_is_below_the_exact_value_of_two_values():
    for seed in (0, 2, 3, 6):
        pomdp = random_questions(seed, values=2, questions=1)
        exact = solve_exact(pomdp, precision=0.01, time_limit=SECONDS)
        assert exact.converged
        tree = bare_tree(pomdp, find_hidden_values(pomdp, build_model(pomdp), [pomdp.start], SECONDS))
        for b in draw_beliefs(pomdp, 50, seed):
            root = tree.find_or_add_node(b)
            assert tree.upper_bound(root) >= exact.policy.value(b) - ROUNDING
            tree.refresh(root)
            tree.backup(root)
            assert tree.upper_bound(root) >= exact.policy.value(b) - ROUNDING


@pytest.mark.parametrize("seed", [1, 5, 7])
def test_potentials_are_far_below_the_values_of_known_states(seed):
    pomdp = random_questions(seed, values=4, questions=2)
    hidden = find_hidden_values(pomdp, build_model(pomdp), [pomdp.start], SECONDS)
    tree = bare_tree(pomdp, hidden)
    values = mdp_bound(build_model(pomdp), 1e-6, SECONDS).max(axis=0)
    best = max(pomdp.reward[-4:] @ pomdp.start)
    share = (tree.upper_bound(tree.find_or_add_node(pomdp.start)) - best) / (values @ pomdp.start - best)
    assert share < 0.8


def test_the_information_of_a_binary_question_bounds_the_value_of_many_equal_values():
    """A question answers yes or no, right with .9, for 1; a wrong report costs 20 and a right one brings 20.

    The value of always asking is -20. With n values, U = -20 + 40 n^(1/q - 1), and q is the largest with
    .95 * 2 * (.5 (.9^q + .1^q))^(1/q) <= 1, by a balanced question.
    """
    n = 8
    T, Z, R = np.zeros((3 + n, n + 1, n + 1)), np.zeros((3 + n, n + 1, 3)), np.zeros((3 + n, n + 1))
    T[:, n, n] = Z[:, n, 2] = 1
    for a in range(3):
        T[a, :n, :n] = np.eye(n)
        yes = (np.arange(n) >> a) % 2 == 0
        Z[a, :n, 0] = np.where(yes, 0.9, 0.1)
        Z[a, :n, 1] = 1 - Z[a, :n, 0]
        R[a, :n] = -1
    T[3:, :n, n] = Z[3:, :n, 2] = 1
    R[3:, :n] = 40 * np.eye(n) - 20
    names = [tuple(f"{kind}{i}" for i in range(k)) for kind, k in (("s", n + 1), ("a", 3 + n), ("o", 3))]
    pomdp = Pomdp(*names, T, Z, R, 0.95, np.append(np.full(n, 1 / n), 0))
    powers = np.linspace(1.001, 2, 100_000)
    fits = 0.95 * 2 * (0.5 * (0.9**powers + 0.1**powers)) ** (1 / powers) <= 1
    expected = -20 + 40 * n ** (1 / powers[fits].max() - 1)
    hidden = find_hidden_values(pomdp, build_model(pomdp), [pomdp.start], SECONDS)
    tree = bare_tree(pomdp, HiddenBounds(potentials=[p for p in hidden.potentials if p.scale]))
    found = tree.upper_bound(tree.find_or_add_node(pomdp.start))
    assert expected - 0.01 <= found <= expected + 0.3  # the multiple C of 20 + 20 is one of a few


@pytest.mark.parametrize(
    ("pomdp", "count"),
    [
        (exchangeable_values((2, 2, 2)), 2**3 * 6),
        (exchangeable_values((3, 3)), 6 * 6 * 2),
        (exchangeable_values((3, 2)), 6 * 2),
        (sharpening_sensor(4, 3), 24),
        (random_questions(1, values=4), 1),
    ],
    ids=["three of two", "two of three", "three and two", "sensor", "none"],
)
def test_the_symmetries_generate_all_exchanges_of_values(pomdp, count):
    found = find_symmetries(build_model(pomdp), 10_000, SECONDS)
    group, new = {tuple(range(len(pomdp.states)))}, [tuple(range(len(pomdp.states)))]
    while new:
        new = [
            product
            for element in new
            for image in found
            if (product := tuple(element[s] for s in image)) not in group and not group.add(product)
        ]
    assert len(group) == count


def test_a_change_of_one_number_breaks_the_symmetries_that_need_it():
    pomdp = exchangeable_values((2, 2))
    reward = pomdp.reward.copy()
    reward[2, 0] += 1e-6  # the report of the first combination
    changed = replace(pomdp, reward=reward)
    found = find_symmetries(build_model(changed), 10_000, SECONDS)
    assert {image[0] for image in found} == {0}
    assert any(image[0] != 0 for image in find_symmetries(build_model(pomdp), 10_000, SECONDS))


@pytest.mark.parametrize("gamma", [0.0, 0.9])
def test_the_largest_gain_is_between_its_value_and_its_bound(gamma):
    rng = np.random.default_rng(3)
    n, pairs = 5, np.array([[0, 1], [2, 4]], np.int32)
    linear, Z, weights = rng.normal(size=n), rng.dirichlet(np.ones(3), size=n), np.array([2.0, 1.0])
    b, value, upper = maximise_gain(linear, 1.5, gamma, Z, pairs, weights, 1e-9, np.full(n, 1 / n))

    def compute(b):
        def entropy(p):
            return -sum(x * log(x) for x in p if x > 0)

        after = sum((b * z).sum() * entropy(b * z / (b * z).sum()) for z in Z.T)
        roots = np.sqrt(b)
        return (
            linear @ b
            + 1.5 * (entropy(b) - gamma * after)
            + weights @ (roots[pairs[:, 0]] * roots[pairs[:, 1]])
        )

    assert value == pytest.approx(compute(b), abs=1e-9)
    assert value <= upper <= value + 1e-6
    assert max(compute(rng.dirichlet(np.ones(n))) for _ in range(2000)) <= upper


def test_a_symmetric_potential_is_as_low_as_one_with_a_weight_for_each_pair():
    pomdp = exchangeable_values((2, 2))
    values = mdp_bound(build_model(pomdp), 1e-9, SECONDS).max(axis=0) + 1e-6
    symmetries = find_symmetries(build_model(pomdp), 10_000, SECONDS)
    bounds = []
    for known in ([], symmetries):
        found = PairPotentials(pomdp, values, np.arange(4), known).minimise(pomdp.start, 10_000_000)
        tree = bare_tree(pomdp, HiddenBounds(potentials=[found]))
        bounds.append(tree.upper_bound(tree.find_or_add_node(pomdp.start)))
    assert bounds[0] == pytest.approx(bounds[1], abs=0.3)  # each within a hundredth of the largest value


@pytest.mark.parametrize(
    "pomdp",
    [exchangeable_values((2, 2)), sharpening_sensor(3, 2), random_questions(4, values=3)],
    ids=["exchangeable", "sensor", "random"],
)
def test_trials_in_the_graph_reach_the_exact_value(pomdp):
    hidden = find_hidden_values(pomdp, build_model(pomdp), [pomdp.start], SECONDS)
    tree = bare_tree(pomdp, hidden)
    root = tree.find_or_add_node(pomdp.start)
    tree.search_graph(root, 0.5, 1e-3, 400_000_000, SECONDS)
    solution = solve(pomdp, precision=1e-3)
    assert solution.lower - ROUNDING <= tree.upper_bound(root) <= solution.upper + 0.01


def test_the_search_with_the_graph_converges_to_the_same_value(monkeypatch):
    pomdp = exchangeable_values((2, 2))
    plain = solve(pomdp, precision=0.01)
    monkeypatch.setattr(trials, "START_WORK", 0)
    with_graph = solve(pomdp, precision=0.01)
    assert plain.converged
    assert with_graph.converged
    assert plain.lower <= with_graph.upper
    assert with_graph.lower <= plain.upper


@pytest.mark.parametrize("paid", [0.3, 0.45])
def test_a_potential_of_one_block_does_not_count_in_another(paid, monkeypatch):
    pomdp = two_hidden_blocks(paid)
    hidden = find_hidden_values(pomdp, build_model(pomdp), [pomdp.start], SECONDS)
    assert any(potential.entropy or len(potential.pairs) for potential in hidden.potentials)
    tree = bare_tree(pomdp, hidden)
    elsewhere = np.array([0, 0, 0.25, 0.25, 0.25, 0.25, 0])
    value = paid / (1 - pomdp.discount)  # whatever the robot does there
    assert tree.upper_bound(tree.find_or_add_node(elsewhere)) >= value - ROUNDING
    plain = solve(pomdp, precision=1e-3)
    monkeypatch.setattr(trials, "START_WORK", 0)
    found = solve(pomdp, precision=1e-3)
    assert found.lower == pytest.approx(plain.lower, abs=1e-3)
    assert found.policy.upper_bound.value(elsewhere) >= value - ROUNDING


def test_a_trial_of_the_graph_ends_where_beliefs_recur_under_a_slow_discount():
    pomdp = values_without_end(3, 0.9, 0.999)
    tree = bare_tree(pomdp)
    tree.add_graph([])
    root = tree.find_or_add_node(pomdp.start)
    for _ in range(50):
        tree.search_graph(root, 0.5, 1e-3, 1_000_000, SECONDS)
    assert tree.work < 100 * 1_000_000


def test_rewards_that_differ_little_but_by_much_of_the_largest_are_no_symmetry():
    pomdp = exchangeable_values((2, 2))
    reward = 1e-14 * pomdp.reward
    reward[2, 0] *= 2
    changed = replace(pomdp, reward=reward)
    assert {image[0] for image in find_symmetries(build_model(changed), 10_000, SECONDS)} == {0}


def test_the_kernel_rejects_what_is_no_potential_or_symmetry():
    pomdp = exchangeable_values((2, 2))
    tree = bare_tree(pomdp)
    none, zero = np.empty((0, 2), np.int32), np.zeros(5)
    with pytest.raises(ValueError, match="one offset per state"):
        tree.add_potential(np.zeros(4), 0.0, 2.0, 0.0, none, np.empty(0), -1)
    with pytest.raises(ValueError, match="power above 1"):
        tree.add_potential(zero, 1.0, 1.0, 0.0, none, np.empty(0), -1)
    with pytest.raises(ValueError, match="unknown state"):
        tree.add_potential(zero, 0.0, 2.0, 0.0, np.array([[0, 7]], np.int32), np.ones(1), -1)
    with pytest.raises(ValueError, match="state of the block"):
        tree.add_potential(zero, 0.0, 2.0, 0.0, none, np.empty(0), 5)
    with pytest.raises(ValueError, match="one state for each state"):
        tree.add_graph([[1, 0]])
    with pytest.raises(ValueError, match="unknown state"):
        tree.add_graph([[0, 1, 2, 3, 5]])
    with pytest.raises(ValueError, match="no graph"):
        tree.search_graph(tree.find_or_add_node(pomdp.start), 0.5, 0.1, 100, 1.0)
