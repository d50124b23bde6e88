"""ProbLog programs of faults in the field, which are kept beside the repository."""

import warnings
from pathlib import Path

import pytest

from lcorpp.reasoning import Reasoner, ReasoningWarning, read_plog

CASES = Path(__file__).parents[3] / "shared" / "cases" / "plog"

EXPECTED = {
    "01_division_true": {"q(3)": 0, "q(2)": 0.5},
    "02_division_order": {"late(3)": 0.5, "late(2)": 0},
    "03_mod_negative": {"odd(-3)": 0.4},
    "04_unify_sum": {"next(2,1)": 0},
    "05_not_unify_sum": {"far(2,1)": 0.5},
    "06_scientific_probability": {"leak": 0.001, "alarm": 0.00025},
    "07_percent_in_block_comment": {"rain": 0.3},
    "08_true_not_arrow": {"go": 0.35, "stay": 0.5},
    "09_rounded_die": {"face(1)": 0.16667},
    "10_reserved_name_shown": {"do": 0.4},
}

needs_cases = pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not here (shared/cases/plog)")


def _ask_all(name: str) -> dict[str | None, float]:
    program = read_plog(CASES / f"{name}.pl")
    reasoner = Reasoner(program)
    return {query.written: float(reasoner.ask(query)) for query in program.queries}


@needs_cases
@pytest.mark.parametrize("name", EXPECTED)
def test_a_case_has_its_answers(name: str) -> None:
    assert _ask_all(name) == pytest.approx(EXPECTED[name], abs=1e-9)


@needs_cases
@pytest.mark.slow
def test_the_network_has_its_answers() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReasoningWarning)  # it may be sampled
        answers = _ask_all("17_network_slow")
    # four standard errors of 20,000 worlds
    assert answers == pytest.approx({"sm(1)": 0.357500, "as(3)": 0.176607}, abs=0.014)
