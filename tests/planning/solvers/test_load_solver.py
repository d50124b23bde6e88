from __future__ import annotations

import subprocess
import sys

import pytest

from lcorpp.errors import ModelError
from lcorpp.planning import parse_pomdp
from lcorpp.planning.solvers import SOLVER_NAMES, load_solver
from tests.planning.models import TIGER


@pytest.mark.parametrize("name", SOLVER_NAMES)
def test_all_solvers_have_one_signature_and_agree(name):
    tiger, reports = parse_pomdp(TIGER), []
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
