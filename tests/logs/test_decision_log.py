"""The log of decisions: every number comes back, whole lines only, the same for any number of processes."""

import itertools
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from lcorpp.assembly.logged_parts import read_parts
from lcorpp.assembly.robot_parts import ClassifierPart, RobotParts, find_fingerprint, make_program
from lcorpp.assembly.solving import solve_domain
from lcorpp.assembly.strategies.baselines import find_strategies
from lcorpp.decision import LCORPP, STRATEGIES, strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DataError, DecisionError, DomainError, FileError
from lcorpp.experiments.comparison import ComparisonOptions, compare_strategies
from lcorpp.logs.decision_log import DecisionLog, LoggedDecision, format_decision, read_log
from lcorpp.logs.replay import ChangedPart, ReplayedDecision, compare, replay_log
from lcorpp.planning import read_policy, write_policy
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.scoring import trial_chunks
from lcorpp.values import ConfusionMatrix, Episode, Instance, Likelihood
from tests.domains.deliveries import GAZE, VOICE, write_domain

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"
NAMES = [row.name for row in STRATEGIES]
COUNTS = np.array([[8.0, 1.0, 1.0], [2.0, 5.0, 3.0], [0.0, 2.0, 8.0]])


@pytest.fixture(scope="module")
def rooms():
    """The parts of the rooms' robot, whose classifier is known by a confusion matrix."""
    domain = load_domain(ROOMS)
    confusion = ConfusionMatrix(domain.senses[0].classes, COUNTS)
    policy = solve_domain(domain).policy
    part = ClassifierPart("summaries", "0123", confusion)
    return RobotParts(domain, policy, {"heading": part}, solver=domain.planning.solver)


class Yes:
    """A world with one answer."""

    def act(self, action):
        return "yes"

    def report(self, action):
        pass


class Fixed:
    """A classifier with one output."""

    def __init__(self, label):
        self.label = label

    def classify(self, signal):
        return self.label


def decide(parts: RobotParts, label, context) -> Episode:
    robot = replace(parts.robot, classifiers={"heading": Fixed(label)})
    return trial_chunks.dt_control(robot, Instance({"heading": np.zeros((2, 4))}, context), Yes())


def write_log(path: Path, folder: Path, **options) -> list[dict]:
    domain = load_domain(folder)
    chosen = {"trials": 30, "seed": 7, "cache": find_cache_folder()} | options
    compare_strategies(domain, ComparisonOptions(log=path, **chosen))
    return read_lines(path)


def replay(path: Path) -> Iterator[ReplayedDecision | ChangedPart | DataError]:
    """Replay with the policies that the tests share."""
    return replay_log(path, cache=find_cache_folder())


def read_lines(path: Path) -> list[dict]:
    """The lines of a log without the times, which differ from run to run."""
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    for line in lines:
        assert set(line.pop("seconds")) == {"classify", "reason", "plan"}
    return lines


@pytest.mark.parametrize(
    "label", ["lab", Likelihood(("lab", "office", "store"), np.array([0.1, 1 / 3, 0.7]))]
)
def test_every_number_comes_back(rooms, label):
    soft = isinstance(label, Likelihood)
    parts = replace(rooms, classifiers={"heading": replace(rooms.classifiers["heading"], soft=soft)})
    context = {"badge": "guest", "weekday": "monday"}
    episode = decide(parts, label, context)
    line = LoggedDecision(1, json.loads(format_decision(parts, LCORPP, context, episode)))
    back = line.read_episode(parts.domain)
    assert (line.strategy, line.context) == ({"name": "LCORPP"}, context)
    assert repr(back) == repr(episode)
    assert back.marginal.probabilities.tolist() == episode.marginal.probabilities.tolist()
    for old, new in zip(episode.steps, back.steps, strict=True):
        assert (old.action, old.observation, old.belief.tolist()) == (
            new.action,
            new.observation,
            new.belief.tolist(),
        )
    assert back.prior.tolist() == episode.prior.tolist()
    robot = read_parts(line.content["parts"], parts.domain).robot
    assert compare(back, robot, line) == []


def test_the_parts_come_back(rooms):
    hard = read_parts(json.loads(json.dumps(rooms.description)), rooms.domain)
    assert (
        hard.program
        == rooms.program
        == rooms.domain.program_for({"heading": rooms.classifiers["heading"].confusion})
    )
    assert hard.description == rooms.description
    soft = replace(rooms, classifiers={"heading": replace(rooms.classifiers["heading"], soft=True)})
    assert read_parts(soft.description, rooms.domain).program == rooms.domain.soft_program(["heading"])
    laplace = replace(rooms, smoothing=Fraction(1))
    assert read_parts(laplace.description, rooms.domain).program == laplace.program != rooms.program


