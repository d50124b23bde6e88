"""Baselines and own strategies: known decisions, two ways to score them, errors with the user's line."""

import json
import random
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from lcorpp import planning
from lcorpp.assembly.strategies.baselines import BASELINES, find_strategies
from lcorpp.assembly.strategies.strategy_table import TABLE_NAMES, TRUST_NAMES
from lcorpp.assembly.strategies.trust import WITH_TRUST
from lcorpp.decision import STRATEGIES, Robot, Strategy
from lcorpp.domains import load_domain
from lcorpp.domains.information import compute_information
from lcorpp.errors import DecisionError, NoReportError
from lcorpp.experiments.comparison import ComparisonOptions, compare_strategies
from lcorpp.reasoning import Reasoner
from lcorpp.scoring import decision_nodes, episode_sums, episode_totals
from lcorpp.scoring.exact_evaluation import evaluate_exactly
from lcorpp.scoring.experiment import Experiment
from lcorpp.scoring.part_state import NoKeyError, make_state_key
from lcorpp.scoring.trials import run_trials
from lcorpp.simulation import NoisyChannel
from tests.decision.fakes import FakeDomain

ROOMS = Path(__file__).parents[2] / "domains" / "rooms"
OWN = """
import numpy
from dataclasses import replace

class Greeter:
    def __init__(self, robot):
        self.robot, self.start, self.greetings = robot, robot.planner.start, 0

    def action(self, belief):
        if self.greetings == 2:
            return self.robot.domain.report_action(self.robot.domain.marginal(belief).most_likely())
        self.greetings += 1
        return "greet"

    def update(self, belief, action, observation):
        return self.robot.planner.update(belief, action, observation)

def greet_twice(robot):
    return replace(robot, planner=Greeter(robot))

def coin(robot, rng):
    return greet_twice(robot) if rng.random() < 0.5 else robot

class Patient:
    name = "patient"
    def robot(self, full):
        return greet_twice(full)

patient = Patient()
unseeded = numpy.random.default_rng(0)

def moody(robot):
    robot = greet_twice(robot)
    robot.planner.greetings = unseeded.integers(2)
    return robot
"""


def parts(place):
    domain = load_domain(place)
    channels = {sense.name: NoisyChannel.from_domain(domain, sense) for sense in domain.senses}
    planner = planning.Planner(planning.solve(domain.pomdp, domain.start_beliefs()))
    return domain, Robot(channels, Reasoner(domain.program), planner, domain), channels


@pytest.fixture(scope="module")
def intention():
    return parts("intention")


@pytest.fixture(scope="module")
def rooms():
    return parts(ROOMS)


