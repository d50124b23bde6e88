from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import PolicyError
from lcorpp.planning import (
    Policy,
    load_solver,
    parse_pomdp,
    read_alphas,
    read_policy,
    read_pomdp,
    solve_finite_horizon,
    write_alphas,
    write_policy,
)
from lcorpp.planning.evaluation.claims import check_claims
from tests.planning.models import LCORPP, SHARED, TIGER, pomdps
from tests.planning.policies import back_up

tiger = parse_pomdp(TIGER, file="tiger.pomdp")
CORRIDOR = """\
discount: 1
values: cost
states: far near goal
actions: walk
observations: none
start: far
T: walk
0.5 0.5 0
0 0.5 0.5
0 0 1
O: * uniform
R: walk : far : * : * 1
R: walk : near : * : * 1
"""


def find_optimum(pomdp, sweeps=400):
    """Return (S,) the optimal values of the MDP, by plain value iteration."""
    T, values = np.asarray(pomdp.transition), np.zeros(len(pomdp.states))
    for _ in range(sweeps):
        values = (pomdp.reward + pomdp.discount * T @ values).max(axis=0)
    return values


@given(pomdps(discounts=(0.0, 0.5, 0.8)), st.data())
@settings(max_examples=15)
def test_the_bound_is_the_optimum_of_the_mdp(pomdp, data):
    """Vectors of plans pass; one above the optimum in one state does not, whatever the other states."""
    policy = back_up(pomdp, 2)
    check_claims(pomdp, policy, "x.policy")
    state = data.draw(st.integers(0, len(pomdp.states) - 1))
    optimum, scale = find_optimum(pomdp), float(np.abs(pomdp.reward).max()) / (1 - pomdp.discount)
    vectors = np.array(policy.vectors)
    vectors[-1, state] = optimum[state] + 1e-2 * scale + 1e-3
    with pytest.raises(
        PolicyError, match=rf"x.policy: vector {len(vectors)} of action .* in state 's{state}'"
    ):
        check_claims(pomdp, Policy.of(pomdp, vectors, policy.actions), "x.policy")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (1e6, "x.NAME: vector 1 of action 'listen' promises 1e+06 in state 'tiger-left', where no policy"
         " earns more than 200; the rewards of tiger.pomdp are -100 to 10, the discount 0.95"),
        (201, "promises 201 in state"),
        (-2001, "where no policy earns less than -2000"),
        (1e308, "promises 1e+308"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("name", ["alpha", "policy"])
def test_a_read_policy_is_compared_with_its_model(tmp_path, name, value, words):
    path = tmp_path / f"x.{name}"
    write, read = {"alpha": (write_alphas, read_alphas), "policy": (write_policy, read_policy)}[name]
    write(Policy.of(tiger, [[value, value]], [0]), path)
    with pytest.raises(PolicyError) as caught:
        read(path, tiger)
    assert words.replace("NAME", name) in str(caught.value)
    write(Policy.of(tiger, [[200, 200], [-2000, -2000]], [0, 1]), path)
    assert len(read(path, tiger)) == 2


def test_a_low_vector_beside_better_ones_passes():
    check_claims(tiger, Policy.of(tiger, [[-1e9, -1e9], [0, 0]], [0, 1]), "x.policy")


@pytest.mark.parametrize("solver", ["qmdp", "fib"])
def test_tables_of_optimistic_solvers_pass(solver):
    """Their proven vectors may be below what the worst policy earns."""
    maze = replace(tiger, reward=[[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
    for pomdp in (tiger, maze, parse_pomdp(LCORPP)):
        check_claims(pomdp, load_solver(solver)(pomdp, time_limit=10).policy, "x.policy")
    low = Policy.of(maze, [[-1e3, -1e3], [-1e3, -1e3], [-1e3, -1e3]], [0, 1, 2])
    with pytest.raises(PolicyError, match="no policy earns less than"):
        check_claims(maze, low, "x.policy")


def test_vectors_of_few_steps_pass_as_such(tmp_path):
    """Costs of one step are below those of endless time, so that their vector promises more."""
    costs = replace(tiger, reward=[[-1.0, -1.0]] * 3)
    one = solve_finite_horizon(costs, 2).policies[0]
    assert one.horizon == 1
    write_policy(one, tmp_path / "x.policy")
    assert read_policy(tmp_path / "x.policy", costs).horizon == 1
    write_alphas(one, tmp_path / "x.alpha")  # the format has no place for the number of steps
    read_alphas(tmp_path / "x.alpha", costs)
    with pytest.raises(PolicyError, match="promises -1 in state"):
        check_claims(costs, replace(one, horizon=None), "x.policy")
    with pytest.raises(PolicyError, match=r"promises -0\.5 in state"):
        check_claims(costs, Policy.of(costs, [[-0.5, -0.5]], [0]), "x.alpha", finite=True)


def test_discount_1():
    corridor = parse_pomdp(CORRIDOR)
    solution = load_solver("sarsop")(corridor)
    check_claims(corridor, solution.policy, "x.policy")
    with pytest.raises(PolicyError, match=r"promises -3\.9 in state 'far'"):
        check_claims(corridor, Policy.of(corridor, [[-3.9, -2, 0]], [0]), "x.policy")
    endless = replace(tiger, discount=1.0)
    two = solve_finite_horizon(endless, 2).policies[1]
    check_claims(endless, two, "x.policy")
    check_claims(endless, Policy.of(endless, [[1e6, 1e6]], [0]), "x.policy")  # without end, no bound is known
    with pytest.raises(PolicyError, match="no policy earns more than 20;"):
        check_claims(endless, replace(two, vector_sets=Policy.of(endless, [[21, 0]], [0]).vector_sets), "x")


def test_the_case_from_the_field():
    folder = SHARED.parent / "cases" / "pomdp"
    if not folder.is_dir():
        pytest.skip("the cases are not here (shared/cases/pomdp)")
    model = read_pomdp(folder / "15_model.pomdp")
    words = r"promises 1e\+06 in state 'left', where no policy earns more than 200"
    with pytest.raises(PolicyError, match=words):
        read_alphas(folder / "15_false_vector.alpha", model)