def test_the_program_is_that_of_a_comparison(rooms):
    class Setup:
        confusion = rooms.classifiers["heading"].confusion

    for soft in (False, True):
        Setup.soft = soft
        part = replace(rooms.classifiers["heading"], soft=soft)
        parts = replace(rooms, classifiers={"heading": part}, smoothing=Fraction(1))
        assert parts.program == make_program(rooms.domain, {"heading": Setup()}, Fraction(1))


def test_a_log_is_the_same_for_any_number_of_processes(tmp_path):
    one = write_log(tmp_path / "one", ROOMS, trials=120, jobs=1)
    two = write_log(tmp_path / "two", ROOMS, trials=120, jobs=2)
    assert one == two
    assert [line["simulated"]["trial"] for line in one] == [i // len(NAMES) for i in range(120 * len(NAMES))]
    assert [line["strategy"]["name"] for line in one[: len(NAMES)]] == NAMES
    assert all(line["simulated"]["truth"]["goal"] in ("lab", "office", "store") for line in one)


def test_a_log_does_not_change_the_scores(tmp_path):
    domain = load_domain(ROOMS)
    plain = compare_strategies(domain, ComparisonOptions(trials=120, seed=2))
    logged = compare_strategies(domain, ComparisonOptions(trials=120, seed=2, log=tmp_path / "log"))
    assert [repr(row) for row in plain.scores] == [repr(row) for row in logged.scores]


def test_an_interrupt_keeps_the_decisions_of_the_complete_trials(tmp_path, monkeypatch):
    whole = write_log(tmp_path / "whole", ROOMS, trials=120)
    honest, calls = trial_chunks.dt_control, itertools.count(1)

    def interrupt(robot, instance, world):
        if next(calls) > 110 * len(NAMES) + 4:
            raise KeyboardInterrupt
        return honest(robot, instance, world)

    monkeypatch.setattr(trial_chunks, "dt_control", interrupt)
    assert write_log(tmp_path / "part", ROOMS, trials=120) == whole[: 110 * len(NAMES)]


def test_an_error_keeps_the_decisions_before_it(tmp_path, monkeypatch):
    honest, calls = trial_chunks.dt_control, itertools.count(1)

    def fail(robot, instance, world):
        if next(calls) > 2 * len(NAMES):
            raise DecisionError("the robot is broken")
        return honest(robot, instance, world)

    monkeypatch.setattr(trial_chunks, "dt_control", fail)
    with pytest.raises(DecisionError, match="broken"):
        write_log(tmp_path / "log", ROOMS)
    assert len(read_lines(tmp_path / "log")) == 2 * len(NAMES)


def test_a_cut_line_does_not_damage_the_next(tmp_path):
    log = tmp_path / "log"
    strategy = strategies(["LCORPP"])
    write_log(log, ROOMS, trials=2, strategies=strategy)
    log.write_bytes(log.read_bytes()[:-300])
    compare_strategies(load_domain(ROOMS), ComparisonOptions(trials=3, log=log, strategies=strategy))
    lines = list(read_log(log))
    assert [isinstance(line, LoggedDecision) for line in lines] == [True, False, True, True, True]
    assert str(lines[1]).startswith(f"{log}:2: not a decision: it is damaged, not JSON: ")


def test_lines_that_are_no_decisions_are_located(tmp_path):
    log = tmp_path / "log"
    log.write_bytes(
        b'\n[1]\n{"format": "other"}\n{"format": "lcorpp decision", "version": 7}\n\xff\n' + b"[" * 9999
    )
    messages = [str(line).removeprefix(f"{log}:") for line in read_log(log)]
    damaged = "not a decision: it is damaged"
    assert (
        messages[0] == f'2: {damaged} or of another kind; expected an object with "format": "lcorpp decision"'
    )
    assert messages[1] == "3: not a decision: its format is 'other'; expected 'lcorpp decision'"
    assert messages[2] == "4: not a decision: its version is 7; this lcorpp reads version 1"
    assert messages[3].startswith(f"5: {damaged}, not JSON: ")
    assert messages[4].endswith("; the line is cut")
    with pytest.raises(FileError, match="missing: cannot be read: No such file"):
        list(read_log(tmp_path / "missing"))


@pytest.mark.parametrize("name", ["", "missing/log", "file/log"])
def test_a_log_that_cannot_be_written_is_refused_before_the_work(tmp_path, name):
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="cannot be written"):
        DecisionLog(tmp_path / name)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
def test_a_full_disk_is_noticed_before_the_work():
    with pytest.raises(FileError, match="/dev/full: cannot be written: No space left on device"):
        DecisionLog(Path("/dev/full"))


