"""LCORPP+trust in comparisons: people in their order, logs and replays, and what has no scores."""

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lcorpp import load_robot
from lcorpp.assembly.options import EvidenceOptions, TrainingOptions
from lcorpp.assembly.soft_rates import compute_soft_rates
from lcorpp.assembly.strategies.baselines import find_strategies
from lcorpp.assembly.strategies.trust import TRUST, WITH_TRUST
from lcorpp.assembly.strategies.trust_session import TrustSession
from lcorpp.decision import dt_control, strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DataError, DecisionError, DomainError
from lcorpp.experiments.comparison import ComparisonOptions, compare_strategies, set_up_experiment
from lcorpp.logs import DecisionLog
from lcorpp.logs.replay import ReplayedDecision, make_logged_robot, replay_log
from lcorpp.planning import SparseTables
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.scoring import trial_chunks
from lcorpp.scoring.experiment import ChunkSource, replay_trial
from lcorpp.values import ConfusionMatrix, EvidenceKind, Instance
from lcorpp.worlds import ScriptedWorld
from tests.domains.deliveries import GAZE, VOICE, write_domain

ROOMS = Path(__file__).parents[2] / "domains" / "rooms"
ROWS = (*strategies(["L"]), WITH_TRUST[0], *strategies(["LCORPP"]), WITH_TRUST[2])


def compare(domain, rows=ROWS, **options):
    chosen = {"trials": 110, "seed": 7, "cache": find_cache_folder()} | options
    return compare_strategies(domain, ComparisonOptions(rows, **chosen))


def read_lines(path):
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    for line in lines:
        del line["seconds"]
    return lines


def hide_turn(domain):
    """Return a domain in which an unsuccessful turn is answered, too, so that the robot does not see it."""
    observation = domain.pomdp.observation.dense.copy()
    turn = domain.pomdp.action_index("turn")
    observation[turn, :2] = observation[turn, 2:4]
    pomdp = replace(domain.pomdp, observation=SparseTables.of(observation))
    return replace(domain, planning=replace(domain.planning, model=pomdp))


def test_names_are_found_and_stay_out_of_the_table():
    names = ["LCORPP+trust", "LCORPP+trust-hearing", "LCORPP+trust-asking"]
    assert [row.name for row in find_strategies([name.upper() for name in names])] == names
    assert not [row for row in find_strategies([]) if row.start is not None]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A comparison in one process, and its log."""
    log = tmp_path_factory.mktemp("whole") / "log"
    return compare(load_domain(ROOMS), log=log), log


@pytest.mark.slow
def test_scores_and_log_do_not_depend_on_the_processes(whole, tmp_path):
    domain, (one, log) = load_domain(ROOMS), whole
    two = compare(domain, jobs=2, log=tmp_path / "two")
    for a, b in zip(one.scores, two.scores, strict=True):
        np.testing.assert_array_equal(a.counts, b.counts)
        assert a.return_ == b.return_
    assert [row.strategy for row in one.scores] == [row.name for row in ROWS]
    lines = read_lines(log)
    assert lines == read_lines(tmp_path / "two")
    assert [line["strategy"]["name"] for line in lines] == [row.name for row in ROWS] * 110
    persons = [line["strategy"]["person"] for line in lines if line["strategy"]["name"] == TRUST.name]
    assert persons == [line["simulated"]["trial"] for line in lines[:: len(ROWS)]] == list(range(110))


@pytest.mark.parametrize("logged", [False, True])
def test_an_interrupt_in_one_process_keeps_every_complete_trial(whole, tmp_path, monkeypatch, logged):
    """Of a chunk of 100 people whose decisions, except L's without a log, are made one by one."""
    honest, calls = trial_chunks.dt_control, itertools.count(1)
    rows, log = (*strategies(["L"]), TRUST), tmp_path / "log" if logged else None

    def interrupt(robot, instance, world):
        if next(calls) > (51 if logged else 25):
            raise KeyboardInterrupt
        return honest(robot, instance, world)

    monkeypatch.setattr(trial_chunks, "dt_control", interrupt)
    kept = compare(load_domain(ROOMS), rows, log=log)
    assert kept.trials == 25
    if log is not None:
        persons = [line["simulated"]["trial"] for line in read_lines(log)]
        assert persons == [person for person in range(25) for _ in rows]
    for a, b in zip(kept.scores, whole[0].scores[:2], strict=True):  # L, LCORPP+trust
        assert a.counts.sum() == 25
        assert (a.counts <= b.counts).all()


def test_other_strategies_are_not_changed(whole):
    domain, (both, _) = load_domain(ROOMS), whole
    alone = compare(domain, strategies(["L", "LCORPP"]))
    assert [repr(row) for row in both.scores[::2]] == [repr(row) for row in alone.scores]
    (trust,) = compare(domain, (TRUST,)).scores
    assert repr(trust) == repr(both.scores[1])


def test_a_trial_follows_those_before_it(whole):
    experiment, *_ = set_up_experiment(
        load_domain(ROOMS), ComparisonOptions((TRUST,), seed=7, cache=find_cache_folder())
    )
    logged = read_lines(whole[1])[102 * len(ROWS) + ROWS.index(TRUST)]
    found = replay_trial(experiment, 102, TRUST, trials=110)
    states = experiment.domain.pomdp.states
    assert {state: p for state, p in zip(states, found.prior, strict=True) if p} == logged["prior"]
    assert [step.action for step in found.steps] == [step["action"] for step in logged["steps"]]
    first = replay_trial(experiment, 0, TRUST, trials=110)
    drawn = ChunkSource(experiment).draw(0, 100).find_trial(0)
    alone = dt_control(TRUST.robot(drawn.robot), drawn.instance, drawn.make_world())
    np.testing.assert_array_equal(first.prior, alone.prior)


