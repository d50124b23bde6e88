"""The cache of policies: equal results, its keys, and what it does not keep."""

import os
from pathlib import Path

import numpy as np
import pytest

from lcorpp.planning import SOLVER_NAMES, SolverOptions, flatten, parse_pomdp, policy_cache
from lcorpp.planning.policy_cache import find_cache_folder, solve_cached
from tests.planning.factored.models import rover
from tests.planning.models import LCORPP, TIGER

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)
STARTS = np.array([[0.5, 0.5], [0.9, 0.1]])
FAST = SolverOptions(precision=0.1)


def entries(folder: Path) -> list[Path]:
    return sorted((folder / "policies").glob("*"))


def assert_equal(one, other) -> None:
    assert (one.lower, one.upper, one.seconds, one.reason) == (
        other.lower,
        other.upper,
        other.seconds,
        other.reason,
    )
    assert (one.history, one.beliefs, one.trials) == (other.history, other.beliefs, other.trials)
    assert (one.solver, one.start_count, len(one.policy)) == (
        other.solver,
        other.start_count,
        len(other.policy),
    )
    np.testing.assert_array_equal(one.start, other.start)
    np.testing.assert_array_equal(one.policy.vectors, other.policy.vectors)
    np.testing.assert_array_equal(one.policy.actions, other.policy.actions)
    assert one.policy.fingerprint == other.policy.fingerprint
    rng = np.random.default_rng(0)
    for belief in rng.dirichlet(np.ones(len(one.start)), 20):
        assert one.gap(belief) == other.gap(belief)


@pytest.mark.parametrize("name", SOLVER_NAMES)
def test_the_second_call_returns_the_same_solution(tmp_path, name, monkeypatch):
    options = SolverOptions(name, precision=0.1)
    first = solve_cached(tiger, STARTS, options, folder=tmp_path)
    monkeypatch.setattr(policy_cache, "load_solver", None)  # nothing is solved
    second = solve_cached(tiger, STARTS, options, folder=tmp_path)
    assert (first.cached, second.cached, first.solver) == (False, True, name)
    assert_equal(first, second)
    assert len(entries(tmp_path)) == 1


def test_the_bound_at_mixtures_is_kept_and_is_another_entry(tmp_path):
    solve_cached(tiger, STARTS, FAST, folder=tmp_path)
    mixed = np.eye(2)
    first, second = (solve_cached(tiger, STARTS, FAST, mixed=mixed, folder=tmp_path) for _ in range(2))
    assert (first.cached, second.cached) == (False, True)
    assert_equal(first, second)
    assert max(second.gap(np.array([p, 1 - p])) for p in np.linspace(0, 1, 50)) <= 0.1
    assert len(entries(tmp_path)) == 2


def test_policies_of_several_vector_sets(tmp_path):
    pomdp = flatten(rover())  # its place is observed
    first, second = (solve_cached(pomdp, pomdp.start[None], FAST, folder=tmp_path) for _ in range(2))
    assert second.cached
    assert len(second.policy.vector_sets) > 1
    assert_equal(first, second)


def test_other_arguments_are_other_entries(tmp_path, monkeypatch):
    solve_cached(tiger, STARTS, FAST, folder=tmp_path)
    cases = [
        (tiger, STARTS[:1], FAST),
        (tiger, STARTS, SolverOptions(precision=0.2)),
        (tiger, STARTS, SolverOptions(precision=0.1, time_limit=50)),
        (tiger, STARTS, SolverOptions("perseus", precision=0.1)),
        (parse_pomdp(TIGER.replace("-100", "-90")), STARTS, FAST),
    ]
    assert not any(solve_cached(*case, folder=tmp_path).cached for case in cases)
    assert all(solve_cached(*case, folder=tmp_path).cached for case in cases)
    monkeypatch.setattr(policy_cache, "_hash_code", lambda: "changed")
    assert not solve_cached(tiger, STARTS, FAST, folder=tmp_path).cached


