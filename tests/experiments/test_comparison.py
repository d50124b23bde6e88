"""A comparison is a value: scores, classifier and solution, with a short repr and an HTML table."""

from dataclasses import replace
from pathlib import Path

import pytest

from lcorpp.assembly import (
    StoredOptions,
    TrainingOptions,
    load_trained,
    simulate_training_data,
    solve_domain,
    train_classifier,
)
from lcorpp.assembly.options import EvidenceOptions
from lcorpp.decision import strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DomainError, LcorppError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.experiments.comparison import set_up_experiment
from lcorpp.logs.replay import replay_log
from lcorpp.planning import Planner
from lcorpp.runs import run_active_learning
from lcorpp.scoring import Experiment, evaluate_exactly, run_trials
from lcorpp.values import EvidenceKind

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"


def test_a_comparison_prints_nothing_and_returns_everything(capsys):
    options = ComparisonOptions(strategies(["L", "LCORPP"]), trials=None)
    comparison = compare_strategies(load_domain(ROOMS), options)
    assert [scores.strategy for scores in comparison.scores] == ["L", "LCORPP"]
    assert comparison.trials is None
    assert comparison.solution is not None
    assert comparison.senses["heading"].trained is None
    assert len(repr(comparison).splitlines()) == 3
    assert comparison._repr_html_().count("<tr>") == 3
    assert "<caption>Scores of the strategies, exact</caption>" in comparison._repr_html_()
    assert repr(comparison.senses["heading"]).startswith("<SenseSetup channel; recall: lab ")
    assert capsys.readouterr() == ("", "")


def test_the_precision_is_reached_at_the_priors_of_soft_evidence():
    """Each person has another prior. The policy is made before the people are met, in one process."""
    domain, rows = load_domain("intention"), strategies(["L", "P", "L+P", "LCORPP"])
    training = TrainingOptions(learner="summaries", tracks=40)
    soft = EvidenceOptions({"motion": EvidenceKind("soft")})
    options = ComparisonOptions(rows, classifiers={"motion": training}, evidence=soft)
    experiment, *_ = set_up_experiment(domain, options)
    scores, _ = run_trials(experiment, 60)
    assert scores[0].gap is None
    assert all(0 < row.gap <= 5e-4 for row in scores[1:])
    starts = replace(experiment.robot, planner=Planner(solve_domain(domain)))
    before, _ = run_trials(replace(experiment, robot=starts), 60)
    assert min(before[2].gap, before[3].gap) > 0.1


@pytest.mark.slow
def test_the_gap_of_decisions_one_by_one_and_of_exact_ones(tmp_path):
    domain, rows = load_domain("museum"), strategies(["R+P", "LCORPP"])
    exact = compare_strategies(domain, ComparisonOptions(rows, trials=None))
    at_once = compare_strategies(domain, ComparisonOptions(rows, trials=15))
    logged = compare_strategies(domain, ComparisonOptions(rows, trials=15, log=tmp_path / "log.jsonl"))
    assert [row.gap for row in at_once.scores] == [row.gap for row in logged.scores]
    replayed = list(replay_log(tmp_path / "log.jsonl"))  # with the same policy, for every prior
    assert [line.differences for line in replayed] == [()] * 30
    for row, all_of_it in zip(at_once.scores, exact.scores, strict=True):
        assert 0 < row.gap <= all_of_it.gap <= 0.01


def test_a_policy_without_bounds_has_no_gap():
    domain = load_domain("intention")
    policy = replace(solve_domain(domain).policy, upper_bound=None)
    for trials in (10, None):
        options = ComparisonOptions(strategies(["P", "LCORPP"]), trials=trials)
        assert compare_strategies(domain, options, policy=policy).gap is None


def test_exact_scores_need_a_channel():
    with pytest.raises(DomainError, match="exact scores require the noisy channel"):
        ComparisonOptions(classifiers={"heading": TrainingOptions()}, trials=None)


def test_arguments_of_another_type_are_rejected_at_once():
    """The type is named before a file is read or a model is solved."""
    domain, options = load_domain(ROOMS), ComparisonOptions()
    calls = [
        (lambda: compare_strategies("rooms", options), "domain is 'rooms'; expected a Domain"),
        (lambda: compare_strategies(domain, {}), "options is {}; expected a ComparisonOptions"),
        (lambda: ComparisonOptions(strategies=("L",)), "strategies.0. is 'L'; expected a Strategy"),
        (lambda: ComparisonOptions(classifiers="lstm"), "classifiers is 'lstm'; expected a mapping"),
        (
            lambda: ComparisonOptions(classifiers={"motion": "lstm"}),
            "expected a TrainingOptions or a StoredOptions or None",
        ),
        (lambda: ComparisonOptions(trials=0), "`trials` must be at least 1, not 0"),
        (lambda: ComparisonOptions(trials=1e3), "trials is 1000.0; expected a whole number"),
        (lambda: ComparisonOptions(trials=None, jobs=-1), "`jobs` must be at least 1, not -1"),
        (lambda: ComparisonOptions(seed=-1), "`seed` must be at least 0, not -1"),
        (lambda: train_classifier(ROOMS, None, TrainingOptions()), "expected a Domain"),
        (lambda: load_trained(None, None, StoredOptions(ROOMS)), "domain is None; expected a Domain"),
        (lambda: simulate_training_data("rooms", None, 0), "expected a Domain"),
        (
            lambda: next(run_active_learning("rooms", None, None, None)),
            "domain is .rooms.; expected a Domain",
        ),
        (lambda: evaluate_exactly(domain, domain, {}, ()), "robot is .*; expected a Robot"),
        (lambda: run_trials("rooms", 10), "experiment is 'rooms'; expected an? Experiment"),
        (lambda: Experiment(domain, None, {}, {}, (), 0), "robot is None; expected a Robot"),
    ]
    for call, words in calls:
        with pytest.raises(LcorppError, match=words):
            call()
