"""Work units on a Dask cluster of other processes: lost workers, and a cluster that goes away."""

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from lcorpp.errors import WorkerError
from lcorpp.experiments import read_sweep, run_sweep
from lcorpp.work_units import cluster
from lcorpp.work_units.running import evaluate_units
from tests.work_units import functions

pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="distributed is not installed")

ROOT = Path(__file__).parents[2]
UNITS = {str(number): number for number in range(24)}
SQUARES = {key: number**2 for key, number in UNITS.items()}

Start = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture(autouse=True)
def patience(monkeypatch) -> None:
    """Dask's processes may start, answer and be starved as slowly as on a busy machine."""
    for limit in ("CONNECT_SECONDS", "IDLE_SECONDS", "STUCK_SECONDS"):
        monkeypatch.setattr(cluster, limit, 600)


@pytest.fixture
def start(tmp_path) -> Iterator[Start]:
    """Start a process of Dask; all are killed at the end."""
    paths = [str(ROOT), *filter(None, sys.path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    environment["DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT"] = "600s"
    started: list[subprocess.Popen[bytes]] = []

    def run(kind: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--no-dashboard", *arguments]
        started.append(subprocess.Popen(command, env=environment, cwd=tmp_path, stderr=subprocess.DEVNULL))
        return started[-1]

    yield run
    for process in reversed(started):
        process.kill()
        process.wait()


@pytest.fixture
def scheduler(start, tmp_path) -> tuple[subprocess.Popen[bytes], str]:
    """A scheduler and its address."""
    file = tmp_path / "scheduler.json"
    process = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
    while not file.exists() or not file.read_text():
        assert process.poll() is None
        time.sleep(0.05)
    return process, json.loads(file.read_text())["address"]


def start_worker(start: Start, address: str) -> subprocess.Popen[bytes]:
    return start("worker", address, "--nthreads", "1", "--no-nanny")


@pytest.mark.slow
def test_the_units_of_a_killed_worker_go_to_another_one(start, scheduler):
    _, address = scheduler
    workers = [start_worker(start, address) for _ in range(2)]
    results = {}
    for key, result in evaluate_units(functions.square_slowly, UNITS, cluster=address):
        results[key] = result
        if len(results) == 4:
            workers[0].kill()
    assert results == SQUARES


@pytest.mark.slow
def test_a_sweep_on_a_cluster_has_the_numbers_of_one_process(start, scheduler, tmp_path):
    """Show 5: one of two workers is killed in the middle."""
    _, address = scheduler
    workers = [start_worker(start, address) for _ in range(2)]
    (tmp_path / "s.toml").write_text(
        'strategies = ["P", "R+P", "LCORPP"]\ntrials = 100\n[axes]\n'
        "noise = [0.2, 0.3, 0.4]\ndiscount = { from = 0.9, to = 0.99, count = 4 }\n"
    )
    sweep = read_sweep(tmp_path / "s.toml")

    def kill_one(done: int, total: int, seconds: float | None) -> None:
        if done == 3:
            workers[0].kill()

    found = run_sweep(sweep, tmp_path / "cluster", cluster=address, progress=kill_one)
    assert workers[0].wait() < 0
    assert len(found.rows) == 36
    assert found.rows == run_sweep(sweep, tmp_path / "here").rows


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["scheduler", "worker"])
def test_a_cluster_that_goes_away_is_named(start, scheduler, monkeypatch, lost):
    monkeypatch.setattr(cluster, "IDLE_SECONDS", 2)
    process, address = scheduler
    worker = start_worker(start, address)
    results = {}

    def lose() -> None:
        for key, result in evaluate_units(functions.square_slowly, UNITS, cluster=address):
            results[key] = result
            (process if lost == "scheduler" else worker).kill()

    with pytest.raises(WorkerError, match=rf"the cluster {address} is lost: its scheduler, or all"):
        lose()
    assert results
    assert results.items() < SQUARES.items()


@pytest.fixture
def give_up_at_once(monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")


@pytest.mark.slow
def test_a_unit_that_ends_its_workers_is_given_up(give_up_at_once, start, scheduler, monkeypatch):
    monkeypatch.setattr(cluster, "STUCK_SECONDS", 5)
    _, address = scheduler
    for _ in range(2):
        start_worker(start, address)
    with pytest.raises(WorkerError, match=f"one unit ended several workers of the cluster {address}"):
        dict(evaluate_units(functions.kill_worker, UNITS, cluster=address))


def test_a_cluster_that_cannot_be_reached_is_named(monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_SECONDS", 1)
    for address, words in (
        ("tcp://127.0.0.1:9", "the cluster tcp://127.0.0.1:9 cannot be reached"),
        ("nowhere", "'nowhere' is not an address of a cluster; expected that of a Dask scheduler"),
        ("http://127.0.0.1:9", "http://127.0.0.1:9 cannot be reached: unknown address scheme 'http'"),
        ("tls://127.0.0.1:9", "tls://127.0.0.1:9 cannot be reached: TLS expects"),
    ):
        with pytest.raises(WorkerError, match=words):
            dict(evaluate_units(functions.square, UNITS, cluster=address))


def test_a_program_that_never_answers_is_no_cluster(monkeypatch):
    """E.g. a web server at the port, which waits for the end of the first line."""
    monkeypatch.setattr(cluster, "CONNECT_SECONDS", 1)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"127.0.0.1:{silent.getsockname()[1]}"
        words = f"the cluster {address} cannot be reached: no answer of a Dask scheduler in 1 seconds"
        with pytest.raises(WorkerError, match=words):
            dict(evaluate_units(functions.square, UNITS, cluster=address))


def test_a_cluster_without_workers_is_named_and_one_with_a_worker_evaluates(start, scheduler, monkeypatch):
    connect, address = cluster._connect, scheduler[1]

    def connect_patiently(address):
        client = connect(address)
        monkeypatch.setattr(cluster, "CONNECT_SECONDS", 1)
        return client

    monkeypatch.setattr(cluster, "_connect", connect_patiently)
    with pytest.raises(WorkerError, match=f"{address} has no worker after 1 seconds; expected `dask worker"):
        dict(evaluate_units(functions.square, UNITS, cluster=address))
    monkeypatch.setattr(cluster, "_connect", connect)
    monkeypatch.setattr(cluster, "CONNECT_SECONDS", 600)
    start_worker(start, address)
    assert dict(evaluate_units(functions.square, UNITS, cluster=address)) == SQUARES


def test_dask_is_an_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(WorkerError, match=r"install lcorpp\[dask\]"):
        dict(evaluate_units(functions.square, UNITS, cluster="tcp://127.0.0.1:9"))
