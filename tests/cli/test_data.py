"""`lcorpp data`: made, fetched, described, drawn; and bad input refused as everywhere."""

from __future__ import annotations

import hashlib
import os
import threading
from pathlib import Path

import numpy as np
import pytest

from lcorpp.cli import console
from lcorpp.learning import read_data, read_recording, save_dataset, write_recording
from lcorpp.learning.data.repairs import REPAIRS
from lcorpp.values import Dataset
from tests.learning.data.server import serving
from tests.learning.data.texts import GOOD, HEADING, atc_rows, crowd, rows

ROOMS = Path(__file__).parents[2] / "tests/domains/rooms"
REAL = Path(__file__).parents[3] / "shared" / "data" / "authors"


def refused(ended, *words):
    assert ended.code == 2
    assert "Traceback" not in ended.err + ended.out
    for word in words:
        assert word in ended.err


def test_make_and_describe(lcorpp, tmp_path):
    file = tmp_path / "people.csv"
    ended = lcorpp("data", "make", "-o", file, "--tracks", 40, "--positives", 10, "--seed", 3)
    assert ended.code == 0
    assert f"wrote {file}: 40 tracks (10 interested, 30 not_interested), seed 3" in ended.out
    recording = read_recording(file)
    assert (len(recording), recording.labels.count("interested")) == (40, 10)
    assert recording.channels == ("x", "y", "velocity", "heading", "facing")
    assert read_data(file).trajectories.shape == (40, 5, 304)  # nobody is too short

    ended = lcorpp("data", "describe", file)
    assert ended.code == 0
    assert "40 tracks of 40 people; x, y, z, velocity, heading, facing" in ended.out
    assert "interested          10      10" in ended.out
    assert "identical tracks: none" in ended.out
    assert "end position" in ended.out

    again = tmp_path / "again.csv"
    assert lcorpp("data", "make", "-o", again, "--tracks", 40, "--positives", 10, "--seed", 3).code == 0
    assert again.read_bytes() == file.read_bytes()


def test_describe_the_last_seconds(lcorpp, tmp_path):
    file = tmp_path / "people.csv"
    lcorpp("data", "make", "--tracks", 40, "--positives", 20, "--seconds", 2, 20, "--out", file)
    whole, last = lcorpp("data", "describe", file), lcorpp("data", "describe", file, "--seconds", 2)
    assert whole.code == last.code == 0, last.err
    assert "2.0 [2.0, 2.0]" in last.out
    assert "2.0 [2.0, 2.0]" not in whole.out
    series = Dataset(
        np.random.default_rng(0).normal(size=(4, 1, 11)), ("a", "b") * 2, channels=("pitch",), interval=1
    )
    save_dataset(series.append([(np.ones((1, 3)), "a")], ["x"]), tmp_path / "series.npz")
    described = lcorpp("data", "describe", tmp_path / "series.npz").out
    assert "1 channels; 2 to 10 s every 1 s" in described
    assert "\n  duration        0." in described
    cut = lcorpp("data", "describe", tmp_path / "series.npz", "--seconds", 3).out
    assert "1 channels; 2 to 3 s every 1 s" in cut
    (tmp_path / "table.csv").write_text("a,label\n1,x\n2,y\n")
    refused(lcorpp("data", "describe", tmp_path / "table.csv", "--seconds", 3), "features have no duration")


def test_make_a_data_set(lcorpp, tmp_path):
    file = tmp_path / "people.npz"
    assert lcorpp("data", "make", "intention", "-o", file, "--tracks", 37, "--seconds", 10, 12).code == 0
    data = read_data(file)
    assert data.trajectories.shape == (37, 5, 304)
    assert data.labels.count("interested") == 1  # 63 of 2286


def test_plot(lcorpp, tmp_path):
    write_recording(crowd(6), tmp_path / "a.csv")
    ended = lcorpp("data", "plot", tmp_path / "a.csv", tmp_path / "a.png")
    assert (ended.code, ended.out) == (0, f"wrote {tmp_path / 'a.png'}\n")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_describe_prints_and_writes_the_repairs(lcorpp, tmp_path):
    file = tmp_path / "a.csv"
    file.write_text(GOOD + "c,0,1,1,in\n" + rows("d", "") + "b,1")
    refused(lcorpp("data", "describe", file), "a.csv:39:1: ", "repair 'cut' would leave out the last line")
    ended = lcorpp("data", "describe", file, "--repair", "all", "--report", tmp_path / "r.csv")
    assert ended.code == 0
    assert "cut: 1 rows in 1 places (leave out the last line of a file that ends in the middle" in ended.out
    assert "labels: 12 rows in 1 places" in ended.out
    assert "leak check: not possible: a leak check needs every class in two groups; in is in 1" in ended.out
    assert len((tmp_path / "r.csv").read_text().splitlines()) == 4
    refused(lcorpp("data", "describe", file, "--repair", "short"), "a.csv:39:1")


