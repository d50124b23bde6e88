"""The program as a whole: help, version, interrupts, and checks of outputs before long work."""

import os
import re
import shutil
import subprocess
import sys
import types
from dataclasses import replace

import numpy as np
import pytest
import typer.main

from lcorpp.learning import Validation, build_report
from lcorpp.values import ConfusionMatrix, Interval
from tests.cli.test_bad_input import INTENTION, ROOMS, refused
from tests.planning.models import shared_model

COMMANDS = ("run", "explain", "ask", "solve", "simulate", "show", "learn", "check", "data")
SMALL = ("--tracks", 40, "--jobs", 1, "--learner", "summaries")


def test_help_fits_into_80_columns(lcorpp, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for option in ("-h", "--help"):
        ended = lcorpp(option)
        assert ended.code == 0
        assert "..." not in ended.out.replace("COMMAND [ARGS]...", "")
        assert max(map(len, ended.out.splitlines())) <= 80
        assert all(f"  {name} " in ended.out for name in COMMANDS)


@pytest.mark.parametrize("command", [*COMMANDS, "data make", "data plot"])
def test_every_command_has_short_help(lcorpp, command):
    ended = lcorpp(*command.split(), "-h")
    assert ended.code == 0
    assert "Show this message and exit." in ended.out


def test_the_shell_completes_commands_and_options(lcorpp, monkeypatch):
    monkeypatch.setenv(
        "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1"
    )  # not that of whoever runs the tests
    monkeypatch.setattr(
        typer.main, "get_command", typer.main.get_command.__wrapped__
    )  # it reads that variable
    assert "complete -o default -F _lcorpp_completion lcorpp" in lcorpp("--show-completion", "bash").out
    monkeypatch.setenv("_LCORPP_COMPLETE", "complete_bash")
    for words, index, expected in (
        ("lcorpp s", "1", ["solve", "simulate", "show", "sweep"]),
        ("lcorpp run --str", "2", ["--strategy"]),
    ):
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", index)
        assert lcorpp().out.split() == expected


def test_run_states_its_default_number_of_trials(lcorpp):
    out = " ".join(lcorpp("run", "-h").out.split())
    assert "Number of simulated people; by default 5000, 200 for a simulated model. [1<=x<=10000000]" in out


def test_version(lcorpp):
    from lcorpp import __version__

    assert lcorpp("--version").out == f"lcorpp {__version__}\n"


def test_learn_states_its_default_number_of_tracks_once(lcorpp):
    out = " ".join(lcorpp("learn", "-h").out.split())
    assert "Simulated training tracks before the first batch" in out
    assert out.count("[default: (100); 0<=x<=1000000]") == 1
    assert "the domain's number" not in out


def test_an_unknown_option_is_one_message(lcorpp):
    refused(lcorpp("run", "--speed", 3), "No such option: --speed")
    refused(lcorpp("fly"), "No such command 'fly'")


def interrupt(*_, **__):
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("function", "command", "words"),
    [
        (
            "assembly.classifier_training.train_and_validate",
            ("run", *SMALL),
            "training and cross-validating summaries",
        ),
        (
            "experiments.comparison.evaluate_exactly",
            ("run", "--exact", "--classifier", "channel"),
            "enumerating people and answers",
        ),
        ("experiments.comparison.run_trials", ("run", "--classifier", "channel"), "simulating trials"),
    ],
)
def test_ctrl_c_names_the_step(lcorpp, monkeypatch, function, command, words):
    monkeypatch.setattr(f"lcorpp.{function}", interrupt)
    ended = lcorpp(*command)
    assert ended.code == 130
    assert f"lcorpp: interrupted while {words}; nothing is kept" in ended.err


def test_ctrl_c_in_the_first_training_of_learn(lcorpp, monkeypatch, tmp_path):
    monkeypatch.setattr("lcorpp.runs.training.train_and_validate", interrupt)
    ended = lcorpp("learn", ROOMS, *SMALL)
    assert ended.code == 130
    assert ended.err.endswith("\ninterrupted: no batch is complete\n")
    ended = lcorpp("learn", ROOMS, *SMALL, "--store", tmp_path / "s.tracks")
    assert "no batch is complete; the decisions so far are kept in" in ended.err


def test_ctrl_c_elsewhere_is_not_silent(lcorpp, monkeypatch):
    monkeypatch.setattr("lcorpp.domains.load_domain", interrupt)
    ended = lcorpp("check", INTENTION)
    assert (ended.code, ended.err) == (130, "lcorpp: interrupted\n")


