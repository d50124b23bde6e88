"""Cases of faults in the field, which are kept beside the repository."""

import runpy
from pathlib import Path

import pytest

CASES = Path(__file__).parents[3] / "shared" / "cases" / "robot"


@pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not here (shared/cases/robot)")
@pytest.mark.parametrize("name", ["01_one_wrong_stamp", "04_frozen_stamps", "06_one_nan_pose", "09_markers"])
def test_a_case_passes(name, monkeypatch):
    monkeypatch.chdir(CASES)  # some read a classifier
    runpy.run_path(str(CASES / f"{name}.py"))
