"""Without a C++ compiler the installation ends at once and names the package to install."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def run_without_compiler(*command: str) -> str:
    """What a command that fails without a compiler writes, its lines joined."""
    if not shutil.which(command[0]):
        pytest.skip(f"{command[0]} is not installed")
    variables = {**os.environ, "CXX": str(ROOT / "no-such-compiler")}
    done = subprocess.run(command, cwd=ROOT, env=variables, capture_output=True, text=True)
    assert done.returncode != 0
    return " ".join((done.stdout + done.stderr).split())


def test_cmake_names_the_package(tmp_path):
    found = run_without_compiler("cmake", "-S", str(ROOT), "-B", str(tmp_path))
    assert "no C++ compiler, which lcorpp needs: install g++ (Debian, Ubuntu: apt install g++;" in found


def test_make_names_the_package_before_it_downloads(tmp_path):
    environment = tmp_path / "venv"
    found = run_without_compiler(
        "make",
        f"VENV={environment}",
        f"DIST={tmp_path}",
        f"PYTHON={sys.executable}",
        f"{environment}/.runtime",
    )
    assert "no C++ compiler, which lcorpp needs: install g++ (Debian, Ubuntu: apt install g++;" in found
    assert not environment.exists()
