"""`lcorpp learn --store`: what was decided is kept, and an interrupted run goes on as if it had not been."""

import csv
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from lcorpp.learning.store import Store, TrackSchema, read_store
from lcorpp.runs.run_store import RunStore

pytestmark = pytest.mark.usefixtures("unrendered")

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"
OPTIONS = ("--tracks", 30, "--learner", "summaries", "--batch-size", 4, "--epsilon", 0, "--jobs", 1)


def stored(path):
    """What must not depend on interruptions."""
    reading = read_store(path)
    said = [
        (s.label, dict(s.belief), dict(s.context), s.group, s.extra["batch"], s.extra["simulated"])
        for s in reading
    ]
    return said, reading.trajectories().tolist()


@pytest.mark.slow
def test_an_interrupted_run_resumes_with_the_results_of_an_uninterrupted_run(lcorpp, tmp_path, monkeypatch):
    """Of corrected labels; those of test_learn_senses.py are hard."""
    learn = ("learn", ROOMS, *OPTIONS, "--labels", "corrected", "--max-batches", 3, "--precision", 0.1)
    plain = lcorpp(*learn, "--store", tmp_path / "plain.tracks", "--out", tmp_path / "plain")
    assert plain.code == 0, plain.err
    assert f"{tmp_path / 'plain.tracks'}: 0 tracks" in plain.out
    with (tmp_path / "plain" / "batches.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["tracks"]) for row in rows] == [30, 34, 38, 42]

    keep, save, calls = RunStore.append_decision, RunStore.save_checkpoint, []

    def interrupted(original):
        """Ctrl-C after the first decision, the training of batch 1 and the last decision of batch 2."""

        def call(run_store, *arguments):
            kept = original(run_store, *arguments)
            calls.append(original)
            if len(calls) in (2, 7, 12):
                raise KeyboardInterrupt
            return kept

        return call

    monkeypatch.setattr(RunStore, "append_decision", interrupted(keep))
    monkeypatch.setattr(RunStore, "save_checkpoint", interrupted(save))
    common = (*learn, "--store", tmp_path / "s.tracks", "--out", tmp_path / "out")
    outs = []
    while not outs or "stopped after 3 batches" not in outs[-1].out:
        outs.append(lcorpp(*common))
        assert outs[-1].code == 0, outs[-1].err
        assert "note:" not in outs[-1].out
        assert len(outs) < 9
    assert len(outs) == 4
    assert "interrupted: the batches above are kept; the decisions so far are kept in" in outs[0].err
    for ended, words in zip(
        outs[1:], ("0, 1 decisions of the next batch are stored", "1\n", "1, 4 decisions"), strict=True
    ):
        assert f"resumes after batch {words}" in ended.out
    assert (tmp_path / "out" / "batches.csv").read_text() == (tmp_path / "plain" / "batches.csv").read_text()
    assert stored(tmp_path / "s.tracks") == stored(tmp_path / "plain.tracks")
    batches = [line for line in plain.out.splitlines() if line.startswith("batch")]
    told = [line for ended in outs for line in ended.out.splitlines() if line.startswith("batch 3")]
    assert told == batches[3:]

    again = lcorpp(*learn, "--store", tmp_path / "s.tracks", "--max-batches", 4)
    assert "resumes after batch 3\n" in again.out
    assert "stopped after 4 batches" in again.out
    assert len(read_store(tmp_path / "s.tracks")) == 16


@pytest.mark.parametrize(
    ("labels", "first"), [("soft", 4), pytest.param("corrected", 5, marks=pytest.mark.slow)]
)
def test_a_run_from_no_data_resumes_as_if_it_had_not_ended(lcorpp, tmp_path, labels, first):
    """With this seed batch `first` is the first after which cross-validation has five cases of each class."""
    options = ("--tracks", 0, "--learner", "summaries", "--batch-size", 8, "--epsilon", 0, "--jobs", 1)
    plain = lcorpp(
        "learn", *options, "--labels", labels, "--max-batches", first, "--store", tmp_path / "p.tracks"
    )
    assert plain.code == 0, plain.err
    lines = [line for line in plain.out.splitlines() if line.startswith("batch")]
    random = "random labels, as cross-validation needs 5 of each class"
    assert lines[0] == f"batch 0: 0 tracks; {random}"
    assert lines[first - 1].startswith(f"batch {first - 1}: {8 * first - 8} tracks; {random}; F1")
    assert lines[first].startswith(f"batch {first}: {8 * first} tracks; recall: ")
    learn = ("learn", *options, "--store", tmp_path / "s.tracks", "--labels")
    for batches in range(2, first + 1):
        again = lcorpp(*learn, labels, "--max-batches", batches)
        assert again.code == 0, again.err
    assert again.out.splitlines()[-3] == lines[first]
    assert stored(tmp_path / "s.tracks") == stored(tmp_path / "p.tracks")
    other = {"soft": "hard", "corrected": "soft"}[labels]
    changed = lcorpp(*learn, other, "--max-batches", 1)
    assert f"labels was {labels}, and is {other} now; trained on all that is stored" in changed.out


def test_options_of_labels_and_tracks_are_checked_before_the_work(lcorpp, tmp_path):
    (tmp_path / "mine.py").write_text(
        "from sklearn.neighbors import KNeighborsClassifier as Near\n\n\ndef near():\n    return Near()\n"
    )
    learner = f"{tmp_path / 'mine.py'}:near"
    words = "cannot learn from weighted cases: its fit has no sample_weight; expected one of lstm, lstm-fast,"
    for labels in ("soft", "corrected"):
        refused = lcorpp("learn", "--labels", labels, "--learner", learner)
        assert (refused.code, words in refused.err) == (2, True)
    few = lcorpp("learn", "--tracks", 19)
    assert (few.code, "--tracks 19: expected 0, or at least 20" in few.err) == (2, True)
    unknown = lcorpp("learn", "--labels", "medium")
    assert (unknown.code, "'medium' is not one of 'hard', 'soft', 'corrected'" in unknown.err) == (2, True)


def test_paths_that_cannot_be_a_store_are_rejected(lcorpp, tmp_path):
    (tmp_path / "text").write_text("hello")
    Store(tmp_path / "other", TrackSchema(("x", "y"), 0.033, ("a", "b"))).close()
    for path, words in (
        (tmp_path, "is not a file; a store of tracks is one"),
        (tmp_path / "text", "text: not a store of tracks"),
        (tmp_path / "other", "its classes: a, b; the tracks to be stored have: lab, office, store"),
        (tmp_path / "no" / "s", "there is no folder"),
    ):
        ended = lcorpp("learn", ROOMS, *OPTIONS, "--store", path)
        assert (ended.code, words in ended.err) == (2, True), ended.err
    with Store(tmp_path / "s", TrackSchema(("x", "y"), 0.033, ("lab", "office", "store"), 12)):
        ended = lcorpp("learn", ROOMS, *OPTIONS, "--store", tmp_path / "s")
    assert ended.code == 2
    assert "is already being written to" in ended.err


@pytest.fixture
def damaged(tmp_path):
    from tests.learning.store.stores import filled

    path = tmp_path / "s.tracks"
    filled(path, 8)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("UPDATE track SET label = 'interested' WHERE record = 4")
        connection.commit()
    return path


def test_check_reports_the_content_and_the_damage_of_a_store(lcorpp, damaged, tmp_path):
    ended = lcorpp("check", damaged)
    assert ended.code == 2
    assert f"{damaged}: 7 tracks (1 interested by a person, " in ended.out
    assert "damaged in 1 place; the other records are" in ended.err
    assert "record 4: its checksum is wrong; 1 record lost" in ended.err
    from tests.learning.store.stores import filled

    filled(tmp_path / "right", 8)
    ended = lcorpp("check", tmp_path / "right")
    assert ended.code == 0
    assert (
        "8 tracks (1 interested by a person, 2 interested by report, 1 not_interested by a person, "
        in ended.out
    )
    assert ended.out.rstrip().endswith("x, y every 0.033 s: OK")
    assert np.isfinite(read_store(tmp_path / "right").trajectories()).all()


def test_stores_of_version_1_are_converted(lcorpp, tmp_path, caplog):
    old = Path(__file__).parents[1] / "learning" / "store" / "version1" / "rooms.tracks"
    for command in (("check",), ("learn", ROOMS, *OPTIONS, "--max-batches", "1", "--store")):
        path = tmp_path / f"{command[0]}.tracks"
        shutil.copy(old, path)
        ended = lcorpp(*command, path)
        assert ended.code == 0
        assert "3 tracks (1 lab by a person, 1 office by a person, 1 store by a person)" in ended.out
        assert f"{path}: converted from version 1 to SQLite, 3 records" in caplog.text
        assert path.with_name(f"{path.name}.old").read_bytes() == old.read_bytes()
    assert len(read_store(path)) > 3
