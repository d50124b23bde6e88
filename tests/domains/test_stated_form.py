"""`[planning.answers]`: the stated form of answers is in the planner's model, and people answer by it."""

import itertools
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lcorpp.decision import STRATEGIES, Robot
from lcorpp.domains import load_domain
from lcorpp.domains.loading import SHIPPED_FOLDER
from lcorpp.errors import DomainError
from lcorpp.experiments.comparison import ComparisonOptions, compare_strategies
from lcorpp.planning import Planner, SparseTables, solve
from lcorpp.reasoning import Reasoner
from lcorpp.scoring.exact_evaluation import evaluate_exactly
from lcorpp.simulation import NoisyChannel, SimulationModel

ROOMS = Path(__file__).parent / "rooms"
FORMS = {
    "number": {"model": "number", "noise": [0.1, 0.5, 0.8]},
    "repeated": {"model": "repeated", "repeats": 0.8, "noise": 0.1},
    "class": {"model": "class", "noise": [0.1, 0.8], "share": 0.3},
}


def load(name, **answers):
    return load_domain(name, changes={"planning": {"answers": answers}})


def score(domain):
    channels = {sense.name: NoisyChannel.from_domain(domain, sense) for sense in domain.senses}
    planner = Planner(solve(domain.pomdp, domain.start_beliefs(), precision=1e-6))
    robot = Robot(channels, Reasoner(domain.program), planner, domain)
    return evaluate_exactly(domain, robot, channels, STRATEGIES)


def mix(observation, states, noise):
    """Return (A, S, O) in which answers are like those of a random person, with the probability `noise`."""
    mixed = observation.copy()
    mixed[:, states] = (1 - noise) * mixed[:, states] + noise * mixed[:, states].mean(axis=1, keepdims=True)
    return mixed


@pytest.mark.parametrize(
    "answers",
    [
        {"model": "number", "noise": [0.4, 0.4, 0.4]},
        {"model": "repeated", "repeats": 0, "noise": 0.4},
        {"model": "class", "noise": [0.4, 0.4], "share": 0.3},
    ],
)
def test_without_an_effect_of_the_memory_scores_are_those_of_independent_answers(answers):
    """The same noise whatever was asked before, against a model with noisier rows."""
    base = load_domain(ROOMS)
    wanted = slice(0, 3)
    noisy = replace(
        base,
        planning=replace(
            base.planning,
            model=replace(
                base.pomdp,
                observation=SparseTables.of(mix(base.pomdp.observation.dense, wanted, 0.4)),
            ),
        ),
        simulation=replace(base.simulation, feedback_model=mix(base.simulation.feedback_model, wanted, 0.4)),
    )
    domain = load(ROOMS, **answers)
    assert len(domain.pomdp.states) > len(base.pomdp.states)
    for one, other in zip(score(domain), score(noisy), strict=True):
        assert one.return_.estimate == pytest.approx(other.return_.estimate, abs=1e-4), one.strategy
        np.testing.assert_allclose(one.counts, other.counts, atol=1e-5)


def test_a_second_question_that_says_nothing_new_is_not_asked():
    """After the first, all answers are noise, or the answer of before."""
    useless = load(ROOMS, model="number", noise=[0, 1]), load(ROOMS, model="repeated", repeats=1)
    costs = [{own.strategy: own.cost.estimate for own in score(domain)} for domain in useless]
    usual = {own.strategy: own.cost.estimate for own in score(load_domain(ROOMS))}
    for strategy in ("P", "R+P", "LCORPP"):
        for cost in costs:
            assert cost[strategy] <= 1 + 1e-9
        assert costs[0][strategy] == pytest.approx(costs[1][strategy], abs=1e-9)
    assert usual["P"] > 1.5


@pytest.mark.parametrize(
    ("name", "form"),
    [
        *itertools.product([ROOMS], FORMS),
        ("intention", "number"),
        ("intention", "repeated"),
        pytest.param("intention", "class", marks=pytest.mark.slow),  # solved up to the time limit, twice
    ],
)
def test_simulated_people_agree_with_exact_scores(name, form):
    domain = load(name, **FORMS[form])
    options = ComparisonOptions(
        strategies=STRATEGIES[-2:],
        classifiers={sense.name: None for sense in domain.senses},
        trials=4000,
        seed=3,
        jobs=1,
    )
    exact = {own.strategy: own for own in score(domain)}
    for found in compare_strategies(domain, options).scores:
        for sampled, own in (
            (found.return_, exact[found.strategy].return_.estimate),
            (found.cost, exact[found.strategy].cost.estimate),
        ):
            error = (sampled.high - sampled.low) / (2 * 1.96)
            assert abs(sampled.estimate - own) <= 3.5 * error, found.strategy


