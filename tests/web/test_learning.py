"""Learning from judged trials: what joins the data, and what a training changes."""

from concurrent.futures import Executor, Future

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.experiments.setup import TrainingOptions
from lcorpp.experiments.training_data import make_training_data
from lcorpp.learning.store import read_store
from lcorpp.web.learning import BatchLearner, find_last_track, find_learning_sense, open_store
from tests.web.conftest import Page


class Inline(Executor):
    """Executor that runs a task at once in this thread, or ends it with a given error."""

    def __init__(self, error=None):
        self._error = error

    def submit(self, function, /, *arguments):
        future = Future()
        if self._error is None:
            future.set_result(function(*arguments))
        else:
            future.set_exception(self._error)
        return future


@pytest.fixture(scope="module")
def data(intention):
    sense = intention.domain.senses[0]
    return make_training_data(intention.domain, sense, TrainingOptions(tracks=60), 0).dataset


def make_learner(robot, data, executor=None, **options):
    learner = BatchLearner(
        robot,
        find_learning_sense(robot.domain, robot.classifiers),
        data,
        batch_size=2,
        executor=executor or Inline(),
        **options,
    )
    notices = []
    learner.notify = notices.append
    return learner, notices


def play(learner, count=1, walked=True):
    for _ in range(count):
        page = Page(learner.robot, keep=learner.keep)
        if walked:
            page.walk(1.0, count=40)
        page.answer_all("pos")
        reply = page.send("judge", right=True, truth=None)
    return reply


def test_after_a_batch_the_classifier_is_trained_again(intention, data):
    learner, notices = make_learner(intention, data)
    assert play(learner)["stored"] == 1
    assert learner.robot is intention
    play(learner)
    assert [notice["type"] for notice in notices] == ["learning", "learnt"]
    counts = np.array(notices[1]["after"])
    assert counts.sum() == len(data) + 2  # each case is tested once
    assert learner.robot.classifiers["motion"].confusion.counts.tolist() == notices[1]["after"]
    assert str(learner.robot.program) != str(intention.program)


def test_the_last_track_is_judged_by_both_classifiers(intention, data):
    learner, notices = make_learner(intention, data)
    play(learner, 2)
    track = notices[1]["track"]
    assert (
        len(track["times"]) == len(track["before"]) == len(track["after"]) == 11
    )  # 4 s at 3 points a second
    assert track["before"] != track["after"]


def test_a_trial_without_a_track_teaches_nothing(intention, data):
    learner, notices = make_learner(intention, data)
    assert play(learner, 3, walked=False)["stored"] == 0
    assert notices == []


def test_trials_are_kept_in_a_store_and_read_again(intention, data, tmp_path):
    sense = intention.domain.senses[0]
    with open_store(tmp_path / "played.tracks", sense, data) as store:
        learner, _ = make_learner(intention, data, store=store)
        play(learner)
    snapshot = read_store(tmp_path / "played.tracks")
    (track,) = snapshot.select()
    assert track.source == "person"
    (trajectory,) = snapshot.trajectories([track])
    assert trajectory[:, 0] == pytest.approx([1.0, 9.0])  # the first sample of the walk
    with open_store(tmp_path / "played.tracks", sense, data) as store:
        again, _ = make_learner(intention, data, store=store)
        assert again.n_stored == 1


def test_a_failed_training_keeps_the_former_classifier(intention, data):
    learner, notices = make_learner(intention, data, Inline(DataError("the training diverged")))
    play(learner, 2)
    assert notices[1] == {"type": "learnt", "error": "the training diverged"}
    assert learner.robot is intention


def test_the_last_unbroken_track_is_kept(intention):
    before = [(t / 10, 0.0, 9 - t / 10) for t in range(20)]
    after = [(10 + t / 10, 0.0, 5 - t / 10) for t in range(20)]  # eight seconds later
    assert find_last_track(intention.classifiers["motion"], before + after) == after
    assert find_last_track(intention.classifiers["motion"], after[:1]) == []


def test_no_sense_learns_without_tracks(museum):
    assert find_learning_sense(museum.domain, museum.classifiers) is None
