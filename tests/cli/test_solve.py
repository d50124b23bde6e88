"""`lcorpp solve`: formats, solvers, pictures, the certificate, interrupts, and what it refuses at once."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys

import pytest

from lcorpp.planning import read_alphas, read_policy, read_pomdp
from lcorpp.planning.solvers import SOLVER_NAMES
from tests.cli.planner import AUTHORS, refused
from tests.planning.models import shared_model


@pytest.mark.parametrize("name", ["a.policy", "a.xml", "a.alpha", "a"])
def test_solve_writes_by_the_suffix(lcorpp, tiger, tmp_path, name):
    ended = lcorpp("solve", tiger, "-o", tmp_path / name)
    assert (ended.code, ended.err) == (0, "")
    pomdp = read_pomdp(tiger)
    read = read_alphas if name.endswith(".alpha") else read_policy
    policy = read(tmp_path / name, pomdp)
    lower = float(re.search(r"lower (\S+),", ended.out)[1])
    assert 19.371 <= policy.value(pomdp.start) == pytest.approx(lower, abs=1e-6)
    assert f"wrote {len(policy)} vectors to {tmp_path / name}" in ended.out


def test_solve_draws_the_bounds(lcorpp, tiger, tmp_path):
    ended = lcorpp("solve", tiger, "-o", tmp_path / "a.policy", "--plot", tmp_path / "a.png")
    assert ended.code == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(os.listdir(tmp_path)) == ["a.png", "a.policy", "tiger.pomdp"]


@pytest.mark.parametrize("name", SOLVER_NAMES)
def test_solve_by_any_solver_and_check(lcorpp, tiger, tmp_path, name):
    out = tmp_path / "a.policy"
    ended = lcorpp("solve", tiger, "-o", out, "--solver", name, "--check", "--plot", tmp_path / "a.svg")
    assert (ended.code, ended.err) == (0, "")
    lower, upper = (float(re.search(rf"{end} (\S+),", ended.out)[1]) for end in ("lower", "upper"))
    assert 19.37 <= lower <= 19.3714 <= upper + 1e-4
    assert re.search(r"^verdict: confirmed", ended.out, re.MULTILINE)
    assert out.exists()
    assert (tmp_path / "a.svg").exists()
    assert name in lcorpp("solve", "--help").out


def test_solve_reports_a_refuted_bound(lcorpp, tiger, tmp_path, monkeypatch):
    """A solver that promises too much: its policy is written all the same, and the exit code is 1."""
    from dataclasses import replace

    from lcorpp.planning import solve

    def boastful(pomdp, **options):
        return replace(solve(pomdp, **options), lower=20.0, upper=21.0)

    monkeypatch.setattr("lcorpp.planning.solvers.load_solver", lambda name: boastful)
    ended = lcorpp("solve", tiger, "-o", tmp_path / "a.policy", "--check")
    assert (ended.code, ended.err) == (1, "")
    assert "verdict: refuted: the policy's value is below the claimed lower bound" in ended.out
    assert (tmp_path / "a.policy").exists()


def test_a_time_for_the_check_implies_it(lcorpp, tiger, tmp_path):
    ended = lcorpp("solve", tiger, "-o", tmp_path / "a.policy", "--check-time", 60)
    assert (ended.code, ended.err) == (0, "")
    assert "verdict: confirmed" in ended.out
    refused(lcorpp("solve", tiger, "-o", tmp_path / "b.policy", "--check-time", -1), "--check-time")
    assert not (tmp_path / "b.policy").exists()


def test_the_memory_has_a_limit(lcorpp, tmp_path):
    model, out = shared_model("hallway.pomdp"), tmp_path / "a.policy"
    ended = lcorpp("solve", model, "-o", out, "--memory-limit", 1, "--time-limit", 600)
    assert (ended.code, ended.err) == (0, "")
    assert "memory limit after" in ended.out
    refused(lcorpp("solve", model, "-o", out, "--memory-limit", 0), "--memory-limit")
    refused(
        lcorpp("solve", model, "-o", out, "--memory-limit", 9, "--solver", "qmdp"),
        "--memory-limit is an option of sarsop, not of qmdp",
    )


ENDLESS = """discount: 1
values: cost
states: far near goal
actions: walk
observations: none
start: far
T: walk
0.5 0.5 0
0 0.5 0.5
0 0.1 0.9
O: * uniform
R: walk : far : * : * 1
R: walk : near : * : * 1
"""


def test_a_horizon_gives_a_policy_for_each_number_of_remaining_steps(lcorpp, tmp_path):
    model, out = tmp_path / "endless.pomdp", tmp_path / "walk.policy"
    model.write_text(ENDLESS)
    refused(lcorpp("solve", model, "-o", out), "a policy may go on forever", "lcorpp solve --horizon")
    ended = lcorpp("solve", model, "-o", out, "--horizon", 3)
    assert (ended.code, ended.err) == (0, "")
    assert "lower -2.750000, upper -2.750000" in ended.out  # 1 + 1 + P(not at the goal after two steps)
    assert f"{tmp_path / 'walk.1.policy'} to walk.3.policy" in ended.out
    pomdp = read_pomdp(model)
    policies = [read_policy(tmp_path / f"walk.{steps}.policy", pomdp) for steps in (1, 2, 3)]
    assert [policy.value(pomdp.start) for policy in policies] == pytest.approx([-1, -2, -2.75])
    assert not out.exists()


def test_options_that_exclude_a_horizon(lcorpp, tiger, tmp_path):
    out = tmp_path / "a.policy"
    refused(lcorpp("solve", tiger, "-o", out, "--horizon", 0), "--horizon")
    refused(
        lcorpp("solve", tiger, "-o", out, "--horizon", 2, "--solver", "fib"),
        "--horizon is an option of sarsop, not of fib",
    )
    refused(
        lcorpp("solve", tiger, "-o", out, "--horizon", 2, "--check"),
        "--check is for policies without --horizon",
    )
    assert not list(tmp_path.glob("a*"))


def test_solve_knows_its_solvers(lcorpp, tiger, tmp_path):
    ended = lcorpp("solve", tiger, "-o", tmp_path / "a.policy", "--solver", "pbvi")
    refused(ended, "unknown solver 'pbvi'; expected one of sarsop, exact, perseus, qmdp, fib")


def test_solve_refuses_outputs_before_it_searches(lcorpp, tmp_path):
    """The model would take the whole hour."""
    model = shared_model("hallway.pomdp")
    hour = ("--time-limit", 3600)
    refused(
        lcorpp("solve", model, "-o", tmp_path / "a.png", *hour),
        "a.png: not the name of a policy; expected one of .policy",
    )
    refused(
        lcorpp("solve", model, "-o", tmp_path / "no" / "a.policy", *hour),
        "cannot be written: there is no folder",
    )
    refused(lcorpp("solve", model, "-o", tmp_path, *hour), "cannot be written: Is a directory")
    refused(
        lcorpp("solve", model, "-o", tmp_path / "a.policy", "--plot", tmp_path / "a.gif", *hour),
        "a.gif: not a figure file; expected one of .png, .svg, .pdf",
    )
    refused(
        lcorpp("solve", model, "-o", tmp_path / "a.policy", "--plot", tmp_path / "no" / "a.png", *hour),
        "cannot be written",
    )
    assert os.listdir(tmp_path) == []


def test_solve_at_the_time_limit_is_a_result(lcorpp, tmp_path):
    model = shared_model("hallway.pomdp")
    ended = lcorpp("solve", model, "-o", tmp_path / "a.policy", "--time-limit", 0.3)
    assert ended.code == 0
    assert "time limit after 0." in ended.out
    assert lcorpp("check", tmp_path / "a.policy", "--model", model).code == 0


def test_solve_on_ctrl_c_writes_the_best_so_far(lcorpp, tmp_path, monkeypatch):
    model = shared_model("hallway.pomdp")
    trials: list[object] = []

    def interrupted(*_: object):
        def tell(now: object) -> None:
            trials.append(now)
            if len(trials) == 20:
                signal.raise_signal(signal.SIGINT)

        return tell

    monkeypatch.setattr("lcorpp.cli.solve._show_bounds", interrupted)
    ended = lcorpp("solve", model, "-o", tmp_path / "a.policy")
    assert (ended.code, ended.err) == (0, "")
    assert "interrupted after" in ended.out
    assert len(trials) == 20
    assert len(read_policy(tmp_path / "a.policy", read_pomdp(model))) > 0
    assert os.listdir(tmp_path) == ["a.policy"]


def test_solve_loads_nothing_heavy(tmp_path):
    """What a short command loads is what it takes: numpy and typer, no more."""
    code = (
        "import sys\nfrom lcorpp.cli.main import main\n"
        "try: main()\nexcept SystemExit: pass\n"
        "print(sorted({'scipy', 'matplotlib', 'rich', 'sklearn', 'torch', 'clingo'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", code, "solve", str(AUTHORS), "-o", str(tmp_path / "a.policy")]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ended.stdout.splitlines()[-1] == "[]"


def test_a_long_search_shows_its_bounds_on_a_terminal(tmp_path):
    model = shared_model("hallway.pomdp")
    code = "from lcorpp.cli.main import main; main()"
    options = ["-o", str(tmp_path / "a.policy"), "--time-limit", "1"]
    ours, theirs = os.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    command = [sys.executable, "-c", code, "solve", str(model), *options]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs, env=environment)
    os.close(theirs)
    drawn = b""
    try:
        while part := os.read(ours, 4096):
            drawn += part
    except OSError:  # how Linux says that the other end is closed
        pass
    os.close(ours)
    assert running.wait() == 0
    assert re.search(rb"solving.* 0\.[0-9]+ to 1\.[0-9]+, [0-9]+ vectors", drawn)


def test_the_bar_shows_bounds_and_never_goes_back():
    from lcorpp.cli.solve import _show_bounds
    from lcorpp.planning import Progress

    told: list[tuple[float, str]] = []
    tell = _show_bounds(lambda share, words: told.append((share, words)), 0.01, 100.0)
    for seconds, upper in ((1.0, 100.0), (2.0, 10.0), (3.0, 1.0), (50.0, 0.99), (60.0, 0.005)):
        tell(Progress(seconds, 0.0, upper, 7, 8, 9))
    shares = [share for share, _ in told]
    assert shares == pytest.approx([0.01, 0.25, 0.5, 0.501, 1.0], abs=2e-3)
    assert told[1][1] == "0 to 10, 7 vectors"
