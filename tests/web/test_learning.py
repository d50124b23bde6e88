"""Learning from judged trials: what joins the data, and what a training changes."""

import os
import signal
import time
from concurrent.futures import BrokenExecutor, Executor, Future

import numpy as np
import pytest

from lcorpp.assembly.options import TrainingOptions
from lcorpp.assembly.training_data import make_training_data
from lcorpp.errors import DataError
from lcorpp.learning.store import read_store
from lcorpp.learning.streaming.people_predictor import PeoplePredictor
from lcorpp.web.learning import (
    BatchLearner,
    compare_on_track,
    find_last_track,
    find_learning_sense,
    open_store,
)
from lcorpp.web.trial import JudgedTrial
from lcorpp.workers import start_worker


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


def make_learner(robot, data, make_executor=Inline, **options):
    learner = BatchLearner(
        robot,
        find_learning_sense(robot.domain, robot.classifiers),
        data,
        batch_size=2,
        make_executor=make_executor,
        **options,
    )
    notices = []
    learner.notify = notices.append
    return learner, notices


WALK = [(i / 10, 1.0, 9 - i / 10) for i in range(40)]


def play(learner, count=1, walked=True):
    for _ in range(count):
        kept = learner.keep(JudgedTrial({}, {"motion": WALK if walked else []}, "interested"))
    return kept


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
    learner, notices = make_learner(intention, data, lambda: Inline(DataError("the training diverged")))
    play(learner, 2)
    assert notices[1] == {"type": "learnt", "error": "the training diverged"}
    assert learner.robot is intention


def test_a_training_whose_process_ends_is_reported_and_repeated(intention, data):
    executors = iter([Inline(BrokenExecutor("killed")), Inline()])
    learner, notices = make_learner(intention, data, make_executor=lambda: next(executors))
    play(learner, 2)
    assert "perhaps for lack of memory; the next judged trial starts another one" in notices[1]["error"]
    assert learner.robot is intention
    play(learner)
    assert notices[-1]["type"] == "learnt"
    assert np.array(notices[-1]["after"]).sum() == len(data) + 3


class Ended(Executor):
    """An executor whose process has ended while it had nothing to do."""

    def submit(self, function, /, *arguments):
        raise BrokenExecutor("ended")


def test_a_process_that_ended_before_the_training_is_started_again(intention, data):
    executors = iter([Ended(), Inline()])
    learner, notices = make_learner(intention, data, make_executor=lambda: next(executors))
    play(learner, 2)
    assert [notice["type"] for notice in notices] == ["learning", "learnt"]
    assert "error" not in notices[1]


def test_a_killed_process_is_noticed(intention, data, monkeypatch):
    monkeypatch.setattr("lcorpp.web.learning.train_again", lambda *_: os.kill(os.getpid(), signal.SIGKILL))
    learner, notices = make_learner(intention, data, start_worker)
    play(learner, 2)
    while len(notices) < 2:
        time.sleep(0.05)
    learner.close()
    assert "perhaps for lack of memory" in notices[1]["error"]


class Waiting(Executor):
    """An executor whose training ends when it is shut down."""

    def submit(self, function, /, *arguments):
        self.future = Future()
        return self.future

    def shutdown(self, *, kill_workers):
        assert kill_workers
        self.future.set_exception(RuntimeError("killed"))


def test_the_end_of_the_page_ends_the_training_without_a_notice(intention, data):
    learner, notices = make_learner(intention, data, Waiting)
    play(learner, 2)
    learner.close()
    assert [notice["type"] for notice in notices] == ["learning"]


def test_a_long_track_needs_few_predictions(intention, monkeypatch):
    """None to find it, and one of each classifier at each of its three points a second."""
    trained, count = intention.classifiers["motion"], []
    update = PeoplePredictor.update
    monkeypatch.setattr(PeoplePredictor, "update", lambda *given: (count.append(1), update(*given))[1])
    track = [(i / 200, 0.0, 9 - i / 2000) for i in range(10_000)]
    assert find_last_track(trained, track) == track
    assert not count
    assert len(compare_on_track(trained, trained, track)["times"]) == 149
    assert len(count) == 2 * 150


def test_the_last_unbroken_track_is_kept(intention):
    before = [(t / 10, 0.0, 9 - t / 10) for t in range(20)]
    after = [(10 + t / 10, 0.0, 5 - t / 10) for t in range(20)]  # eight seconds later
    assert find_last_track(intention.classifiers["motion"], before + after) == after
    assert find_last_track(intention.classifiers["motion"], after[:1]) == []


def test_no_sense_learns_without_tracks(museum):
    assert find_learning_sense(museum.domain, museum.classifiers) is None
