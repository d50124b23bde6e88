"""Work units in processes: the same results for any number, lost workers, errors."""

import threading

import pytest
from joblib import parallel_config

from lcorpp.errors import DecisionError, WorkerError
from lcorpp.work_units.running import evaluate_units
from tests.work_units import functions

UNITS = {str(number): number for number in range(8)}


@pytest.mark.parametrize("jobs", [None, 1, 2])
def test_any_number_of_processes_gives_the_same_results(jobs):
    found = dict(evaluate_units(functions.square, UNITS, jobs=jobs))
    assert found == {key: number**2 for key, number in UNITS.items()}


def test_an_active_configuration_of_joblib_is_used():
    threads = set()

    def note(number: int) -> int:
        threads.add(threading.current_thread())
        return number

    with parallel_config(backend="threading", n_jobs=2):
        assert dict(evaluate_units(note, UNITS)) == UNITS
    assert threading.main_thread() not in threads


@pytest.mark.slow
def test_the_unit_of_a_killed_worker_is_evaluated_again(tmp_path):
    marker = str(tmp_path / "killed")
    units = {key: (marker, number) for key, number in UNITS.items()}
    assert dict(evaluate_units(functions.kill_worker_once, units, jobs=2)) == UNITS
    assert (tmp_path / "killed").exists()


@pytest.mark.slow
def test_a_unit_that_always_ends_its_worker_is_given_up():
    words = r"3 times in a row with \d units left, perhaps for lack of memory"
    with pytest.raises(WorkerError, match=words):
        dict(evaluate_units(functions.kill_worker, {"0": 0, "1": 1}, jobs=2))


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_of_a_unit_arrives(jobs):
    with pytest.raises(DecisionError, match="three is impossible"):
        dict(evaluate_units(functions.refuse_three, UNITS, jobs=jobs))
