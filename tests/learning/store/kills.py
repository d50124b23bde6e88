"""Kill Algorithm 1 many times and check that no accepted record is lost.

Run it with `python -m tests.learning.store.kills`.

A child process runs the algorithm with a run store (store and checkpoint) and reports through a pipe what was
accepted. SIGKILL ends it at a random moment, while it starts, appends or trains; the next child resumes. In
the end the store must contain what a run without kills stores, record by record, and the confusion matrix
must be equal. SQLite is slowed down, so that many kills hit a transaction.
"""

from __future__ import annotations

import argparse
import collections
import itertools
import json
import os
import signal
import sqlite3
import sys
import tempfile
import time
import traceback
from pathlib import Path

import numpy as np

from lcorpp.decision import lcorpp
from lcorpp.learning import train_and_validate
from lcorpp.learning.classifiers.registry import learner
from lcorpp.learning.store import database, read_store
from lcorpp.runs.run_store import RunStore
from lcorpp.values import Dataset, Distribution, Episode, Instance
from tests.decision.fakes import VALUES, FakeDomain, FakePlanner, FakeReasoner, FakeWorld

INTERVAL, POINTS, BATCH = 0.2, 20, 24
INSTRUCTIONS, PAUSE = 5, 2e-4
"""SQLite waits for PAUSE seconds after each few instructions: an append takes some milliseconds."""


def walk(slow: bool, rng: np.random.Generator) -> np.ndarray:
    """(2, POINTS) an unsteady walk along x, slow or not."""
    steps = rng.normal(0.15 if slow else 0.2, 0.05, POINTS - 1)
    return np.stack([np.cumsum([0, *steps]), rng.normal(0, 0.02, POINTS)])


def initial_dataset() -> Dataset:
    rng = np.random.default_rng(0)
    labels = tuple(VALUES[row % 2] for row in range(40))
    return Dataset(np.array([walk(x == "yes", rng) for x in labels]), labels, interval=INTERVAL)


def meet(number: int) -> tuple[Instance, FakeWorld]:
    """Return the person with this number, whose answers are right three times of four."""
    rng = np.random.default_rng([1, number])
    slow = bool(rng.random() < 0.5)
    answers = ["nod" if (rng.random() < 0.75) == slow else "shake" for _ in range(200)]
    return Instance({"eyes": walk(slow, rng)}, {"sky": "grey"}), FakeWorld(*answers)


def run(path: Path, report, batches: int | None = None) -> None:
    """Run or resume Algorithm 1, for ever or until this many batches are completed."""
    data, words = initial_dataset(), FakeDomain()

    def train(_sense: str, dataset: Dataset):
        report("training")
        estimator = learner("summaries", interval=INTERVAL)
        trained, validation = train_and_validate(estimator, dataset, folds=2, seed=0)
        return trained, validation.confusion

    def decided(instance: Instance, episode: Episode) -> None:
        belief = Distribution(VALUES, episode.steps[-1].belief)
        labels, beliefs = {"eyes": episode.report}, {"eyes": belief}
        id = run_store.append_decision(
            instance.signals, instance.context, labels, beliefs, episode.answers, {}
        )
        report(f"kept {id} {episode.report}")

    with RunStore(path, {"eyes": data}, {"eyes": VALUES}, {"seed": 0}) as run_store:
        for note in run_store.notes:
            report(f"note {note}")
        line = itertools.count(run_store.n_people)
        loop = lcorpp(
            run_store.datasets(),
            train=train,
            make_reasoner=lambda _: FakeReasoner(),
            planner=FakePlanner(),
            domain=words,
            collect=lambda: meet(next(line)),
            batch_size=BATCH,
            epsilon=0,
            listener=decided,
            resume_point=run_store.resume(train),
        )
        for batch in loop:
            run_store.save_checkpoint(batch, [])
            report(f"batch {batch.number}")
            if batch.converged or batch.number == batches:
                return


