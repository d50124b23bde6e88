from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings

from lcorpp.errors import ModelError
from lcorpp.planning import parse_pomdp, read_pomdp
from lcorpp.planning.solver_table import SOLVER_NAMES
from lcorpp.planning.solvers import load_solver
from tests.planning.models import LCORPP, TIGER, pomdps, shared_model
from tests.planning.solvers.brute_force import best, tail

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)


@pytest.mark.parametrize("name", SOLVER_NAMES)
def test_all_solvers_have_one_signature_and_agree(name):
    reports = []
    solution = load_solver(name)(tiger, [0.5, 0.5], precision=0.01, time_limit=60, callback=reports.append)
    assert solution.lower <= 19.372
    assert solution.upper >= 19.371
    assert solution.policy.fingerprint == tiger.fingerprint
    assert reports
    assert reports[-1].upper >= reports[-1].lower
    assert solution.history[0][0] <= solution.seconds
    assert solution.gap(tiger.start) == pytest.approx(
        solution.policy.upper_bound.value(tiger.start) - solution.policy.value(tiger.start)
    )
    assert "value at the start in" in solution.summary()


@pytest.mark.parametrize(("solver", "precision"), [("sarsop", 2e-3), ("perseus", 0.05)])
@pytest.mark.parametrize(
    ("model", "least", "most"),
    [
        ("tiger.95.pomdp", 19.371, 19.372),
        ("4x3.95.pomdp", 1.8899, 1.8909),
        ("cheese.95.pomdp", 3.4854, 3.4863),
    ],
)
def test_known_values_are_bracketed(solver, precision, model, least, most):
    solution = load_solver(solver)(read_pomdp(shared_model(model)), precision=precision, time_limit=600)
    assert solution.reason == "precision reached"
    # both brackets hold the value, so each one's lower end is below the other's upper end
    assert solution.lower <= most
    assert solution.upper >= least
    assert solution.upper - solution.lower <= precision


@pytest.mark.parametrize(
    ("solver", "options"),
    [("sarsop", {"time_limit": 1}), ("perseus", {"time_limit": 0.5, "beliefs": 50})],
)
@given(pomdp=pomdps(discounts=(0.3, 0.5)))
@settings(max_examples=6)
def test_brute_force_is_between_the_bounds(solver, options, pomdp):
    solution = load_solver(solver)(pomdp, precision=1e-2, **options)
    assert solution.lower <= solution.upper
    exact, (least, most) = best(pomdp, pomdp.start, 4), tail(pomdp, 4)
    assert solution.lower <= exact + most + 1e-9
    assert solution.upper >= exact + least - 1e-9


@pytest.mark.parametrize("solver", ["sarsop", "perseus"])
def test_several_starts_all_reach_the_precision(solver):
    starts = np.array([[0.5, 0.5, 0, 0, 0], [0.9, 0.1, 0, 0, 0], [0, 0, 0.2, 0.8, 0]])
    solution = load_solver(solver)(lcorpp, starts, precision=0.1)
    assert solution.reason == "precision reached"
    assert all(solution.gap(start) <= 0.1 + 1e-9 for start in starts)


@pytest.mark.parametrize(
    ("solver", "calls"), [("sarsop", 3), ("perseus", 3), ("exact", 2), ("qmdp", 1), ("fib", 1)]
)
def test_an_interrupt_returns_the_best_so_far(solver, calls):
    reports = []

    def stop(progress):
        reports.append(progress)
        if len(reports) == calls:
            raise KeyboardInterrupt

    solution = load_solver(solver)(tiger, callback=stop)
    assert (solution.reason, solution.trials) == ("interrupted", reports[-1].trials)
    assert len(reports) == calls
    assert solution.lower == pytest.approx(reports[-1].lower, abs=1e-9)
    assert solution.upper == pytest.approx(reports[-1].upper, abs=1e-9)
    assert solution.policy.value(tiger.start) - 1e-9 <= solution.lower <= 19.372
    assert solution.upper >= 19.371


@pytest.mark.parametrize("solver", ["sarsop", "perseus", "exact"])
def test_a_tiny_time_limit_returns_a_result(solver):
    solution = load_solver(solver)(lcorpp, time_limit=1e-9)
    assert solution.reason == "time limit"
    assert solution.lower <= 51.657 <= solution.upper + 1e-9


@pytest.mark.parametrize("solver", SOLVER_NAMES)
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *(({"precision": value}, "expected a .*positive number") for value in (0, -1, float("nan"))),
        *(({"time_limit": value}, "expected a .*positive number") for value in (0, -1, float("nan"))),
        *(({"start": start}, "cannot have shape") for start in ([1.0], [0.5] * 5, [[[0.5] * 2]])),
        ({"start": [0.5, 0.4]}, "not a distribution"),
        ({"start": np.empty((0, 2))}, "no start belief"),
    ],
)
def test_invalid_arguments(solver, arguments, message):
    with pytest.raises(ModelError, match=message):
        load_solver(solver)(tiger, **arguments)


def test_an_unknown_name_is_an_error():
    with pytest.raises(ModelError, match="unknown solver 'magic'; expected one of sarsop, exact, perseus"):
        load_solver("magic")


def test_the_table_imports_no_solver():
    code = (
        "import sys, lcorpp.planning.solvers;"
        "heavy = {'scipy', 'scipy.optimize', 'lcorpp.planning.solvers.perseus', 'lcorpp.planning.sarsop'};"
        "print(*(heavy & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []
