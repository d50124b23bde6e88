"""No accepted record is lost, whenever the process that runs Algorithm 1 is killed."""

import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lcorpp.learning.store import read_store

ROOT = Path(__file__).parents[3]
ROOMS = ROOT / "tests" / "domains" / "rooms"


def run_kills(kills: int, longest: float) -> str:
    options = ("--kills", str(kills), "--longest", str(longest))
    ended = subprocess.run(
        [sys.executable, "-m", "tests.learning.store.kills", *options],
        cwd=ROOT,
        capture_output=True,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.mark.slow
def test_three_kills():
    report = run_kills(3, longest=0.05)
    assert re.match(
        r"3 kills \(.*\): [1-9]\d* records accepted, none lost; .* equal to those of a run", report
    )


@pytest.mark.slow
def test_two_hundred_kills():
    report = run_kills(200, longest=0.05)
    assert int(re.search(r"(\d+) records accepted, none lost", report)[1]) > 200
    assert all(f"while {phase}" in report for phase in ("starting", "appending", "training"))


@pytest.mark.slow
def test_the_command_itself(tmp_path):
    """Six kills of `lcorpp learn`, some of them with worker processes that train its folds."""
    store, log = tmp_path / "s.tracks", tmp_path / "log"
    options = ("--tracks", "60", "--learner", "summaries", "--batch-size", "20", "--epsilon", "0")
    command = [str(Path(sys.executable).with_name("lcorpp")), "learn", str(ROOMS), *options]
    command += ["--max-batches", "1000", "--store", str(store), "--jobs"]
    rng, there = random.Random(0), dict[str, str | None]()
    for kill in range(6):
        with log.open("w") as file:  # no pipe: workers of the dead would hold it open
            process = subprocess.Popen(
                [*command, str(1 + kill % 2)], cwd=ROOT, stdout=file, stderr=file, start_new_session=True
            )
            wanted = len(there) + rng.randint(1, 50)
            while process.poll() is None and len(read_labels(store)) < wanted:
                time.sleep(0.05)
            time.sleep(rng.uniform(0, 0.3))
            assert process.poll() is None, log.read_text()
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        now = read_labels(store)
        assert there.items() <= now.items()
        assert len(now) >= wanted
        there = now


def read_labels(store: Path) -> dict[str, str | None]:
    """Return the stored labels by id; none before the store is created."""
    if not store.exists() or not store.stat().st_size:
        return {}
    reading = read_store(store)
    assert not reading.damage
    return {stored.id: stored.label for stored in reading}