def test_people_answer_by_the_number_of_the_question_and_repeat_themselves():
    """`feedback` has noise .2; a third of the random answers are right."""
    domain = load(ROOMS, model="number", noise=[0, 0.5, 1])
    model, rng, n = SimulationModel(domain), np.random.default_rng(5), 4000
    person = {"goal": "lab"}
    answers = []
    for _ in range(n):
        world = model.make_world(person, rng)
        answers.append([world.act("point") for _ in range(4)])
    right = (np.array(answers) == "yes").mean(axis=0)
    expected = np.array([0.8, 0.5 * 0.8 + 0.5 / 3, 1 / 3, 1 / 3])
    assert (np.abs(right - expected) < 4 * np.sqrt(0.25 / n)).all()
    domain = load(ROOMS, model="repeated", repeats=0.9)
    model, answers = SimulationModel(domain), []
    for _ in range(n):
        world = model.make_world(person, rng)
        answers.append([world.act("point") for _ in range(2)])
    pairs = np.array(answers)
    equal = (pairs[:, 0] == pairs[:, 1]).mean()
    independent = 0.8**2 + 2 * 0.1**2
    assert abs(equal - (0.9 + 0.1 * independent)) < 4 * np.sqrt(0.25 / n)
    assert abs((pairs == "yes").mean() - 0.8) < 4 * np.sqrt(0.25 / n)


def test_people_of_two_classes_answer_with_their_own_noise():
    """Nobody of the second class is right but by chance; agreement of answers shows the classes."""
    domain = load(ROOMS, model="class", noise=[0, 1], share=0.25)
    model, rng, n = SimulationModel(domain), np.random.default_rng(6), 4000
    worlds = (model.make_world({"goal": "lab"}, rng) for _ in range(n))
    right = np.array([[world.act("point") for _ in range(2)] for world in worlds]) == "yes"
    assert abs(right.mean() - (0.75 * 0.8 + 0.25 / 3)) < 4 * np.sqrt(0.25 / n)
    assert abs(right.all(axis=1).mean() - (0.75 * 0.8**2 + 0.25 / 9)) < 4 * np.sqrt(0.25 / n)


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"model": "tired"}, "model: 'tired'; expected one of number, repeated, class"),
        ({"noise": [0, 1]}, "model is missing"),
        ({"model": "number"}, "noise is missing"),
        (
            {"model": "number", "noise": 0.3},
            "noise: expected a list of 2 to 10 numbers, for the first, second",
        ),
        ({"model": "number", "noise": [0.3]}, "noise: expected a list of 2 to 10 numbers"),
        ({"model": "number", "noise": [0.3, 1.5]}, "noise: 1.5; expected numbers from 0 to 1"),
        ({"model": "number", "noise": [0.3, True]}, "noise: True; expected numbers from 0 to 1"),
        ({"model": "number", "noise": [0.3, float("nan")]}, "noise: nan; expected numbers from 0 to 1"),
        ({"model": "number", "noise": [0, 1], "repeats": 0.5}, "repeats: unknown key"),
        ({"model": "repeated"}, "repeats is missing"),
        ({"model": "class", "noise": [0, 0.5]}, "share is missing"),
        (
            {"model": "class", "noise": [0, 0.5, 1], "share": 0.2},
            "noise: expected a list of 2 numbers, for the",
        ),
        ({"model": "class", "noise": [0, 1], "share": 2}, "share: expected a number from 0 to 1, not 2"),
        ({"model": "repeated", "repeats": 2}, "repeats: expected a number from 0 to 1, not 2"),
    ],
)
def test_wrong_sections_are_errors_of_their_key(answers, words):
    with pytest.raises(DomainError) as raised:
        load(ROOMS, **answers)
    assert "domain.toml" in str(raised.value)
    assert words in str(raised.value)


def test_a_dialogue_that_cannot_be_followed_has_no_form(tmp_path):
    """Where an answer may also mean that the robot did not turn."""
    folder = shutil.copytree(SHIPPED_FOLDER / "intention", tmp_path / "intention")
    model = folder / "interaction.pomdp"
    blind = "O: turn\n0.0 0.0 1.0\n0.0 0.0 1.0\n"
    text = model.read_text()
    assert blind in text
    model.write_text(text.replace(blind, "O: turn\n0.9 0.1 0.0\n0.1 0.9 0.0\n"))
    with pytest.raises(DomainError, match="the dialogue cannot be followed") as raised:
        load(folder, **FORMS["number"])
    assert "[planning] answers: " in str(raised.value)
