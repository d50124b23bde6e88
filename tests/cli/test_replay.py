"""`lcorpp run, explain, learn --log`, `lcorpp replay`, and the messages of `lcorpp -v`."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.cli.planner import refused

INTENTION = Path(__file__).parents[2] / "src/lcorpp/domains/intention"
FACTS = ("--fact", "time=afternoon", "--fact", "location=classroom")


@pytest.fixture
def log(lcorpp, tmp_path):
    """40 decisions."""
    return write_log(lcorpp, tmp_path / "log.jsonl", 5)


def write_log(lcorpp, file, people):
    """Write the decisions of eight strategies."""
    assert lcorpp("run", "--classifier", "channel", "--trials", people, "--jobs", 1, "--log", file).code == 0
    return file


def test_the_decisions_of_all_strategies_have_no_differences(lcorpp, tmp_path):
    log = write_log(lcorpp, tmp_path / "log.jsonl", 12)
    ended = lcorpp("replay", log)
    assert ended.code == 0
    lines = ended.out.splitlines()
    assert len(lines) == 97
    assert re.fullmatch(r"1  L: time=\w+, location=\w+, classifier=\w+: report_(\w+); \1", lines[0])
    assert lines[-1] == "96 decisions, 0 differences"
    assert lcorpp("replay", log, "--quiet").out == f"{lines[-1]}\n"


def test_changed_knowledge_is_named_before_the_differences(lcorpp, log, tmp_path):
    folder = shutil.copytree(INTENTION, tmp_path / "copy")
    knowledge = folder / "knowledge.plog"
    assert lcorpp("replay", log, "-q", "--domain", folder).code == 0
    line = next(line for line in knowledge.read_text().splitlines() if "pr(intention=interested" in line)
    changed = line[: line.rindex("=") + 1] + " 0.5."
    knowledge.write_text(knowledge.read_text().replace(line, changed))
    ended = lcorpp("replay", log, "--domain", folder)
    assert ended.code == 1
    assert ended.out.startswith(f"changed since the log: knowledge: {knowledge}\n1  L: ")
    assert "\n    marginal of interested: " in ended.out
    assert re.search(r"\n40 decisions, \d+ differences in \d+ of them\n$", ended.out)


def test_damaged_lines_are_named_and_the_others_checked(lcorpp, log):
    text = log.read_bytes().splitlines(keepends=True)
    other = json.loads(text[4])
    other["parts"]["domain"]["folder"] = "/nowhere"
    lost = json.dumps(other).encode() + b"\n"
    log.write_bytes(b"".join([*text[:4], lost, lost, b"{}\n", *text[4:8]]) + text[8][:200])
    ended = lcorpp("replay", "-q", log)
    assert ended.code == 2
    assert ended.out == "8 decisions, 0 differences\n"
    first, second, third = ended.err.splitlines()
    assert first.startswith(f"lcorpp: {log}:5: cannot be replayed: /nowhere: no folder with a domain.toml")
    assert first.endswith(" (2 lines)")
    assert second.startswith(
        f"{log}:7: not a decision: it is damaged or of another kind; expected an object with"
    )
    assert third.startswith(f"{log}:12: not a decision: it is damaged, not JSON: ")
    assert third.endswith("; the line is cut")


def test_explain_and_learn_write_the_same_format(lcorpp, tmp_path):
    log = tmp_path / "log"
    assert lcorpp("explain", *FACTS, "--log", log).code == 0
    given = ("--likelihood", "interested=0.3", "--answers", "pos,pos,pos,pos")
    assert lcorpp("explain", *FACTS, *given, "--log", log).code == 0
    options = ("--learner", "summaries", "--tracks", 40, "--batch-size", 20, "--max-batches", 1, "--jobs", 1)
    assert lcorpp("learn", *options, "--log", log).code == 0
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert len(lines) == 22
    assert lines[0]["parts"]["classifiers"]["motion"]["source"] == "channel"
    assert set(lines[0]["simulated"]) == {"truth", "cost", "return"}
    assert lines[1]["labels"] == {"motion": {"interested": 0.3, "not_interested": 1.0}}
    assert lines[1]["parts"]["classifiers"]["motion"]["source"] == "given"
    assert set(lines[1]["simulated"]) == {"truth"}  # prepared answers have no cost
    assert lines[2]["parts"]["classifiers"]["motion"]["source"] == "summaries"
    assert [line["simulated"]["trial"] for line in lines[2:]] == list(range(20))
    assert lcorpp("replay", "-q", log).out == "22 decisions, 0 differences\n"


def test_the_policy_s_file_and_options_are_used_again(lcorpp, tmp_path):
    policy, log = tmp_path / "own.policy", tmp_path / "log"
    assert lcorpp("solve", INTENTION / "interaction.pomdp", "-o", policy, "--precision", 1).code == 0
    rows = ("--strategy", "L+P", "--strategy", "LCORPP")
    rest = ("--classifier", "channel", "--trials", 5, "--jobs", 1, *rows, "--log", log)
    assert lcorpp("run", "--policy", policy, *rest).code == 0
    assert lcorpp("run", "--solver", "qmdp", *rest).code == 0
    assert lcorpp("replay", "-q", log).out == "20 decisions, 0 differences\n"
    policy.unlink()
    ended = lcorpp("replay", "-q", log)
    assert (ended.code, ended.out) == (2, "10 decisions, 0 differences\n")
    assert f"{log}:1: cannot be replayed: {policy}: cannot be read: No such file" in ended.err


def test_a_log_that_cannot_be_written_is_refused_before_the_work(lcorpp, tmp_path):
    log = tmp_path / "missing" / "log"
    for command in ("run", "explain", "learn"):
        refused(lcorpp(command, "--log", log), f"{log}: cannot be written: No such file or directory")
    refused(
        lcorpp("run", "--classifier", "channel", "--exact", "--log", tmp_path / "log"),
        "--log: no single decisions are made with --exact",
    )
    refused(lcorpp("replay", log), f"{log}: cannot be read: No such file or directory")


def start(*arguments: object) -> subprocess.Popen[str]:
    """Start a command in another process."""
    return subprocess.Popen(
        [sys.executable, "-c", "from lcorpp.cli.main import main; main()", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )


@pytest.mark.slow
def test_an_interrupted_run_keeps_whole_lines(tmp_path):
    log = tmp_path / "log"
    rows = ("--strategy", "L", "--strategy", "LCORPP")
    child = start("run", "--classifier", "channel", "--trials", 100_000, "--jobs", 2, *rows, "--log", log)
    while not (log.exists() and log.stat().st_size) and child.poll() is None:
        time.sleep(0.05)
    child.send_signal(signal.SIGINT)
    _, err = child.communicate()
    kept = re.search(r"interrupted: (\d+) of 100000 trials are kept", err)
    assert kept, err
    lines = log.read_text().splitlines()
    assert len(lines) == 2 * int(kept[1])
    assert json.loads(lines[-1])["simulated"]["trial"] >= int(kept[1]) - 1


def test_messages_are_shown_on_request(lcorpp, silent_afterwards):
    command = ("explain", *FACTS, "--label", "zero", "--answers", "pos,pos,pos,pos")
    assert lcorpp(*command).err == ""
    ended = lcorpp("-v", *command)
    decided = (
        "lcorpp.decision: given time=afternoon, location=classroom, classifier=zero: interested; move_forward"
    )
    (line,) = ended.err.splitlines()
    assert line.startswith(decided)
    assert line.endswith(", report_interested")
    ended = lcorpp("-vv", *command)
    *steps, line = ended.err.splitlines()
    assert line.startswith(decided)
    assert steps[0].startswith("lcorpp.decision: evidence {'time': 'afternoon'")
    assert steps[1].startswith("lcorpp.decision: move_forward: pos, belief [")
    assert steps[-1].startswith("lcorpp.decision: report_interested: a report, belief [")


@pytest.mark.slow
def test_messages_of_other_processes_are_shown():
    options = ("--classifier", "channel", "--strategy", "LCORPP", "--trials", 101, "--jobs", 2)
    child = start("--verbose", "run", *options)
    _, err = child.communicate()
    assert child.returncode == 0
    assert len(re.findall(r"^lcorpp\.decision: given ", err, re.MULTILINE)) == 101
