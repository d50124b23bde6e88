"""`lcorpp watch`: alarms about a log."""

import json
import shutil
from pathlib import Path

import pytest

from tests.cli.planner import refused

INTENTION = Path(__file__).parents[2] / "src/lcorpp/domains/intention"


@pytest.fixture
def run(lcorpp, tmp_path):
    """Return the log of decisions about some people."""

    def run(people, *options):
        log = tmp_path / "log.jsonl"
        rest = ("--classifier", "channel", "--jobs", 1, "--trials", people, "--log", log)
        assert lcorpp("run", *rest, *(options or ("--strategy", "LCORPP"))).code == 0
        return log

    return run


def test_few_people_are_no_alarm(lcorpp, run, few_faults, tmp_path):
    log, figure = run(20), tmp_path / "evidence.png"
    ended = lcorpp("watch", log, "--plot", figure)
    assert (ended.code, ended.out, ended.err) == (0, "20 decisions of LCORPP, no alarm\n", "")
    assert figure.stat().st_size > 1000


@pytest.mark.parametrize("options", [(), pytest.param(("--given",), marks=pytest.mark.slow)])
def test_swapped_knowledge_is_named(lcorpp, run, options):
    """The people answer as noisily as the domain states, which is more noise than the model states."""
    log = run(100, "--preset", "low", "--strategy", "LCORPP")
    ended = lcorpp("watch", log, *options)
    assert ended.code == 1
    first = next(line for line in ended.out.splitlines() if "probably wrong" in line)
    assert "probably wrong: the knowledge about intention (" in first
    assert "the answers are noisier than the model states (degree 0." in ended.out
    assert ended.out.endswith("100 decisions of LCORPP, 2 alarms\n")


def test_one_strategy_of_several_is_chosen(lcorpp, run, few_faults):
    log = run(20, "--strategy", "LCORPP", "--strategy", "P")
    refused(
        lcorpp("watch", log), f"{log}:2: a decision of LCORPP after those of P, perhaps about the same people"
    )
    ended = lcorpp("watch", log, "--strategy", "lcorpp")
    assert (ended.code, ended.out) == (0, "20 decisions of LCORPP, no alarm\n")
    refused(
        lcorpp("watch", log, "--strategy", "R"), f"{log}: no decision of the strategy 'R'; expected one of"
    )


def test_changed_files_and_damaged_lines_are_named(lcorpp, run, few_faults, tmp_path):
    log, folder = run(10), shutil.copytree(INTENTION, tmp_path / "copy")
    knowledge = folder / "knowledge.plog"
    knowledge.write_text(knowledge.read_text().replace("0.76", "0.75"))
    ended = lcorpp("watch", log, "--domain", folder)
    assert ended.out.startswith(f"changed since the log: knowledge: {knowledge}\n10 decisions")
    text = log.read_text().splitlines(keepends=True)
    odd = json.loads(text[3])
    odd["steps"][0]["action"] = "sing"
    log.write_text("".join([*text[:2], "{}\n", json.dumps(odd), "\n"]))
    ended = lcorpp("watch", log)
    assert (ended.code, ended.out) == (2, "2 decisions of LCORPP, no alarm\n")
    first, second = ended.err.splitlines()
    assert first.startswith(f"lcorpp: {log}:3: not a decision: it is damaged or of another kind; expected")
    assert second.startswith(f"{log}:4: cannot be watched: unknown action 'sing'; expected one of")


def test_a_log_is_followed_until_an_interrupt(lcorpp, run, few_faults, monkeypatch):
    log = run(12)
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines[:4]) + lines[4][:50])
    waiting = iter([lines[4][50:], b"{}\n", b"".join(lines[5:])])

    def append(seconds):
        part = next(waiting, None)
        if part is None:
            raise KeyboardInterrupt
        with open(log, "ab") as file:
            file.write(part)

    monkeypatch.setattr("time.sleep", append)
    ended = lcorpp("watch", log, "--follow")
    assert (ended.code, ended.out) == (0, "12 decisions of LCORPP, no alarm\n")
    assert f"{log}:6: not a decision: it is damaged or of another kind; expected" in ended.err


def test_bad_input_is_refused(lcorpp, run, tmp_path):
    log = run(5)
    refused(lcorpp("watch", tmp_path / "none"), f"{tmp_path / 'none'}: cannot be read: No such file")
    refused(lcorpp("watch", log, "--rate", 1), "the rate of false alarms is 1.0; expected a number between")
    refused(lcorpp("watch", log, "--plot", tmp_path / "x.doc"), f"{tmp_path / 'x.doc'}: not a figure file")
    (empty := tmp_path / "empty").touch()
    for command in ("watch", "replay"):
        refused(lcorpp(command, empty), f"{empty}: has no decisions; expected a log that was written with")
    other = tmp_path / "other"
    other.write_text("{}\n")
    refused(
        lcorpp("watch", other),
        f"{other}:1: not a decision: it is damaged or of another kind; expected an object with",
    )