def test_names_with_markup_are_printed_as_they_are(lcorpp, tmp_path):
    """Neither rich's markup and emoji nor matplotlib's formulas have a meaning in a track id or a class."""
    file = tmp_path / "[b].csv"
    file.write_text(
        HEADING
        + "".join(rows(f"[/x]{i}", ("[bold]", ":smile:", "$x$y_^{")[i % 3], speed=1 + i) for i in range(6))
        + rows("[/y]", "", speed=8)
    )
    ended = lcorpp("data", "describe", file, "--repair", "labels")
    assert (ended.code, ended.err) == (0, "")
    for words in (f"{file}: 6 tracks", "[bold] ", ":smile: ", "$x$y_^{ ", "in track [/x]5", "(track [/y])"):
        assert words in ended.out
    ended = lcorpp("data", "plot", file, tmp_path / "[b].png", "--repair", "labels")
    assert ended.out == f"wrote {tmp_path / '[b].png'}\n"
    table = tmp_path / "table.csv"
    table.write_text("lean,[/gaze],label,group\n1,2,[/x],a\n3,2,[/x],a\n2,1,:smile:,[/b]\n")
    ended = lcorpp("data", "describe", table)
    assert ended.code == 0
    for words in ("[/x] ", ":smile: ", "[/gaze] "):
        assert words in ended.out


def test_progress_of_a_file_with_markup_in_its_name(monkeypatch):
    import io

    from rich.console import Console

    terminal = Console(file=io.StringIO(), force_terminal=True, width=80, markup=False)
    monkeypatch.setattr(console, "err", terminal, raising=False)
    with console.show_progress("reading [/x].csv") as advance:
        advance(1, 2)
    assert "reading [/x].csv" in terminal.file.getvalue()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_read_as_a_file_is(lcorpp, tmp_path):
    """All readers open their file several times; a pipe has its content once."""
    text = HEADING + "".join(rows(f"track {i}", "in" if i % 2 else "out", samples=60) for i in range(40))
    assert len(text) > 40_000  # more than the detection of the format reads
    (tmp_path / "file.csv").write_text(text)

    def pipe(content):
        (tmp_path / "pipe.csv").unlink(missing_ok=True)
        os.mkfifo(tmp_path / "pipe.csv")
        threading.Thread(target=(tmp_path / "pipe.csv").write_text, args=(content,), daemon=True).start()
        return tmp_path / "pipe.csv"

    ended, expected = (lcorpp("data", "describe", file) for file in (pipe(text), tmp_path / "file.csv"))
    assert (ended.code, ended.out) == (0, expected.out.replace("file.csv", "pipe.csv"))
    assert (
        len(read_recording(pipe(text)))
        == len(read_recording(pipe(text + "b,0,1,1,in\nb,1,2,2,in\n"))) - 1
        == 40
    )
    refused(lcorpp("data", "describe", pipe(text + "b,0,1,x,in\n")), "pipe.csv:2402:7: 'x' is not a number")
    table = "lean,label,group\n" + "".join(f"{i},{'ab'[i % 2]},{i}\n" for i in range(5000))
    assert "5000 cases of 5000 people" in lcorpp("data", "describe", pipe(table)).out


def test_describe_tracking_data_without_labels(lcorpp, tmp_path):
    (tmp_path / "atc.csv").write_text("".join(atc_rows(name, speed=0.5 + name / 10) for name in range(6)))
    ended = lcorpp("data", "describe", tmp_path / "atc.csv")
    assert "without a label       6       6        72" in ended.out
    assert "leak check: not possible: a leak check needs labels; track '0' has none" in ended.out
    (tmp_path / "labels.csv").write_text("".join(f"{name},{name % 2}\n" for name in range(6)))
    labelled = ("--label-file", tmp_path / "labels.csv", "--label", "1=in", "--label", "0=out")
    ended = lcorpp("data", "describe", tmp_path / "atc.csv", *labelled, "--robot", 1, 2, 3.14)
    assert "out         3       3" in ended.out
    assert "duration        0.500 [0.500, 0.500]  p 1.000  no leak" in ended.out


