"""Inputs and settings of the tests of commands; the fixture `lcorpp` runs one."""

import logging

import pytest

from tests.planning.models import TIGER


@pytest.fixture
def silent_afterwards():
    """The test shows the log; later tests do not."""
    yield
    log = logging.getLogger("lcorpp")
    log.setLevel(logging.NOTSET)
    log.handlers.clear()


@pytest.fixture
def unrendered(monkeypatch):
    """Figures are files without content: drawing takes most of the time of small runs that write them."""
    monkeypatch.setattr("lcorpp.plot_style._render", lambda figure, kind: b"a figure")
    monkeypatch.setattr("lcorpp.experiments.figures.strategies.plot_strategies", lambda *_: None)
    monkeypatch.setattr("lcorpp.experiments.figures.batches.plot_batches", lambda *_: None)
    monkeypatch.setattr("lcorpp.learning.plot_report", lambda _, file: file.write_bytes(b"a figure"))


@pytest.fixture
def tiger(tmp_path):
    """The tiger problem as a file."""
    file = tmp_path / "tiger.pomdp"
    file.write_text(TIGER)
    return file
