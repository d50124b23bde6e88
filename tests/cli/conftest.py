"""Running a command inside the test's process, as the shell would see it."""

import logging
import sys
from dataclasses import dataclass

import pytest

from lcorpp.cli.main import main
from tests.planning.models import TIGER


@dataclass(frozen=True)
class Ended:
    """What a command printed and its exit code."""

    code: int
    out: str
    err: str


@pytest.fixture
def lcorpp(monkeypatch, capsys):
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
def silent_afterwards():
    """The test shows the log; later tests do not."""
    yield
    log = logging.getLogger("lcorpp")
    log.setLevel(logging.NOTSET)
    log.handlers.clear()


@pytest.fixture
def unrendered(monkeypatch):
    """Figures are drawn but not rendered, which takes most of the time of small runs that write them."""
    monkeypatch.setattr("lcorpp.plot_style._render", lambda figure, kind: b"a figure")


@pytest.fixture
def tiger(tmp_path):
    """The tiger problem as a file."""
    file = tmp_path / "tiger.pomdp"
    file.write_text(TIGER)
    return file