def test_ctrl_c_while_the_commands_load(lcorpp, monkeypatch):
    class Interrupted(types.ModuleType):
        def __getattr__(self, name):
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "lcorpp.cli.app", Interrupted("lcorpp.cli.app"))
    ended = lcorpp("--version")
    assert (ended.code, ended.err) == (130, "lcorpp: interrupted\n")


def test_outputs_are_checked_before_the_work(lcorpp, monkeypatch, tmp_path):
    def fail(*_, **__):
        raise AssertionError("work before the check")

    for name in (
        "assembly.classifier_training.train_and_validate",
        "assembly.robot.solve_domain",
        "runs.training.train_and_validate",
    ):
        monkeypatch.setattr(f"lcorpp.{name}", fail)
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        refused(lcorpp("run", *SMALL, "--out", out), "is a file")
        refused(lcorpp("learn", *SMALL, "--out", out), "is a file")
    refused(lcorpp("data", "make", "-o", tmp_path / "no" / "a.csv"), "cannot be written")


def test_the_options_of_learn_are_checked_before_the_work(lcorpp, monkeypatch, tmp_path):
    monkeypatch.setattr("lcorpp.assembly.solving.solve_cached", None)
    (tmp_path / "file").write_text("")
    refused(lcorpp("learn", *SMALL, "--store", tmp_path / "file" / "x.tracks"), "file is a file")
    refused(lcorpp("learn", *SMALL, "--store", tmp_path / "no" / "x.tracks"), "there is no folder")
    refused(lcorpp("learn", *SMALL, "--epsilon", "nan"), "--epsilon nan: expected a number from 0")
    expected = "expected a number from 0, below 1"
    refused(lcorpp("learn", *SMALL, "--confidence", "1"), f"--confidence 1: {expected}")
    refused(lcorpp("learn", *SMALL, "--confidence", "nan"), f"--confidence nan: {expected}")
    refused(lcorpp("learn", "--device", "x"), "--device x: expected one of cpu, cuda")
    refused(lcorpp("learn", "--learner", "nosuch"), "unknown learner 'nosuch'")


def test_learn_of_a_domain_without_trajectories_asks_for_data(lcorpp, tmp_path):
    shutil.copytree(INTENTION, tmp_path / "mine")
    file = tmp_path / "mine" / "domain.toml"
    lines = file.read_text().splitlines()
    file.write_text("\n".join(line for line in lines if not line.startswith("people =")))
    refused(lcorpp("learn", tmp_path / "mine"), "give --data, or --classifier channel to `lcorpp run`")


def test_a_message_has_the_name_of_the_recording_once(lcorpp, tmp_path):
    file = tmp_path / "few.csv"
    file.write_text("time,track,x,y,label\n0,1,0,0,interested\n0.1,1,0,1,interested\n")
    ended = lcorpp("learn", "--data", file)
    refused(ended, f"{file}: every track is shorter than 1 s")
    assert ended.err.count("few.csv") == 1


def test_options_without_effect_are_rejected(lcorpp):
    exact = ("run", "--exact", "--classifier", "channel")
    refused(lcorpp(*exact, "--trials", 10), "--trials: nothing is sampled with --exact")
    for command in ("run", "learn"):
        refused(lcorpp(command, "--format", "svg"), "without --out none is drawn")
        refused(lcorpp(command, "--out", ""), "'--out'", "expected the name of a folder")


@pytest.mark.parametrize("number", [9_999_999_999, 99_999_999_999_999_999_999])
def test_numbers_have_an_upper_limit(lcorpp, tiger, number):
    for option in ("--trials", "--steps"):
        refused(lcorpp("simulate", tiger, tiger, option, number), option, "is not in the range")
    for option in ("--trials", "--tracks"):
        refused(lcorpp("run", option, number), option, "is not in the range")
    refused(lcorpp("learn", "--batch-size", number), "--batch-size", "is not in the range")
    refused(lcorpp("data", "make", "--tracks", number), "--tracks", "is not in the range")


def test_a_classifier_that_cannot_be_saved_is_reported_before_the_training(lcorpp, monkeypatch, tmp_path):
    monkeypatch.setattr("lcorpp.assembly.classifier_training.train_and_validate", interrupt)
    file = tmp_path / "mine.py"
    file.write_text(
        "from sklearn.base import BaseEstimator, ClassifierMixin\n"
        "class Mine(ClassifierMixin, BaseEstimator):\n"
        "    def fit(self, X, y):\n        return self\n"
        "    def predict_proba(self, X):\n        return None\n"
        "def mine():\n    return Mine()\n"
    )
    ended = lcorpp("run", "--tracks", 40, "--learner", f"{file}:mine", "--out", tmp_path / "out")
    assert ended.code == 130
    assert "note: the classifier will not be saved: " in ended.out
    assert not (tmp_path / "out").exists()


