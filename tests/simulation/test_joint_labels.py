"""Labels that the truth program relates to more than their class: camera and laser see the same walk."""

from collections import Counter

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.assembly.case import draw_case
from lcorpp.assembly.strategies.baselines import find_strategies
from lcorpp.assembly.strategies.trust import TRUST, check_dialogue
from lcorpp.audit import read_people
from lcorpp.decision import Robot, strategies
from lcorpp.errors import DataError, DomainError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.planning import Planner, solve
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.reasoning import Enumeration, Reasoner
from lcorpp.scoring import Experiment, evaluate_exactly, run_trials
from lcorpp.scoring.cases import list_cases
from lcorpp.simulation import NoisyChannel, Population

DOMAIN = load_domain("intention", preset="around")
CHANNELS = {sense.name: NoisyChannel.from_domain(DOMAIN, sense) for sense in DOMAIN.senses}
LABELS = ("classifier", "legs")


def test_a_domain_has_joint_labels_where_its_rules_relate_them_to_more_than_their_class():
    assert DOMAIN.simulation.joint_labels == ("motion", "legs")
    assert load_domain("intention").simulation.joint_labels == ()
    assert load_domain("museum").simulation.joint_labels == ()
    given = {"interested": {"one": 0.8, "zero": 0.2}, "not_interested": {"one": 0.3, "zero": 0.7}}
    changed = load_domain(
        "intention", preset="around", changes={"simulation": {"channel": {"motion": given}}}
    )
    assert changed.simulation.joint_labels == ("legs",)


def test_labels_of_people_have_the_joint_distribution_of_the_program():
    rng, count = np.random.default_rng(3), 40_000
    people = Population(DOMAIN).sample(count, rng)
    predicted = [channel.classify_many(channel.simulate(people, rng)) for channel in CHANNELS.values()]
    drawn = Counter(zip([person["intention"] for person in people], *predicted, strict=True))
    joint = Enumeration(DOMAIN.simulation.true_program).exact(("intention", *LABELS))
    class_of = [{label: value for value, label in sense.label_of.items()} for sense in DOMAIN.senses]
    for (intention, *labels), p in joint.items():
        classes = [known[label] for known, label in zip(class_of, labels, strict=True)]
        expected, error = float(p), float(p * (1 - p) / count) ** 0.5
        assert drawn[intention, *classes] / count == pytest.approx(expected, abs=4.5 * error)


def test_exact_cases_are_those_of_the_program_where_all_are_perceived():
    """The mass of each value and pair of labels, by enumeration of the possible worlds."""
    everyone = {"motion": {"side": {"ahead": 1, "aside": 1}}, "legs": {"distance": {"near": 1, "far": 1}}}
    domain = load_domain("intention", preset="around", changes={"simulation": {"present": everyone}})
    names = ("time", "location", "intention", *LABELS, "side", "distance")
    joint = Enumeration(domain.simulation.true_program).exact(names)
    people = [(dict(zip(names, values, strict=True)), float(p)) for values, p in joint.items()]
    for case in list_cases(domain, CHANNELS, people):
        labels = {s.attribute: s.label_of[case.labels[s.name]] for s in domain.senses}
        wanted = {**case.context, **labels}
        for v, value in enumerate(domain.values):
            known = {**wanted, "intention": value}
            mass = sum(p for person, p in people if known.items() <= person.items())
            assert case.masses[v] == pytest.approx(mass, abs=1e-12)


def test_a_laser_is_worth_most_where_the_camera_sees_two_people_in_three():
    robot = Robot(
        CHANNELS,
        Reasoner(DOMAIN.program),
        Planner(solve(DOMAIN.pomdp, DOMAIN.start_beliefs(), precision=0.01)),
        DOMAIN,
    )
    rows = strategies(["R+P", "LCORPP", "LCORPP-motion", "LCORPP-legs"], list(CHANNELS))
    exact = {row.strategy: row for row in evaluate_exactly(DOMAIN, robot, CHANNELS, rows)}
    gain = exact["LCORPP"].return_.estimate - exact["LCORPP-legs"].return_.estimate
    assert gain == pytest.approx(1.46, abs=0.01)
    experiment = Experiment(DOMAIN, robot, CHANNELS, CHANNELS, rows, seed=11)
    scores = {row.strategy: row for row in run_trials(experiment, 6000)[0]}
    difference = scores["LCORPP"].subtract(scores["LCORPP-legs"])["return"]
    assert difference.low > 0
    half_width = (difference.high - difference.low) / 2
    assert abs(difference.estimate - gain) < 2 * half_width
    for name, row in scores.items():
        for field in ("accuracy", "cost", "return_"):
            found, expected = getattr(row, field), getattr(exact[name], field).estimate
            assert abs(found.estimate - expected) <= found.high - found.low


def test_a_given_label_determines_the_person_of_the_others():
    labels = [draw_case(DOMAIN, {}, {}, {"motion": "interested"}, seed=seed) for seed in range(300)]
    assert {case.person["classifier"] for case in labels} == {"one"}
    stops = np.mean([case.person["legs"] == "stops" for case in labels])
    expected = Reasoner(DOMAIN.program).posterior("legs", {"classifier": "one"})["stops"]
    assert stops == pytest.approx(expected, abs=4 * (expected * (1 - expected) / 300) ** 0.5)


def test_what_takes_labels_as_independent_refuses_those_of_one_walk(tmp_path):
    assert DOMAIN.find_related_senses(DOMAIN.program) == ("motion", "legs")
    assert load_domain("museum").find_related_senses(load_domain("museum").program) == ()
    with pytest.raises(DomainError, match=r"relates the labels of motion and legs, and LCORPP\+trust takes"):
        check_dialogue(DOMAIN, [TRUST])
    for name, is_refused in (("LCORPP", True), ("LCORPP-legs", False)):
        rows = find_strategies([name], ["motion", "legs"])
        options = ComparisonOptions(rows, trials=30, log=tmp_path / name, cache=find_cache_folder())
        compare_strategies(DOMAIN, options)
        if is_refused:
            with pytest.raises(DataError, match="an audit takes labels as independent given the value"):
                read_people(tmp_path / name)
        else:
            assert read_people(tmp_path / name).strategy == name
