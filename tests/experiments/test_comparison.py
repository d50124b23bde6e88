"""A comparison is a value: scores, classifier and solution, with a short repr and an HTML table."""

from pathlib import Path

import pytest

from lcorpp.decision import strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DomainError
from lcorpp.experiments.comparison import ComparisonOptions, compare_strategies
from lcorpp.experiments.setup import TrainingOptions

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"


def test_a_comparison_prints_nothing_and_returns_everything(capsys):
    options = ComparisonOptions(strategies(["L", "LCORPP"]), trials=None)
    comparison = compare_strategies(load_domain(ROOMS), options)
    assert [scores.strategy for scores in comparison.scores] == ["L", "LCORPP"]
    assert comparison.trials is None
    assert comparison.solution is not None
    assert comparison.classifier.trained is None
    assert len(repr(comparison).splitlines()) == 3
    assert comparison._repr_html_().count("<tr>") == 3
    assert repr(comparison.classifier).startswith("<ClassifierSetup channel; recall: lab ")
    assert capsys.readouterr() == ("", "")


def test_exact_scores_need_a_channel():
    with pytest.raises(DomainError, match="exact scores require the noisy channel"):
        compare_strategies(load_domain(ROOMS), ComparisonOptions(classifier=TrainingOptions(), trials=None))
