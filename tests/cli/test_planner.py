"""The planner's other commands: simulate, show and check on models and policies."""

from __future__ import annotations

import os
import re

import pytest

from lcorpp.planning import Factored, cpt, read_pomdp
from lcorpp.planning.formats.pomdpx.writer import write_pomdpx
from tests.cli.planner import AUTHORS, refused
from tests.planning.models import shared_model

TURNED = "interested_turned,not_interested_turned"


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A policy of the authors' model."""
    from lcorpp.planning import solve, write_policy

    file = tmp_path_factory.mktemp("solved") / "authors.policy"
    write_policy(solve(read_pomdp(AUTHORS)).policy, file)
    return file


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text)]


# simulate


def test_simulate_agrees_with_what_the_policy_promises(lcorpp, solved):
    ended = lcorpp("simulate", AUTHORS, solved, "--trials", 4000, "--seed", 5)
    assert (ended.code, ended.err) == (0, "")
    lines = ended.out.splitlines()
    assert "4000 episodes of at most 917 steps, seed 5" in lines[0]  # .99 ** 917 is below 1e-4
    mean, _, low, high = numbers(lines[1].replace("95%", "95 "))
    (promised,) = numbers(lines[2])
    assert low < mean < high
    assert promised == pytest.approx(51.6569, abs=1e-3)
    assert low < promised + 2 * (high - low)  # a bound from below, up to chance
    assert "steps per second" in lines[-1]
    assert (
        lcorpp("simulate", AUTHORS, solved, "--trials", 4000, "--seed", 5).out.splitlines()[:3] == lines[:3]
    )


def test_simulate_prints_episodes_step_by_step(lcorpp, solved):
    ended = lcorpp("simulate", AUTHORS, solved, "--trials", 3, "--trace", 2, "--steps", 4)
    assert ended.code == 0
    assert ended.out.count("episode ") == 2
    table = ended.out.split("episode 2")[0].splitlines()
    assert table[1].split() == ["step", "state", "action", "observation", "reward", "discounted", "so", "far"]
    total, worth = 0.0, 1.0
    for number, line in enumerate(table[2:-2], start=1):
        cells = line.split()
        assert int(cells[0]) == number
        total += worth * float(cells[4])
        worth *= 0.99
        assert float(cells[5]) == pytest.approx(total, abs=1e-3)
    assert table[-2].startswith("  ends in ")


def test_simulate_prints_the_effect_of_truncation(lcorpp, tiger, tmp_path):
    lcorpp("solve", tiger, "-o", tmp_path / "a.alpha")
    ended = lcorpp("simulate", tiger, tmp_path / "a.alpha", "--trials", 50, "--steps", 10)
    assert "50 episodes were cut off" in ended.out
    # what may follow: .95 ** 10 / .05 steps of at least -100 and at most 10
    least, most = numbers(ended.out.split("by ")[1].splitlines()[0])
    assert (least, most) == pytest.approx((-1197, 120), rel=1e-2)


def test_simulate_refuses(lcorpp, solved, tiger, tmp_path):
    refused(lcorpp("simulate", tiger, solved), "authors.policy", "another model")
    refused(lcorpp("simulate", tiger, tmp_path / "no.policy"), "no.policy: cannot be read")
    for option in ("--trials", "--steps"):
        assert lcorpp("simulate", tiger, solved, option, 0).code == 2
    assert lcorpp("simulate", tiger, solved, "--trace", -1).code == 2


def test_each_command_refuses_a_policy_that_promises_what_no_policy_earns(lcorpp, tiger, tmp_path):
    false, path = tmp_path / "false.policy", tmp_path / "x.policy"
    lcorpp("solve", tiger, "-o", path)
    false.write_text(re.sub(r'(<Vector action="0"[^>]*>)\S+', r"\g<1>1e6", path.read_text(), count=1))
    words = "action 'listen' promises 1e+06 in state 'tiger-left', where no policy earns more than 200;"
    refused(lcorpp("check", false, "--model", tiger), "false.policy: vector ", words)
    refused(lcorpp("simulate", tiger, false), words)
    refused(lcorpp("show", tiger, false), words)


