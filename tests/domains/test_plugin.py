"""The plug-in of a domain folder: recordings, and errors of the user's code."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.domains.plugin import SimulationPlugin
from lcorpp.errors import DomainError
from lcorpp.values import find_perceived

GOOD = """
import numpy as np
COLUMNS = ("time", "x", "y")
def recordings(people, rng, *, seconds=(1.0, 2.0)):
    return [np.cumsum(np.full((5, 3), seconds[0]), axis=0) for _ in people]
def trajectory(person, rng):
    return np.zeros((2, 3))
"""
CROWD = [{"goal": "lab"}, {"goal": "store"}]


def people(folder: Path, text: str) -> SimulationPlugin:
    (folder / "people.py").write_text(text)
    return SimulationPlugin(folder / "people.py", ())


def test_recordings_of_a_plug_in(tmp_path):
    own = people(tmp_path, GOOD)
    assert own.defines("recordings")
    assert own.columns == ("time", "x", "y")
    tables = own.recordings(CROWD, np.random.default_rng(0))
    assert [table.shape for table in tables] == [(5, 3), (5, 3)]
    assert own.recordings(CROWD, np.random.default_rng(0), seconds=(3.0, 4.0))[0][0, 0] == 3.0


def test_a_plug_in_without_recordings(tmp_path):
    own = people(tmp_path, "def trajectory(person, rng):\n    return [[0.0, 1.0]]\n")
    assert not own.defines("recordings")
    assert own.columns == ()


def test_none_is_a_person_whom_the_sense_does_not_perceive(tmp_path):
    text = "def gaze(people, rng):\n    return [None if p['goal'] == 'lab' else [1.0, 2.0] for p in people]\n"
    (tmp_path / "people.py").write_text(text)
    gaze = SimulationPlugin(tmp_path / "people.py", ["gaze"]).signals["gaze"]
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(gaze(CROWD, rng), [[np.nan, np.nan], [1.0, 2.0]])
    assert not find_perceived(gaze(CROWD[:1], rng)).any()
    assert gaze(CROWD[1:], rng).tolist() == [[1.0, 2.0]]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('("time", "x", "y")', '("x", "y")', r"COLUMNS is \('x', 'y'\); .* 'time' first"),
        ('COLUMNS = ("time", "x", "y")', "", r"COLUMNS is None; .* 'time' first"),
        (
            "for _ in people",
            "for _ in [1]",
            r"expected 2 recordings, one for each person, of shape \(samples, 3",
        ),
        ("(5, 3)", "(5, 4)", r"of shape \(samples, 3\)"),
        ("(5, 3)", "(0, 3)", r"of shape \(samples, 3\)"),
        ("seconds[0])", "float('nan'))", "a recording has a value that is not a number"),
        ("seconds[0])", "-1.0)", "the times of a recording do not increase"),
        (
            "return [np",
            "raise KeyError('no')\n    return [np",
            r"people\.py:5: recordings\(\) failed: KeyError",
        ),
    ],
)
def test_recordings_that_are_wrong(tmp_path, old, new, words):
    assert old in GOOD
    with pytest.raises(DomainError, match=words):
        people(tmp_path, GOOD.replace(old, new)).recordings(CROWD, np.random.default_rng(0))


def test_a_name_that_is_no_function_is_not_defined(tmp_path):
    with pytest.raises(DomainError, match=r"people\.py: defines none of trajectory, "):
        people(tmp_path, "trajectory = 3\n")


def test_recordings_of_the_domain_of_the_paper():
    simulation = load_domain("intention").simulation
    assert simulation.columns == ("time", "x", "y", "z", "velocity", "heading", "facing")
    assert simulation.recordings is not None
    crowd = [{"intention": "interested"}, {"intention": "not_interested"}]
    tables = simulation.recordings(crowd, np.random.default_rng(0), seconds=(2.0, 3.0))
    assert [table.shape[1] for table in tables] == [7, 7]
    with pytest.raises(DomainError, match=r"recordings\(\) failed: ValueError: seconds is \(3\.0, 2\.0\)"):
        simulation.recordings(crowd, np.random.default_rng(0), seconds=(3.0, 2.0))
