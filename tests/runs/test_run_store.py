"""A run of Algorithm 1 resumes from its store and checkpoint, whatever the state of either."""

import json
import shutil
import sqlite3
from contextlib import closing
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lcorpp.decision import Batch, TrainedSense
from lcorpp.errors import DataError, FileError
from lcorpp.learning import learner, train_and_validate
from lcorpp.learning.store import NewTrack, Store, read_store
from lcorpp.runs.checkpoint import CheckpointFolder
from lcorpp.runs.run_store import RunStore
from lcorpp.values import ConfusionMatrix, Dataset, Distribution, EvidenceKind, LabelEvidence

CLASSES = ("slow", "fast")
BELIEF = Distribution(CLASSES, np.array([0.9, 0.1]))
ANSWERS = (("ask", "yes"), ("ask", "no"))


def walks(cases: int, seed: int = 0) -> Dataset:
    rng = np.random.default_rng(seed)
    labels = tuple(CLASSES[row % 2] for row in range(cases))
    steps = (
        rng.normal(0.2, 0.05, (cases, 2, 12)) * np.array([1 + (x == "fast") for x in labels])[:, None, None]
    )
    return Dataset(np.cumsum(steps, axis=2), labels, interval=0.4)


DATA = walks(24)
PREVIOUS = ConfusionMatrix(("fast", "slow"), np.array([[6.0, 2.0], [1.0, 7.0]]))
MATRIX = ConfusionMatrix(CLASSES, np.array([[9, 3], [2, 10]]))


@cache
def learnt(numbers: bytes, labels: tuple[str, ...]):
    tracks = np.frombuffer(numbers).reshape(len(labels), 2, -1)
    trained, validation = train_and_validate(
        learner("summaries", interval=0.4), Dataset(tracks, labels, interval=0.4), folds=2
    )
    return trained, validation.confusion


def learn(_sense: str, dataset: Dataset):
    return learnt(dataset.trajectories.tobytes(), dataset.labels)


def never(_sense, _dataset):
    raise AssertionError("nothing had to be trained")


def decide(run_store: RunStore, row: int, report: str | None = "slow", **extra: object) -> str:
    signals, labels = {"walk": walks(1, seed=row).trajectories[0]}, {"walk": report}
    return run_store.append_decision(signals, {"time": "noon"}, labels, {"walk": BELIEF}, ANSWERS, extra)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "s.tracks"


@pytest.fixture
def opened(path):
    """Return a function that closes the run store and opens it again with some settings."""
    run_stores = []

    def open_again(data: Dataset = DATA, **settings: object) -> RunStore:
        for run_store in run_stores:
            run_store.close()
        run_stores.append(RunStore(path, {"walk": data}, {"walk": CLASSES}, {"seed": 0, **settings}))
        return run_stores[-1]

    yield open_again
    for run_store in run_stores:
        run_store.close()


@pytest.fixture
def ended(opened):
    """A run that completed batch 1 of three decisions, and two decisions of the next."""
    run_store = opened()
    assert run_store.resume(never) is None
    run_store.save_checkpoint(batch(0, run_store.datasets()["walk"]), [{"batch": 0}])
    for row in range(3):
        decide(run_store, row, None if row == 1 else "fast")
    completed = batch(1, run_store.datasets()["walk"])
    run_store.save_checkpoint(completed, [{"batch": 0}, {"batch": 1, "f1": 0.1 + 0.2}])
    decide(run_store, 3, note="a")
    decide(run_store, 4, None)
    return completed


def batch(number: int, dataset: Dataset) -> Batch:
    return make_batch(number, dataset, *learn("walk", dataset), PREVIOUS)


def make_batch(number: int, dataset: Dataset, classifier, confusion, previous: ConfusionMatrix) -> Batch:
    sense = TrainedSense(classifier, confusion, previous)
    return Batch(number, {"walk": dataset}, {"walk": sense}, (), (), {}, False)


