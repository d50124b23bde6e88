"""A solver in the user's file: its policy or solution is used, and its faults are errors with the line."""

import numpy as np
import pytest

from lcorpp.errors import ModelError
from lcorpp.planning import Policy, SolverOptions, load_solver, parse_pomdp, solve
from tests.planning.models import LCORPP, TIGER

tiger = parse_pomdp(TIGER)

BLIND = """
import numpy as np
from lcorpp.planning import Policy

def blind(pomdp, start, *, precision, time_limit, callback):
    '''The best single action for ever; its value is the solution of a linear system.'''
    identity = np.eye(len(pomdp.states))
    table = [np.linalg.solve(identity - pomdp.discount * pomdp.transition[a], pomdp.reward[a])
             for a in range(len(pomdp.actions))]
    assert start.ndim == 2
    return Policy.of(pomdp, table, range(len(table)))
"""


@pytest.fixture
def write(tmp_path):
    def write(body: str, head: str = "from dataclasses import replace\nfrom lcorpp import planning\n") -> str:
        (tmp_path / "own.py").write_text(head + body)
        return f"{tmp_path / 'own.py'}:own"

    return write


def test_a_policy_gets_bounds(write):
    own = load_solver(write(BLIND, "").replace(":own", ":blind"))
    solution = own(tiger)
    assert solution.lower == pytest.approx(-20)  # listening for ever, at 1 a step and discount 0.95
    assert solution.lower == solution.policy.value(tiger.start)
    assert 19.371 <= solution.upper == pytest.approx(solution.lower + solution.gap(tiger.start))
    assert (solution.reason, solution.converged) == ("own solver ended", False)
    several = own(tiger, [[0.5, 0.5], [1, 0]], precision=500)
    assert (several.reason, several.start_count) == ("precision reached", 2)


def test_a_solution_is_returned_as_it_is(write):
    text = "def own(pomdp, start, **options):\n    return planning.solve(pomdp, start, **options)\n"
    solution, expected = load_solver(write(text))(tiger, precision=0.01), solve(tiger, precision=0.01)
    assert (solution.lower, solution.upper, solution.reason) == (
        expected.lower,
        expected.upper,
        expected.reason,
    )
    np.testing.assert_array_equal(solution.policy.vectors, expected.policy.vectors)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return pomdp.start", r"own\.py:3: own\(\) returned a ndarray; expected a Solution or a Policy"),
        ("return None", r"own\(\) returned a NoneType"),
        ("return 1 / 0", r"own\.py:4: own\(\) failed: ZeroDivisionError"),
        ("raise SystemExit(1)", r"own\.py:4: own\(\) failed: SystemExit"),
        (
            "return planning.solve(planning.parse_pomdp(OTHER), time_limit=1).policy",
            r"own\.py:3: own\(\) returned a policy of another problem: the policy is for another model",
        ),
        (
            "return planning.Policy.of(pomdp, [[900.0, 900.0]], [0])",
            r"own\(\) returned a policy whose vectors promise 900 at a start belief",
        ),
        (
            "return planning.Policy.of(pomdp, [[0.0, 0.0]], [9])",
            r"own\.py:4: own\(\) failed: PolicyError: an action index is outside 0 to 2",
        ),
        (
            "return replace(planning.solve(pomdp, start), lower=float('nan'))",
            r"own\(\) returned the bounds nan and .*; expected lower <= upper",
        ),
        ("return replace(planning.solve(pomdp, start), lower=99)", r"the bounds 99 and"),
        (
            "return replace(planning.solve(pomdp, start), lower=0)",
            r"own\(\) returned 'precision reached' with a gap of 19\.3\d+, above 0\.0005",
        ),
    ],
)
def test_faults_name_the_file_and_the_line(write, body, message):
    name = write(f"def own(pomdp, start, **options):\n    {body}\n")
    solver = load_solver(name)
    solver.function.function.__globals__["OTHER"] = LCORPP
    with pytest.raises(ModelError, match=message):
        solver(tiger)


def test_other_parameters_are_refused_before_the_solver_runs(write):
    name = write("def own(pomdp, start):\n    raise AssertionError\n")
    words = (
        r"own\.py:3: own\(pomdp, start\) cannot be called as a solver \(.*'precision'\); expected own\(pomdp,"
    )
    with pytest.raises(ModelError, match=words + r" start, \*, precision, time_limit, callback\)"):
        load_solver(name)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": "magic"}, r"unknown solver 'magic'; expected one of sarsop, .*, or FILE\.py:NAME"),
        ({"name": "none.py:own"}, r"none\.py: there is no such file"),
        ({"name": 3}, r"the solver is 3; expected str"),
        ({"precision": 0}, r"the precision is 0; expected a finite positive number"),
        ({"precision": "x"}, r"precision must be a number, not 'x' \(str\)"),
        ({"time_limit": float("nan")}, r"the time limit is nan; expected a positive number"),
    ],
)
def test_options_are_checked_when_they_are_made(options, message):
    with pytest.raises(ModelError, match=message):
        SolverOptions(**options)


def test_a_file_without_the_function(write):
    with pytest.raises(ModelError, match=r"own\.py has no function 'own'; expected one of other"):
        SolverOptions(write("def other(): pass\n", ""))


def test_a_policy_of_the_same_names_is_checked_by_its_fingerprint(write):
    name = write("def own(pomdp, start, **options):\n    return POLICY\n")
    solver = load_solver(name)
    cheap = parse_pomdp(TIGER.replace("-100", "-90"))
    assert cheap.fingerprint != tiger.fingerprint
    solver.function.function.__globals__["POLICY"] = Policy.of(cheap, [[-20.0, -20.0]], [0])
    with pytest.raises(ModelError, match="transitions, observations, rewards or discount have changed"):
        solver(tiger)
