"""People whom a sense does not perceive: the table `[simulation.present]`, and None in people.py."""

from collections.abc import Sequence
from contextlib import closing
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lcorpp import Instance, dt_control, load_domain
from lcorpp.assembly import TrainingOptions
from lcorpp.assembly.case import draw_case
from lcorpp.decision import Robot, strategies
from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.learning.store import read_store
from lcorpp.planning import Planner, solve
from lcorpp.reasoning import Reasoner
from lcorpp.runs import (
    ActiveLearningOptions,
    BatchResult,
    RunStore,
    run_active_learning,
    set_up_learning,
)
from lcorpp.scoring import Experiment, Scores, evaluate_exactly, run_trials
from lcorpp.simulation import NoisyChannel, PeopleStream, simulate_dataset, simulate_signals
from lcorpp.simulation.people import SimulatedSignals
from lcorpp.values import find_perceived

BY_GROUP = {"group": {"alone": 0.5, "family": 0.9, "class": 0.2}}


def load(name: str, present: object) -> Domain:
    return load_domain(name, changes={"simulation": {"present": present}})


def channels_of(domain: Domain) -> dict[str, NoisyChannel]:
    return {sense.name: NoisyChannel.from_domain(domain, sense) for sense in domain.senses}


@cache
def planner(name: str) -> Planner:
    domain = load_domain(name)
    return Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.01))


def score(domain: Domain, name: str, rows: Sequence[str] = ()) -> dict[str, Scores]:
    channels = channels_of(domain)
    robot = Robot(channels, Reasoner(domain.program), planner(name), domain)
    chosen = strategies(rows, list(channels))
    return {row.strategy: row for row in evaluate_exactly(domain, robot, channels, chosen)}


def test_a_sense_perceives_people_by_the_value_of_an_attribute():
    domain, rng = load("museum", {"motion": BY_GROUP}), np.random.default_rng(0)
    channel = channels_of(domain)["motion"]
    for group, probability in BY_GROUP["group"].items():
        people = [{"wish": "tour", "group": group}] * 20_000
        perceived = find_perceived(simulate_signals(domain, "motion", channel, people, rng))
        assert perceived.mean() == pytest.approx(probability, abs=0.014)  # 4 standard errors
    everyone = simulate_signals(domain, "gaze", channel, people[:50], rng)
    assert find_perceived(everyone).all()


def test_exact_scores_are_linear_in_the_probability_of_being_perceived():
    """Law of total probability over whether one sense perceives the person, whatever the strategy."""
    never, often, always = (score(load("intention", {"motion": p}), "intention") for p in (0, 0.7, 1))
    alone = score(load_domain("intention"), "intention")
    for name in often:
        for field in ("accuracy", "cost", "return_"):
            a, b, c = (getattr(own[name], field).estimate for own in (never, often, always))
            assert b == pytest.approx(0.3 * a + 0.7 * c, abs=1e-9)
            assert c == pytest.approx(getattr(alone[name], field).estimate, abs=1e-12)
    for with_label, without in (("LCORPP", "R+P"), ("L+R", "R"), ("L+P", "P")):
        assert never[with_label].return_.estimate == pytest.approx(never[without].return_.estimate, abs=1e-9)


def test_one_of_two_senses_that_perceives_no_one_is_worth_nothing():
    scores = score(load("museum", {"gaze": 0.0}), "museum", ["LCORPP", "LCORPP-gaze", "LCORPP-motion", "R+P"])
    for name, other in (("LCORPP", "LCORPP-gaze"), ("LCORPP-motion", "R+P")):
        assert scores[name].return_.estimate == pytest.approx(scores[other].return_.estimate, abs=1e-9)


def test_exact_and_simulated_scores_agree_where_a_third_lacks_one_of_two_senses():
    domain = load("museum", {"motion": BY_GROUP, "gaze": 2 / 3})
    channels = channels_of(domain)
    robot = Robot(channels, Reasoner(domain.program), planner("museum"), domain)
    rows = strategies([], list(channels))
    experiment = Experiment(domain, robot, channels, channels, rows, seed=5)
    simulated, _ = run_trials(experiment, 4000)
    for exact, drawn in zip(evaluate_exactly(domain, robot, channels, rows), simulated, strict=True):
        for field in ("accuracy", "cost", "return_"):
            expected, found = getattr(exact, field), getattr(drawn, field)
            assert abs(found.estimate - expected.estimate) <= 2 * (found.high - found.low) / 2 + 1e-9


