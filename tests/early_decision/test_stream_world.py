"""The world that answers `watch`: stages, gaps, tracks that end, and the dialogue."""

import numpy as np
import pytest

from lcorpp.early_decision.extension import OVER, WATCH
from lcorpp.early_decision.stream_world import StreamWorld
from lcorpp.errors import WorldError
from lcorpp.learning import Prediction
from tests.early_decision.streams import make_stream


class Answers:
    """A world that records the actions."""

    def __init__(self):
        self.done = []

    def act(self, action):
        self.done.append(action)
        return "pos"

    def report(self, action):
        self.done.append(action)


def predict(points, p, track=1):
    known = None if p is None else np.array([p, 1 - p])
    return Prediction("Ada", track, points, 0.0, known)


def test_stages_in_order():
    """Stages at 2 and 3 points; predictions between them do not count."""
    stream = [predict(1, None), predict(2, 0.4), predict(2, 0.9), predict(3, 0.6), predict(4, 0.1)]
    world = StreamWorld(make_stream(), stream, Answers())
    assert [world.act(WATCH) for _ in range(3)] == ["bin_1", "bin_2", OVER]
    assert (world.seconds, world.probability) == (3.0, 0.6)


def test_a_gap_takes_the_first_prediction_after_it():
    assert StreamWorld(make_stream(), [predict(7, 0.6)], Answers()).act(WATCH) == "bin_2"


@pytest.mark.parametrize("rest", [[], [predict(3, 0.6, track=2), predict(3, 0.6)]])
def test_a_person_who_leaves(rest):
    world = StreamWorld(make_stream(), [predict(2, 0.4), *rest], Answers())
    assert [world.act(WATCH) for _ in range(3)] == ["bin_1", OVER, OVER]


def test_the_dialogue_ends_the_stream():
    answers = Answers()
    world = StreamWorld(make_stream(), [predict(2, 0.4)], answers)
    assert (world.act("greet"), world.act(WATCH)) == ("pos", OVER)
    world.report("report_interested")
    assert answers.done == ["greet", "report_interested"]
    assert world.seconds == 0


def test_other_classes():
    wrong = Prediction("Ada", 1, 2, 0.0, np.full(3, 1 / 3))
    with pytest.raises(WorldError, match="a prediction of 3 classes; expected interested and not_interested"):
        StreamWorld(make_stream(), [wrong], Answers()).act(WATCH)