def test_simulate_refuses_a_promise_that_the_policy_does_not_keep(lcorpp, tiger, tmp_path):
    """Each vector is possible for some policy, but listening forever earns -20."""
    path = tmp_path / "x.alpha"
    path.write_text("0\n30 30\n")
    assert lcorpp("check", path, "--model", tiger).code == 0
    ended = lcorpp("simulate", tiger, path, "--trials", 100)
    assert ended.code == 2
    assert "policy's lower bound     30" in ended.out
    words = "x.alpha: the policy's vectors promise 30 at the start belief, but it earns at most -19.9"
    assert words in ended.err


def test_simulate_compares_a_finite_horizon_with_nothing(lcorpp, tiger, tmp_path):
    costs = tmp_path / "costs.pomdp"
    costs.write_text(re.sub(r"(R: .*) -?\d+", r"\1 -1", tiger.read_text()))
    lcorpp("solve", costs, "-o", tmp_path / "x.policy", "--horizon", 2)
    ended = lcorpp("simulate", costs, tmp_path / "x.1.policy", "--trials", 100)
    assert (ended.code, ended.err) == (0, "")
    assert "policy's lower bound     -1 for 1 remaining steps" in ended.out


def test_simulate_at_discount_0(lcorpp, tiger, tmp_path):
    myopic = tmp_path / "myopic.pomdp"
    myopic.write_text(tiger.read_text().replace("0.95", "0"))
    assert "verdict: confirmed" in lcorpp("solve", myopic, "-o", tmp_path / "x.policy", "--check").out
    ended = lcorpp("simulate", myopic, tmp_path / "x.policy", "--trials", 100)
    assert "100 episodes of at most 1 steps" in ended.out
    assert "policy's value           [-1, -1]" in ended.out
    assert "discount      0" in lcorpp("show", myopic, tmp_path / "x.policy").out


# show


def test_show_writes_the_policys_graph(lcorpp, solved, tmp_path):
    ended = lcorpp("show", AUTHORS, solved, "--graph", tmp_path / "a.dot")
    assert (ended.code, ended.err) == (0, "")
    dot = (tmp_path / "a.dot").read_text()
    assert dot.startswith("digraph policy {")
    nodes = int(re.search(r"a\.dot: (\d+) nodes\n", ended.out)[1])
    assert dot.count("peripheries=2") == 1
    assert len(re.findall(r"^  n\d+ \[", dot, re.MULTILINE)) == nodes
    assert lcorpp("show", AUTHORS, solved, "--graph", tmp_path / "a.png").code == 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    refused(
        lcorpp("show", AUTHORS, solved, "--graph", tmp_path / "a.gv"),
        "expected one of .png, .svg, .pdf, .dot",
    )


def test_show_prints_the_facts_of_a_model(lcorpp):
    ended = lcorpp("show", AUTHORS)
    assert (ended.code, ended.err) == (0, "")
    facts = dict(line.strip().split(None, 1) for line in ended.out.splitlines()[1:])
    assert facts["actions"] == "5: move_forward, greet, turn, report_interested, report_not_interested"
    assert facts["discount"] == "0.99"
    assert facts["reward"] == "-80 to 80"
    assert facts["start"] == "uniform over all states"
    assert "27 entries above zero, 21.60%" in ended.out  # of 125: 5 + 5 + 7 + 5 + 5


def test_show_finds_what_is_observed(lcorpp):
    out = lcorpp("show", shared_model("tag-avoid.pomdp")).out
    assert "within one of 30 blocks of at most 29 states" in out
    assert "uniform over 841 states" in out
    out = lcorpp("show", shared_model("RockSample_7_8.pomdpx")).out
    assert "robot (50, observed), rock0 (2)" in out
    assert "12800" in out