def test_a_search_that_has_not_converged_is_reported(lcorpp, monkeypatch):
    from lcorpp.assembly import solving
    from lcorpp.planning import solve

    def stop_early(pomdp, beliefs, options, **_):
        solution = solve(pomdp, beliefs)
        return replace(solution, reason="time limit", upper=solution.lower + 0.25, solver=options.name)

    monkeypatch.setattr(solving, "solve_cached", stop_early)
    for command in (("run", "--exact", "--strategy", "P"), ("explain", "--label", "zero")):
        ended = lcorpp(*command, "--preset", "authors")
        assert ended.code == 0
        text = "note: SARSOP ended (time limit): no policy earns more than 0.25 above this one from any start"
        assert f"{text}, 0.5% of what planning gains" in ended.out
        assert "converged" not in ended.err


def test_the_paper_s_trial(lcorpp):
    """PAPER.md, section 2: prior [.22, .78]; after pos, pos, pos the robot reports interested."""
    facts = ("--fact", "time=afternoon", "--fact", "location=classroom", "--label", "zero")
    ended = lcorpp("explain", *facts, "--truth", "interested", "--answers", "pos,pos,pos")
    assert ended.code == 0
    actions = [line for line in ended.out.splitlines() if "observes" in line]
    assert [line.split()[1] for line in actions] == ["move_forward", "move_forward", "greet"]
    for words in ("0.220250", "0.779750", "0.717686", "0.958123", "0.989191", "7  report_interested"):
        assert words in ended.out
    *_, reported, gap = ended.out.splitlines()
    assert reported == "intention = interested (correct)"
    assert gap.startswith("gap at this prior at most ")
    refused(lcorpp("explain", *facts, "--answers", "pos"), "--answers has 1 answers", "move_forward")
    refused(lcorpp("explain", "--answers", "maybe"), "expected one of pos, neg, none")
    refused(lcorpp("explain", "--truth", "bored"), "expected one of interested, not_interested")
    refused(lcorpp("explain", "--truth", "interested", "--interactive"), "--interactive has none")


def test_no_header_is_cut_at_80_columns(monkeypatch, capsys):
    """Numbers of any width wrap instead, and so do the names of classes."""
    from rich.console import Console

    from lcorpp.cli import console, robot_output
    from lcorpp.scoring.metrics import METRICS, Scores

    monkeypatch.setattr(console, "out", Console(width=80, highlight=False), raising=False)
    wide = [Interval(-12345.678, -23456.789, 98765.432)] * len(METRICS)
    robot_output.print_scores([Scores("LCORPP", np.zeros((2, 3)), *wide, 1.0)], None, 5)
    out = capsys.readouterr().out
    header = out.splitlines()[2].split()
    assert header == ["strategy", "F1", "precision", "recall", "accuracy", "cost", "return"]
    assert "…" not in out
    classes = ("interested_in_a_long_conversation", "prefers_not_to_be_disturbed_now", "third", "wish")
    labels, folds = classes * 10, tuple(i % 5 for i in range(40))
    confusion, p = ConfusionMatrix(classes, 10 * np.eye(4)), np.tile(0.7 * np.eye(4) + 0.075, (10, 1))
    groups = tuple(map(str, range(40)))
    validation = Validation(confusion, labels, p, None, folds, labels, groups)
    console.out.print(robot_output._make_report_table(build_report(validation)))
    assert "…" not in capsys.readouterr().out