def test_of_a_line_that_does_not_fit_nothing_remains(tmp_path, monkeypatch):
    log = DecisionLog(tmp_path / "log")
    log.append_lines([b"one\n"])

    class Full:
        """A file that takes two more bytes."""

        def __init__(self, file):
            self.file, self.left = file, 2

        def write(self, data):
            if not self.left:
                raise OSError(28, "No space left on device")
            self.left -= 2
            return self.file.write(data[:2])

        def __getattr__(self, name):
            return getattr(self.file, name)

    monkeypatch.setattr(log, "_file", Full(log._file))
    with pytest.raises(FileError, match="No space left"):
        log.append_lines([b"two\n"])
    log.close()
    assert (tmp_path / "log").read_bytes() == b"one\n"


def test_exact_scores_have_no_log(tmp_path):
    with pytest.raises(DomainError, match="exact scores are computed without decisions"):
        compare_strategies(load_domain(ROOMS), ComparisonOptions(trials=None, log=tmp_path / "log"))
    assert not (tmp_path / "log").exists()


def test_a_replay_finds_no_differences_in_any_domain(tmp_path):
    """All strategies, with one and with several shared variables and senses."""
    write_log(tmp_path / "rooms", ROOMS)
    write_log(tmp_path / "deliveries", write_domain(tmp_path / "domain", senses=GAZE + VOICE))
    for name in ("rooms", "deliveries"):
        results = list(replay(tmp_path / name))
        assert len(results) in (30 * len(NAMES), 30 * (len(NAMES) + 2))
        assert all(isinstance(result, ReplayedDecision) and not result.differences for result in results)


def test_baselines_and_own_strategies_are_replayed(tmp_path):
    """Also those that draw their actions: the seed is in the log."""
    own, log = tmp_path / "own.py", tmp_path / "log"
    own.write_text(
        "from dataclasses import replace\n"
        "class Planner:\n"
        "    def __init__(self, full): self.full, self.start, self.update = full, full.start, full.update\n"
        "    def action(self, belief): return 'to_lab' if belief[0] > 0.3 else self.full.action(belief)\n"
        "def hasty(robot): return replace(robot, planner=Planner(robot.planner))\n"
    )
    chosen = find_strategies(["ask-twice", "random", "always-report", f"{own}:hasty"], ["heading"])
    write_log(log, ROOMS, strategies=chosen)
    results = list(replay(log))
    assert [result.strategy for result in results[:4]] == [strategy.name for strategy in chosen]
    assert len(results) == 4 * 30
    assert not any(result.differences for result in results)
    own.write_text(own.read_text().replace("to_lab", "to_store"))
    results = list(replay(log))
    assert results.pop(3) == ChangedPart(4, f"strategy hasty: {own}:hasty")
    different = {result.strategy for result in results if result.differences}
    assert different == {"hasty"}
    own.write_text(own.read_text().replace("belief[0]", "belief['lab']"))
    errors = [result for result in replay(log) if isinstance(result, DataError)]
    assert len(errors) == 30
    assert str(errors[0]).startswith(f"{log}:4: cannot be replayed: {own}:4: strategy 'hasty'")


@pytest.fixture
def change_and_replay(tmp_path):
    """A copy of the rooms, a log of decisions in it, and a function that changes a file and replays."""
    folder = shutil.copytree(ROOMS, tmp_path / "rooms")
    write_log(tmp_path / "log", folder)

    def change(file, old, new):
        text = (folder / file).read_text()
        assert old in text
        (folder / file).write_text(text.replace(old, new))
        results = list(replay(tmp_path / "log"))
        parts = [result.what for result in results if isinstance(result, ChangedPart)]
        if parts:
            assert isinstance(results[0], ChangedPart)
        differences = [
            d for result in results if isinstance(result, ReplayedDecision) for d in result.differences
        ]
        errors = [str(result) for result in results if isinstance(result, DataError)]
        return [part.replace(f"{folder}/", "") for part in parts], differences, errors

    return change


def test_changed_knowledge_is_named(change_and_replay):
    text = (ROOMS / "badges.plog").read_text()
    line = next(line for line in text.splitlines() if "pr(goal=" in line)
    parts, differences, errors = change_and_replay(
        "badges.plog", line, line[: line.rindex("=") + 1] + " 1/100."
    )
    assert parts == ["knowledge: badges.plog"]
    assert any(d.startswith("marginal of lab: ") for d in differences)
    assert any(d.startswith("prior: differs by ") for d in differences)
    assert errors == []


