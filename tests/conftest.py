"""Settings of all tests: no test fails because the machine is slow or busy, or uses the user's policies."""

import atexit
import gc
import os
import shutil
import signal
import sys
import tempfile
from dataclasses import dataclass
from functools import cache

import pytest
import typer.main
from hypothesis import HealthCheck, settings

# Imports leave almost no garbage; looking for it takes a tenth of the collection of the tests.
gc.disable()

# The suite draws the same few examples each time; `make check-slow` searches with new ones, and more.
settings.register_profile("search", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("lcorpp", settings.get_profile("search"), derandomize=True, max_examples=40)
settings.load_profile("lcorpp")

# Tests interrupt themselves and their children; a shell that runs them in the background ignores the signals.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

# Commands share policies, as a user's do, in a folder that the first process makes, the parent of the others.
if "PYTEST_XDIST_WORKER" not in os.environ:
    os.environ["LCORPP_CACHE"] = tempfile.mkdtemp(prefix="lcorpp-tests-")
    atexit.register(shutil.rmtree, os.environ["LCORPP_CACHE"], ignore_errors=True)

# The parser of all commands takes longer than most commands of the tests; they share it.
typer.main.get_command = cache(typer.main.get_command)


@dataclass(frozen=True)
class Ended:
    """What a command printed and its exit code."""

    code: int
    out: str
    err: str


@pytest.fixture
def lcorpp(monkeypatch, capsys):
    """Run a command in this process, as the shell would see it."""
    from lcorpp.cli.main import main  # after the settings above

    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "dumb")

    def run(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["lcorpp", *map(str, arguments)])
        capsys.readouterr()
        try:
            main()
            code = 0
        except SystemExit as ended:
            code = 0 if ended.code is None else int(ended.code)
        captured = capsys.readouterr()
        return Ended(code, captured.out, captured.err)

    return run


@pytest.fixture
def few_faults(monkeypatch):
    """An alarm about few faults, which are quickly compiled."""
    monkeypatch.setattr("lcorpp.fitting.faults.find_table", lambda *_: None)
    monkeypatch.setattr("lcorpp.fitting.faults.MAX_EXCHANGES", 1)


def pytest_collection_finish() -> None:
    """Leave the modules and the tests out of all collections of garbage."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000)
    gc.enable()