def test_show_draws_what_is_done_where(lcorpp, solved, tmp_path, tiger):
    for states, name in ((TURNED, "line.svg"), (f"{TURNED},term", "triangle.png")):
        ended = lcorpp("show", AUTHORS, solved, "--states", states, "-o", tmp_path / name)
        assert (ended.code, ended.err) == (0, "")
        assert f"drew {states.replace(',', ', ')} in {tmp_path / name}" in ended.out
        assert "lower bound of the value 51.65" in ended.out
        assert (tmp_path / name).stat().st_size > 1000
    lcorpp("solve", tiger, "-o", tmp_path / "tiger.policy")
    ended = lcorpp("show", tiger, tmp_path / "tiger.policy", "-o", tmp_path / "tiger.pdf")
    assert "drew tiger-left, tiger-right in" in ended.out


def test_show_refuses(lcorpp, solved, tmp_path):
    picture = ("-o", tmp_path / "a.png")
    refused(lcorpp("show", AUTHORS, *picture), "-o draws a policy; give one after")
    refused(lcorpp("show", AUTHORS, "--graph", tmp_path / "a.dot"), "--graph draws a policy")
    refused(lcorpp("show", AUTHORS, solved, "--states", TURNED), "of a picture; give one with -o")
    refused(lcorpp("show", AUTHORS, solved, *picture), "choose among the 5 with --states A,B")
    refused(lcorpp("show", AUTHORS, solved, "--states", "term", *picture), "two or three different states")
    refused(
        lcorpp("show", AUTHORS, solved, "--states", "term,term", *picture), "two or three different states"
    )
    refused(
        lcorpp("show", AUTHORS, solved, "--states", "term,up", *picture),
        "unknown state 'up'; expected one of",
    )
    refused(
        lcorpp("show", AUTHORS, solved, "--states", TURNED, "-o", tmp_path / "a.jpg"), "not a figure file"
    )
    assert os.listdir(tmp_path) == []


def test_show_takes_semicolons_where_names_hold_commas(lcorpp, tmp_path):
    problem = Factored.of(
        states={"x": "1 2", "y": "1 2"},
        actions="a b",
        observations="o",
        start={"x": "uniform", "y": "uniform"},
        transition={"x": "same", "y": "same"},
        observation=cpt("", "uniform"),
        reward=cpt("action x", {"a 1": 1, "b 2": 1}),
        discount=0.5,
    )
    model, policy = tmp_path / "a.pomdpx", tmp_path / "a.policy"
    write_pomdpx(problem, model)
    assert lcorpp("solve", model, "-o", policy).code == 0
    ended = lcorpp("show", model, policy, "--states", "x=1,y=1; x=2,y=1", "-o", tmp_path / "a.png")
    assert "drew x=1,y=1, x=2,y=1 in" in ended.out
    refused(
        lcorpp("show", model, policy, "--states", "x=1,y=1,x=2,y=1", "-o", tmp_path / "b.png"),
        "unknown state",
    )


# check


def test_check_knows_all_formats(lcorpp, solved, tmp_path):
    model = shared_model("Tiger.pomdpx")
    assert lcorpp("check", model).out.rstrip().endswith("OK")
    for name in ("a.alpha", "a.xml"):
        assert lcorpp("solve", model, "-o", tmp_path / name).code == 0
        ended = lcorpp("check", tmp_path / name, "--model", model)
        assert (ended.code, ended.err) == (0, "")
        refused(lcorpp("check", tmp_path / name), "give --model")
        refused(lcorpp("check", tmp_path / name, "--model", AUTHORS), name)
    (tmp_path / "b.pomdpx").write_text("<pomdpx><Discount>1</Discount></pomdpx>")
    refused(lcorpp("check", tmp_path / "b.pomdpx"), "b.pomdpx:1:")
    (tmp_path / "b.alpha").write_text("0\n1 2 x\n\n")
    refused(lcorpp("check", tmp_path / "b.alpha", "--model", model), "b.alpha:2:")
