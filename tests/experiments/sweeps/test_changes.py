"""Each axis changes what its name says, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.errors import WorkerError
from lcorpp.experiments.sweeps.axes import Problem, Setting, configure, hash_domain, list_axes
from lcorpp.experiments.sweeps.evaluation import evaluate_configuration
from lcorpp.reasoning import Reasoner

INTENTION = load_domain("intention")
PROBLEM = Problem("intention", "paper", (), None, 0, hash_domain(INTENTION))


def configured(**settings):
    pairs = settings.items()
    return configure(PROBLEM, tuple(Setting(tuple(name.split("__")), value) for name, value in pairs))


def marginal(program, attribute="intention", given=None):
    return {value: float(p) for value, p in Reasoner(program).exact(attribute, given or {}).items()}


def test_noise_and_discount():
    changed = configured(noise=0.1, discount=0.9)
    assert changed.pomdp.discount == 0.9
    a, s, o = (
        changed.pomdp.action_index("greet"),
        changed.pomdp.state_index("interested_turned"),
        changed.pomdp.observation_index("neg"),
    )
    assert changed.simulation.feedback_model[a, s, o] == pytest.approx(0.1)
    assert (changed.pomdp.reward == INTENTION.pomdp.reward).all()


def test_the_cost_of_an_action_leaves_terminal_states_without_cost():
    pomdp = configured(cost__greet=7.5).pomdp
    greet, term = pomdp.action_index("greet"), pomdp.state_index("term")
    assert pomdp.reward[greet].tolist() == [-7.5, -7.5, -7.5, -7.5, INTENTION.pomdp.reward[greet, term]]
    assert (np.delete(pomdp.reward, greet, 0) == np.delete(INTENTION.pomdp.reward, greet, 0)).all()


def test_rewards_of_right_and_wrong_reports():
    pomdp = configured(reward__right=10, reward__wrong__interested=-30).pomdp
    rows = {name: pomdp.reward[pomdp.action_index(name)].tolist() for name in pomdp.actions}
    assert rows["report_interested"] == [10, -30, 10, -30, 0]
    assert rows["report_not_interested"] == [-80, 10, -80, 10, 0]


@pytest.mark.parametrize("side", ["", "known__", "true__"])
def test_classifier_rates_of_the_robot_and_of_the_world(side):
    changed = configured(**{f"{side}classifier__interested": 0.9})
    known = marginal(changed.program, "classifier", {"intention": "interested"})["one"]
    true = changed.simulation.noisy_channels["motion"]["interested"]["one"]
    assert (round(known, 9), round(true, 9)) == {
        "": (0.9, 0.9),
        "known__": (0.9, 0.76),
        "true__": (0.76, 0.9),
    }[side]
    other = {"intention": "not_interested"}
    assert marginal(changed.program, "classifier", other)["one"] == pytest.approx(0.29)


@pytest.mark.parametrize("side", ["", "known__", "true__"])
@pytest.mark.parametrize("share", [0, 0.25, 0.4, 0.8, 1])
def test_the_prevalence_changes_nothing_given_the_intention(side, share):
    changed = configured(**{f"{side}prevalence__interested": share})
    programs = {"known__": changed.program, "true__": changed.simulation.true_program}
    for name, program in programs.items():
        expected = share if side in ("", name) else 0.4
        assert marginal(program)["interested"] == pytest.approx(expected)
        for value in ("interested", "not_interested"):
            if expected not in (0, 1) or (expected == 1) == (value == "interested"):
                given = {"intention": value}
                assert marginal(program, "time", given) == pytest.approx(
                    marginal(INTENTION.program, "time", given)
                )


def test_a_number_of_the_knowledge_and_of_the_truth():
    atom = "intention=interested|identity=student"
    program = configured(**{f"known__pr__{atom}": 0.6})
    given = {"identity": "student"}
    assert marginal(program.program, given=given)["interested"] == pytest.approx(0.6)
    assert marginal(program.simulation.true_program, given=given)["interested"] == pytest.approx(0.3)


def test_what_is_not_varied_has_the_scores_of_the_paper():
    rows = {row["strategy"]: row for row in evaluate_configuration(PROBLEM, ())}
    assert [round(rows[name]["return"], 2) for name in ("P", "R+P", "LCORPP")] == [41.38, 45.98, 51.53]
    same = evaluate_configuration(PROBLEM, (Setting(("noise",), 0.3), Setting(("cost", "greet"), 2)))
    assert [row["return"] for row in same] == pytest.approx([row["return"] for row in rows.values()])
    assert rows["P"]["reference"] == "R+P"
    assert rows["P"]["return_difference"] == pytest.approx(rows["R+P"]["return"] - rows["P"]["return"])
    assert rows["L"]["reference"] == "LCORPP"


def test_every_axis_of_the_shipped_domains_can_be_set():
    """Museum has two senses, shopping several shared variables."""
    for name in ("museum", "shopping"):
        domain = load_domain(name)
        problem = Problem(name, domain.preset, (), None, 0, hash_domain(domain))
        for axis in list_axes(domain):
            if axis[0] not in ("known", "true") and axis[0] != "pr":
                changed = configure(problem, (Setting(axis, 0.3),))
                assert hash_domain(changed) != problem.fingerprint, axis


def test_a_worker_with_other_code_or_another_domain_is_named():
    with pytest.raises(WorkerError, match=r"a worker has lcorpp .*; expected 0\.0\.1 \(abc\)"):
        configure(replace(PROBLEM, version="0.0.1 (abc)"), ())
    with pytest.raises(WorkerError, match="the files of the domain intention differ for a worker"):
        configure(replace(PROBLEM, fingerprint="abc"), ())
