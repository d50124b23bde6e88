"""The table of strategies: which parts are asked, and what stands in for those that are not."""

from dataclasses import dataclass

import numpy as np
import pytest

from lcorpp.decision import STRATEGIES, Robot, dt_control, strategies
from lcorpp.errors import DecisionError
from lcorpp.values import Likelihood
from tests.decision.fakes import Answers, Eyes, Mind, Plan, Words, seen

FULL = {row.name: row for row in STRATEGIES}


def decide(name: str, index: int, sky: str = "grey", *answers: str):
    mind = Mind()
    robot = FULL[name].robot(Robot(Eyes(), mind, Plan(), Words()))
    return dt_control(robot, seen(index, sky), Answers(*answers)), mind


def test_the_six_strategies_of_the_paper():
    assert list(FULL) == ["L", "R", "P", "L+R", "R+P", "LCORPP"]
    assert len({(row.learns, row.reasons, row.plans) for row in STRATEGIES}) == 6


@pytest.mark.parametrize(("index", "said"), [(0, "yes"), (1, "no")])
def test_l_takes_the_label_at_its_word(index, said):
    episode, mind = decide("L", index)
    assert (episode.label, episode.report, len(episode.steps), mind.asked) == (said, said, 1, [])


@dataclass(frozen=True)
class Weighing:
    """A classifier that says how likely what it saw is under each value."""

    weights: tuple[float, float]

    def classify(self, instance):
        return Likelihood(Words.values, self.weights)


def test_l_takes_a_likelihood_for_a_distribution():
    robot = FULL["L"].robot(Robot(Weighing((1, 4)), Mind(), Plan(), Words()))
    episode = dt_control(robot, seen(0), Answers())
    assert (episode.label.most_likely(), episode.report) == ("no", "no")
    np.testing.assert_allclose(episode.marginal.probabilities, [0.2, 0.8])


def test_r_reports_what_the_facts_make_likely():
    episode, mind = decide("R", 1, "sunny")
    assert (episode.label, episode.report) == (None, "yes")
    assert mind.asked == [("wish", {"sky": "sunny"})]


def test_p_starts_where_its_model_starts():
    episode, mind = decide("P", 0, "sunny", "shake", "shake")
    assert (episode.label, episode.marginal, mind.asked) == (None, None, [])
    np.testing.assert_array_equal(episode.prior, Plan.start)
    assert episode.report == "no"


def test_l_and_r_weigh_label_and_facts():
    episode, mind = decide("L+R", 1, "sunny")
    assert mind.asked == [("wish", {"sky": "sunny", "label": "no"})]
    assert (episode.report, len(episode.steps)) == ("no", 1)


def test_r_and_p_starts_from_the_facts():
    episode, _ = decide("R+P", 0, "sunny", "nod", "nod")
    assert episode.label is None
    assert episode.prior == pytest.approx([0.6, 0.4])
    assert episode.report == "yes"


def test_lcorpp_uses_all_parts():
    episode, _ = decide("LCORPP", 0, "sunny", "nod")
    assert (episode.label, episode.report) == ("yes", "yes")
    assert episode.prior == pytest.approx([0.8, 0.2])


def test_names_are_found_in_any_order_and_case():
    assert [row.name for row in strategies(["lcorpp", "r+p", "L"])] == ["L", "R+P", "LCORPP"]
    assert strategies([]) == STRATEGIES
    with pytest.raises(DecisionError, match=r"unknown strategy 'CORPP'; expected one of L, R, P, L\+R"):
        strategies(["corpp"])
