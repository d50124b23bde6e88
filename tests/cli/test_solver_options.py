"""The solver of a robot's commands: domain.toml, options, own functions, the cache, interrupts."""

import json
import re
from pathlib import Path

import pytest

from lcorpp.assembly import solve_domain
from lcorpp.domains import load_domain
from lcorpp.errors import DomainError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.planning import SolverOptions, solve, write_policy
from tests.cli.planner import refused
from tests.domains.test_loading import edit, folder as rooms  # noqa: F401
from tests.planning.models import TIGER

pytestmark = pytest.mark.usefixtures("unrendered")

EXPLAIN = ("explain", "--fact", "time=morning", "--label", "one", "--truth", "interested", "--seed", 1)
OWN = """
from lcorpp.planning import solve as sarsop

def thorough(pomdp, start, **options):
    return sarsop(pomdp, start, **options).policy

def broken(pomdp, start, **options):
    return {}["x"]
"""


@pytest.fixture
def own(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    return tmp_path / "own.py"


def test_the_bounds_are_in_the_results(lcorpp, tmp_path):
    command = (
        "run",
        "--exact",
        "--classifier",
        "channel",
        "--strategy",
        "P",
        "--format",
        "svg",
        "--out",
        tmp_path,
    )
    ended = lcorpp(*command)
    found = json.loads((tmp_path / "results.json").read_text())["configuration"]["solution"]
    assert (ended.code, ended.err) == (0, "")
    assert (found["solver"], found["reason"], found["converged"]) == ("sarsop", "precision reached", True)
    assert found["gap"] == found["upper"] - found["lower"] <= 5e-4
    ended = lcorpp(*command, "--solver", "qmdp", "--precision", 0.1, "--time-limit", 9)
    assert ended.code == 0
    assert "solver qmdp: value in [" in ended.out
    assert "warning: solver qmdp has not converged (policy evaluated): a better one may exist" in ended.err
    found = json.loads((tmp_path / "results.json").read_text())["configuration"]["solution"]
    assert (found["solver"], found["reason"], found["converged"]) == ("qmdp", "policy evaluated", False)
    assert found["gap"] > 0.1


def test_the_gap_at_the_priors_is_in_the_summary(lcorpp, tmp_path):
    priors = "gap at the priors of these people at most "
    few = ("run", "--classifier", "channel", "--trials", 30, "--jobs", 1, "--strategy", "LCORPP")
    ended = lcorpp(*few, "--format", "svg", "--out", tmp_path)
    (gap,) = re.findall(rf"at the start belief; {priors}(\S+); \d+ vectors", ended.out)
    found = json.loads((tmp_path / "results.json").read_text())["configuration"]["gap_at_priors"]
    assert (ended.code, ended.err) == (0, "")
    assert 0 < found <= float(gap) <= 5e-4
    assert priors not in lcorpp(*few[:-1], "L").out
    file = tmp_path / "intention.policy"
    write_policy(solve_domain(load_domain("intention")).policy, file)
    assert priors not in lcorpp(*few, "--policy", file).out
    ended = lcorpp("explain", "--likelihood", "interested=0.3", "--strategy", "R+P")
    assert ended.code == 2
    ended = lcorpp("explain", "--likelihood", "interested=0.3", "--strategy", "LCORPP")
    (gap,) = re.findall(r"gap at this prior at most (\S+)\n", ended.out)
    assert float(gap) <= 5e-4


def test_a_gap_above_the_precision_is_noted(lcorpp, monkeypatch):
    monkeypatch.setattr("lcorpp.planning.sarsop.solver.MIXTURE_WORK", 0)
    soft = ("--evidence", "soft", "--learner", "summaries", "--tracks", 40, "--jobs", 1)
    ended = lcorpp("run", *soft, "--trials", 50, "--strategy", "LCORPP", "--no-cache")
    assert ended.code == 0
    note = (
        "note: the gap at a prior is above the precision 0.0005, so a better policy for some people may"
        " exist; with a longer --time-limit the search goes on"
    )
    assert note in " ".join(ended.out.split())


def test_learn_states_the_bounds(lcorpp, tmp_path):
    options = ("--learner", "summaries", "--tracks", 40, "--batch-size", 20, "--max-batches", 1, "--jobs", 1)
    ended = lcorpp("learn", *options, "--precision", 1, "--no-cache", "--out", tmp_path)
    assert ended.code == 0
    found = json.loads((tmp_path / "batches.json").read_text())["solution"]
    assert (found["converged"], found["cached"]) == (True, False)
    assert 5e-4 < found["gap"] <= 1
    (gap,) = re.findall(r"\ngap at the priors of these people at most (\S+)\n", ended.out)
    assert 0 < float(gap) <= 1


def test_the_second_explain_takes_the_policy_from_the_cache(lcorpp, tmp_path, monkeypatch):
    monkeypatch.setenv("LCORPP_CACHE", str(tmp_path))
    first, second, again = lcorpp(*EXPLAIN), lcorpp(*EXPLAIN), lcorpp(*EXPLAIN, "--no-cache")
    words = "; from the cache of policies (--no-cache solves again)"
    assert [words in ended.out for ended in (first, second, again)] == [False, True, False]
    assert second.out.replace(words, "") == first.out
    assert len(list((tmp_path / "policies").iterdir())) == 1


def test_the_library_keeps_nothing_unasked(tmp_path, monkeypatch):
    monkeypatch.setenv("LCORPP_CACHE", str(tmp_path))
    domain = load_domain("intention")
    assert not solve_domain(domain, SolverOptions(precision=1)).cached
    assert list(tmp_path.iterdir()) == []
    assert [solve_domain(domain, cache=tmp_path / "mine").cached for _ in range(2)] == [False, True]


@pytest.mark.parametrize(
    "command", [EXPLAIN, ("run", "--classifier", "channel", "--exact", "--strategy", "P")]
)
def test_ctrl_c_goes_on_with_the_best_policy_so_far(lcorpp, monkeypatch, command):
    def stop(_):
        raise KeyboardInterrupt

    def interrupted(pomdp, starts, options, **_):
        return solve(pomdp, starts, callback=stop)

    monkeypatch.setattr("lcorpp.assembly.solving.solve_cached", interrupted)
    ended = lcorpp(*command)
    assert ended.code == 0
    assert "(interrupted; this is the best policy so far): " in ended.err + ended.out


def test_an_own_solver(lcorpp, own, tmp_path):
    ended = lcorpp(*EXPLAIN, "--solver", f"{own}:thorough")
    expected = lcorpp(*EXPLAIN)
    assert ended.code == 0
    assert f"solver {own}:thorough: value in [66.498, 66.498] at the start belief" in ended.out
    steps = [output.out.partition("1  learning")[2] for output in (ended, expected)]
    assert steps[0] == steps[1] != ""
    model = Path(load_domain("intention").pomdp.file)
    ended = lcorpp("solve", model, "-o", tmp_path / "a.policy", "--solver", f"{own}:thorough", "--check")
    assert ended.code == 0
    assert "verdict: confirmed" in ended.out


@pytest.mark.parametrize("command", [("explain",), ("run", "--learner", "summaries"), ("learn",)])
def test_solvers_are_checked_before_the_work(lcorpp, own, monkeypatch, command):
    for name in (
        "assembly.solving.solve_cached",
        "assembly.classifier_training.train_and_validate",
        "runs.training.train_and_validate",
    ):
        monkeypatch.setattr(f"lcorpp.{name}", None)
    refused(lcorpp(*command, "--solver", "pbvi"), "unknown solver 'pbvi'; expected one of sarsop")
    refused(lcorpp(*command, "--solver", f"{own}:none"), "own.py has no function 'none'; expected one of")
    refused(lcorpp(*command, "--precision", 0), "the precision is 0.0; expected a finite positive number")
    refused(lcorpp(*command, "--time-limit", "nan"), "the time limit is nan; expected a positive number")


def test_an_own_solver_that_fails(lcorpp, own, tmp_path):
    ended = lcorpp(*EXPLAIN, "--solver", f"{own}:broken")
    assert (ended.code, ended.err) == (2, f"lcorpp: {own}:8: broken() failed: KeyError: 'x'\n")
    model = Path(load_domain("intention").pomdp.file)
    command = ("solve", model, "-o", tmp_path / "a.policy", "--solver", f"{own}:broken")
    refused(lcorpp(*command), "own.py:8: broken() failed: KeyError: 'x'")


def test_a_policy_needs_no_solver(lcorpp, tmp_path):
    refused(
        lcorpp("run", "--policy", tmp_path / "a.policy", "--solver", "qmdp"),
        "--solver: nothing is solved, as --policy gives a policy",
    )


def test_domain_toml_names_the_solver(rooms, own):  # noqa: F811
    (rooms / "own.py").write_text(own.read_text())
    chosen = 'terminal = "gone"\nsolver = "own.py:thorough"\nprecision = 1\ntime_limit = 5'
    edit(rooms / "domain.toml", 'terminal = "gone"', chosen)
    domain = load_domain(rooms)
    assert domain.planning.solver == SolverOptions(f"{rooms / 'own.py'}:thorough", 1, 5)
    solution = compare_strategies(domain, ComparisonOptions(trials=None)).solution
    assert solution.solver == f"{rooms / 'own.py'}:thorough"
    assert solution.upper - solution.lower <= 1
    for old, new, message in (
        (
            "own.py:thorough",
            "own.py:quick",
            r"domain\.toml:18: \[planning\] solver: .*own\.py has no function 'quick'",
        ),
        ("own.py:quick", "magic", r"domain\.toml:18: \[planning\] solver: unknown solver 'magic'"),
        (
            "time_limit = 5",
            "time_limit = 0",
            r"domain\.toml:20: \[planning\] time_limit: expected a number from",
        ),
        ("precision = 1", 'precision = "1"', r"domain\.toml:19: \[planning\] precision: expected a number"),
    ):
        edit(rooms / "domain.toml", old, new)
        with pytest.raises(DomainError, match=message):
            load_domain(rooms)


ONLINE = ("--solver", "online", "--step-seconds", 0.01, "--time-limit", 1)


def test_a_robot_that_searches_at_each_step_repeats_its_logged_decisions(lcorpp, tmp_path):
    log = tmp_path / "log.jsonl"
    command = ("run", "shopping", "--preset", "small", "--trials", 5, "--log", log)
    ended = lcorpp(*command, *ONLINE)
    assert ended.code == 0
    assert "note: LCORPP+trust is left out: LCORPP+trust acts by a policy" in ended.out
    assert "solver online: value in [" in ended.out
    assert "15 decisions, 0 differences" in lcorpp("replay", log).out
    assert '"step_seconds": 0.01' in log.read_text()


def test_explain_prints_what_another_action_gains_at_most(lcorpp):
    ended = lcorpp("explain", "shopping", "--preset", "small", "--fact", "requester=alice", *ONLINE)
    assert ended.code == 0
    found = re.findall(r"value in \[(\S+), (\S+)\]: another action gains at most (\S+) more", ended.out)
    steps = [line for line in ended.out.splitlines() if "observes" in line or "the decision" in line]
    assert len(found) == len(steps) > 1
    for lower, upper, gap in found:
        assert float(gap) == pytest.approx(float(upper) - float(lower), abs=2e-3, rel=0.1)


def test_where_no_search_at_each_step_is_possible(lcorpp, tmp_path, rooms):  # noqa: F811
    model = tmp_path / "tiger.pomdp"
    model.write_text(TIGER)
    for command, message in (
        (("solve", model, "--solver", "online", "-o", tmp_path / "a.policy"), "online makes no policy"),
        (("run", "--strategy", "LCORPP+trust", "--trials", 5, *ONLINE), "LCORPP+trust acts by a policy"),
        (("play", *ONLINE), "the page acts by a policy; expected another solver than online"),
        (("run", "--step-seconds", 0, "--trials", 5), "the step time is 0.0; expected a finite"),
        (("run", "--step-seconds", 1, "--trials", 5), "--step-seconds is an option of online, not of sarsop"),
    ):
        ended = lcorpp(*command)
        assert ended.code == 2
        assert message in " ".join(ended.err.replace("│", " ").split())
    chosen = 'terminal = "gone"\nsolver = "online"\nstep_seconds = 0.2'
    edit(rooms / "domain.toml", 'terminal = "gone"', chosen)
    assert load_domain(rooms).planning.solver == SolverOptions("online", step_seconds=0.2)
    edit(rooms / "domain.toml", "step_seconds = 0.2", "step_seconds = -1")
    with pytest.raises(DomainError, match=r"domain\.toml:19: \[planning\] step_seconds: expected a number"):
        load_domain(rooms)


def test_help_names_the_solvers(lcorpp):
    for command in ("run", "learn", "explain", "solve"):
        text = re.sub(r"[\s│]+", " ", lcorpp(command, "--help").out)
        online = "qmdp or fib" if command == "solve" else "qmdp, fib or online"  # which makes no policy
        assert f"sarsop, exact, perseus, {online}, or your own as FILE.py:NAME" in text
        assert "--time-limit" in text
        assert "--precision" in text
