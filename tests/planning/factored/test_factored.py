from __future__ import annotations

import tracemalloc
from itertools import product

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from lcorpp.errors import ModelError
from lcorpp.planning import Factored, Pomdp, cpt as table, flatten, parse_pomdp, solve, start_beliefs
from tests.planning.factored.models import factored_models, rover
from tests.planning.models import LCORPP


def test_the_value_of_the_rover_by_hand():
    """West, look at the rock for free, sample it if it is good (10), then leave (10)."""
    known = (10 * 0.95**2 + 10 * 0.95**4) / 2 + 10 * 0.95**3 / 2
    solution = solve(flatten(rover()), precision=1e-4)
    assert solution.lower == pytest.approx(known, abs=1e-4)
    assert solution.lower - 1e-9 <= known <= solution.upper + 1e-9


def test_names_of_flat_states():
    flat = flatten(rover())
    assert flat.states[:3] == ("rover=left,rock=good", "rover=left,rock=bad", "rover=middle,rock=good")
    assert flat.actions == ("west", "east", "check", "sample")
    # the exit and a bad reading never occur together
    assert flat.observations == (
        "rover=left,sensor=good",
        "rover=left,sensor=bad",
        "rover=middle,sensor=good",
        "rover=middle,sensor=bad",
        "rover=exit,sensor=good",
    )


def test_flat_tables_by_hand():
    flat = flatten(rover())
    check, sample = flat.action_index("check"), flat.action_index("sample")
    middle = flat.state_index("rover=middle,rock=bad")
    assert flat.observation[check, middle].tolist() == [0, 0, 0.2, 0.8, 0]
    left = flat.state_index("rover=left,rock=good")
    assert flat.transition[sample, left, flat.state_index("rover=left,rock=bad")] == 1
    assert flat.reward[:, left].tolist() == [-100, 0, 0, 10]
    assert flat.start.tolist() == [0, 0, 0.5, 0.5, 0, 0]


def test_a_single_variable_keeps_its_value_names():
    problem = Factored.of(
        states={"door": range(2)},
        actions="wait",
        start={"door": [0.25, 0.75]},
        transition={"door": "same"},
        reward=-1,
        discount=0.5,
    )
    flat = flatten(problem)
    assert (flat.states, flat.actions, flat.observations) == (("0", "1"), ("wait",), ("none",))
    assert flat.reward.tolist() == [[-1, -1]]
    assert flat.start.tolist() == [0.25, 0.75]


def test_several_action_and_observation_variables():
    problem = Factored.of(
        states={"x": "a b"},
        actions={"arm": "up down", "base": "stay go"},
        observations={"eye": "a b", "ear": "a b"},
        start={"x": "a"},
        transition={"x": table("base x", {"* *": "same", "go *": "uniform"})},
        observation={
            "eye": table("x'", {"a": [0.9, 0.1], "b": [0.1, 0.9]}),
            # sounds follow the observed part
            "ear": table("eye", {"a": "a", "b": {"a": 0.5, "b": 0.5}}),
        },
        reward={"both": table("arm base", {"up go": 1})},
        discount=0.9,
    )
    flat = flatten(problem)
    assert flat.actions == ("arm=up,base=stay", "arm=up,base=go", "arm=down,base=stay", "arm=down,base=go")
    assert flat.observations == ("eye=a,ear=a", "eye=b,ear=a", "eye=b,ear=b")
    assert flat.observation[0, 1] == pytest.approx([0.1, 0.45, 0.45])
    assert flat.reward[:, 0].tolist() == [0, 1, 0, 0]


def test_rewards_may_depend_on_the_next_state():
    problem = Factored.of(
        states={"x": "a b"},
        actions="go",
        observations="quiet loud",
        start={"x": "a"},
        transition={"x": table("x", {"*": [0.25, 0.75]})},
        observation=table("x'", {"a": "quiet", "b": [0.5, 0.5]}),
        reward={
            "there": table("x x'", {"a b": 8}),
            "heard": table("x' observation", {"b loud": -16, "a quiet": 4}),
        },
        discount=0.9,
    )
    # from a: 8 * 3/4 - 16 * 3/4 * 1/2 + 4 * 1/4; from b without the first term
    assert flatten(problem).reward.tolist() == [[1.0, -5.0]]