def test_a_comment_in_the_knowledge_changes_nothing(change_and_replay):
    text = (ROOMS / "badges.plog").read_text()
    assert change_and_replay("badges.plog", text, f"% a comment\n{text}") == ([], [], [])


def test_a_changed_model_is_named(change_and_replay):
    text = (ROOMS / "guide.pomdp").read_text()
    discount = next(line for line in text.splitlines() if line.startswith("discount"))
    parts, _, errors = change_and_replay("guide.pomdp", discount, "discount: 0.5")
    assert parts == ["model: guide.pomdp"]
    assert errors == []


def test_a_changed_policy_option_is_named(change_and_replay):
    parts, differences, errors = change_and_replay(
        "domain.toml", "[planning]", "[planning]\nprecision = 1000"
    )
    assert parts == ["domain: domain.toml"]
    assert any(d.startswith("action ") for d in differences)
    assert errors == []


def test_a_domain_that_is_broken_now_is_an_error_of_each_line(change_and_replay):
    parts, differences, errors = change_and_replay("domain.toml", 'terminal = "gone"', 'terminal = "left"')
    assert parts == differences == []
    assert len(errors) == 30 * len(NAMES)
    assert "log:1: cannot be replayed: " in errors[0]
    assert "has no state 'left'" in errors[0]


def test_a_changed_classifier_and_policy_file_are_named(rooms, tmp_path):
    stored, policy_file, log = tmp_path / "own.npz", tmp_path / "own.policy", tmp_path / "log"
    stored.write_bytes(b"one")
    write_policy(rooms.policy, policy_file)
    part = ClassifierPart.of(str(stored), None, confusion=rooms.classifiers["heading"].confusion)
    policy = read_policy(policy_file, rooms.domain.pomdp)
    parts = RobotParts(rooms.domain, policy, {"heading": part}, policy_file=policy_file)
    context = {"badge": "guest"}
    with DecisionLog(log) as decisions:
        decisions.append(parts, LCORPP, context, decide(parts, "lab", context))
    (result,) = replay(log)
    assert isinstance(result, ReplayedDecision)
    assert result.differences == ()
    stored.write_bytes(b"two")
    (alphas,) = policy.vector_sets
    write_policy(replace(policy, vector_sets=(replace(alphas, vectors=alphas.vectors - 1),)), policy_file)
    *named, result = replay(log)
    assert [change.what for change in named] == [f"classifier of heading: {stored}", f"policy: {policy_file}"]
    assert result.differences == ()
    policy_file.unlink()
    *_, error = replay(log)
    assert f"{log}:1: cannot be replayed: {policy_file}: cannot be read" in str(error)


def test_a_policy_from_nowhere_cannot_be_set_up_again(rooms):
    parts = replace(rooms, solver=None)
    with pytest.raises(DecisionError, match="no file and no solver"):
        read_parts(parts.description, rooms.domain)


def test_fingerprints_of_sources(tmp_path):
    assert find_fingerprint("lstm") is find_fingerprint("package.module:function") is None
    assert find_fingerprint(str(tmp_path / "own.py:make")) == "missing"
    (tmp_path / "own.py").write_text("def make(): ...\n")
    assert find_fingerprint(str(tmp_path / "own.py:make")) not in (None, "missing")


def test_content_of_another_form_is_an_error_of_its_line(rooms, tmp_path):
    """Every field of a decision, left out or replaced by something else."""
    context = {"badge": "guest"}
    content = json.loads(format_decision(rooms, LCORPP, context, decide(rooms, "lab", context)))
    needed = ["strategy", "facts", "labels", "evidence", "marginal", "prior", "steps", "report", "parts"]
    damaged = []
    for name in needed:
        damaged += [{key: value for key, value in content.items() if key != name}]
        damaged += [{**content, name: other} for other in (7, "x", [[]], {"x": {"y": []}}, {"x": -1})]
    log = tmp_path / "log"
    log.write_text("".join(json.dumps(line) + "\n" for line in damaged))
    results = list(replay(log))
    assert len(results) == len(damaged)
    for number, result in enumerate(results, 1):
        if isinstance(result, DataError):
            assert str(result).startswith(f"{log}:{number}: cannot be replayed: ")
        else:
            assert result.differences
    left_out = results[::6]
    assert all("a field is missing" in str(result) for result in left_out)


@pytest.mark.parametrize("content", [b"\x89PNG\r\n", b"name,value\n", b'{"format": "other"}\n'])
def test_a_file_of_another_kind_is_left_as_it_is(tmp_path, content):
    path = tmp_path / "other"
    path.write_bytes(content)
    with pytest.raises(DataError, match="other: exists and is not a log of decisions"):
        DecisionLog(path)
    assert path.read_bytes() == content