def test_a_run_resumes_where_it_ended(opened, ended):
    run_store = opened()
    resumed = run_store.resume(never)
    assert (run_store.notes, run_store.number, run_store.n_people) == ([], 1, 5)
    assert run_store.rows == [{"batch": 0}, {"batch": 1, "f1": 0.1 + 0.2}]
    assert [(s.extra.get("note"), s.label) for s in run_store.pending] == [("a", "slow"), (None, None)]
    assert (resumed.number, resumed.decided) == (1, 2)
    assert resumed.senses["walk"].previous.counts.tolist() == PREVIOUS.counts.tolist()
    assert np.array_equal(resumed.senses["walk"].confusion.counts, ended.senses["walk"].confusion.counts)
    tracks = walks(50, seed=9).trajectories
    assert resumed.senses["walk"].classifier.classify_many(tracks) == ended.senses[
        "walk"
    ].classifier.classify_many(tracks)
    omega = run_store.datasets()["walk"]
    assert omega.labels == (*DATA.labels, "fast", "fast", "slow")
    assert omega.groups[:24] == DATA.groups
    assert np.array_equal(omega.trajectories[-1], walks(1, seed=3).trajectories[0])


def test_stored_decisions_contain_their_run_and_batch(opened, path):
    run_store = opened()
    id = decide(run_store, 7, "slow", simulated={"actual": "fast"})
    (stored,) = read_store(path)
    assert (stored.id, stored.label, stored.source, dict(stored.context)) == (
        id,
        "slow",
        "robot",
        {"time": "noon"},
    )
    assert dict(stored.belief) == dict(BELIEF)
    assert stored.extra["batch"] == 1
    assert stored.extra["met"] == 0
    assert stored.extra["simulated"] == {"actual": "fast"}


def test_the_evidence_of_stored_labels_is_that_of_the_decisions(opened, ended, path):
    """A label by a person is certain; a store of an earlier version has no answers."""
    omega = opened().datasets()["walk"]
    assert omega.evidence[:24] == (None,) * 24
    assert omega.evidence[24:] == (LabelEvidence(dict(BELIEF), {"time": "noon"}, ANSWERS),) * 3
    opened().close()
    with Store(path, read_store(path).schema) as store:
        (first, *_) = store.snapshot()
        store.relabel(first.id, "slow")
        store.append(NewTrack(walks(1, seed=99).trajectories[0], "fast", belief=BELIEF))
    omega = opened().datasets()["walk"]
    assert [own and own.answers for own in omega.evidence[24:]] == [None, ANSWERS, ANSWERS, None]
    assert omega.evidence[24] is None
    assert omega.evidence[-1] == LabelEvidence(dict(BELIEF))


def test_both_matrices_are_restored_from_the_checkpoint(opened):
    run_store = opened()
    trained, _ = learn("walk", DATA)
    fewer = ConfusionMatrix(CLASSES, MATRIX.counts, MATRIX.counts.sum(axis=1, keepdims=True) / [2, 4])
    before = ConfusionMatrix(CLASSES, MATRIX.counts, fewer.effective_cases / 2)
    sense = TrainedSense(trained, fewer, before, ConfusionMatrix(CLASSES, MATRIX.counts + 1))
    run_store.save_checkpoint(Batch(0, {"walk": DATA}, {"walk": sense}, (), (), {}, False), [])
    again = opened().resume(never).senses["walk"]
    assert again.confusion.counts.tolist() == MATRIX.counts.tolist()
    assert again.confusion.effective_cases.tolist() == fewer.effective_cases.tolist()
    assert again.previous.effective_cases.tolist() == before.effective_cases.tolist()
    assert again.against_reports.counts.tolist() == (MATRIX.counts + 1).tolist()
    assert again.against_reports.effective_cases is None


@pytest.mark.parametrize("evidence", ["soft", "set"])
def test_a_soft_classifier_is_restored_from_the_checkpoint(opened, evidence):
    run_store = opened()
    first = batch(0, run_store.datasets()["walk"])
    soft = first.senses["walk"].classifier.as_evidence(EvidenceKind(evidence))
    run_store.save_checkpoint(make_batch(0, DATA, soft, first.senses["walk"].confusion, PREVIOUS), [])
    tracks = walks(3, seed=9).trajectories
    again = opened().resume(never).senses["walk"].classifier.classify_many(tracks)
    assert [str(likelihood) for likelihood in again] == [str(one) for one in soft.classify_many(tracks)]


def test_a_classifier_that_cannot_be_stored_is_trained_again(opened, path):
    """On its own training data, without the decisions since, as in a run without a crash."""

    class Odd:
        def classify(self, signal):
            return "slow"

    run_store = opened()
    run_store.save_checkpoint(make_batch(0, DATA, Odd(), MATRIX, PREVIOUS), [])
    decide(run_store, 1)
    given = []
    resumed = opened().resume(lambda _, dataset: given.append(dataset) or (Odd(), MATRIX))
    assert len(given[0]) == len(DATA)
    assert (resumed.decided, resumed.senses["walk"].classifier.classify(None)) == (1, "slow")


