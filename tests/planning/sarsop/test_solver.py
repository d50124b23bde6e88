from __future__ import annotations

import signal
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings

from lcorpp.errors import PolicyError
from lcorpp.planning import BatchPolicy, Planner, Pomdp, Progress, parse_pomdp, read_pomdp, solve
from lcorpp.planning.evaluation.certificate import certificate
from tests.planning.models import LCORPP, SHARED, TIGER, pomdps, shared_model

lcorpp = parse_pomdp(LCORPP)


def test_the_authors_model_at_the_default_precision():
    solution = solve(lcorpp)
    assert 51.656 <= solution.lower <= solution.upper <= 51.658
    assert solution.reason == "precision reached"
    assert solution.policy.value(lcorpp.start) == pytest.approx(solution.lower, abs=1e-12)


def test_the_tiger_problem():
    solution = solve(parse_pomdp(TIGER), precision=0.5)
    assert solution.lower <= 19.372
    assert solution.upper >= 19.371
    assert solution.upper - solution.lower <= 0.5


def test_the_authors_first_steps():
    belief = np.array([0.22, 0.78, 0, 0, 0])  # not turned; the prior of the paper's example
    planner = Planner(solve(lcorpp, belief))
    for action, likely in (("move_forward", 0.717), ("move_forward", 0.958), ("greet", 0.989)):
        assert planner.action(belief) == action
        belief = planner.update(belief, action, "pos")
        assert belief[0] == pytest.approx(likely, abs=5e-4)  # three digits are known
    assert planner.action(belief) == "report_interested"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "least", "most", "gap"),
    [
        ("hallway.pomdp", 0.9939, 1.2064, 1.2),
        ("tiger-grid.pomdp", 2.256, 2.532, 2.5),
        ("network.pomdp", 293.185, 293.821, 80),
        ("aloha.10.pomdp", 534.79, 545.13, 28),
        ("tag-avoid.pomdp", -6.201, -1.899, 20),
    ],
)
def test_bounds_agree_with_those_of_appl(name, least, most, gap):
    solution = solve(read_pomdp(shared_model(name)), time_limit=5)
    assert solution.lower <= most
    assert solution.upper >= least
    assert solution.upper - solution.lower < gap  # better than the initial bounds


@given(pomdps())
@settings(max_examples=12)
def test_vectors_are_achievable(pomdp):
    """No vector exceeds the value of the fully observable problem."""
    solution = solve(pomdp, precision=1e-2, time_limit=1)
    value = np.full(len(pomdp.states), pomdp.reward.max() / (1 - pomdp.discount))
    for _ in range(400):
        value = (pomdp.reward + pomdp.discount * pomdp.transition.dense @ value).max(axis=0)
    assert (solution.policy.vectors <= value + 1e-6).all()  # 400 sweeps at .95 leave 1e-9 of the start


def test_the_policy_earns_its_lower_bound():
    """By enumeration of all observations of 200 steps."""
    tiger = parse_pomdp(TIGER)
    policy = solve(tiger, precision=1e-2).policy
    reached, earned = {(0.5, 0.5): 1.0}, 0.0
    for t in range(200):
        following: dict[tuple[float, float], float] = {}
        for key, chance in reached.items():
            belief = np.array(key)
            a = policy.action(belief)
            earned += tiger.discount**t * chance * float(belief @ tiger.reward[a])
            for column in tiger.observation[a].T:
                weights = (belief @ tiger.transition[a]) * column
                after = tuple(np.round(weights / weights.sum(), 9).tolist())
                following[after] = following.get(after, 0.0) + chance * float(weights.sum())
        reached = following
    assert earned >= policy.value(tiger.start) - 0.01  # later rewards are below .95^200 * 20 < .001


def test_the_upper_bound_never_rises():
    history = solve(parse_pomdp(TIGER), precision=0.1).history
    assert all(a[2] >= b[2] for a, b in pairwise(history))


def test_an_absorbing_state_with_costs():
    text = "discount: 0.9\nvalues: cost\nstates: a end\nactions: stay go\nobservations: o\nstart: a\n"
    text += "O: * uniform\n"
    text += (
        "T: stay identity\nT: go 0 1 0 1\nR: stay : a : * : * 3\nR: go : a : * : * 5\nR: * : end : * : * 1\n"
    )
    solution = solve(parse_pomdp(text), precision=1e-6)
    # going costs 5 and then 1 in every step, 5 + .9 * 10; staying costs 30
    assert solution.lower == pytest.approx(-14)
    assert solution.upper == pytest.approx(-14)
    assert "precision reached" in solution.summary()