@pytest.mark.parametrize("damage", [b"", b"PK", None, "cut", 0.0, 0.25, 0.5, 0.75, 0.999])
def test_a_damaged_entry_is_computed_again(tmp_path, damage):
    first = solve_cached(tiger, STARTS, FAST, folder=tmp_path)
    (entry,) = entries(tmp_path)
    content = entry.read_bytes()
    if damage == "cut":
        damage = content[: len(content) // 2]
    elif isinstance(damage, float):  # a flipped bit, wherever it is
        place, damage = int(damage * len(content)), bytearray(content)
        damage[place] ^= 1
    elif damage is None:  # an entry of another format
        np.savez(tmp_path / "x.npz", facts=np.array("{}"))
        damage = (tmp_path / "x.npz").read_bytes()
    entry.write_bytes(damage)
    again = solve_cached(tiger, STARTS, FAST, folder=tmp_path)
    assert not again.cached
    np.testing.assert_array_equal(again.policy.vectors, first.policy.vectors)
    assert solve_cached(tiger, STARTS, FAST, folder=tmp_path).cached


def test_interrupted_searches_and_own_solvers_are_not_kept(tmp_path):
    def stop(_):
        raise KeyboardInterrupt

    stopped = solve_cached(lcorpp, lcorpp.start[None], SolverOptions(), folder=tmp_path, callback=stop)
    assert (stopped.reason, stopped.converged) == ("interrupted", False)
    (tmp_path / "own.py").write_text("from lcorpp.planning import solve\n")
    own = SolverOptions(f"{tmp_path / 'own.py'}:solve")
    assert not any(solve_cached(tiger, STARTS, own, folder=tmp_path).cached for _ in range(2))
    assert entries(tmp_path) == []


def test_a_time_limit_is_a_result_that_is_kept(tmp_path):
    short = SolverOptions(time_limit=1e-9)
    first, second = (solve_cached(lcorpp, lcorpp.start[None], short, folder=tmp_path) for _ in range(2))
    assert (first.reason, second.reason, second.cached) == ("time limit", "time limit", True)


def test_a_folder_that_cannot_be_written_is_not_used(tmp_path):
    (tmp_path / "file").write_text("")
    assert not any(solve_cached(tiger, STARTS, FAST, folder=tmp_path / "file").cached for _ in range(2))
    assert not solve_cached(tiger, STARTS, FAST).cached


def test_the_oldest_entries_are_deleted(tmp_path, monkeypatch):
    options = [SolverOptions(precision=precision) for precision in (0.1, 0.2, 0.3)]
    for number, option in enumerate(options):
        solve_cached(tiger, STARTS, option, folder=tmp_path)
        for entry in entries(tmp_path):  # as old as its number
            if entry.stat().st_mtime > 1000:
                os.utime(entry, (number, number))
    size = sum(entry.stat().st_size for entry in entries(tmp_path))
    monkeypatch.setattr(policy_cache, "MAX_BYTES", 7 * size // 6)  # one more is too many
    solve_cached(tiger, STARTS, SolverOptions(precision=0.4), folder=tmp_path)
    assert [solve_cached(tiger, STARTS, o, folder=tmp_path).cached for o in reversed(options)] == [
        True,
        True,
        False,
    ]


@pytest.mark.parametrize(
    ("environment", "folder"),
    [
        ({"LCORPP_CACHE": "/a", "XDG_CACHE_HOME": "/b"}, "/a"),
        ({"LCORPP_CACHE": "", "XDG_CACHE_HOME": "/b"}, None),
        ({"XDG_CACHE_HOME": "/b"}, "/b/lcorpp"),
        ({"XDG_CACHE_HOME": ""}, "/c/.cache/lcorpp"),
    ],
)
def test_the_folder_of_the_user(monkeypatch, environment, folder):
    monkeypatch.delenv("LCORPP_CACHE")
    for name, value in ({"HOME": "/c"} | environment).items():
        monkeypatch.setenv(name, value)
    assert find_cache_folder() == (None if folder is None else Path(folder))