def test_the_table_fits_into_80_columns(lcorpp, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = lcorpp("run", "--classifier", "channel", "--trials", 40, "--jobs", 1).out.splitlines()
    (head,) = (line.split() for line in lines if line.split()[:1] == ["strategy"])
    assert head == ["strategy", "F1", "precision", "recall", "accuracy", "cost", "return"]
    after = next(i for i, line in enumerate(lines) if line.split()[:1] == ["LCORPP"]) + 1
    assert lines[after].count("[") == lines[after].count("]") == 6
    assert len(lines[after]) <= 80


def test_tables_of_several_variables_and_senses_fit_into_80_columns(lcorpp, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    rows = [f"--strategy={name}" for name in ("P", "R+P")]
    small = lcorpp(
        "run", "shopping", "--preset", "small", "--trials", 50, "--jobs", 1, *rows
    ).out.splitlines()
    rows = [f"--strategy={name}" for name in ("L", "LCORPP", "LCORPP-motion", "LCORPP-gaze")]
    museum = lcorpp("run", "museum", "--trials", 50, "--jobs", 1, *rows).out.splitlines()
    for lines, reference, worse in ((small, "R+P", "P"), (museum, "LCORPP", "LCORPP-motion")):
        tables = lines[: next(i for i, line in enumerate(lines) if re.match("classifier|SARSOP", line))]
        assert max(map(len, tables)) <= 80
        differences = lines[lines.index("differences on the same people, paired intervals") :]
        assert any(line.split() == [reference, "minus", "cost", "return"] for line in differences)
        (row,) = (line for line in differences if line.split()[:1] == [worse])
        assert re.fullmatch(r" \S+ +-?[\d.]+ \[-?[\d.]+, -?[\d.]+\] +[\d.]+ \[-?[\d.]+, [\d.]+\] *", row), row
    assert next(line.split() for line in small if "item" in line) == [
        "strategy",
        "item",
        "person",
        "room",
        "all",
        "cost",
        "return",
    ]


def test_the_table_precedes_the_classifier_s_evaluation(lcorpp):
    out = lcorpp("run", *SMALL, "--trials", 100).out
    assert out.index("LCORPP") < out.index("accuracy 0.") < out.index("Brier")
    assert "±" not in out


def test_figures_in_other_formats(lcorpp, tmp_path):
    options = ("run", "--classifier", "channel", "--trials", 20, "--strategy", "L", "--out", tmp_path)
    assert lcorpp(*options, "--format", "svg").code == 0
    assert {path.name for path in tmp_path.iterdir()} == {"results.csv", "results.json", "results.svg"}
    assert lcorpp(*options).code == 0
    assert (tmp_path / "results.png").exists()
    assert (tmp_path / "results.pdf").read_bytes().startswith(b"%PDF")
    refused(lcorpp(*options, "--format", "gif"), "gif")


def test_simulate_explains_a_mean_beyond_the_bounds(lcorpp, tiger, tmp_path):
    policy = tmp_path / "tiger.policy"
    assert lcorpp("solve", tiger, "-o", policy).code == 0
    explained = 0
    for seed in range(4):
        ended = lcorpp("simulate", tiger, policy, "--trials", 1000, "--seed", seed)
        assert "policy's lower bound     19.371" in ended.out
        explained += "by sampling error: the interval contains the value" in ended.out
        explained += "as one interval in 20 does by chance" in ended.out
    assert explained == 4  # the bounds are 1e-6 apart: no mean lies between them


def test_progress_has_a_total_or_a_spinner(tmp_path):
    """No step displays `0/?`."""
    code = "from lcorpp.cli.main import main; main()"
    ours, theirs = os.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    command = [sys.executable, "-c", code, "run", "--classifier", "channel", "--trials", "300", "--jobs", "1"]
    command += ["--strategy", "LCORPP"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs, env=environment)
    os.close(theirs)
    drawn = b""
    try:
        while part := os.read(ours, 4096):
            drawn += part
    except OSError:  # Linux: the other end is closed
        pass
    os.close(ours)
    assert running.wait() == 0
    assert b"/300" in drawn
    assert b"/?" not in drawn


def test_bad_models_end_in_one_message(lcorpp, tmp_path):
    model = shared_model("tiger.aaai.pomdp")
    refused(lcorpp("simulate", model, tmp_path / "no.policy"), "cannot be read")
    refused(lcorpp("show", tmp_path), "no folder with a domain.toml")


def test_explain_decides_as_the_robot_of_the_library(lcorpp, tmp_path):
    """The same person of a seed, in the log of the command and by one call."""
    from lcorpp import load_robot
    from lcorpp.logs import read_log

    log = tmp_path / "decisions.jsonl"
    for seed in (0, 3):
        assert (
            lcorpp("explain", "intention", "--fact", "time=morning", "--seed", seed, "--log", log).code == 0
        )
    robot = load_robot("intention")
    for seed, logged in zip((0, 3), read_log(log), strict=True):
        episode, expected = robot.decide({"time": "morning"}, seed=seed), logged.read_episode(robot.domain)
        assert (episode.evidence, episode.report) == (expected.evidence, expected.report)
        assert [(step.action, step.observation) for step in episode.steps] == [
            (step.action, step.observation) for step in expected.steps
        ]


def test_help_lists_learners_solvers_and_strategies_without_loading_them():
    code = "import sys, lcorpp.cli.app; print({'sklearn', 'scipy', 'torch', 'matplotlib'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
