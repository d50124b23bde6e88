"""The file of finished units: crash-safe, of one run, for one process."""

import os
import signal
import sqlite3
import subprocess
import sys

import pytest

from lcorpp.errors import DataError, FileError
from lcorpp.work_units.store import UnitStore, hash_unit, make_seed

RUN = {"lcorpp": "1.0", "trials": "200"}

WRITER = """
import os, signal, sys
from pathlib import Path
from lcorpp.work_units.store import UnitStore
store = UnitStore(Path(sys.argv[1]), {"lcorpp": "1.0", "trials": "200"})
for number in range(10):
    store.add(str(number), number)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def file(tmp_path):
    return tmp_path / "units.sqlite"


def test_results_keep_all_digits(file):
    rows = [{"return": 0.1 + 0.2, "strategy": "R+P", "reference": None}]
    with UnitStore(file, RUN) as store:
        store.add("a", rows)
        assert store["a"] == rows
    with UnitStore(file, RUN) as store:
        assert (len(store), "a" in store, "b" in store, store["a"]) == (1, True, False, rows)


def test_a_killed_process_loses_nothing_that_was_added(file):
    ended = subprocess.run([sys.executable, "-c", WRITER, file], env={**os.environ})
    assert ended.returncode == -signal.SIGKILL
    with UnitStore(file, RUN) as store:
        assert [store[str(number)] for number in range(10)] == list(range(10))


@pytest.mark.parametrize(
    ("identity", "words"),
    [
        ({"lcorpp": "1.0", "trials": "300"}, "trials was 200, now 300"),
        ({"lcorpp": "2.0", "trials": "200"}, "lcorpp was 1.0, now 2.0"),
        ({"lcorpp": "1.0"}, "trials was 200, now missing"),
    ],
)
def test_results_of_another_run_are_refused(file, identity, words):
    with UnitStore(file, RUN) as store:
        store.add("a", 1)
    with pytest.raises(DataError, match="units.sqlite: its 1 results are of another run: " + words):
        UnitStore(file, identity)
    with UnitStore(file, RUN) as store:
        assert len(store) == 1


def test_another_version_or_another_file_is_refused(file, tmp_path):
    UnitStore(file, RUN).__exit__()
    with sqlite3.connect(file) as connection:
        connection.execute("PRAGMA user_version = 9")
    connection.close()
    with pytest.raises(DataError, match=r"its version is 9; this lcorpp has version 1"):
        UnitStore(file, RUN)
    with sqlite3.connect(other := tmp_path / "other") as connection:
        connection.execute("CREATE TABLE people (name TEXT)")
    connection.close()
    with pytest.raises(DataError, match="an SQLite file, but not of results of work units"):
        UnitStore(other, RUN)
    (text := tmp_path / "text").write_text("noise,return\n" * 100)
    with pytest.raises(DataError, match="not a file of results, or a damaged one"):
        UnitStore(text, RUN)


def test_without_results_a_store_belongs_to_any_run(file):
    UnitStore(file, {**RUN, "seed": "9", "more": "text"}).__exit__()
    with UnitStore(file, RUN) as store:
        store.add("a", 1)
    with UnitStore(file, RUN) as store:
        assert store["a"] == 1


def test_a_damaged_result_is_named(file):
    with UnitStore(file, RUN) as store:
        store.add("a", 1)
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE unit SET result = '[1, '")
    connection.close()
    with pytest.raises(DataError, match="a damaged result: Expecting value"):
        UnitStore(file, RUN)


def test_a_second_writer_and_a_full_disk_are_named(file, tmp_path):
    with UnitStore(file, RUN) as store:
        with pytest.raises(FileError, match="another process writes to it"):
            UnitStore(file, RUN)
        store.add("a", "kept")
        (pages,) = store._connection.execute("PRAGMA page_count").fetchone()
        store._connection.execute(f"PRAGMA max_page_count = {pages}")  # as a full disk
        with pytest.raises(FileError, match="the disk is full; the 1 finished results are kept"):
            store.add("b", "x" * 100_000)
    with UnitStore(file, RUN) as store:
        assert (store["a"], len(store)) == ("kept", 1)
    with pytest.raises(FileError, match="nowhere"):
        UnitStore(tmp_path / "nowhere" / "units.sqlite", RUN)


def test_keys_and_seeds_depend_on_the_content_alone():
    assert hash_unit({"noise": 0.1, "discount": 0.9}) == hash_unit({"discount": 0.9, "noise": 0.1})
    assert hash_unit({"noise": 0.1}) != hash_unit({"noise": 0.2})
    seeds = {make_seed(seed, key) for seed in range(10) for key in "abc"}
    assert len(seeds) == 30
    assert make_seed(1, "a") == make_seed(1, "a") < 2**64
