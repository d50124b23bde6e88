"""Trust: the mixture and its weights, asking, planning for noise, and the errors of its options."""

import numpy as np
import pytest

from lcorpp import load_robot
from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import Robot, dt_control
from lcorpp.errors import DecisionError
from lcorpp.trust import Trust, TrustOptions
from lcorpp.trust.asking import AskingPlanner, AskingRule
from lcorpp.values import Distribution, Likelihood, Step
from tests.decision.fakes import VALUES, FakeClassifier, FakeDomain, FakePlanner, FakeWorld, make_instance
from tests.trust.fakes import NOISES, AskDialogue, SkyReasoner, find_noisy_likelihoods, weigh_sources


def make_trust(reasoner=None, **options):
    dialogue = AskDialogue()
    return Trust(
        reasoner or SkyReasoner(), FakeDomain(), dialogue, FakePlanner(), options=TrustOptions(**options)
    ), dialogue


def steps(*observations):
    return [Step("ask", heard, np.array([0.5, 0.5])) for heard in observations]


def test_the_prior_is_the_mean_of_the_sources_at_first_with_a_larger_weight_of_the_knowledge():
    trust, _ = make_trust()
    stated = ("knowledge", "knowledge without labels", "label", "no evidence")
    assert trust.sources == (*stated, "learnt", "recent", "corrected")
    prior = trust.posterior("wish", {"sky": "sunny", "label": "yes"})
    known, facts, sensed = 0.72 / (0.72 + 0.03), 0.9, 0.8 / 1.1
    # without people, what is learnt knows the stated rates alone; corrected knowledge is knowledge
    others = (facts + sensed + 0.5 + 2 * sensed + known) / 6
    usual, noise = 0.4 * known + 0.6 * others, NOISES[1:].mean() / 2  # that share is without evidence
    assert prior["yes"] == pytest.approx((1 - noise) * usual + noise * 0.5, abs=1e-6)


def test_a_source_gains_by_the_probability_that_it_gave_to_the_answers():
    trust, _ = make_trust(share=0.0)
    evidence = {"sky": "sunny"}
    trust.learn(evidence, steps("nod"))
    # P(nod) by each source: P(nod | yes) P(yes) + P(nod | no) P(no)
    values = np.array([[p, 1 - p] for p in (0.9, 0.9, 0.5, 0.5, 0.5, 0.5, 0.9)])
    chances = (weigh_sources(7, 3) * (find_noisy_likelihoods(0) @ values.T)).sum(axis=0)
    np.testing.assert_allclose(trust.weights, chances / chances.sum())


def test_right_knowledge_keeps_its_weight_where_answers_are_nearly_random():
    """Answers are right with probability .52 instead of .75, so that few people prove nothing.

    Sources without evidence aside, which gain where answers are noisy.
    """
    weights = []
    for seed in range(20):
        rng, (trust, _) = np.random.default_rng(seed), make_trust()
        for _ in range(20):
            is_yes = rng.random() < 0.9
            heard = ["nod" if (rng.random() < 0.52) == is_yes else "shake" for _ in range(3)]
            trust.learn({"sky": "sunny"}, steps(*heard))
        own = dict(zip(trust.sources, trust.weights, strict=True))
        weights.append(own["knowledge"] / (1 - own["no evidence"]))
    assert np.mean(weights) > 0.33  # 0.31 if answers are judged by the stated and the estimated noise alone


def test_each_source_keeps_a_share():
    trust, _ = make_trust(SkyReasoner(sunny=0.999), share=0.01)
    for _ in range(200):
        trust.learn({"sky": "sunny"}, steps("shake", "shake"))
    assert trust.weights[0] >= 0.01 / 7
    assert trust.weights.sum() == pytest.approx(1)
    assert trust.posterior("wish", {"sky": "sunny"})["yes"] < 0.1


def test_knowledge_that_is_wrong_loses_and_knowledge_that_is_right_wins():
    for sunny, wins in ((0.9, True), (0.1, False)):
        rng, (trust, _) = np.random.default_rng(0), make_trust(SkyReasoner(sunny=sunny, grey=1 - sunny))
        for _ in range(300):
            sky = ("sunny", "grey")[int(rng.integers(2))]
            is_yes = rng.random() < (0.9 if sky == "sunny" else 0.1)
            heard = ["nod" if (rng.random() < 0.75) == is_yes else "shake" for _ in range(3)]
            trust.learn({"sky": sky}, steps(*heard))
        weight = dict(zip(trust.sources, trust.weights, strict=True))["knowledge"]
        assert (weight > 0.2) == wins
        assert f"<td>knowledge</td><td>{weight:.3f}</td>" in trust._repr_html_()
        assert repr(trust).startswith("<Trust after 300 people: ")
        assert trust.posterior("wish", {"sky": "sunny"})["yes"] == pytest.approx(0.9, abs=0.08)


