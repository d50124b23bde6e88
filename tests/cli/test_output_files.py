"""Output files and folders: what is refused before the work, and one process at a time for a folder."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lcorpp.cli.output_files import check_writable, lock_results
from lcorpp.errors import FileError
from tests.cli.test_bad_input import refused

fcntl = pytest.importorskip("fcntl")

RESULTS = [
    ("run", "--classifier", "channel", "--trials", 300),
    ("learn", "--tracks", 40),
    ("figures", "--fast"),
    ("sweep", "noise.toml"),
    ("observe",),
]


@pytest.mark.parametrize("command", RESULTS, ids=lambda command: command[0])
def test_a_second_run_with_the_same_folder_is_refused(lcorpp, tmp_path, command):
    with lock_results(tmp_path, None):
        ended = lcorpp(*command, "--out", tmp_path / ".." / tmp_path.name)
    refused(ended, "another process writes its results there; expected another folder, or its end")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", RESULTS, ids=lambda command: command[0])
def test_a_folder_that_cannot_be_created_is_refused_before_the_work(lcorpp, tmp_path, command):
    (tmp_path / "link").symlink_to(tmp_path / "nowhere" / "below")
    refused(lcorpp(*command, "--out", tmp_path / "link"), "link: cannot create the folder: File exists")
    refused(lcorpp(*command, "--out", tmp_path / ("x" * 300)), "File name too long")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder that not even root can write to")
def test_a_folder_that_cannot_be_written_is_refused():
    folder = Path("/proc/self")
    with pytest.raises(FileError, match="/proc/self: cannot be written"), lock_results(folder, None):
        pass
    with pytest.raises(FileError, match=r"/proc/self/x.csv: cannot be written"):
        check_writable(folder / "x.csv")


def test_a_killed_process_leaves_no_lock(tmp_path):
    code = """
import sys, time
from pathlib import Path
from lcorpp.cli.output_files import lock_results
with lock_results(Path(sys.argv[1]), None):
    print("locked", flush=True)
    time.sleep(600)
"""
    command = [sys.executable, "-c", code, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "locked\n"
        with pytest.raises(FileError, match="another process"), lock_results(tmp_path, None):
            pass
        process.send_signal(signal.SIGKILL)
        process.wait()
    with lock_results(tmp_path, None):
        pass


def test_a_new_folder_stays_if_it_has_results(tmp_path):
    for name in ("empty", "full"):
        with lock_results(tmp_path / name, None):
            if name == "full":
                (tmp_path / name / "results.csv").write_text("")
    assert os.listdir(tmp_path) == ["full"]


def test_a_file_that_cannot_be_written_is_refused(tmp_path):
    for name in ("x" * 300, "a\0b"):
        with pytest.raises(FileError, match="cannot be written"):
            check_writable(tmp_path / name)
    check_writable(tmp_path / "new.csv")
    check_writable(Path(os.devnull))
    assert list(tmp_path.iterdir()) == []