def test_algorithm_1_and_single_decisions_get_no_signal_of_a_sense_that_does_not_perceive():
    domain = load("museum", {"motion": 0.0, "gaze": {"group": {"alone": 1, "family": 0, "class": 0}}})
    stream = PeopleStream(domain, channels_of(domain), seed=1)
    for _ in range(60):
        instance, _ = stream.next()
        assert set(instance.signals) == ({"gaze"} if instance.context["group"] == "alone" else set())
    robot = Robot(channels_of(domain), Reasoner(domain.program), planner("museum"), domain)
    episode = dt_control(robot, *stream.next())
    assert "motion" not in episode.evidence
    case = draw_case(domain, {}, {"group": "alone"}, {})
    assert case.predicted == {}
    assert dt_control(robot, Instance({}, case.facts), case.world).report in domain.values


@pytest.fixture
def lobby(tmp_path) -> Path:
    """A copy of the museum in which children of a class are not seen."""
    folder = load_domain("museum").folder
    for file in folder.iterdir():
        if file.is_file():
            (tmp_path / file.name).write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
    text = (tmp_path / "people.py").read_text(encoding="utf-8")
    text += "\n\n_all = gaze\n\ndef gaze(people, rng):\n    signals = _all(people, rng)\n"
    text += (
        "    return [None if p['group'] == 'class' else s for p, s in zip(people, signals, strict=True)]\n"
    )
    (tmp_path / "people.py").write_text(text, encoding="utf-8")
    return tmp_path


def test_a_training_set_has_perceived_people_only(lobby):
    domain = load_domain(lobby)
    gaze = domain.find_sense("gaze")
    source = SimulatedSignals.from_domain(domain, gaze)
    data = simulate_dataset(domain, gaze, source, 90, np.random.default_rng(0))
    assert len(data) == 90
    assert np.isfinite(data.trajectories).all()
    assert {data.labels.count(name) for name in gaze.classes} == {30}


def test_a_sense_that_perceives_no_one_cannot_be_trained():
    domain = load("museum", {"gaze": 0.0})
    gaze = domain.find_sense("gaze")
    source = SimulatedSignals.from_domain(domain, gaze)
    with pytest.raises(DomainError, match=r"'gaze' does not perceive one of 100 people whose attention is"):
        simulate_dataset(domain, gaze, source, 9, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("present", "words"),
    [
        ({"smell": 0.5}, r"no sense 'smell'; expected one of motion, gaze"),
        ({"gaze": 1.5}, r"gaze.*expected a number from 0 to 1"),
        ({"gaze": "often"}, r"gaze.*expected a number from 0 to 1"),
        (
            {"gaze": {}},
            r"is a table of nothing; expected a probability, or one attribute of .*knowledge.plog",
        ),
        ({"gaze": {"group": 1, "time": 1}}, r"is a table of group, time; expected a probability"),
        ({"gaze": {"side": {"left": 1}}}, r"has no attribute 'side'"),
        (
            {"gaze": {"motion": dict.fromkeys(("waits", "approaches", "passes"), 0.5)}},
            "'motion' is the label of",
        ),
        ({"gaze": {"group": 0.5}}, r"group: expected a table of probabilities, e.g. \{ alone = 0.9 \}"),
        ({"gaze": {"group": {"alone": 1}}}, r"'family' is missing; expected the values of group at .*:\d+"),
        ({"gaze": {"group": {**BY_GROUP["group"], "duo": 1}}}, r"'duo' is not among the values of group"),
        ({"gaze": {"group": {**BY_GROUP["group"], "class": -1}}}, r"class.*expected a number from 0 to 1"),
    ],
)
def test_errors_of_the_table(present, words):
    with pytest.raises(DomainError, match=words):
        load("museum", present)


def test_a_run_with_a_store_continues_as_if_it_had_not_ended(tmp_path):
    domain = load("intention", {"motion": 0.5})
    training = TrainingOptions("summaries", tracks=20)

    def run(max_batches: int, store: Path | None) -> list[BatchResult]:
        options = ActiveLearningOptions({"motion": training}, batch_size=10, max_batches=max_batches)
        senses = set_up_learning(domain, options)
        if store is None:
            return list(run_active_learning(domain, senses, planner("intention"), options))
        data = {name: own.dataset for name, own in senses.data.items()}
        classes = {sense.name: sense.classes for sense in domain.senses}
        with closing(RunStore(store, data, classes, {})) as run_store:
            return list(
                run_active_learning(domain, senses, planner("intention"), options, run_store=run_store)
            )

    straight = run(2, None)
    run(1, tmp_path / "s.tracks")
    continued = run(2, tmp_path / "s.tracks")
    first, last = straight[-1].batch, continued[-1].batch
    assert first.datasets["motion"].labels == last.datasets["motion"].labels
    assert 20 < len(last.datasets["motion"]) < 40  # half of the 20 people
    np.testing.assert_array_equal(
        first.senses["motion"].confusion.counts, last.senses["motion"].confusion.counts
    )
    stored = read_store(tmp_path / "s.tracks")
    assert len(stored) == 20
    assert len(stored.select()) == len(last.datasets["motion"]) - 20