@pytest.fixture
def own(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    return f"{tmp_path / 'own.py'}:"


def test_strategies_are_found_by_their_names(own):
    found = find_strategies(["random", "lcorpp", f"{own}greet_twice", "ASK-TWICE", f"{own}patient"])
    assert [row.name for row in found] == ["LCORPP", "ask-twice", "random", "greet_twice", "patient"]
    assert [row.draws for row in found] == [False, False, True, False, False]
    assert find_strategies([]) == STRATEGIES
    assert [row.name for row in find_strategies([f"{own}coin"])] == ["coin"]
    assert find_strategies([f"{own}coin"])[0].draws
    assert [row.name for row in find_strategies(["random", "R"], [])] == ["R", "random"]


def test_the_light_table_has_the_name_of_every_strategy():
    assert tuple(row.name for row in STRATEGIES) == TABLE_NAMES
    assert tuple(row.name for row in WITH_TRUST) == TRUST_NAMES


def test_the_most_informative_action_is_the_question(intention):
    """Before the turn, `move_forward` is right with .9 and `greet` with .8; each less its entropy."""
    domain, _, _ = intention
    belief = np.array([0.5, 0.5, 0, 0, 0])
    information = dict(zip(domain.pomdp.actions, compute_information(domain, belief), strict=True))
    for action, p in (("move_forward", 0.9), ("greet", 0.8)):
        expected = np.log(2) + p * np.log(p) + (1 - p) * np.log(1 - p)
        assert information[action] == pytest.approx(expected, abs=1e-12)
    assert information["report_interested"] == 0
    assert compute_information(domain, np.array([0.0, 0, 0, 0, 1])) == pytest.approx(0)


def test_ask_twice_asks_two_questions(intention):
    """Both are `move_forward`, at a cost of 4; the answers of people are wrong with .3 whatever is asked."""
    domain, robot, channels = intention
    (scores,) = evaluate_exactly(domain, robot, channels, find_strategies(["ask-twice"]))
    assert (scores.cost.estimate, scores.cost_sd) == (pytest.approx(8), pytest.approx(0, abs=1e-6))
    certain = Strategy("certain", learns=True, reasons=True, plans=True).robot(robot)
    asking = find_strategies(["ask-twice"])[0].robot(certain)
    assert asking.planner.action(np.array([1.0, 0, 0, 0, 0])) == "report_interested"


def test_always_report_is_l_and_r(intention):
    domain, robot, channels = intention
    rows = find_strategies(["L+R", "always-report"])
    first, second = evaluate_exactly(domain, robot, channels, rows)
    np.testing.assert_array_equal(first.counts, second.counts)
    assert first.return_ == second.return_


def test_histories_and_beliefs_give_the_same_exact_scores(rooms):
    """Of robots that act by the belief alone, once by beliefs and once by histories."""
    domain, robot, channels = rooms
    rows = tuple(row for row in STRATEGIES if row.name in ("L+R", "P", "LCORPP"))
    unchanged = [replace(row, change=lambda robot: robot) for row in rows]
    by_belief = evaluate_exactly(domain, robot, channels, rows)
    by_history = evaluate_exactly(domain, robot, channels, tuple(unchanged))
    for one, other in zip(by_belief, by_history, strict=True):
        np.testing.assert_allclose(one.counts, other.counts, atol=1e-9)
        assert other.return_.estimate == pytest.approx(one.return_.estimate, abs=1e-7)
        assert other.cost_sd == pytest.approx(one.cost_sd, abs=1e-5)  # of rare, long decisions


def test_exact_scores_of_an_own_strategy_are_those_of_trials(intention, own):
    domain, robot, channels = intention
    rows = find_strategies([f"{own}greet_twice", "ask-twice"])
    exact = evaluate_exactly(domain, robot, channels, rows)
    simulated, _ = run_trials(Experiment(domain, robot, channels, channels, rows, 5), 500)
    for one, other in zip(exact, simulated, strict=True):
        assert other.cost.estimate == pytest.approx(one.cost.estimate)  # 2 greetings, or 2 steps forward
        width = other.return_.high - other.return_.low
        assert other.return_.estimate == pytest.approx(one.return_.estimate, abs=1.2 * width)  # 4.7 errors


def test_random_actions_depend_on_the_trial_alone(intention, own):
    domain, robot, channels = intention
    rows = find_strategies(["random", f"{own}coin"])
    experiment = Experiment(domain, robot, channels, channels, rows, 5)
    both, _ = run_trials(experiment, 150, jobs=1)
    again, _ = run_trials(replace(experiment, strategies=(*STRATEGIES[:1], *rows)), 150, jobs=2)
    other, _ = run_trials(replace(experiment, seed=6), 150)
    for k in (0, 1):
        np.testing.assert_array_equal(both[k].counts, again[k + 1].counts)
        assert both[k].return_ == again[k + 1].return_ != other[k].return_


def test_random_chooses_all_actions_equally(intention):
    domain, robot, _ = intention
    drawn = find_strategies(["random"])[0].robot(robot, np.random.default_rng(0)).planner
    actions = [drawn.action(domain.pomdp.start) for _ in range(5000)]
    for action in domain.pomdp.actions:
        assert actions.count(action) == pytest.approx(1000, abs=115)  # 4 standard errors


def test_a_strategy_that_draws_has_no_exact_scores(intention, own):
    domain, robot, channels = intention
    for name, words in (("random", "strategy 'random'"), (f"{own}coin", r"own\.py:21: strategy 'coin'")):
        rows = find_strategies([name])
        with pytest.raises(DecisionError, match=f"{words} draws its actions, so it has no exact scores"):
            evaluate_exactly(domain, robot, channels, rows)
        with pytest.raises(DecisionError, match="no exact scores"):  # before anything is solved
            compare_strategies(domain, ComparisonOptions(strategies=rows, trials=None))
    with pytest.raises(DecisionError, match="'coin' draws its actions; expected a random generator"):
        rows[0].robot(robot)
    with pytest.raises(DecisionError, match=r"own\.py:32: strategy 'moody': chose .* second parameter"):
        evaluate_exactly(domain, robot, channels, find_strategies([f"{own}moody"]))


@dataclass
class Remembering:
    """Greets three times, counting in a way that has a key or has none."""

    robot: Robot
    count: object

    @property
    def start(self):
        return self.robot.planner.start

    def action(self, belief):
        if next(self.count, None) is None:
            return self.robot.domain.report_action(self.robot.domain.marginal(belief).most_likely())
        return "greet"

    def update(self, belief, action, observation):
        return self.robot.planner.update(belief, action, observation)


class Countdown:
    """An iterator whose state is an attribute."""

    def __init__(self, rest):
        self.rest = rest

    def __next__(self):
        if not self.rest:
            raise StopIteration
        self.rest -= 1
        return self.rest


def test_histories_are_merged_only_if_the_state_is_known(intention):
    """The orders of equal answers end at one belief; of an iterator with unknown state none are merged."""
    domain, robot, channels = intention
    results, counts = [], []
    for make in (lambda: Countdown(3), lambda: iter(range(3))):
        nodes = decision_nodes.HistoryNodes(
            domain,
            robot,
            Strategy("s", True, True, True, change=lambda r, m=make: replace(r, planner=Remembering(r, m()))),
            channels,
        )
        level = {nodes.root({"time": "morning", "location": "library"}, {"motion": "interested"})}
        for _ in range(3):
            level = {
                after
                for node, action in zip(level, nodes.find_actions(list(level)), strict=True)
                for after in nodes.extend([node] * 2, [action] * 2, ["pos", "neg"])
            }
            counts.append(len(level))
        results.append(sorted(nodes.find_actions(list(level))))
    assert counts == [2, 3, 4, 2, 4, 8]
    assert set(results[0]) == set(results[1]) == {"report_interested", "report_not_interested"}


def test_keys_of_states():
    def count():
        total = 0

        def add(step):
            nonlocal total
            total += step
            return total

        return add

    first, second, shared = count(), count(), object()
    key = make_state_key(first, ())
    assert make_state_key(second, ()) == key
    first(1)
    assert make_state_key(first, ()) != key
    for one, other in (
        ([1, 2], (1, 2)),
        ({"a": 1}, {"a": 2}),
        (np.array([0.5, 0.5]), np.array([0.25, 0.75])),
        (True, 1),
        ({1, 2}, {1, 3}),
        (Countdown(1), Countdown(2)),
        (Countdown(1).__next__, Countdown(2).__next__),
    ):
        assert make_state_key(one, ()) == make_state_key(one, ()) != make_state_key(other, ())
    assert make_state_key(np.array([0.1 + 0.2]), ()) == make_state_key(np.array([0.3]), ())
    assert make_state_key([shared], {id(shared)}) == ("list", id(shared))
    endless = [1]
    endless.append(endless)
    for value in (iter([1]), shared, np.random.default_rng(0), random.Random(0), endless):
        with pytest.raises(NoKeyError):
            make_state_key(value, ())


def test_too_many_histories_are_refused(intention, own, monkeypatch):
    domain, robot, channels = intention
    monkeypatch.setattr(decision_nodes, "MAX_ACTIONS", 10)
    with pytest.raises(
        DecisionError, match=r"'greet_twice': more than 10 actions in all histories .* simulated"
    ):
        evaluate_exactly(domain, robot, channels, find_strategies([f"{own}greet_twice"]))


def test_a_strategy_without_reports_has_no_exact_scores(intention, monkeypatch):
    domain, robot, channels = intention
    monkeypatch.setattr(episode_sums, "MAX_STEPS", 1)
    words = r"strategy 'LCORPP': no report after 1 actions; .* from the prior interested: 0\.\d+, not_"
    with pytest.raises(NoReportError, match=words):
        evaluate_exactly(domain, robot, channels, find_strategies(["LCORPP"]))


def test_unlikely_episodes_are_dropped_with_bounds(intention, monkeypatch):
    domain, robot, channels = intention
    rows = find_strategies(["R+P", "LCORPP"])
    exact = evaluate_exactly(domain, robot, channels, rows)
    monkeypatch.setattr(episode_totals, "MAX_SIZE", 0)
    monkeypatch.setattr(episode_sums, "MAX_POINTS", 1000)
    for full, part in zip(exact, evaluate_exactly(domain, robot, channels, rows), strict=True):
        for name, interval in part.metrics.items():
            assert interval.low < full.metrics[name].estimate < interval.high, name
            assert interval.low <= interval.estimate <= interval.high
            assert interval.confidence == 1
        assert part.f1.high - part.f1.low < 0.01
    monkeypatch.setattr(episode_sums, "MAX_POINTS", 300)
    for full, part in zip(exact, evaluate_exactly(domain, robot, channels, rows), strict=True):
        assert part.return_.low < full.return_.estimate < part.return_.high
        assert part.f1.low < full.f1.estimate < part.f1.high


def test_the_likeliest_points_are_continued_first(intention, monkeypatch):
    """Many small batches find what whole levels find; few points find bounds of it."""
    domain, robot, channels = intention
    rows = find_strategies(["P", "R+P", "L+P", "LCORPP"])
    exact = evaluate_exactly(domain, robot, channels, rows)
    monkeypatch.setattr(episode_totals, "MAX_SIZE", 0)
    monkeypatch.setattr(episode_sums, "MIN_BATCH", 10)
    monkeypatch.setattr(episode_sums, "MAX_LEFT", 1e-12)
    widths = []
    for max_points in (100, 1000, 100_000):
        monkeypatch.setattr(episode_sums, "MAX_POINTS", max_points)
        found = evaluate_exactly(domain, robot, channels, rows)
        for full, part in zip(exact, found, strict=True):
            for name, interval in part.metrics.items():
                exact_value = full.metrics[name].estimate  # branches below MIN_BRANCH are in neither
                assert interval.low - 1e-7 <= exact_value <= interval.high + 1e-7, name
        widths.append(max([part.accuracy.high - part.accuracy.low for part in found]))
    assert 0.2 > widths[0] > 5 * widths[1] > 1e4 * widths[2]


def test_a_strategy_that_fails_leaves_the_others_their_scores(intention, own, monkeypatch, lcorpp, tmp_path):
    domain, robot, channels = intention
    (alone,) = evaluate_exactly(domain, robot, channels, find_strategies(["R+P"]))
    monkeypatch.setattr(decision_nodes, "MAX_ACTIONS", 10)
    options = ("--exact", "--strategy", "R+P", "--strategy", f"{own}greet_twice", "--out", tmp_path / "out")
    command = ("run", "intention", "--no-cache", "--classifier", "channel")
    ended = lcorpp(*command, *options)
    assert ended.code == 0
    words = " ".join(ended.err.split())
    assert re.search(
        r"warning: .*greet_twice has no exact scores: .* more than 10 actions in all hist", words
    )
    written = json.loads((tmp_path / "out" / "results.json").read_text())
    (kept,) = written["strategies"]
    assert kept["return"] == pytest.approx(alone.return_.estimate)
    (reason,) = written["failures"].values()
    assert "more than 10 actions in all histories" in reason
    failed = lcorpp(*command, "--exact", "--strategy", f"{own}greet_twice")
    assert (failed.code, "more than 10 actions" in failed.err) == (2, True)
    monkeypatch.setattr(episode_totals, "MAX_SIZE", 0)
    for max_points, is_noted in ((1000, False), (50, True)):
        monkeypatch.setattr(episode_sums, "MAX_POINTS", max_points)
        printed = lcorpp(*command, "--exact", "--strategy", "R+P").out
        assert ("not enumerated are R+P " in printed) is is_noted


BAD = """
from dataclasses import replace

def nothing(robot):
    pass

def fails(robot):
    return 1 / 0

class Planner:
    start = None
    def __init__(self, planner, result):
        self.start, self.update, self.result = planner.start, planner.update, result
    def action(self, belief):
        return self.result if isinstance(self.result, (str, type(None))) else belief[self.result]

def unknown(robot):
    return replace(robot, planner=Planner(robot.planner, "dance"))

def silent(robot):
    return replace(robot, planner=Planner(robot.planner, None))

def breaks(robot):
    return replace(robot, planner=Planner(robot.planner, 99))

def endless(robot):
    return replace(robot, planner=Planner(robot.planner, "greet"))

def no_part(robot):
    return replace(robot, planner="plan")

VALUE = 3
"""


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nothing", r"own\.py:4: strategy 'nothing' returned None; expected a Robot"),
        ("fails", r"own\.py:8: fails\(\) failed: ZeroDivisionError"),
        (
            "unknown",
            r"own\.py:14: strategy 'unknown': action\(\) returned 'dance'; expected one of move_forward, ",
        ),
        (
            "silent",
            r"own\.py:14: strategy 'silent': action\(\) returned None; expected one of move_forward, ",
        ),
        ("breaks", r"own\.py:15: strategy 'breaks' failed: IndexError"),
        ("endless", r"own\.py:26: strategy 'endless': no report after 500 actions; the last one was 'greet'"),
        ("no_part", r"own\.py:30: no_part\(\) failed: DecisionError: the planner of a robot is 'plan'"),
    ],
)
def test_a_strategy_that_is_wrong_is_named(intention, tmp_path, name, words):
    (tmp_path / "own.py").write_text(BAD)
    domain, robot, channels = intention
    rows = find_strategies([f"{tmp_path / 'own.py'}:{name}"])
    with pytest.raises(DecisionError, match=words):
        run_trials(Experiment(domain, robot, channels, channels, rows, 5), 1)
    if name != "endless":
        with pytest.raises(DecisionError, match=words):
            evaluate_exactly(domain, robot, channels, rows)


def test_names_that_are_wrong(tmp_path, own):
    (tmp_path / "bad.py").write_text(BAD + "class Named:\n    name = 3\n    robot = print\nnamed = Named()\n")
    for names, words in (
        (["nobody"], "unknown strategy 'nobody'; expected one of L, R, .* ask-twice, random, always-report"),
        ([f"{tmp_path / 'bad.py'}:VALUE"], r"bad\.py has no function 'VALUE'; expected one of"),
        ([f"{tmp_path / 'bad.py'}:named"], r"the name of a strategy is 3; expected a text"),
        ([f"{tmp_path / 'none.py'}:x"], r"none\.py: there is no such file"),
        (
            [f"{own}patient", f"{own}patient"],
            r"own\.py:26: strategy 'patient': another strategy has this name",
        ),
    ):
        with pytest.raises(DecisionError, match=words):
            find_strategies(names)


def test_baselines_need_a_domain_with_a_model(intention):
    _, robot, _ = intention
    other = replace(robot, domain=FakeDomain())
    for row in BASELINES[:2]:
        with pytest.raises(DecisionError, match=f"the domain of the strategy '{row.name}' is"):
            row.robot(other, np.random.default_rng(0))
