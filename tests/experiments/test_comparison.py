"""A comparison is a value: scores, classifier and solution, with a short repr and an HTML table."""

from pathlib import Path

import pytest

from lcorpp.decision import strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DomainError, LcorppError
from lcorpp.experiments import (
    ComparisonOptions,
    Experiment,
    StoredOptions,
    TrainingOptions,
    compare_strategies,
    evaluate_exactly,
    load_trained,
    run_active_learning,
    run_trials,
    simulate_training_data,
    train_classifier,
)

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
    assert repr(comparison.senses["heading"]).startswith("<SenseSetup channel; recall: lab ")
    assert capsys.readouterr() == ("", "")


def test_exact_scores_need_a_channel():
    options = ComparisonOptions(classifiers={"heading": TrainingOptions()}, trials=None)
    with pytest.raises(DomainError, match="exact scores require the noisy channel"):
        compare_strategies(load_domain(ROOMS), options)


def test_arguments_of_another_type_are_rejected_at_once():
    """The type is named before a file is read or a model is solved."""
    domain, options = load_domain(ROOMS), ComparisonOptions()
    calls = [
        (lambda: compare_strategies("rooms", options), "the domain is 'rooms'; expected Domain"),
        (lambda: compare_strategies(domain, {}), "`options` is {}; expected ComparisonOptions"),
        (lambda: ComparisonOptions(strategies=("L",)), "a strategy is 'L'; expected Strategy"),
        (lambda: ComparisonOptions(classifiers="lstm"), "`classifiers` is 'lstm'; expected Mapping"),
        (
            lambda: ComparisonOptions(classifiers={"motion": "lstm"}),
            "expected TrainingOptions or StoredOptions",
        ),
        (lambda: ComparisonOptions(trials=0), "`trials` must be at least 1, not 0"),
        (lambda: ComparisonOptions(trials=1e3), "`trials` is 1000.0; expected int"),
        (lambda: ComparisonOptions(trials=None, jobs=-1), "`jobs` must be at least 1, not -1"),
        (lambda: ComparisonOptions(seed=-1), "`seed` must be at least 0, not -1"),
        (lambda: train_classifier(ROOMS, None, TrainingOptions()), "expected Domain"),
        (lambda: load_trained(None, None, StoredOptions(ROOMS)), "the domain is None; expected Domain"),
        (lambda: simulate_training_data("rooms", None, 0), "expected Domain"),
        (
            lambda: next(run_active_learning("rooms", None, None, None)),
            "domain is .rooms.; expected a Domain",
        ),
        (lambda: evaluate_exactly(domain, domain, {}, ()), "the robot is .*; expected Robot"),
        (lambda: run_trials("rooms", 10), "the experiment is 'rooms'; expected Experiment"),
        (lambda: Experiment(domain, None, {}, {}, (), 0), "the robot .* is None; expected Robot"),
    ]
    for call, words in calls:
        with pytest.raises(LcorppError, match=words):
            call()
