"""Blocks that the starts reach: their definition, and that searches with them find the same values."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning import Pomdp, _native, solve
from lcorpp.planning.evaluation.certificate import certificate
from lcorpp.planning.sarsop import reachable_blocks
from lcorpp.planning.sarsop.kernel_model import build_model
from lcorpp.planning.solvers.heuristic_search import OnlinePlanner
from lcorpp.planning.solvers.perseus import solve_perseus

PLACES, ROCKS = 3, 3


def sparse_model(seed: int, size: int = 12, actions: int = 3, signals: int = 3) -> Pomdp:
    """Transitions and observations with one or two outcomes, so that few states are together in a belief."""
    rng = np.random.default_rng(seed)

    def rows(count: int) -> np.ndarray:
        table = np.zeros((actions, size, count))
        for a in range(actions):
            for s in range(size):
                likely, other = rng.integers(count, size=2)
                share = rng.choice([1.0, 1.0, 0.75])
                table[a, s, likely] += share
                table[a, s, other] += 1 - share
        return table

    names = (
        tuple(f"{kind}{i}" for i in range(n)) for kind, n in (("s", size), ("a", actions), ("o", signals))
    )
    start = np.zeros(size)
    start[rng.integers(size, size=2)] = 0.5
    start /= start.sum()
    return Pomdp(*names, rows(size), rows(signals), rng.normal(size=(actions, size)) * 3, 0.9, start)


def row_of_rocks() -> Pomdp:
    """Places in a row, where the robot knows its place though no observation shows it; rocks good or bad."""
    S = PLACES * 2**ROCKS
    T, Z = np.zeros((4, S, S)), np.zeros((4, S, 3))
    reward = np.zeros((4, S))
    for place in range(PLACES):
        for rocks in range(2**ROCKS):
            s, good = place * 2**ROCKS + rocks, rocks >> place & 1
            T[0, s, max(place - 1, 0) * 2**ROCKS + rocks] = 1
            T[1, s, min(place + 1, PLACES - 1) * 2**ROCKS + rocks] = 1
            T[2, s, s - (good << place)] = 1  # sample
            T[3, s, s] = 1  # look
            Z[:3, s, 0] = 1
            Z[3, s, 1:] = (0.2, 0.8) if good else (0.8, 0.2)
            reward[2, s] = 10 if good else -10
            reward[:, s] -= 0.1
    start = np.zeros(S)
    start[: 2**ROCKS] = 1 / 2**ROCKS
    names = (tuple(f"{kind}{i}" for i in range(n)) for kind, n in (("s", S), ("a", 4), ("o", 3)))
    return Pomdp(*names, T, Z, reward, 0.9, start)


def find(pomdp, supports) -> np.ndarray:
    begins = np.cumsum([0, *map(len, supports)]).astype(np.int64)
    states = np.concatenate([np.array(sorted(support), dtype=np.int32) for support in supports])
    return _native.find_reachable_blocks(build_model(pomdp), begins, states)


def blocks_by_definition(pomdp: Pomdp, supports: list[set[int]]) -> list[int]:
    """Merge, one pair at a time, what the same action and observation reach from a block or from a start."""
    A, S, O = pomdp.observation.shape  # noqa: E741
    T, Z = pomdp.transition.dense > 0, pomdp.observation.dense > 0
    reached = set().union(*supports)
    while True:
        more = {int(n) for s in reached for a in range(A) for n in np.flatnonzero(T[a, s])}
        if more <= reached:
            break
        reached |= more
    block = {s: s for s in reached}
    sources = list(supports)
    while True:
        before = dict(block)
        groups = [[s for s in reached if block[s] == b] for b in set(block.values())]
        for group in [*groups, *sources]:
            for a in range(A):
                for o in range(O):
                    found = {block[n] for s in group for n in np.flatnonzero(T[a, s] & Z[a, :, o]).tolist()}
                    block = {s: min(found) if b in found else b for s, b in block.items()}
        if block == before:
            spread = [start for start in supports if len({block[s] for s in start}) > 1]
            if not spread or len(sources) > len(supports):
                break
            sources.append(set().union(*spread))
    numbers = list(dict.fromkeys(block[s] for s in sorted(reached)))
    return [numbers.index(block[s]) if s in reached else -1 for s in range(S)]


@given(seed=st.integers(0, 10**6), data=st.data())
@settings(max_examples=30)
def test_blocks_agree_with_their_definition(seed, data):
    pomdp = sparse_model(seed)
    support = st.sets(st.integers(0, 11), min_size=1, max_size=3)
    supports = data.draw(st.lists(support, min_size=1, max_size=3))
    assert find(pomdp, supports).tolist() == blocks_by_definition(pomdp, supports)


def test_places_are_blocks():
    pomdp = row_of_rocks()
    assert set(build_model(pomdp).export_blocks().tolist()) == {0}
    expected = np.repeat(np.arange(PLACES), 2**ROCKS).tolist()
    assert find(pomdp, [set(range(2**ROCKS))]).tolist() == expected


@pytest.mark.parametrize(
    ("begins", "states", "message"),
    [
        ([0, 2], [0], "do not fit together"),
        ([1, 1], [0], "do not fit together"),
        ([0], [], "do not fit together"),
        ([0, 0, 1], [0], "a start has no states"),
        ([0, 1], [64], "out of range"),
        ([0, 1], [-1], "out of range"),
    ],
)
def test_wrong_starts_are_refused(begins, states, message):
    model = build_model(row_of_rocks())
    with pytest.raises(ValueError, match=message):
        _native.find_reachable_blocks(model, np.array(begins, np.int64), np.array(states, np.int32))


@pytest.fixture
def refined():
    """Refine the blocks of all models."""
    with patch.object(reachable_blocks, "MAX_BLOCK_STATES", 0):
        yield


def agree(one, other, precision=2e-3) -> bool:
    return one.lower <= other.upper + precision and other.lower <= one.upper + precision


@pytest.mark.parametrize("seed", range(12))
def test_searches_find_the_same_values(refined, seed):
    pomdp = sparse_model(seed)
    found = solve(pomdp, precision=1e-3, time_limit=20)
    with patch.object(reachable_blocks, "MAX_BLOCK_STATES", 4096):
        plain = solve(pomdp, precision=1e-3, time_limit=20)
    assert found.reason == plain.reason == "precision reached"
    assert agree(found, plain)
    assert certificate(found).verdict == "confirmed"
    assert found.policy.value(pomdp.start) == pytest.approx(found.lower, abs=1e-9)
    assert found.policy.upper_bound.value(pomdp.start) == pytest.approx(found.upper, abs=1e-9)


def test_vectors_are_stored_over_the_places(refined):
    pomdp = row_of_rocks()
    found = solve(pomdp, precision=1e-2, time_limit=60)
    assert found.reason == "precision reached"
    assert {len(part.states) for part in found.policy.vector_sets} == {2**ROCKS}
    with patch.object(reachable_blocks, "MAX_BLOCK_STATES", 4096):
        assert agree(found, solve(pomdp, precision=1e-2, time_limit=60), 0)


@pytest.mark.parametrize("seed", range(6))
def test_several_starts_and_their_mixtures(refined, seed):
    pomdp = sparse_model(seed)
    starts = np.eye(12)[[0, 5]]
    found = solve(pomdp, start=starts, mixed=starts, precision=1e-3, time_limit=20)
    with patch.object(reachable_blocks, "MAX_BLOCK_STATES", 4096):
        for weight in (0.0, 0.3, 0.8, 1.0):
            start = weight * starts[0] + (1 - weight) * starts[1]
            plain = solve(pomdp, start=start, precision=1e-4, time_limit=20)
            assert found.policy.value(start) <= plain.upper + 1e-6
            assert found.policy.upper_bound.value(start) >= plain.lower - 1e-6
            assert found.policy.gap(start) <= 2e-3


@pytest.mark.parametrize("seed", range(6))
def test_a_previous_solution_from_another_start_is_used(refined, seed):
    pomdp = sparse_model(seed)
    first = solve(pomdp, precision=1e-3, time_limit=20)
    start = np.full(12, 1 / 12)
    second = solve(pomdp, start=start, previous=first, precision=1e-3, time_limit=20)
    back = solve(pomdp, previous=second, precision=1e-3, time_limit=20)
    with patch.object(reachable_blocks, "MAX_BLOCK_STATES", 4096):
        assert agree(second, solve(pomdp, start=start, precision=1e-3, time_limit=20))
    assert agree(first, back)
    assert certificate(back).verdict == "confirmed"
    assert certificate(second).verdict == "confirmed"


def test_an_online_planner_searches_from_any_belief(refined):
    pomdp = row_of_rocks()
    planner = OnlinePlanner(pomdp, trials=30, seconds=60, precision=1e-2)
    rng = np.random.default_rng(1)
    for start in (pomdp.start, rng.dirichlet(np.ones(len(pomdp.states))), pomdp.start):
        found = planner.search(start)
        with patch.object(reachable_blocks, "MAX_BLOCK_STATES", 4096):
            plain = solve(pomdp, start=start, precision=0.5, time_limit=60)
        assert found.lower <= plain.upper + 1e-6
        assert plain.lower <= found.upper + 1e-6


def test_perseus_uses_them(refined):
    pomdp = row_of_rocks()
    found = solve_perseus(pomdp, precision=0.5, time_limit=20, beliefs=200)
    with patch.object(reachable_blocks, "MAX_BLOCK_STATES", 4096):
        assert agree(found, solve(pomdp, precision=1e-2, time_limit=60))