@pytest.mark.parametrize("place", ["rooms", pytest.param("deliveries", marks=pytest.mark.slow)])
def test_a_replay_learns_in_the_order_of_the_log(tmp_path, place):
    """With one sense and with several senses and shared variables; two runs in one file."""
    folder = ROOMS if place == "rooms" else write_domain(tmp_path / "domain", senses=GAZE + VOICE)
    domain, log = load_domain(folder), tmp_path / "log"
    for seed in (7, 8):
        compare(domain, trials=8, seed=seed, log=log)
    results = list(replay_log(log, cache=find_cache_folder()))
    assert len(results) == 2 * 8 * len(ROWS)
    assert not [result for result in results if result.differences]


def test_a_replay_recognises_the_people_of_the_log(tmp_path):
    """Three people in turn; without their ids the beliefs differ from the second meeting on."""
    robot = load_robot("intention", cache=find_cache_folder())
    parts, log = robot.parts, tmp_path / "log"
    session, facts = TRUST.start(parts.robot, parts.rates), {"time": "afternoon", "location": "classroom"}
    with DecisionLog(log) as kept:
        for n in range(9):
            who, answers = str(n % 3), ScriptedWorld(9 * [["pos", "neg", "pos"][n % 3]])
            own = make_logged_robot(parts, TRUST, {"motion": "interested"}, None, session=session, person=who)
            episode = dt_control(own, Instance({"motion": [[0.0, 1.0], [0.0, 1.0]]}, facts), answers)
            session.learn(episode.evidence, episode.steps, who)
            kept.append(parts, TRUST, facts, episode, person=n, person_id=who)
    assert not [result for result in replay_log(log, cache=find_cache_folder()) if result.differences]
    lines = [json.loads(line) for line in log.read_bytes().splitlines()]
    for line in lines:
        del line["strategy"]["person_id"]
    log.write_text("".join(json.dumps(line) + "\n" for line in lines))
    results = list(replay_log(log, cache=find_cache_folder()))
    assert [bool(result.differences) for result in results] == 3 * [False] + 6 * [True]


def test_a_line_that_is_missing_stops_the_replay_of_its_session(tmp_path):
    log = tmp_path / "log"
    compare(load_domain(ROOMS), trials=30, log=log)
    lines = log.read_bytes().splitlines(keepends=True)
    del lines[4 * len(ROWS) + 1]
    log.write_bytes(b"".join(lines))
    results = list(replay_log(log, cache=find_cache_folder()))
    errors = [result for result in results if isinstance(result, DataError)]
    assert len(errors) == 25
    assert "'LCORPP+trust' has learnt from 4 people, and the line is after 5: decisions" in str(errors[0])
    others = [result for result in results if isinstance(result, ReplayedDecision)]
    assert len(others) == 30 * len(ROWS) - 26
    assert not [result for result in others if result.differences]


def test_an_interrupt_keeps_the_people_about_whom_all_strategies_decided(whole, tmp_path, monkeypatch):
    """Of two processes, of which this one runs the strategies that learn from people."""
    domain, learn, calls = load_domain(ROOMS), TrustSession.learn, iter(range(10_000))

    def interrupt(session, *decision):
        if next(calls) == 2 * 104 + 1:
            raise KeyboardInterrupt
        learn(session, *decision)

    monkeypatch.setattr(TrustSession, "learn", interrupt)
    part = compare(domain, jobs=2, log=tmp_path / "part")
    assert (whole[0].trials, part.trials) == (110, 104)
    assert all(row.counts.sum() == 104 for row in part.scores)
    assert read_lines(tmp_path / "part") == read_lines(whole[1])[: 104 * len(ROWS)]


def test_a_strategy_that_learns_has_no_exact_scores():
    with pytest.raises(DecisionError, match=r"'LCORPP\+trust' learns from each person, so its scores depend"):
        compare(load_domain("intention"), (TRUST,), trials=None)


def test_a_dialogue_that_cannot_be_followed_is_refused_before_the_work():
    domain = hide_turn(load_domain("intention"))
    with pytest.raises(
        DomainError, match="after 'turn' and 'pos' the planner's own variables may have sever"
    ):
        set_up_experiment(domain, ComparisonOptions((TRUST,), {"motion": TrainingOptions(learner="unknown")}))


def test_no_senses():
    shopping = load_domain("shopping", preset="small")
    comparison = compare(shopping, (*strategies(["R+P"], []), TRUST), trials=40)
    known, trust = comparison.scores
    assert trust.return_.estimate > known.return_.low


def test_soft_evidence_has_the_rates_of_the_confusion_matrix():
    domain = load_domain("intention")
    matrix = ConfusionMatrix(("interested", "not_interested"), np.array([[80.0, 20.0], [30.0, 70.0]]))
    rates = compute_soft_rates(domain, {"motion": matrix}, 0, soft=["motion"])
    (attribute,) = domain.label_attributes
    assert list(rates) == [attribute]
    np.testing.assert_allclose(np.array(list(rates[attribute].values())).T, [[0.8, 0.2], [0.3, 0.7]])
    assert compute_soft_rates(domain, {}, soft=[]) == {}


@pytest.mark.parametrize("kind", ["soft", "set"])
def test_likelihoods_and_sets_are_evidence_for_trust(tmp_path, kind):
    domain = load_domain("intention")
    training = {"motion": TrainingOptions("summaries", tracks=60)}
    evidence = EvidenceOptions({"motion": EvidenceKind(kind)})
    log = tmp_path / "log"
    comparison = compare(domain, (TRUST,), trials=25, classifiers=training, evidence=evidence, log=log)
    assert comparison.scores[0].counts.sum() == 25
    assert not [result for result in replay_log(log, cache=find_cache_folder()) if result.differences]
