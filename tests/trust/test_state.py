"""The state of trust: a restart goes on exactly, whatever was condensed or has faded."""

import json

import numpy as np
import pytest

from lcorpp.assembly.strategies.trust import WITH_TRUST
from lcorpp.decision import dt_control, strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DecisionError
from lcorpp.experiments.comparison import ComparisonOptions, set_up_experiment
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.scoring.experiment import ChunkSource
from lcorpp.trust import Trust, TrustOptions, latent_class_model
from lcorpp.values import Step
from tests.decision.fakes import FakeDomain, FakePlanner
from tests.trust.fakes import AskDialogue, SkyReasoner


def make_trust(**options):
    return Trust(SkyReasoner(), FakeDomain(), AskDialogue(), FakePlanner(), options=TrustOptions(**options))


def meet(trust, rng, number):
    """Let some people answer; a tenth of them without a label."""
    for _ in range(number):
        evidence = {"sky": str(rng.choice(["sunny", "grey"])), "label": str(rng.choice(["yes", "no"]))}
        if rng.random() < 0.1:
            del evidence["label"]
        heard = rng.choice(["nod", "shake"], size=rng.integers(5))
        trust.learn(evidence, [Step("ask", str(answer), np.array([0.5, 0.5])) for answer in heard])


def copy_state(trust):
    return json.loads(json.dumps(trust.state()))


@pytest.mark.parametrize("n_before", [0, 25, 120])
def test_a_restart_goes_on_exactly(n_before, monkeypatch):
    """Also with other credible estimates, with rare cases as counts, and where people are forgotten."""
    monkeypatch.setattr(latent_class_model, "MAX_CASES", 20)
    rng, whole = np.random.default_rng(3), make_trust(memory=4.0)
    meet(whole, rng, n_before)
    restarted = make_trust(memory=4.0)
    restarted.restore(copy_state(whole))
    assert restarted.n_people == n_before
    if n_before == 25:
        assert copy_state(whole)["learners"][0]["learnt"]["learnt"]["alternative"] is not None
    other = np.random.default_rng(4)
    meet(whole, np.random.default_rng(4), 60)
    meet(restarted, other, 60)
    assert copy_state(restarted) == copy_state(whole)
    evidence = {"sky": "sunny", "label": "no"}
    np.testing.assert_array_equal(
        whole.posterior("wish", evidence).probabilities, restarted.posterior("wish", evidence).probabilities
    )


@pytest.mark.parametrize(("name", "row"), [("museum", WITH_TRUST[0]), ("intention", WITH_TRUST[1])])
def test_a_domain_s_restart_goes_on_exactly(name, row):
    """With the policies for the estimated observation model, whose search may be unfinished."""
    experiment, *_ = set_up_experiment(
        load_domain(name),
        ComparisonOptions((row, *strategies(["LCORPP"])), seed=5, cache=find_cache_folder()),
    )
    chunk = ChunkSource(experiment).draw(0, 100)
    sessions = [row.start(experiment.robot, {})]
    for trial in range(60):
        if trial == 37:
            sessions.append(row.start(experiment.robot, {}))
            sessions[1].trust.restore(copy_state(sessions[0].trust))
        drawn, episodes = chunk.find_trial(trial), []
        for session in sessions:
            episodes.append(dt_control(session.robot(drawn.robot), drawn.instance, drawn.make_world()))
            session.learn(episodes[-1].evidence, episodes[-1].steps)
        for episode in episodes[1:]:
            np.testing.assert_array_equal(episode.prior, episodes[0].prior)
            assert [step.action for step in episode.steps] == [step.action for step in episodes[0].steps]
    one, two = (copy_state(session.trust) for session in sessions)
    assert one == two


def test_a_state_that_does_not_fit_is_refused():
    trust = make_trust()
    meet(trust, np.random.default_rng(0), 5)
    state = copy_state(trust)
    with pytest.raises(DecisionError, match="trust has learnt from 5 people; expected a new one"):
        trust.restore(state)
    used = make_trust()
    used.posterior("wish", {"sky": "grey"})
    with pytest.raises(DecisionError, match="trust has already made predictions; expected a new one"):
        used.restore(state)
    for key, value, message in (
        ("version", 1, "has the version 1; this lcorpp reads 3"),
        ("sources", ["knowledge"], r"has other sources, \['knowledge'\]; expected \['knowledge', 'knowl"),
        ("values", ["no", "yes"], r"has other values, \['no', 'yes'\]; expected \['yes', 'no'\]"),
        ("labels", [["no", "yes"]], r"has other labels, \[\['no', 'yes'\]\]; expected \[\['yes', 'no'\]\]"),
        (
            "stated_answers",
            [[[0.5, 0.5], [0.5, 0.5]]],
            r"has other stated answers, \[\[\[0.5, 0.5\], .*expected",
        ),
        (
            "forms_of_answers",
            ["number"],
            r"has other forms of answers, \['number'\]; expected \['independent'\]",
        ),
    ):
        with pytest.raises(DecisionError, match=f"the state of trust {message}"):
            make_trust().restore(state | {key: value})
    learner = state["learners"][0]
    weights = learner["source_weights"]
    cases = learner["learnt"]["learnt"]["cases"]
    unknown = {**learner["learnt"]["learnt"], "cases": cases | {"contexts": [9] * len(cases["contexts"])}}
    for damage in (
        {"learnt": {}},
        {"source_weights": ["x"] * 6},
        {"source_weights": [[10**400, *weights[0][1:]], *weights[1:]]},
        {"source_weights": [[float("nan"), *weights[0][1:]], *weights[1:]]},
        {"source_weights": (25 * np.array(weights)).tolist()},
        {"learnt": learner["learnt"] | {"learnt": unknown}},
        {"tables": None, "learnt": None},
    ):
        with pytest.raises(DecisionError, match="the state of trust is damaged"):
            make_trust().restore(state | {"learners": [state["learners"][0] | damage]})
    with pytest.raises(DecisionError, match="the state of trust is damaged"):
        make_trust().restore(state | {"learners": []})
    with pytest.raises(DecisionError, match="the state of trust has the version None; this lcorpp reads 3"):
        make_trust().restore({})