def corridor(length: int = 6) -> Pomdp:
    """An observed place and a hidden side: go to the end, look, then open a door."""
    places, sides = range(length), range(2)
    S = 2 * length + 1
    done = S - 1
    T, Z = np.zeros((4, S, S)), np.zeros((4, S, 2 * length + 1))
    reward = np.full((4, S), -1.0)
    reward[:, done] = 0.0
    T[:, done, done] = Z[:, done, 2 * length] = 1.0
    for p in places:
        for side in sides:
            s = 2 * p + side
            T[0, s, 2 * min(p + 1, length - 1) + side] += 0.9
            T[0, s, s] += 0.1
            T[1, s, s] = 1.0
            T[2:, s, done] = 1.0
            reward[2:, s] = -50.0
            if p == length - 1:
                reward[2 + side, s], reward[3 - side, s] = 20.0, -20.0
            sharp = 0.5 + 0.4 * p / (length - 1)
            Z[0, s, 2 * p] = Z[0, s, 2 * p + 1] = 0.5
            Z[2:, s, 2 * p] = Z[2:, s, 2 * p + 1] = 0.5
            Z[1, s, 2 * p + side], Z[1, s, 2 * p + 1 - side] = sharp, 1 - sharp
    start = np.zeros(S)
    start[:2] = 0.5
    names = (*(f"{p}{side}" for p in places for side in "lr"), "done")
    return Pomdp(
        names,
        ("go", "select_action", "left", "right"),
        tuple(map(str, range(2 * length + 1))),
        T,
        Z,
        reward,
        0.95,
        start,
    )


def test_observed_parts_split_the_vectors():
    pomdp = corridor()
    solution = solve(pomdp, precision=1e-3)
    assert solution.reason == "precision reached"
    policy = solution.policy
    # one set per place, one for the end, and one for beliefs over several places
    assert [len(piece.states) for piece in policy.vector_sets] == [2] * 6 + [1, 13]
    assert policy.value(pomdp.start) == pytest.approx(solution.lower)
    assert policy.action(pomdp.start) == 0
    rng = np.random.default_rng(0)
    for _ in range(50):
        belief = rng.dirichlet(np.full(13, 0.3))
        # states outside a set count with the floor, still below the upper bound
        assert (policy.vectors @ belief).max() <= policy.value(belief) + 1e-9
        assert policy.gap(belief) >= 0
    beliefs = rng.dirichlet(np.full(13, 0.3), 20)
    values, actions = BatchPolicy(policy).values_and_actions(beliefs)
    assert values == pytest.approx([policy.value(belief) for belief in beliefs])
    alike = actions == [policy.action(belief) for belief in beliefs]
    assert alike.mean() > 0.8  # equal plans with other first actions differ by rounding alone


def test_a_start_over_several_places():
    pomdp = corridor()
    anywhere = np.append(np.full(12, 1 / 12), 0.0)
    here, there = solve(pomdp, anywhere, precision=1e-2), solve(pomdp, precision=1e-3)
    assert here.reason == "precision reached"
    assert here.policy.value(anywhere) == pytest.approx(here.lower)
    assert here.lower > there.upper  # some of the way is behind it


def test_a_previous_solution_is_used_for_another_start():
    starts = np.random.default_rng(1).dirichlet(np.ones(4), 20)
    starts = np.column_stack([starts, np.zeros(20)])
    first = solve(lcorpp, starts, precision=1e-2)
    again = solve(lcorpp, starts[7], precision=1e-2, previous=first)
    assert (again.trials, again.reason) == (0, "precision reached")
    assert again.lower == pytest.approx(first.policy.value(starts[7]))
    finer = solve(lcorpp, starts[7], precision=1e-4, previous=again)
    alone = solve(lcorpp, starts[7], precision=1e-4)
    assert 0 < finer.trials < alone.trials
    assert finer.lower <= alone.upper
    assert alone.lower <= finer.upper
    with pytest.raises(PolicyError, match="previous solution is for another model"):
        solve(parse_pomdp(TIGER), previous=first)


def test_a_policy_without_upper_bound_has_no_gap():
    policy = solve(lcorpp, precision=0.1).policy
    assert policy.gap(lcorpp.start) <= 0.1
    with pytest.raises(PolicyError, match="no upper bound; solve the model"):
        replace(policy, upper_bound=None).gap(lcorpp.start)


def test_an_interrupt_reaches_the_kernels():
    """The signal arrives while compiled code runs; the search returns its result so far."""
    pomdp = read_pomdp(shared_model("tag-avoid.pomdp"))

    def soon(now: Progress) -> None:
        if now.trials == 1:
            signal.setitimer(signal.ITIMER_REAL, 0.3)

    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        solution = solve(pomdp, precision=1e-6, time_limit=600, callback=soon)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert solution.reason == "interrupted"
    assert solution.lower <= solution.upper


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(file.name for file in SHARED.glob("*.pomdp*")) or ["tag-avoid.pomdp"])
def test_the_certificate_confirms_the_policy(name):
    """The policy contains the pruned vectors that its vectors depend on."""
    pomdp = read_pomdp(shared_model(name))
    found = certificate(solve(pomdp, time_limit=4), max_nodes=20_000, time_limit=600)
    assert found.verdict == "confirmed", found.text