def test_labels_of_persons_cause_a_training_at_the_next_start(opened, ended, path):
    opened().close()
    with Store(path, read_store(path).schema) as store:
        (first, *_) = store.snapshot()
        store.relabel(first.id, "slow")
        store.append(NewTrack(walks(1, seed=99).trajectories[0], "slow", "person"))
    run_store = opened()
    given = []
    resumed = run_store.resume(lambda name, dataset: given.append(dataset) or learn(name, dataset))
    assert run_store.notes == ["2 records were added by persons or another run: trained again"]
    assert given[0].labels[24:] == ("slow", "fast", "slow", "slow")
    assert np.array_equal(resumed.senses["walk"].previous.counts, ended.senses["walk"].confusion.counts)
    trained = resumed.senses["walk"]
    batch_again = make_batch(1, given[0], trained.classifier, trained.confusion, trained.previous)
    run_store.save_checkpoint(batch_again, run_store.rows)
    run_store = opened()
    resumed = run_store.resume(never)
    assert resumed.decided == 2
    assert np.array_equal(resumed.senses["walk"].previous.counts, trained.previous.counts)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"seed": 3}, "not used, seed was 0, and is 3 now"),
        ({"data": walks(30)}, "not used, data was 24 tracks, "),
    ],
)
def test_a_checkpoint_of_other_settings_is_not_used(opened, ended, settings, words):
    run_store = opened(**settings)
    assert run_store.resume(never) is None
    assert words in run_store.notes[0]
    assert run_store.notes[0].endswith("; trained on all that is stored")
    assert (run_store.number, run_store.pending, run_store.rows, run_store.n_people) == (None, (), [], 5)
    assert len(run_store.datasets()["walk"]) == len(settings.get("data", DATA)) + 3


def spoilt(path, how):
    (file,) = (path.with_name(path.name + ".checkpoint")).glob(how[0])
    how[1](file)


def cut(file):
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def make_file_change(**facts):
    def change(file):
        file.write_text(json.dumps({**json.loads(file.read_text()), **facts}))

    return change


def make_sense_change(**facts):
    def change(file):
        content = json.loads(file.read_text())
        content["senses"]["walk"] |= facts
        file.write_text(json.dumps(content))

    return change


@pytest.mark.parametrize(
    ("how", "words"),
    [
        (("checkpoint.json", lambda file: file.unlink()), "no checkpoint"),
        (("checkpoint.json", cut), "not used, it is damaged"),
        (("checkpoint.json", lambda file: file.write_bytes(b"\xff")), "not UTF-8"),
        (("checkpoint.json", lambda file: file.write_text("[]")), "damaged"),
        (
            ("checkpoint.json", make_file_change(version=4)),
            "this lcorpp reads versions 1, 2, 3",
        ),
        (("checkpoint.json", make_file_change(store="00")), "another store"),
        (("checkpoint.json", make_file_change(number=-1)), "-1 is not a number"),
        (("checkpoint.json", make_sense_change(counts=[[1]])), "cannot have shape"),
        (("checkpoint.json", make_sense_change(previous=[[1]])), "cannot have shape"),
        (("checkpoint.json", make_file_change(rows=3)), "damaged"),
        (("checkpoint.json", make_file_change(settings=None)), "damaged"),
        (("checkpoint.json", make_sense_change(classifier="x")), "damaged"),
    ],
)
def test_a_checkpoint_that_cannot_be_used_costs_a_training(opened, ended, path, how, words):
    opened().close()
    spoilt(path, how)
    run_store = opened()
    assert words in run_store.notes[0]
    assert run_store.resume(never) is None
    assert len(run_store.datasets()["walk"]) == 24 + 3


@pytest.mark.parametrize(
    ("how", "words"),
    [
        (("classifier-*", lambda file: file.unlink()), "cannot be read"),
        (("classifier-*", cut), "differs from the file that was written; trained again"),
    ],
)
def test_a_damaged_classifier_is_trained_again(opened, ended, path, how, words):
    opened().close()
    spoilt(path, how)
    run_store = opened()
    resumed = run_store.resume(learn)
    assert words in run_store.notes[0]
    assert (resumed.number, resumed.decided) == (1, 2)
    tracks = walks(50, seed=9).trajectories
    assert resumed.senses["walk"].classifier.classify_many(tracks) == ended.senses[
        "walk"
    ].classifier.classify_many(tracks)