def test_the_observation_model_is_estimated_and_the_next_planner_is_for_it():
    rng, (trust, dialogue) = np.random.default_rng(1), make_trust()
    for n in range(1000):
        is_yes = rng.random() < 0.5
        trust.learn({}, steps(*["nod" if (rng.random() < 0.6) == is_yes else "shake" for _ in range(4)]))
        assert len(dialogue.planned) == n + 1
        assert dialogue.planned[-1] is trust.tables
    assert trust.learnt.rows[0, 0] == pytest.approx(0.6, abs=0.05)
    mean = trust.used.source_weights.compute_mean_rows(trust.learnt.rows)
    np.testing.assert_allclose(trust.tables[0], mean, atol=0.01)  # weights change until the next fit


def test_every_kth_person_is_asked_while_the_stated_model_is_refuted():
    rule, wanted = AskingRule(TrustOptions(ask_every=2, min_asked=0), 0.1), list[int]()
    for n in range(8):
        wanted.append(rule.find_wanted(has_alternative=False, is_as_stated=n < 4))
        rule.add(1, 1, wanted[-1])
    assert wanted == [3, 0, 0, 0, 3, 0, 3, 0]


def test_the_planner_is_for_the_stated_model_until_the_answers_refute_it():
    trust, _ = make_trust(SkyReasoner(sunny=0.999))
    assert trust.used.is_as_stated
    for _ in range(30):
        trust.learn({"sky": "sunny"}, steps("nod", "shake", "nod", "shake"))
    assert not trust.used.is_as_stated


def test_people_are_asked_while_too_few_have_given_enough_answers():
    trust, _ = make_trust(SkyReasoner(sunny=0.999), ask_every=1000, ask_answers=3, min_asked=1.0)
    asked = []
    for _ in range(10):
        world = FakeWorld(*["nod"] * 9)
        robot = Robot({"eyes": FakeClassifier()}, trust, trust.make_planner(), FakeDomain())
        episode = dt_control(robot, make_instance(0, "sunny"), world)
        trust.learn(episode.evidence, episode.steps)
        asked.append(world.done.count("ask") >= 3)
    assert [n for n, is_asked in enumerate(asked) if is_asked] == [0, 2, 5]  # 1 < sqrt(2), 2 < sqrt(5)


def test_the_budget_of_added_questions_is_kept_and_used():
    """Each added question costs .1."""
    trust, _ = make_trust(SkyReasoner(sunny=0.999), ask_every=1, ask_answers=3, ask_budget=0.05)
    added = 0
    for n in range(1, 301):
        planner = trust.make_planner()
        assert isinstance(planner, AskingPlanner)
        robot = Robot({"eyes": FakeClassifier()}, trust, planner, FakeDomain())
        episode = dt_control(robot, make_instance(0, "sunny"), FakeWorld(*["nod"] * 9))
        trust.learn(episode.evidence, episode.steps)
        added += planner.added
        assert 0.1 * added <= trust.asking.spent + 1e-9
        assert trust.asking.spent <= 0.05 * min(n, 10 * n**0.5) + 1e-9
    assert trust.asking.spent > 0.05 * 10 * 300**0.5 - 0.3
    assert 0.1 * added > trust.asking.spent / 2


def test_people_are_asked_while_other_estimates_are_credible():
    trust, _ = make_trust(SkyReasoner(sunny=0.999), ask_every=1000, ask_answers=3, min_asked=0.0)
    trust.learn({"sky": "sunny"}, steps("nod"))
    asked = []
    for other in (None, trust.learnt.estimates, None):
        trust.learnt.alternative = other
        world = FakeWorld(*["nod"] * 9)
        dt_control(
            Robot({"eyes": FakeClassifier()}, trust, trust.make_planner(), FakeDomain()),
            make_instance(0, "sunny"),
            world,
        )
        asked.append(world.done.count("ask") >= 3)
    assert asked == [False, True, False]