@pytest.mark.skipif(not REAL.is_dir(), reason="the authors' data is not here (shared/data/authors)")
def test_describe_finds_the_leaks_of_the_authors_tracks(lcorpp):
    ended = lcorpp("data", "describe", REAL, "--label", "1=interested", "--label", "0=not_interested")
    assert ended.code == 0
    assert "123 tracks of 109 people; x, y" in ended.out
    assert "people with several tracks: 13" in ended.out
    assert "end position    0.99" in ended.out
    assert ended.out.count("  LEAK") == 3


def test_fetch(lcorpp, tmp_path, monkeypatch):
    monkeypatch.setenv("NO_PROXY", "*")
    content = (GOOD + rows("c", "in", samples=2000)).encode()
    digest = hashlib.sha256(content).hexdigest()
    with serving(content) as web:
        ended = lcorpp("data", "fetch", web.url, "-o", tmp_path / "new", "--sha256", digest)
        assert (ended.code, ended.err.strip()) == (0, "")
        assert f"{len(content)} bytes, sha256 {digest}" in ended.out
        refused(
            lcorpp("data", "fetch", web.url, "-o", tmp_path, "--sha256", "0" * 64), "not the file expected"
        )
        web.status = 404
        refused(lcorpp("data", "fetch", web.url, "-o", tmp_path), "the server answered 404")
    assert len(read_recording(tmp_path / "new" / "people here.csv")) == 3


def test_wrong_arguments_of_data_end_in_one_message(lcorpp, tmp_path):
    good = tmp_path / "a.csv"
    good.write_text(GOOD)
    refused(
        lcorpp("data", "make", "-o", tmp_path / "a.txt"), "a.txt: not the name of a recording; expected one"
    )
    refused(lcorpp("data", "make", "-o", tmp_path / "no" / "a.csv"), "cannot be written")
    refused(lcorpp("data", "make", "-o", good, "--tracks", 5, "--positives", 6), "--positives 6 is more than")
    refused(lcorpp("data", "make", "-o", good, "--seconds", 5, 1), "seconds")
    refused(lcorpp("data", "make", ROOMS, "-o", good), "no people.py with recordings")
    refused(lcorpp("data", "make", "--seconds", 5, 3, "-o", good), "--seconds 5 3: expected 0 < A <= B")
    refused(lcorpp("data", "describe", tmp_path / "none.csv"), "none.csv: cannot be read: No such file")
    refused(lcorpp("data", "describe", good, "--repair", "magic"), "unknown repair 'magic'")
    refused(lcorpp("data", "describe", good, "--label", "in"), "expected WORD=CLASS")
    refused(lcorpp("data", "describe", good, "--label", "1=one"), "a.csv:2:", "unknown label 'in'")
    refused(lcorpp("data", "describe", good, "--gap", "-1"), "the longest silence is -1.0 s")
    refused(lcorpp("data", "describe", good, "--report", tmp_path / "no" / "r.csv"), "cannot be written")
    refused(lcorpp("data", "plot", good, tmp_path / "a.txt"), "not a figure file")
    refused(lcorpp("data", "fetch", "nothing"), "'nothing' is not the address of a file")
    refused(lcorpp("data", "fetch", "authors", "--sha256", "0" * 64), "--sha256 is for a URL")
    (tmp_path / "few.csv").write_text("track,time,x,y\nc,0,1,1\n")
    refused(lcorpp("data", "describe", tmp_path / "few.csv", "--repair", "all"), "no track remains")
    (tmp_path / "ids.csv").write_text("d,in\n")
    walks = tmp_path / "walks.csv"
    walks.write_text("track,time,x,y\nc,0,1,1\nc,1,2,1\n")
    refused(
        lcorpp("data", "describe", walks, "--label-file", tmp_path / "ids.csv"),
        "no track remains; 1 of 1 ids",
    )
    refused(lcorpp("data", "describe", good, "--seconds", "nan"), "the last nan seconds")
    refused(
        lcorpp("run", "--learner", "summaries", "--tracks", 20, "--seconds", "nan"), "the window is nan s"
    )
    assert good.read_text() == GOOD


