"""Fuzzing with atheris, a million inputs in a separate process."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest


@pytest.mark.slow
def test_fuzzed_inputs_give_a_program_or_a_typed_error() -> None:
    if find_spec("atheris") is None:
        pytest.skip("atheris is not installed; `pip install atheris` brings it")
    script = Path(__file__).with_name("fuzz_parser.py")
    done = subprocess.run(
        [sys.executable, str(script), "-runs=1000000"], capture_output=True, text=True, timeout=7200
    )
    assert done.returncode == 0, done.stderr[-4000:]
    assert "DONE" in done.stderr
