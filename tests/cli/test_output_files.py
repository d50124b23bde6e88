"""Output files and folders: what is refused before the work, and one process at a time for a folder."""

import os
import signal
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

from lcorpp.cli.output_files import check_writable, lock_results
from lcorpp.errors import FileError
from tests.cli.test_bad_input import refused

fcntl = pytest.importorskip("fcntl")

PLANNING = Path(str(files("lcorpp.domains") / "intention" / "interaction.pomdp"))

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
from importlib.resources import files
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


def test_results_have_no_figures_without_matplotlib(tmp_path):
    """The extra `plots` is named before the work; numbers are written as ever.

    In a process of its own: modules that are loaded no longer need matplotlib.
    """
    (tmp_path / "noise.toml").write_text(
        'domain = "intention"\nstrategies = ["LCORPP"]\n[axes]\nnoise = [0.1]\n'
    )
    fast = "intention --learner summaries --tracks 40 --jobs 1"
    run, learn = f"run {fast} --trials 100 --out run", f"learn {fast} --max-batches 1 --out learn"
    code = f"""
import sys
from lcorpp.cli.app import app
sys.modules["matplotlib"] = None
for command in ("{run}", "{learn}", "sweep noise.toml --out sweep"):
    app(command.split(), standalone_mode=False)
"""
    ended = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.count("note: no figures are drawn; they need the extra lcorpp[plots]") == 3
    written = {path.suffix for path in tmp_path.glob("*/*")}
    assert {".csv", ".json", ".npz"} < written
    assert not {".png", ".pdf", ".svg"} & written


def test_a_figure_without_matplotlib_is_refused_before_the_work(lcorpp, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    commands = [
        ("run", "intention", "--out", tmp_path / "run", "--format", "png"),
        ("figures", "trial", "--out", tmp_path / "figures"),
        ("solve", PLANNING, "-o", tmp_path / "tiger.alpha", "--plot", tmp_path / "bounds.svg"),
        ("data", "plot", "tracks.csv", tmp_path / "tracks.png"),
        ("audit", "decisions.jsonl", "--figure", tmp_path / "audit.png"),
    ]
    for command in commands:
        refused(
            lcorpp(*command), "figures need matplotlib, which is not installed: pip install 'lcorpp[plots]'"
        )
    assert list(tmp_path.iterdir()) == []


def test_a_download_without_pooch_is_refused(lcorpp, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    ended = lcorpp("data", "fetch", "http://127.0.0.1:9/tracks.csv", "-o", tmp_path)
    refused(ended, "a download needs pooch: pip install 'lcorpp[fetch]'")
