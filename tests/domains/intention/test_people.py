"""Simulated people of the intention domain: reproducible, plausible, and the classes differ as intended."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import ks_2samp
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import cross_val_predict
from sklearn.neighbors import KNeighborsClassifier

import lcorpp

FILE = Path(lcorpp.__file__).parent / "domains" / "intention" / "people.py"
INTENTIONS = ("interested", "not_interested")


def load() -> ModuleType:
    """Load the file by path, as a domain folder is loaded, without an entry in sys.modules."""
    spec = importlib.util.spec_from_file_location("people_of_a_test", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


people = load()


def crowd(size: int) -> list[dict[str, str]]:
    return [{"intention": INTENTIONS[i % 2], "identity": "student"} for i in range(size)]


@pytest.fixture(scope="module")
def tracks() -> np.ndarray:
    return people.trajectories(crowd(2000), np.random.default_rng(0))


def auc(features: np.ndarray, model) -> float:
    interested = np.arange(len(features)) % 2 == 0
    probabilities = cross_val_predict(model, features, interested, method="predict_proba", cv=5)
    return float(roc_auc_score(interested, probabilities[:, 1]))


def velocities(tracks: np.ndarray) -> np.ndarray:
    """Speed in six parts of the track, and steps along and across the line from start to end."""
    step = np.diff(tracks[:, :, ::6], axis=2)
    way = tracks[:, :, -1] - tracks[:, :, 0]
    x, y = (way / np.hypot(*way.T)[:, None]).T[:, :, None]
    ahead, aside = x * step[:, 0] + y * step[:, 1], x * step[:, 1] - y * step[:, 0]
    parts = np.array_split(np.stack([ahead, aside, np.hypot(*step.transpose(1, 0, 2))], axis=1), 6, axis=2)
    return np.concatenate([part.mean(axis=2) for part in parts], axis=1)


def model() -> HistGradientBoostingClassifier:
    return HistGradientBoostingClassifier(max_iter=30, max_depth=3, random_state=0)


def test_shape_and_reproducibility():
    one = people.trajectory({"intention": "interested"}, np.random.default_rng(5))
    again = people.trajectory({"intention": "interested"}, np.random.default_rng(5))
    assert one.shape == (2, 304)
    assert one.dtype == np.float64
    assert np.array_equal(one, again)
    assert people.trajectories([], np.random.default_rng(5)).shape == (0, 2, 304)
    assert np.all(np.isfinite(people.trajectories(crowd(7), np.random.default_rng(1))))


@pytest.mark.parametrize("person", [{}, {"intention": "maybe"}])
@pytest.mark.parametrize("simulate", ["trajectories", "recordings"])
def test_a_person_without_intention_is_rejected(person, simulate):
    with pytest.raises(ValueError, match="expected one of interested, not_interested"):
        getattr(people, simulate)([person], np.random.default_rng(0))


def test_walks_are_plausible(tracks):
    noise = 5 * people.TRACKER_ERROR + people.MAX_SWAY
    assert tracks[:, 1].min() > people.walking.WALL_Y - noise  # not through the wall
    assert np.hypot(tracks[:, 0], tracks[:, 1]).min() > people.walking.ROBOT_RADIUS  # nor into the robot
    speed = np.hypot(*np.diff(tracks[:, :, ::12], axis=2).transpose(1, 0, 2)) / (12 * people.INTERVAL)
    assert 0.8 < speed[1::2].mean() < 1.4  # metres a second, of those not interested
    assert speed.max() < 3.0


def test_both_classes_end_at_the_same_distances(tracks):
    end = tracks[:, :, -1]
    distance = np.hypot(*end.T)
    low, high = people.END_DISTANCE
    assert low - 0.4 < distance.min() < distance.max() < high + 0.2  # a step and the noise of the tracker
    assert ks_2samp(distance[::2], distance[1::2]).pvalue > 0.001
    assert auc(end, KNeighborsClassifier(31)) < 0.58


def test_intention_shows_in_motion_and_early(tracks):
    quarter, half, whole = (auc(velocities(tracks[:, :, :points]), model()) for points in (76, 152, 304))
    assert 0.65 < quarter < half < whole < 0.84


def test_equal_goals_give_equal_motion():
    same = load()
    same.walking.P_LATE = 1.0  # interested people never show it
    same.walking.P_OTHER_GOAL = same.walking.P_CURIOUS = same.walking.P_LINGERS = 0.0
    tracks = same.trajectories(crowd(800), np.random.default_rng(0))
    assert abs(auc(velocities(tracks), model()) - 0.5) < 0.07  # 3 standard errors


def test_classes_overlap():
    alike = load()
    alike.walking.P_LATE, alike.walking.P_OTHER_GOAL = 0.0, 1.0  # all come to the robot, whatever for
    tracks = alike.trajectories(crowd(800), np.random.default_rng(0))
    assert abs(auc(velocities(tracks), model()) - 0.5) < 0.07


def test_recordings_contain_the_columns_of_a_tracker():
    tables = people.recordings(crowd(60), np.random.default_rng(3))
    again = people.recordings(crowd(60), np.random.default_rng(3))
    assert all(np.array_equal(one, other) for one, other in zip(tables, again, strict=True))
    low, high = people.DURATION
    for table in tables:
        time, x, y, z, velocity, heading, facing = table.T
        assert time[0] == 0
        assert np.all(np.abs(np.diff(time) - people.INTERVAL) <= 2 * people.TIME_JITTER + 1e-9)
        assert low - 1e-9 <= time[-1] < high + people.INTERVAL
        assert 1.2 < z.min() < z.max() < 2.2
        assert np.all(np.abs(np.concatenate([heading, facing])) <= np.pi)
        lag = round(people.VELOCITY_WINDOW / people.INTERVAL)
        way = np.stack([x[lag:] - x[:-lag], y[lag:] - y[:-lag]])  # velocity and heading agree with the places
        assert np.allclose(np.hypot(*way) / (time[lag:] - time[:-lag]), velocity[lag:])
        assert np.allclose(np.arctan2(way[1], way[0]), heading[lag:])
    assert people.recordings([], np.random.default_rng(0)) == []


def test_interested_people_face_the_robot():
    interested = [{"intention": "interested"}] * 200
    passing = [{"intention": "not_interested"}] * 200

    def away(crowd):
        tables = people.recordings(crowd, np.random.default_rng(2))
        x, y, facing = (np.array([table[-30:, i].mean() for table in tables]) for i in (1, 2, 6))
        return np.abs(np.angle(np.exp(1j * (facing - np.arctan2(-y, -x))))).mean()

    assert away(interested) < away(passing)


@pytest.mark.slow
@settings(max_examples=10)
@given(st.floats(0.04, 60), st.integers(1, 3), st.integers(0, 2**32))
def test_recordings_last_as_long_as_asked(seconds, size, seed):
    for table in people.recordings(crowd(size), np.random.default_rng(seed), seconds=(seconds, seconds)):
        assert seconds - 1e-9 <= table[-1, 0] < seconds + people.INTERVAL
        assert np.all(np.diff(table[:, 0]) > 0)
        assert np.all(np.isfinite(table))


@pytest.mark.parametrize("seconds", [(5, 4), (0, 4), (4, 61), (float("nan"), 4)])
def test_impossible_durations_are_rejected(seconds):
    with pytest.raises(ValueError, match=r"expected 0\.033 <= shortest <= longest <= 60"):
        people.recordings(crowd(1), np.random.default_rng(0), seconds=seconds)


def test_durations_are_alike_for_both_classes():
    tables = people.recordings(crowd(400), np.random.default_rng(4))
    lasting = np.array([table[-1, 0] for table in tables])
    assert ks_2samp(lasting[::2], lasting[1::2]).pvalue > 0.001
