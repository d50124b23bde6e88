"""The table of strategies: which parts are used, and the substitutes of the others."""

from dataclasses import dataclass

import numpy as np
import pytest

from lcorpp.decision import STRATEGIES, Robot, dt_control, strategies
from lcorpp.decision.strategies import list_strategies
from lcorpp.errors import DecisionError
from lcorpp.values import Likelihood
from tests.decision.fakes import (
    FakeClassifier,
    FakeDomain,
    FakePlanner,
    FakeReasoner,
    FakeWorld,
    make_instance,
)

FULL = {row.name: row for row in STRATEGIES}


def decide(name: str, index: int, sky: str = "grey", *answers: str):
    reasoner = FakeReasoner()
    robot = FULL[name].robot(Robot({"eyes": FakeClassifier()}, reasoner, FakePlanner(), FakeDomain()))
    return dt_control(robot, make_instance(index, sky), FakeWorld(*answers)), reasoner


def test_the_strategies_are_all_combinations_of_parts():
    """The six of the paper, and L+P."""
    assert list(FULL) == ["L", "R", "P", "L+R", "R+P", "L+P", "LCORPP"]
    assert len({(row.learns, row.reasons, row.plans) for row in STRATEGIES}) == 7


@pytest.mark.parametrize(("index", "label"), [(0, "yes"), (1, "no")])
def test_l_reports_the_label(index, label):
    episode, reasoner = decide("L", index)
    assert (episode.labels["eyes"], episode.report) == (label, label)
    assert (len(episode.steps), reasoner.queries) == (1, [])


@dataclass(frozen=True)
class LikelihoodClassifier:
    """A classifier that returns a likelihood."""

    weights: tuple[float, float]

    def classify(self, signal):
        return Likelihood(FakeDomain.values, self.weights)


def test_l_normalises_a_likelihood():
    robot = FULL["L"].robot(
        Robot({"eyes": LikelihoodClassifier((1, 4))}, FakeReasoner(), FakePlanner(), FakeDomain())
    )
    episode = dt_control(robot, make_instance(0), FakeWorld())
    assert (episode.labels["eyes"].most_likely(), episode.report) == ("no", "no")
    np.testing.assert_allclose(episode.marginal.probabilities, [0.2, 0.8])


def test_r_reports_the_most_likely_value_given_the_facts():
    episode, reasoner = decide("R", 1, "sunny")
    assert (episode.labels, episode.report) == ({}, "yes")
    assert reasoner.queries == [("wish", {"sky": "sunny"})]


def test_p_starts_where_its_model_starts():
    episode, reasoner = decide("P", 0, "sunny", "shake", "shake")
    assert (episode.labels, episode.marginal, reasoner.queries) == ({}, None, [])
    np.testing.assert_array_equal(episode.prior, FakePlanner.start)
    assert episode.report == "no"


def test_l_and_r_weigh_label_and_facts():
    episode, reasoner = decide("L+R", 1, "sunny")
    assert reasoner.queries == [("wish", {"sky": "sunny", "label": "no"})]
    assert (episode.report, len(episode.steps)) == ("no", 1)


def test_r_and_p_starts_from_the_facts():
    episode, _ = decide("R+P", 0, "sunny", "nod", "nod")
    assert episode.labels == {}
    assert episode.prior == pytest.approx([0.6, 0.4])
    assert episode.report == "yes"


def test_l_and_p_starts_from_the_rates_of_the_label():
    episode, reasoner = decide("L+P", 0, "sunny", "nod")
    # P(label=yes | value) is as 4 to 1 under the program, whatever the sky is
    np.testing.assert_allclose(episode.prior, [0.8, 0.2])
    assert all("sky" not in evidence for _, evidence in reasoner.queries)
    assert (episode.steps[0].action, episode.report) == ("ask", "yes")


def test_lcorpp_uses_all_parts():
    episode, _ = decide("LCORPP", 0, "sunny", "nod")
    assert (episode.labels["eyes"], episode.report) == ("yes", "yes")
    assert episode.prior == pytest.approx([0.8, 0.2])


def test_names_are_found_in_any_order_and_case():
    assert [row.name for row in strategies(["lcorpp", "r+p", "L"])] == ["L", "R+P", "LCORPP"]
    assert strategies([]) == STRATEGIES
    with pytest.raises(DecisionError, match=r"unknown strategy 'corpp'; expected one of L, R, P, L\+R"):
        strategies(["corpp"])


def test_without_senses_no_strategy_learns():
    assert [row.name for row in list_strategies([])] == ["R", "P", "R+P"]
    with pytest.raises(
        DecisionError, match=r"unknown strategy 'L' in a domain without classifiers; expected"
    ):
        strategies(["L"], [])


def test_with_several_senses_each_is_left_out_in_turn():
    rows = list_strategies(["eyes", "ears"])
    assert [row.name for row in rows[7:]] == ["LCORPP-eyes", "LCORPP-ears"]
    parts = {"eyes": FakeClassifier(), "ears": FakeClassifier()}
    full = Robot(parts, FakeReasoner(), FakePlanner(), FakeDomain())
    assert [list(row.robot(full).classifiers) for row in rows[6:]] == [["eyes", "ears"], ["ears"], ["eyes"]]
    assert [row.name for row in strategies(["lcorpp-EARS"], ["eyes", "ears"])] == ["LCORPP-ears"]


def test_a_sense_that_perceives_nothing_gives_no_label():
    robot = Robot(
        {"eyes": FakeClassifier(), "ears": FakeClassifier()}, FakeReasoner(), FakePlanner(), FakeDomain()
    )
    assert robot.classify(make_instance(1)) == {"eyes": "no"}


def test_the_full_strategy_has_two_names_and_one_name_needs_no_list():
    assert [row.name for row in strategies(["l+r+p"])] == ["LCORPP"]
    assert [row.name for row in strategies("R+P")] == ["R+P"]
    with pytest.raises(DecisionError, match="unknown strategy 'R\\+L'"):
        strategies("R+L")
