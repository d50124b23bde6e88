"""People stay detected, however busy the machine is that sends their positions."""

import pytest


@pytest.fixture(autouse=True)
def max_age(monkeypatch):
    monkeypatch.setattr("lcorpp.worlds.ros.people.positions.MAX_AGE", 600.0)
