"""The page of LCORPP+limits: its engine draws as the plan does, and a server's draws are replayed."""

from __future__ import annotations

import json
from itertools import count

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.assembly.strategies.limits import WITH_LIMITS
from lcorpp.logs.decision_log import read_log
from lcorpp.logs.replay import ReplayedDecision, replay_log
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.web.model import make_exported_model, write_model
from lcorpp.web.setup import set_up_robot
from tests.cli.planner import refused
from tests.web.conftest import Asker

FACTS = {"time": "afternoon", "location": "classroom"}


@pytest.fixture(scope="module")
def limited():
    domain = load_domain("intention", preset="limit_10")
    options = {"strategy": WITH_LIMITS, "cache": find_cache_folder()}
    return set_up_robot(domain, {"motion": None}, domain.planning.solver, **options)


def test_an_exported_page_follows_the_plan(limited, node, tmp_path):
    """With each draw the engine takes the node of its interval, then the edges of the answers."""
    (tmp_path / "model.json").write_text(write_model(make_exported_model(limited)))
    node(model=str(tmp_path / "model.json"))
    plan, seen = limited.plan, set()
    policy, observations = plan.policy, limited.domain.pomdp.observations
    assert json.loads((tmp_path / "model.json").read_text())["domain"]["limits"] == ["bothered"]
    for draw in np.linspace(0, 0.999, 23).tolist():
        node(call=["start"])
        node(call=["observe", FACTS, {"motion": "one"}])
        reply = node(call=["decide", draw])
        row = policy.probabilities[plan.find_start({**FACTS, "classifier": "one"})]
        place = int(np.searchsorted(np.cumsum(row), draw, side="right"))
        said = iter(["pos", "neg", "neg", "pos", "pos", "pos", "neg", "neg", "neg", "neg", "neg"])
        while not reply["done"]:
            seen.add(place)
            assert reply["action"] == policy.action_names[policy.controller.actions[place]]
            answer = next(said)
            after = int(policy.controller.successors[place, observations.index(answer)])
            following = {row["observation"]: row["action"] for row in reply["outcomes"]}
            assert following[answer] == policy.action_names[policy.controller.actions[after]]
            reply = node(call=["answer", answer, 0.0])
            place = after
        assert node(call=["record"])["strategy"] == {"name": "LCORPP+limits"}
    assert len(seen) > 3


def test_evidence_that_is_not_listed_begins_as_the_nearest(limited, node, tmp_path):
    (tmp_path / "model.json").write_text(write_model(make_exported_model(limited)))
    node(model=str(tmp_path / "model.json"))
    node(call=["start"])
    reply = node(call=["decide", 0.5])
    policy = limited.plan.policy
    prior = np.array([reply["belief"].get(state, 0.0) for state in limited.domain.pomdp.states])
    own = policy.probabilities[policy.find_start(prior)]
    place = int(np.searchsorted(np.cumsum(own), 0.5, side="right"))
    assert reply["action"] == policy.action_names[policy.controller.actions[place]]


def test_a_served_page_logs_its_draws(limited, tmp_path):
    """The decisions of forty trials are those of the seeds in the log."""
    lines, trials = [], count()
    asker = Asker(limited, log=lines.append, make_seed=lambda: (5, next(trials)))
    policy, observations = limited.plan.policy, limited.domain.pomdp.observations
    rng = np.random.default_rng(0)
    firsts = set()
    for _ in range(40):
        asker.send("start")
        place = asker.send("infer", facts=FACTS, labels={"motion": "interested"})["node"]
        steps = []
        while True:
            action = policy.action_names[policy.controller.actions[place]]
            if action in limited.domain.planning.reports:
                steps.append([action, None])
                break
            seen = int(rng.integers(2))
            steps.append([action, observations[seen]])
            place = int(policy.controller.successors[place, seen])
        firsts.add(steps[0][0])
        sent = {"facts": FACTS, "labels": {"motion": "interested"}}
        assert asker.send("log", **sent, steps=steps)["type"] == "logged"
        wrong = [["greet" if steps[0][0] != "greet" else "turn", "pos"], *steps]
        assert "expected" in asker.send("log", **sent, steps=wrong)["message"]
    assert len(firsts) > 1
    log = tmp_path / "log.jsonl"
    log.write_bytes(b"".join(lines))
    assert [json.loads(line)["strategy"]["seed"] for line in lines] == [[5, n] for n in range(40)]
    assert len(list(read_log(log))) == 40
    replayed = [own for own in replay_log(log) if isinstance(own, ReplayedDecision)]
    assert len(replayed) == 40
    assert not any(own.differences for own in replayed)


def test_what_the_page_does_not_play(lcorpp, tmp_path):
    options = ["export", "intention", "--to", tmp_path / "a", "--classifier", "channel"]
    refused(lcorpp(*options, "--strategy", "ask-twice"), "the page plays LCORPP and LCORPP+limits")
    refused(lcorpp(*options, "--strategy", "LCORPP+limits"), "LCORPP+limits needs one")