def test_numbers_are_those_of_the_file(lcorpp, tmp_path):
    recording = crowd(10)
    write_recording(recording, tmp_path / "a.csv")
    ended = lcorpp("data", "describe", tmp_path / "a.csv")
    median = np.median([track.duration for track in recording.tracks if track.label == "in"])
    assert f"{median:.1f} [" in ended.out


def test_the_help_names_every_repair(lcorpp):
    ended = lcorpp("data", "describe", "--help")
    assert ended.code == 0
    for name in (*REPAIRS, "all"):
        assert f" {name}" in ended.out


def test_extreme_input_of_data_ends_in_one_message(lcorpp, tmp_path):
    """A huge number, a report over its own source, two meanings of a label, no address: one message each."""
    file = tmp_path / "people.csv"
    file.write_text("track,time,x,y,label\na,0,0,0,p\na,1,1,0,p\na,2,1e200,0,p\nb,0,0,0,q\nb,1,1,1,q\n")
    for arguments, words in (
        ((), "people.csv:4:5: track 'a': the x is 1e+200; expected a finite number up to 1e+09"),
        (("--report", str(file)), "is the file that is described; expected another file"),
        (("--label", "p=1", "--label", "p=2"), "--label p: has the classes '1' and '2'; expected one"),
    ):
        ended = lcorpp("data", "describe", str(file), *arguments)
        assert (ended.code, "Traceback" in ended.err) == (2, False)
        assert words in " ".join(ended.err.split())
    assert file.read_text().startswith("track,time")
    assert lcorpp("data", "fetch", "http://[::1").code == 2


def test_a_stored_data_set_in_millimetres_is_refused(lcorpp, tmp_path):
    walk = np.cumsum(np.full((4, 2, 50), 40.0), axis=2)  # 40 mm between two samples
    dataset = Dataset(walk, ("a", "b", "a", "b"))
    save_dataset(dataset, tmp_path / "walks.npz")
    ended = lcorpp("data", "describe", str(tmp_path / "walks.npz"))
    assert ended.code == 2
    assert "it looks like millimetres taken for metres" in " ".join(ended.err.split())
    read = read_data(tmp_path / "walks.npz", repair=("units",))
    assert np.allclose(read.trajectories, walk / 1000)


def test_columns_and_units_of_recordings(lcorpp, tmp_path):
    """All commands that read recordings have the same options."""
    file = tmp_path / "own.csv"
    file.write_text(
        "id,stamp,pos_x,y,label\n"
        + "".join(f"{t},{100 * i},{100 * i},{t * 1000},{'ab'[t % 2]}\n" for t in range(4) for i in range(20))
    )
    columns = ("--column", "track=id", "--column", "time=stamp", "--column", "x=pos_x")
    refused(
        lcorpp("data", "describe", file), "expected --column track=id --column time=stamp --column x=pos_x"
    )
    refused(lcorpp("data", "plot", file, tmp_path / "a.png", *columns), ": --time-unit ms gives")
    ended = lcorpp("data", "describe", file, *columns, "--time-unit", "ms", "--unit", "mm")
    assert ended.code == 0, ended.err
    assert "4 tracks of 4 people; x, y" in ended.out
    assert "1.00 [1.00, 1.00]" in ended.out
    assert "every 0.1 s" in ended.out
    refused(
        lcorpp("data", "describe", file, "--column", "id"), "--column 'id': expected COLUMN=NAME, for example"
    )
    refused(
        lcorpp("data", "describe", file, "--column", "x=a", "--column", "x=b"), "is 'a' and 'b'; expected one"
    )
    refused(
        lcorpp("data", "describe", file, *columns, "--fps", "25", "--time-unit", "s"), "expected one of them"
    )
    refused(
        lcorpp("run", "intention", "--trials", "1", "--unit", "mm"), "--unit, --time-unit, --fps: no recorded"
    )
    series = tmp_path / "toy.ts"
    series.write_text("@problemName Toy\n@univariate true\n@classLabel true a b\n@data\n1,2,3:a\n2,3,4:b\n")
    described = lcorpp("data", "describe", series, "--fps", "10")
    assert "2 cases of 2 people; 1 channels; 3 points every 0.1 s" in described.out, described.err