def test_a_policy_that_never_reports_ends_with_the_most_probable_value():
    class Asker(FakePlanner):
        def action(self, belief):
            return "ask"

    trust, _ = make_trust()
    trust.used.planner = Asker()
    world = FakeWorld(*["shake"] * 200)
    robot = Robot({"eyes": FakeClassifier()}, trust, trust.make_planner(), FakeDomain())
    episode = dt_control(robot, make_instance(0, "sunny"), world)
    assert world.done.count("ask") == 100
    assert episode.report == "no"


def test_a_likelihood_counts_as_its_most_probable_label_in_what_is_learnt():
    trust, _ = make_trust()

    class Soft(SkyReasoner):
        def posterior(self, attribute, evidence):
            label = evidence.get("label")
            if isinstance(label, Likelihood):
                prior = super().posterior(attribute, {k: v for k, v in evidence.items() if k != "label"})
                weights = prior.probabilities * (self.rates @ label.weights)
                return Distribution(VALUES, weights / weights.sum())
            return super().posterior(attribute, evidence)

    trust, _ = make_trust(Soft())
    evidence = {"sky": "grey", "label": Likelihood(VALUES, [1.0, 0.2])}
    assert 0 < trust.posterior("wish", evidence)["yes"] < 1
    trust.learn(evidence, steps("nod"))
    assert trust.learnt.cases.labels.tolist() == [[0]]


def test_a_person_without_answers_changes_no_weight():
    trust, _ = make_trust(share=0.0)
    before = trust.weights
    trust.learn({"sky": "grey", "label": "no"}, [Step("say no", None, np.array([0.1, 0.9]))])
    np.testing.assert_allclose(trust.weights, before)
    assert trust.n_people == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"share": 1.0}, r"`share` of trust is 1\.0; expected from 0 to below 1"),
        ({"share": float("nan")}, "`share` of trust is nan"),
        ({"memory": 0}, "`memory` of trust is 0; expected positive"),
        ({"ask_every": -1}, "`ask_every` of trust is -1; expected at least 0"),
        ({"min_asked": -1.0}, "`min_asked` of trust is -1.0; expected at least 0"),
        ({"ask_budget": -1.0}, "`ask_budget` of trust is -1.0; expected at least 0"),
        ({"max_asked": -1.0}, "`max_asked` of trust is -1.0; expected at least 0"),
        ({"max_stated_loss": -0.1}, "`max_stated_loss` of trust is -0.1; expected at least 0"),
        ({"ask_answers": 0}, "`ask_answers` of trust is 0; expected at least 1"),
        ({"refits": 0}, "`refits` of trust is 0; expected at least 1"),
        ({"iterations": 0}, "`iterations` of trust is 0; expected at least 1"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(DecisionError, match=message):
        TrustOptions(**options)


def test_trust_predicts_the_shared_variable_only():
    trust, _ = make_trust()
    with pytest.raises(DecisionError, match="trust predicts 'wish', not 'sky'"):
        trust.posterior("sky", {})


def test_a_prediction_does_not_depend_on_earlier_ones_with_the_same_label(monkeypatch):
    """The last context is that of all further facts."""
    monkeypatch.setattr("lcorpp.trust.sources.learnt.MAX_CONTEXTS", 1)
    (trust, _), (fresh, _) = make_trust(), make_trust()
    trust.posterior("wish", {"sky": "sunny", "label": "yes"})
    grey = {"sky": "grey", "label": "yes"}
    assert trust.posterior("wish", grey)["yes"] == fresh.posterior("wish", grey)["yes"]


def test_forms_with_some_weight_are_mixed_in_predictions():
    robot = load_robot("intention", cache=False).robot
    trust = set_up_trust(robot.domain, robot.reasoner, robot.planner)
    facts = {"time": "afternoon", "location": "classroom"}
    for _ in range(10):
        trust.learn(facts, 3 * [Step("move_forward", "neg", robot.planner.start)])
    marginals = np.array([trust.predict("intention", facts, own)[1].marginal for own in trust._learners])
    weights = np.array([0.5, 0.3, 0.15, 0.05])
    trust.form_weights = weights
    kept = np.where(weights >= 0.1, weights, 0)
    found = trust.posterior("intention", facts).probabilities
    np.testing.assert_allclose(found, kept @ marginals / kept.sum())
    assert np.ptp(marginals[:, 0]) > 1e-6
