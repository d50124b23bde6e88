"""Models from logs of decisions: what people answered determines rates and knowledge, without true values."""

import json
import shutil

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.decision import strategies
from lcorpp.errors import DataError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.model_learning import estimate_return, format_report, learn_from_log, write_model

ORDER = ["identity < time, location, intention < classifier"]


def write_log(path, strategy="LCORPP", trials=1000, seed=0, noise=0.3):
    domain = load_domain("intention", changes={"simulation": {"noise": noise}})
    compare_strategies(domain, ComparisonOptions(strategies([strategy]), trials=trials, seed=seed, log=path))
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "people.jsonl")


def read_rates(parameters):
    """Return P(answer is right) of move_forward and greet, for people who are interested and who are not."""
    own = parameters.observation
    return np.array([own[0, 0, 0], own[0, 2, 1], own[1, 0, 0], own[1, 2, 1]])


def test_rates_of_answers_and_the_hidden_identity_are_found(log):
    learnt = learn_from_log(log, hidden={"identity": ("a", "b", "c")}, order=ORDER, draws=20)
    assert learnt.episodes.action_names[:2] == ("move_forward", "greet")
    assert learnt.episodes.observation_names[:2] == ("pos", "neg")
    assert read_rates(learnt.model.parameters) == pytest.approx(np.full(4, 0.7), abs=0.08)
    structure = learnt.knowledge.structure
    assert structure["intention"] == structure["time"] == structure["location"] == ("identity",)
    assert structure["classifier"] == ("intention",)


def test_wrong_rates_are_corrected(tmp_path):
    """The model states answers that are right in .7 of the cases; they are in .85."""
    learnt = learn_from_log(write_log(tmp_path / "log.jsonl", noise=0.15), draws=1)
    assert read_rates(learnt.model.parameters)[:2] == pytest.approx([0.85, 0.85], abs=0.05)


def test_true_values_are_not_read(log, tmp_path):
    """Without what the simulation knows, and with it, the same is learnt."""
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    for line in lines:
        del line["simulated"]
    (tmp_path / "log.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    one, other = (learn_from_log(path, draws=2) for path in (log, tmp_path / "log.jsonl"))
    assert format_report(one) == format_report(other)


@pytest.mark.slow
def test_intervals_of_rates_cover_the_truth(tmp_path):
    """Bootstrap intervals of 20 logs of 300 people."""
    covered = []
    for seed in range(20):
        learnt = learn_from_log(write_log(tmp_path / f"{seed}.jsonl", trials=300, seed=seed), draws=60)
        low, high = learnt.find_interval(read_rates)
        covered += ((low <= 0.7) & (high >= 0.7)).tolist()
    assert 0.88 <= np.mean(covered) <= 0.99


def test_the_folder_of_a_log_is_a_domain_with_its_senses(log, tmp_path):
    learnt = learn_from_log(log, draws=2)
    write_model(tmp_path / "own", learnt)
    domain, stated = load_domain(tmp_path / "own"), load_domain("intention")
    assert domain.observed == ("time", "location")
    assert [sense.label_of for sense in domain.senses] == [stated.senses[0].label_of]
    assert domain.planning.reports == stated.planning.reports
    chosen = ComparisonOptions(strategies(["LCORPP"]), trials=None)
    (scores,) = compare_strategies(domain, chosen).scores
    assert scores.accuracy.low > 0.8


def test_the_return_names_actions_without_a_step(log):
    """The learnt policy turns to people, which the robot of the log never did."""
    found = estimate_return(learn_from_log(log, draws=10))
    assert found.unseen == ("turn",)
    assert str(found).endswith(", if turn is as stated")
    assert found.unfollowed < 0.5
    assert found.solution.lower - 1e-3 <= found.estimate <= found.solution.upper + 1e-6


def test_what_a_log_does_not_show_is_as_stated(log):
    learnt = learn_from_log(log, draws=2)
    report, stated = format_report(learnt), load_domain("intention").pomdp
    turn = learnt.episodes.action_names.index("turn")
    assert "## turn\n\n0 steps: as the domain states it, and not identifiable from these data." in report
    assert learnt.pomdp.reward[turn, 0] == stated.reward[stated.action_index("turn"), 0]
    transition = stated.transition.dense[stated.action_index("turn")]
    names = ("interested_not_turned", "interested_turned")
    one, other = (stated.states.index(name) for name in names)
    assert learnt.model.parameters.transition[turn, 0, 1] == pytest.approx(transition[one, other])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: [], "no decision; strategies in it: none"),
        (
            lambda lines: [line | {"steps": []} for line in lines],
            "no decision has an answer; expected some, as",
        ),
        (
            lambda lines: [line | {"facts": {"time": "noon"}} for line in lines],
            "no decision has an answer: time is noon; expected one of morning, afternoon, evening",
        ),
        (lambda lines: [line | {"parts": {}} for line in lines], "cannot be read: a field is missing"),
    ],
)
def test_logs_without_answers_are_refused(log, tmp_path, change, message):
    lines = [json.loads(line) for line in log.read_text().splitlines()[:20]]
    own = tmp_path / "own.jsonl"
    own.write_text("".join(json.dumps(line) + "\n" for line in change(lines)))
    with pytest.raises(DataError, match=message):
        learn_from_log(own)


def test_damaged_lines_are_left_out_and_named(log, tmp_path):
    lines = log.read_text().splitlines()[:200]
    broken = json.loads(lines[7])
    broken["steps"][0]["action"] = "sing"
    own = tmp_path / "own.jsonl"
    own.write_text("\n".join([lines[0][:50], *lines[:7], json.dumps(broken), *lines[8:]]) + "\n")
    report = format_report(learn_from_log(own, draws=2))
    assert "- 1 decisions are left out: " in report


def test_answers_that_the_domain_excludes_are_left_out(log, tmp_path):
    """A domain in which interested people always answer well, and others never do."""
    folder = tmp_path / "strict"
    shutil.copytree(load_domain("intention").folder, folder, ignore=shutil.ignore_patterns("__pycache__"))
    model = folder / "interaction.pomdp"
    lines = model.read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("O: move_forward"))
    states = load_domain("intention").pomdp.states
    rows = ["1 0 0" if state.startswith("interested") else "0 1 0" for state in states[:-1]] + ["0 0 1"]
    lines[start + 1 : start + 1 + len(rows)] = rows
    model.write_text("\n".join(lines) + "\n")
    learnt = learn_from_log(log, folder=folder, draws=1)
    (reason,) = learnt.stated.skipped
    assert reason == "the domain excludes its answers"
    assert 100 < learnt.stated.skipped[reason] < 1000


def test_the_command_and_its_options(log, lcorpp, tmp_path):
    ended = lcorpp("model", log, "-o", tmp_path / "own", "--hidden", "identity=2")
    assert ended.code == 0, ended.err
    assert "4 states: interested_1, interested_2, not_interested_1, not_interested_2" in ended.out
    wrong = lcorpp("model", log, "-o", tmp_path / "other", "--reports", "report_{intention}")
    assert wrong.code == 2
    assert "has decisions; expected no --reports, which is for others" in wrong.err
    wrong = lcorpp("model", log, "-o", tmp_path / "other", "--strategy", "P")
    assert "no decision of P; strategies in it: LCORPP" in wrong.err
    wrong = lcorpp("model", log, "-o", tmp_path / "other", "--hidden", "identity")
    assert "--hidden is 'identity'; expected NAME=VALUES with two or more, or NAME=2" in wrong.err
    assert not (tmp_path / "other").exists()
