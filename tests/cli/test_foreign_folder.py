"""Domain folders, models and logs of others: their code, their paths and their texts."""

import io
import json
import os
import re
import shutil
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from lcorpp.cli import console
from tests.cli.planner import refused

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"
CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]")
CODE = "open('{mark}', 'w').close()\n"


@pytest.fixture
def folder(tmp_path):
    """A copy of a domain whose code leaves a mark when it is run."""
    folder = shutil.copytree(ROOMS, tmp_path / "rooms")
    people = folder / "people.py"
    people.write_text(CODE.format(mark=tmp_path / "mark") + people.read_text())
    return folder


@pytest.fixture
def foreign(monkeypatch):
    """Give a folder and its files to another user."""

    def give(folder):
        if os.geteuid() != 0:
            monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
            return
        for path in (folder, *folder.rglob("*")):
            os.chown(path, 12345, -1)

    if not hasattr(os, "geteuid"):
        pytest.skip("this system has no owners")
    return give


def replace(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def test_own_code_is_run_after_a_note(lcorpp, folder):
    ended = lcorpp("check", folder)
    assert (ended.code, (folder.parent / "mark").exists()) == (0, True)
    assert ended.err == f"note: running Python code of {folder}\n"
    assert lcorpp("check", "museum").err == ""  # it comes with lcorpp


@pytest.mark.parametrize(
    "command",
    [
        ("check",),
        ("explain",),
        ("show",),
        ("data", "make"),
        ("play",),
    ],
)
def test_code_of_others_is_refused(lcorpp, folder, foreign, command):
    foreign(folder)
    refused(
        lcorpp(*command, folder),
        "people.py: this Python code belongs to the user",
        "--trust-code runs it",
    )
    assert not (folder.parent / "mark").exists()


def test_consent(lcorpp, folder, foreign):
    foreign(folder)
    ended = lcorpp("check", folder, "--trust-code")
    assert (ended.code, (folder.parent / "mark").exists()) == (0, True)
    assert f"note: running Python code of {folder}" in ended.err


def test_the_files_of_the_command_line_have_consent(lcorpp, folder, foreign):
    own = folder.parent / "own" / "own.py"
    own.parent.mkdir()
    own.write_text("def solve(pomdp, start, **options):\n    raise ValueError('it was run')\n")
    replace(folder / "domain.toml", 'people = "people.py"\n', "")
    foreign(own.parent)
    ended = lcorpp("run", folder, "--strategy", "P", "--trials", 20, f"--solver={own}:solve")
    assert "it was run" in ended.err
    assert "note" not in ended.err


def test_a_check_without_code(lcorpp, folder, foreign):
    foreign(folder)
    ended = lcorpp("check", folder, "--no-code")
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.splitlines()[0] == (
        f"{folder} (rooms, preset calm): observes badge, weekday; decides goal among lab, office, store;"
        " 4 states, 4 actions, 4 observations: OK; not run: people.py"
    )
    for key, new in (
        ("model", '"people.py:make"'),
        ("solver", '"people.py:solve"\nmodel = "guide.pomdp"'),
    ):
        text = (ROOMS / "domain.toml").read_text()
        (folder / "domain.toml").write_text(text.replace('model = "guide.pomdp"', f"{key} = {new}"))
        ended = lcorpp("check", folder, "--no-code")
        assert (ended.code, ended.err) == (0, "")
        assert ended.out.count("not run: people.py") == 2
    assert not (folder.parent / "mark").exists()
    (folder / "people.py").write_text("def f(:\n")
    refused(lcorpp("check", folder, "--no-code"), "people.py:1: SyntaxError")
    replace(folder / "badges.plog", "goal : rooms.", "goal : towns.")
    refused(lcorpp("check", folder, "--no-code"), "badges.plog:5:")


def test_a_log_names_no_code_of_others(lcorpp, folder, foreign, tmp_path):
    own = tmp_path / "own" / "own.py"
    own.parent.mkdir()
    own.write_text("def guess(robot):\n    return robot\n")
    log = tmp_path / "log.jsonl"
    command = ("run", "--classifier", "channel", "--trials", 2, "--jobs", 1, "--strategy", f"{own}:guess")
    assert lcorpp(*command, "--log", log).code == 0
    own.write_text(CODE.format(mark=tmp_path / "mark") + own.read_text())
    foreign(own.parent)
    ended = lcorpp("replay", log)
    assert ended.code == 2
    assert "own.py: this Python code belongs to the user" in ended.err
    assert not (tmp_path / "mark").exists()


OUTSIDE = [
    ('program = "badges.plog"', 'program = "../secret"', "[reasoning] program"),
    ('program = "badges.plog"', 'program = "{secret}"', "[reasoning] program"),
    ('program = "badges.plog"', 'program = "link"', "[reasoning] program"),
    ('model = "guide.pomdp"', 'model = "below/../../secret"', "[planning] model"),
    ('model = "guide.pomdp"', 'model = "../secret.py:f"', "[planning] model"),
    ('model = "guide.pomdp"', 'model = "guide.pomdp"\nsolver = "../secret.py:f"', "[planning] solver"),
    ('model = "guide.pomdp"', 'model = "guide.pomdp"\nrecogniser = "../secret"', "[planning] recogniser"),
    ("tracks = 60", 'data = "../secret"', "[learning] data"),
    ("tracks = 60", 'classifier = "../secret.py:f"', "[learning] classifier"),
    ('people = "people.py"', 'people = "../secret.py"', "[simulation] people"),
    ('people = "people.py"', 'world = "../secret.py:f"', "[simulation] world"),
    ('people = "people.py"', 'truth = "../secret"', "[simulation] truth"),
]


@pytest.mark.parametrize(("old", "new", "key"), OUTSIDE)
def test_a_domain_names_files_in_its_folder(lcorpp, folder, old, new, key):
    secret = folder.parent / "secret"
    for file in (secret, secret.with_suffix(".py")):
        file.write_text("password = 1234\n")
    (folder / "link").symlink_to(secret)
    replace(folder / "domain.toml", old, new.format(secret=secret))
    for option in ((), ("--no-code",)):
        ended = lcorpp("check", folder, *option)
        refused(ended, f"{key}: ", "is outside of the domain folder; expected a file in it")
        assert "1234" not in ended.err


def test_the_description_of_a_domain_is_no_link(lcorpp, folder):
    secret = folder.parent / "secret"
    secret.write_text("password is 1234\n")
    (folder / "domain.toml").unlink()
    (folder / "domain.toml").symlink_to(secret)
    for command in ("check", "run"):
        ended = lcorpp(command, folder)
        refused(ended, "domain.toml: is a link out of its folder")
        assert "1234" not in ended.err


def test_texts_of_others_cannot_control_the_terminal(lcorpp, folder, tmp_path, silent_afterwards):
    replace(folder / "domain.toml", '"rooms"', r'"ro\u001b[2Joms"')
    replace(folder / "domain.toml", '"Which room', r'"\u009b2J\u202eWhich\rroom')
    replace(folder / "guide.pomdp", "point", "po\x1b[2Jint")
    tracks = tmp_path / "tracks.csv"
    tracks.write_text(
        "track,time,x,y,label\n"
        + "".join(f"{k},{t},{t},{k},\x1b[2J{'ab'[k % 2]}\n" for k in range(8) for t in range(20))
    )
    model = tmp_path / "a\x1b[2J.pomdp"
    model.write_bytes((folder / "guide.pomdp").read_bytes())
    runs = [
        lcorpp("check", folder),
        lcorpp("run", folder, "--exact", "--strategy", "P", "--no-cache"),
        lcorpp("-v", "explain", folder, "--strategy", "P", "--seed", 1),
        lcorpp("show", model),
        lcorpp("show", tmp_path / "missing\x1b[2J.pomdp"),
        lcorpp("data", "describe", tracks),
        lcorpp("fly\x1b[2J"),
        lcorpp("check", "--\x1b[2J"),
    ]
    for ended in runs:
        written = ended.out + ended.err
        assert not CONTROLS.search(written)
        assert r"\x1b[2J" in written, written


def test_the_texts_of_a_log_cannot_control_the_terminal(lcorpp, tmp_path):
    log = tmp_path / "log.jsonl"
    options = ("--classifier", "channel", "--trials", 3, "--jobs", 1, "--strategy", "LCORPP")
    assert lcorpp("run", *options, "--log", log).code == 0
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    lines[0]["steps"] = [{"action": "\x1b[2J", "observation": "\x9b2J", "belief": lines[0]["prior"]}]
    lines[1]["report"] = "\x1b[2J"
    lines[2]["facts"] = {"\x1b[2J": "\x1b[2J"}
    log.write_text("".join(f"{json.dumps(line, ensure_ascii=False)}\n" for line in lines))
    for command in (("replay",), ("watch",)):
        ended = lcorpp(*command, log)
        written = ended.out + ended.err
        assert not CONTROLS.search(written)
        assert "Traceback" not in written
        assert command[0] != "replay" or r"\x1b[2J" in written


@pytest.mark.parametrize(
    "arguments", [("ask", "a.plog", "c"), ("ask", "a.plog", "c", "--json"), ("check", "é.pomdp")]
)
def test_output_in_ascii(lcorpp, tmp_path, monkeypatch, arguments):
    from lcorpp.cli.main import main

    (tmp_path / "a.plog").write_text("s = {x, y}. c : s. random(c). pr(c=x) = 0.3.")
    (tmp_path / "é.pomdp").write_bytes((ROOMS / "guide.pomdp").read_bytes())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["lcorpp", *arguments])
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, encoding="ascii", write_through=True))
    monkeypatch.delitem(vars(console), "out", raising=False)
    with suppress(SystemExit):
        main()
    text = written.getvalue().decode("ascii")
    assert {"c": "x  0.300000  #########\n", "--json": '"query"', "é.pomdp": r"\xe9.pomdp: 4 states"}[
        arguments[-1]
    ] in text
    vars(console).pop("out", None)


@pytest.mark.parametrize(
    ("failure", "words"),
    [
        (MemoryError(), "lcorpp: not enough memory\n"),
        (RecursionError(), "lcorpp: an input is nested too deeply\n"),
    ],
)
def test_no_memory_and_no_stack(lcorpp, monkeypatch, failure, words):
    def fail(*_, **__):
        raise failure

    monkeypatch.setattr("lcorpp.domains.load_domain", fail)
    ended = lcorpp("check", ROOMS)
    assert (ended.code, ended.out, ended.err) == (2, "", words)