def lose_records(path, after):
    """Remove the last records, as a power loss does on a disk that reports writes before they are made."""
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("DELETE FROM track WHERE record > ?", (after,))
        connection.execute("UPDATE sqlite_sequence SET seq = ?", (after,))
        connection.commit()


def test_a_run_resumes_after_the_last_stored_decision(opened, ended, path):
    """One of the two decisions since the last training is lost."""
    opened().close()
    lose_records(path, after=4)
    run_store = opened()
    assert (run_store.resume(never).decided, run_store.n_people) == (1, 4)
    decide(run_store, 4)


def test_records_that_the_training_used_are_lost(opened, ended, path):
    opened().close()
    lose_records(path, after=1)
    run_store = opened()
    assert run_store.resume(learn).decided == 0
    assert run_store.notes[-1] == "2 records that the last training used are lost: trained again"


def test_a_run_with_a_store_of_version_1_is_resumed(path, opened):
    """Its checkpoint still belongs to the converted store."""
    old = Path(__file__).parents[1] / "learning" / "store" / "version1"
    shutil.copy(old / "run.tracks", path)
    shutil.copytree(old / "run.tracks.checkpoint", path.with_name(f"{path.name}.checkpoint"))
    run_store = opened()
    resumed = run_store.resume(learn)
    assert (run_store.notes, run_store.number, run_store.n_people) == ([], 1, 4)
    assert (resumed.number, resumed.decided) == (1, 1)
    assert not resumed.senses["walk"].previous.counts.any()  # version 1 of a checkpoint is without them
    assert np.array_equal(resumed.senses["walk"].confusion.counts, MATRIX.counts)
    assert run_store.datasets()["walk"].labels == (*DATA.labels, "fast", "fast", "slow")
    assert np.array_equal(run_store.datasets()["walk"].trajectories[-1], walks(1, seed=3).trajectories[0])


def test_only_one_classifier_file_stays(opened, ended, path):
    folder = path.with_name(path.name + ".checkpoint")
    assert len(list(folder.iterdir())) == 2


def test_a_crash_between_the_files_of_a_checkpoint_leaves_the_one_before(opened, ended, path, monkeypatch):
    run_store = opened()
    before = run_store.resume(never)
    write = CheckpointFolder.write.__globals__["write_atomically"]

    def crash(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setitem(CheckpointFolder.write.__globals__, "write_atomically", crash)
    with pytest.raises(KeyboardInterrupt):
        run_store.save_checkpoint(batch(2, run_store.datasets()["walk"]), [])
    monkeypatch.setitem(CheckpointFolder.write.__globals__, "write_atomically", write)
    after = opened().resume(never)
    assert (after.number, after.decided) == (before.number, before.decided) == (1, 2)


def test_one_run_at_a_time(opened, path):
    opened()
    with pytest.raises(FileError, match="is already being written to"):
        RunStore(path, {"walk": DATA}, {"walk": CLASSES}, {})


def test_a_store_of_other_tracks_is_refused(opened, path):
    opened().close()
    other = Dataset(np.zeros((2, 2, 5)), CLASSES, interval=0.4)
    with pytest.raises(DataError, match="its time points of a track: 12; the tracks to be stored have: 5"):
        RunStore(path, {"walk": other}, {"walk": CLASSES}, {})
    Store(path, read_store(path).schema).close()  # the lock is free again


def test_a_decision_about_a_person_whom_the_sense_did_not_perceive_is_complete_and_teaches_nothing(
    opened, ended, path
):
    run_store = opened()
    before, people, n_pending = run_store.datasets()["walk"], run_store.n_people, len(run_store.pending)
    labels, beliefs = {"walk": "slow"}, {"walk": BELIEF}
    id = run_store.append_decision({}, {"time": "noon"}, labels, beliefs, ANSWERS, {})
    after = run_store.datasets()["walk"]
    np.testing.assert_array_equal(after.trajectories, before.trajectories)
    assert after.labels == before.labels
    assert id not in {track.id for track, _ in run_store.decisions("walk")}
    again = opened()
    assert again.n_people == people + 1
    assert [track.id for track in again.pending][n_pending:] == [id]
    assert again.resume(never).decided == n_pending + 1
    again.close()
    track = read_store(path).tracks[-1]
    assert (track.id, track.points, track.label, track.belief["slow"]) == (id, 0, None, 0.9)
    assert not read_store(path).damage