def run_and_kill(path: Path, lines: int, delay: float) -> list[str]:
    """Run a child, kill it `delay` seconds after its report has so many lines, and return the report.

    The report, not the time, decides, so that a busy machine kills in the same phases as an idle one.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(reader)
            connect = database.connect

            def connect_slowly(*arguments) -> sqlite3.Connection:
                connection = connect(*arguments)
                connection.set_progress_handler(lambda: time.sleep(PAUSE), INSTRUCTIONS)
                return connection

            database.connect = connect_slowly
            run(path, lambda words: os.write(writer, f"{words}\n".encode()))
        except BaseException:
            traceback.print_exc()
        os._exit(1)
    os.close(writer)
    with os.fdopen(reader, encoding="utf-8") as pipe:
        report = [pipe.readline() for _ in range(lines)]
        time.sleep(delay)
        os.kill(child, signal.SIGKILL)
        report += pipe.readlines()
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status), f"the child ended by itself after reporting {report[-3:]}"
    return [line.rstrip("\n") for line in report]


def check(path: Path, accepted: dict[str, str], number: int) -> None:
    """Check that every accepted record is there, and at most one that was not reported yet."""
    reading = read_store(path)
    assert not reading.damage, reading.damage
    there = {stored.id: stored.label for stored in reading}
    lost = {id: label for id, label in accepted.items() if there.get(id) != label}
    assert not lost, f"lost: {lost}"
    assert len(there) <= len(accepted) + 1, "records that were not reported"
    accepted.update(there)  # the child was killed between the commit and its report
    if number >= 0:
        content = json.loads((path.with_name(f"{path.name}.checkpoint") / "checkpoint.json").read_text())
        assert content["number"] in (number, number + 1)


def facts(path: Path) -> tuple[list, np.ndarray, list]:
    """Return all that must not depend on kills: the stored records and the last matrix."""
    reading = read_store(path)
    rows = [
        (s.record, s.label, s.source, dict(s.belief or ()), s.group, s.extra["batch"], s.extra["met"])
        for s in reading
    ]
    content = json.loads((path.with_name(f"{path.name}.checkpoint") / "checkpoint.json").read_text())
    return (
        rows,
        reading.trajectories(),
        [content["number"], content["senses"]["eyes"]["counts"], content["senses"]["eyes"]["previous"]],
    )


def main(kills: int, seed: int, longest: float, folder: Path) -> str:
    rng = np.random.default_rng(seed)
    path, plain = folder / "killed.tracks", folder / "plain.tracks"
    run(folder / "first.tracks", lambda _: None, 1)  # imports everything: the children need not
    accepted: dict[str, str] = {}
    number, where = -1, collections.Counter[str]()
    for _ in range(kills):
        lines = 0 if rng.random() < 0.25 else int(rng.integers(1, BATCH // 2))
        reported = run_and_kill(path, lines, rng.uniform(0, longest))
        for line in reported:
            word, _, rest = line.partition(" ")
            if word == "kept":
                id, _, label = rest.partition(" ")
                accepted[id] = label
            elif word == "batch":
                number = int(rest)
            elif word == "note":
                raise AssertionError(f"damage after a kill: {rest}")
        phases = {"": "starting", "note": "starting", "training": "training"}
        where[phases.get(reported[-1].partition(" ")[0] if reported else "", "appending")] += 1
        if path.exists() and path.stat().st_size:
            check(path, accepted, number)
    run(path, lambda _: None, number + 2)
    run(plain, lambda _: None, number + 2)
    (rows, tracks, matrix), (rows_, tracks_, matrix_) = facts(path), facts(plain)
    assert rows == rows_
    assert np.array_equal(tracks, tracks_)
    assert matrix == matrix_
    left = sorted(file.name for file in path.with_name(f"{path.name}.checkpoint").iterdir())
    assert len(left) == 2, f"{left} where the checkpoint and its classifier are expected"
    phases = ", ".join(f"{count} while {name}" for name, count in where.most_common())
    return (
        f"{kills} kills ({phases}): {len(accepted)} records accepted, none lost;"
        f" {number + 2} batches, equal to those of a run without kills"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="of the moments")
    parser.add_argument(
        "--longest", type=float, default=0.05, help="seconds from the last report to the kill, at most"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        print(main(options.kills, options.seed, options.longest, Path(made)))
    sys.exit(0)
