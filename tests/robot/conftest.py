"""A small classifier, and configurations of the stand-in, for all tests of the robot."""

import pytest

from lcorpp import load_domain
from lcorpp.assembly.options import TrainingOptions
from lcorpp.assembly.track_robot import set_up_track_robot
from lcorpp.planning.policy_cache import find_cache_folder
from tests.worlds.ros.stand_in import heard_domain


@pytest.fixture(autouse=True)
def max_age(monkeypatch):
    """People stay detected, however busy the machine is that sends their positions."""
    monkeypatch.setattr("lcorpp.worlds.ros.people.positions.MAX_AGE", 600.0)


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A folder with the domain "heard", in which silence is possible."""
    made = tmp_path_factory.mktemp("robot")
    heard_domain(made / "heard")
    return made


@pytest.fixture(scope="session")
def parts(folder):
    """Domain, policy and rates; and the classifier of the sense motion."""
    domain = load_domain(folder / "heard")
    training = {"motion": TrainingOptions("summaries", tracks=100)}
    return set_up_track_robot(domain, training, domain.planning.solver, cache=find_cache_folder())
