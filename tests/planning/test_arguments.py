"""Arguments of a wrong type raise a ModelError before any work."""

from __future__ import annotations

import pytest

from lcorpp.errors import ModelError
from lcorpp.planning import (
    OnlinePlanner,
    Planner,
    Policy,
    PomcpPlanner,
    certificate,
    evaluate,
    parse_pomdp,
    simulate,
    solve,
    solve_finite_horizon,
    solve_finite_horizon_exact,
)
from lcorpp.planning.solver_table import SOLVER_NAMES
from lcorpp.planning.solvers import load_solver
from tests.planning.models import TIGER

tiger = parse_pomdp(TIGER)
policy = Policy.of(tiger, [[0.0, 0.0]], [0])


@pytest.mark.parametrize(
    ("function", "arguments", "options", "message"),
    [
        *((load_solver(name), (3,), {}, r"pomdp must be a Pomdp, not 3 \(int\)") for name in SOLVER_NAMES),
        (solve_finite_horizon, ("tiger.pomdp", 3), {}, r"pomdp must be a Pomdp, not 'tiger.pomdp' \(str\)"),
        (solve_finite_horizon_exact, (None, 3), {}, r"pomdp must be a Pomdp, not None \(NoneType\)"),
        (solve_finite_horizon, (tiger, 3), {"discount": "1"}, r"discount must be a number, not '1' \(str\)"),
        (solve, (tiger,), {"precision": "high"}, r"precision must be a number, not 'high' \(str\)"),
        (solve, (tiger,), {"time_limit": None}, r"time limit must be a number, not None"),
        (solve, (tiger,), {"callback": 7}, "callback must be a function, not 7"),
        (solve, (tiger,), {"previous": policy}, "previous must be a Solution, not <Policy"),
        (solve, (tiger, [[0.5, 0.5], [1.0]]), {}, "start must be one belief or several, not"),
        (solve, (tiger, {"tiger-left": 1}), {}, "a belief is 2 numbers"),
        (simulate, (3, policy), {"seed": 0}, r"pomdp must be a Pomdp, not 3 \(int\)"),
        (simulate, (tiger, tiger), {"seed": 0}, r"policy must be a Policy, not <Pomdp.* \(Pomdp\)"),
        (evaluate, (tiger, "policy"), {}, r"policy must be a Policy, not 'policy' \(str\)"),
        (evaluate, (tiger, policy), {"precision": "1"}, r"precision must be a number, not '1' \(str\)"),
        (certificate, (policy,), {}, "solution must be a Solution, not <Policy"),
        (Planner, (3,), {}, r"policy must be a Solution or Policy, not 3 \(int\)"),
        (Planner, (policy, 3), {}, r"pomdp must be a Pomdp, not 3 \(int\)"),
        (OnlinePlanner, (3,), {}, r"pomdp must be a Pomdp, not 3 \(int\)"),
        (PomcpPlanner, (policy,), {}, "pomdp must be a Pomdp, not <Policy"),
    ],
)
def test_a_wrong_type_is_named(function, arguments, options, message):
    with pytest.raises(ModelError, match=message):
        function(*arguments, **options)