def test_variables_may_share_a_table():
    problem = Factored.of(
        states={"x": "a b", "y": "c d"},
        actions="go",
        start={"x y": {"a c": 0.5, ("b", "d"): 0.5}},
        transition={"y x": table("x y", {"* *": "same", "a c": {"d b": 1}})},
        reward={"none": 0},
        discount=0.9,
    )
    flat = flatten(problem)
    assert flat.states == ("x=a,y=c", "x=a,y=d", "x=b,y=c", "x=b,y=d")
    assert flat.start.tolist() == [0.5, 0, 0, 0.5]
    assert flat.transition[0].argmax(axis=1).tolist() == [3, 1, 2, 3]
    assert flatten(problem, reachable=True).states == ("x=a,y=c", "x=b,y=d")


def test_a_value_may_have_the_name_of_a_keyword():
    problem = Factored.of(
        states={"x": "same other"},
        actions="go",
        start={"x": "uniform"},
        transition={"x": table("x", {"*": "same"})},
        reward={"none": 0},
        discount=0.9,
    )
    assert flatten(problem).transition[0].tolist() == [[1, 0], [1, 0]]


def dense(problem: Factored) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return transition, observation, reward and start by enumeration of all combinations."""
    tables = {id(t): np.asarray(t) for t in (*problem.start, *problem.transition, *problem.observation)}

    def chance(parts, values):
        result = 1.0
        for t in parts:
            result *= tables[id(t)][tuple(values[name] for name in (*t.parents, *t.children))]
        return result

    def cases(variables, sign=""):
        names = [v.name + sign for v in variables]
        return [
            dict(zip(names, numbers, strict=True))
            for numbers in product(*(range(len(v.values)) for v in variables))
        ]

    before, after = cases(problem.states), cases(problem.states, "'")
    actions, looks = cases(problem.actions), cases(problem.observations)
    seen = cases(problem.observed)
    T = np.array([[[chance(problem.transition, a | x | y) for y in after] for x in before] for a in actions])
    Z = np.zeros((len(actions), len(after), len(seen) * len(looks)))
    for i, a in enumerate(actions):
        for j, y in enumerate(after):
            for k, (s, o) in enumerate(product(seen, looks)):
                if all(y[name + "'"] == value for name, value in s.items()):
                    Z[i, j, k] = chance(problem.observation, a | y | o)
    R = np.zeros(T.shape[:2])
    for i, a in enumerate(actions):
        for j, x in enumerate(before):
            for k, y in enumerate(after):
                for o in looks:
                    p = T[i, j, k] * chance(problem.observation, a | y | o)
                    values = a | x | y | o
                    for t in problem.reward.values():
                        R[i, j] += p * np.asarray(t)[tuple(values[name] for name in t.parents)]
    return T, Z, R, np.array([chance(problem.start, x) for x in before])


@settings(max_examples=10, suppress_health_check=list(HealthCheck))
@given(factored_models())
def test_flat_is_the_product_of_the_tables(problem):
    T, Z, R, start = dense(problem)
    flat = flatten(problem)
    # 1e-12: sums of some dozen products
    assert np.abs(np.asarray(flat.transition) - T).max() < 1e-12
    occurring = Z.any(axis=(0, 1)) if len(problem.observed) + len(problem.observations) > 1 else slice(None)
    assert np.abs(np.asarray(flat.observation) - Z[:, :, occurring]).max() < 1e-12
    assert np.abs(flat.reward - R).max() < 1e-12
    assert np.abs(flat.start - start).max() < 1e-12


@settings(max_examples=10, suppress_health_check=list(HealthCheck))
@given(factored_models())
def test_reachable_states_are_a_subset(problem):
    whole, part = flatten(problem), flatten(problem, reachable=True)
    leads = (np.asarray(whole.transition) > 0).any(axis=0)
    known = whole.start > 0
    while (grown := known | leads[known].any(axis=0)).sum() > known.sum():
        known = grown
    assert part.states == tuple(name for name, here in zip(whole.states, known, strict=True) if here)
    kept = np.ix_(range(len(whole.actions)), known, known)
    assert (np.asarray(part.transition) == np.asarray(whole.transition)[kept]).all()
    assert (part.reward == whole.reward[:, known]).all()
    assert (part.start == whole.start[known]).all()
    for name in part.observations:
        mine, theirs = part.observation_index(name), whole.observation_index(name)
        expected = np.asarray(whole.observation)[:, known, theirs]
        assert (np.asarray(part.observation)[:, :, mine] == expected).all()


@settings(max_examples=10, suppress_health_check=list(HealthCheck))
@given(factored_models())
def test_start_beliefs_mix_to_the_start_belief(problem):
    flat = flatten(problem)
    starts = start_beliefs(problem, flat)
    assert starts.sum(axis=1) == pytest.approx(1)
    share = np.array([(flat.start[belief > 0]).sum() for belief in starts])
    assert (np.diff(share) <= 1e-12).all()
    assert share @ starts == pytest.approx(flat.start)
    seen = {variable.name for variable in problem.observed}
    for belief in starts if len(problem.states) > 1 else ():
        names = [flat.states[s].split(",") for s in np.flatnonzero(belief)]
        assert len({tuple(part for part in name if part.split("=")[0] in seen) for name in names}) == 1


def test_start_beliefs_after_an_observation_are_worth_more():
    problem = rover(start={"rover": {"left": 0.5, "middle": 0.5}, "rock": "good"})
    flat = flatten(problem)
    starts = start_beliefs(problem, flat)
    assert [[flat.states[s] for s in np.flatnonzero(b)] for b in starts] == [
        ["rover=left,rock=good"],
        ["rover=middle,rock=good"],
    ]
    blind = solve(flat).lower
    seeing = solve(flat, starts).policy
    assert np.mean([seeing.value(belief) for belief in starts]) > blind + 0.1


def test_a_flat_problem_round_trips():
    pomdp = parse_pomdp(LCORPP)
    back = flatten(Factored.of_pomdp(pomdp))
    assert back.fingerprint == pomdp.fingerprint
    assert (back.start == pomdp.start).all()


def test_a_large_grid_is_sparse():
    """90,000 places: a matrix over them would take 65 GB."""
    side = 300
    moves = {"east": (1, 0), "north": (0, 1)}
    problem = Factored.of(
        states={"x": range(side), "y": range(side)},
        observed="x",
        actions="east north",
        observations={"near": "yes no"},
        start={"x": 0, "y": 0},
        transition={
            axis: table(
                f"action {axis}",
                {"* *": "same"}
                | {
                    f"{move} {i}": {min(i + step[k], side - 1): 0.75, i: 0.25}
                    for i in range(side - 1)
                    for move, step in moves.items()
                    if step[k]
                },
            )
            for k, axis in enumerate("xy")
        },
        observation=table("y'", {"*": "no", f"{side - 1}": "yes"}),
        reward=table("x' y'", {f"{side - 1} {side - 1}": 1}),
        discount=0.99,
    )
    tracemalloc.start()
    flat = flatten(problem)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(flat.transition.values) == 2 * (2 * side * side - side)
    assert len(flat.observations) == 2 * side
    assert flat.reward.sum() == pytest.approx(2 * 0.75 + 2)
    assert peak < 200e6


def test_unreachable_states_take_no_memory():
    names = [f"x{i}" for i in range(40)]
    problem = Factored.of(
        states=dict.fromkeys(names, "off on"),
        actions="press wait",
        start=dict.fromkeys(names, "off"),
        transition=dict.fromkeys(names, "same")
        | {"x7": table("action x7", {"* *": "same", "press *": "on"})},
        reward={"none": 0},
        discount=0.9,
    )
    with pytest.raises(
        ModelError, match="1099511627776 states are too many to be written out; see `reachable`"
    ):
        flatten(problem)
    assert len(flatten(problem, reachable=True).states) == 2


def test_a_flattened_model_is_a_pomdp():
    assert isinstance(flatten(rover()), Pomdp)
    assert rover().equals(rover())
    assert not rover().equals(rover(discount=0.9))
    assert not rover().equals(rover(start={"rover": "left", "rock": "uniform"}))
