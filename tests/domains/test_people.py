from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import cross_val_predict
from sklearn.neighbors import KNeighborsClassifier

import lcorpp

FILE = Path(lcorpp.__file__).parent / "domains" / "intention" / "people.py"
INTENTIONS = ("interested", "not_interested")


def load() -> ModuleType:
    """By path, as a domain folder is loaded, and without a place in sys.modules."""
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
    return people.trajectories(crowd(1000), np.random.default_rng(0))


def auc(features: np.ndarray, model) -> float:
    interested = np.arange(len(features)) % 2 == 0
    told = cross_val_predict(model, features, interested, method="predict_proba", cv=5)
    return float(roc_auc_score(interested, told[:, 1]))


def velocities(tracks: np.ndarray) -> np.ndarray:
    """Forward, sideways and absolute displacement in six parts of the track; forward is where it goes."""
    step = np.diff(tracks[:, :, ::6], axis=2)
    step[:, 0] *= np.sign(tracks[:, 0, -1] - tracks[:, 0, 0])[:, None]
    parts = np.array_split(np.concatenate([step, np.hypot(step[:, :1], step[:, 1:])], axis=1), 6, axis=2)
    return np.concatenate([part.mean(axis=2) for part in parts], axis=1)


def model() -> HistGradientBoostingClassifier:
    return HistGradientBoostingClassifier(max_iter=60, max_depth=3, random_state=0)


def test_shape_and_reproducibility():
    one = people.trajectory({"intention": "interested"}, np.random.default_rng(5))
    again = people.trajectory({"intention": "interested"}, np.random.default_rng(5))
    assert one.shape == (2, 304)
    assert one.dtype == np.float64
    assert np.array_equal(one, again)
    assert people.trajectories([], np.random.default_rng(5)).shape == (0, 2, 304)
    assert np.all(np.isfinite(people.trajectories(crowd(7), np.random.default_rng(1))))


@pytest.mark.parametrize("person", [{}, {"intention": "maybe"}])
def test_a_person_without_intention_is_told(person):
    with pytest.raises(ValueError, match="expected one of interested, not_interested"):
        people.trajectory(person, np.random.default_rng(0))


def test_people_walk_as_people_do(tracks):
    low, high = people.WALLS
    assert tracks[:, 1].min() > low - 0.3  # noise of the tracker reaches into the wall
    assert tracks[:, 1].max() < high
    speed = np.hypot(*np.diff(tracks[:, :, ::12], axis=2).transpose(1, 0, 2)) / (12 * people.INTERVAL)
    assert 0.8 < speed.mean() < 1.2  # metres a second
    assert speed.max() < 2.6
    assert np.hypot(tracks[:, 0], tracks[:, 1]).min() > 0.5  # nobody walks into the robot


def test_the_end_is_drawn_alike_and_does_not_leak(tracks):
    end = np.hypot(*tracks[:, :, -1].T)
    low, high = people.SEEN_UNTIL
    assert low - 0.4 < end.min() < end.max() < high + 0.2  # a step and the noise of the tracker
    assert abs(np.median(end[::2]) - np.median(end[1::2])) < 0.2  # 3 standard errors
    assert auc(tracks[:, :, -1], KNeighborsClassifier(15)) < 0.6


def test_intention_shows_in_motion_and_early(tracks):
    relative = tracks - tracks[:, :, :1]
    assert 0.74 < auc(velocities(relative), model()) < 0.88
    assert auc(velocities(relative[:, :, :76]), model()) > 0.65


def test_without_a_difference_in_what_is_wanted_there_is_none_in_motion():
    same = load()
    same.NOTICE = (0.0, 0.0)  # the interested never turn to the robot
    same.HESITATING = same.CURIOUS = same.LINGERING = 0.0
    tracks = same.trajectories(crowd(800), np.random.default_rng(0))
    assert abs(auc(velocities(tracks - tracks[:, :, :1]), model()) - 0.5) < 0.07  # 3 standard errors
