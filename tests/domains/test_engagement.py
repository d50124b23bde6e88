"""The domain `engagement`: its exact scores, its baseline, and how near its people are to the recordings."""

from pathlib import Path

import numpy as np
import pytest

from lcorpp.assembly import TrainingOptions, read_training_data, train_classifier
from lcorpp.assembly.strategies.baselines import find_strategies
from lcorpp.decision.strategies import LCORPP, list_strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DomainError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.learning import cross_validate, learner
from lcorpp.learning.evaluation.held_out import HeldOutPredictor
from lcorpp.simulation.people import make_signal_source, simulate_dataset
from lcorpp.values import Dataset

ENGAGEMENT = Path(__file__).parents[3] / "shared" / "data" / "engagement"
needs_recordings = pytest.mark.skipif(
    not ENGAGEMENT.is_dir(), reason="the recordings are not here (shared/data/engagement)"
)


@pytest.fixture(scope="module")
def domain():
    return load_domain("engagement")


@pytest.fixture(scope="module")
def exact(domain):
    comparison = compare_strategies(domain, ComparisonOptions(trials=None))
    return {scores.strategy: scores for scores in comparison.scores}


def test_the_robot_is_better_than_its_parts_and_the_rule(exact):
    returns = {name: scores.return_.estimate for name, scores in exact.items()}
    assert next(iter(exact)) == "gaze-rule"
    for name in ("gaze-rule", "L", "R", "P", "L+R", "R+P", "L+P", "LCORPP-gaze"):
        assert returns["LCORPP"] > returns[name] + 1
    assert returns["LCORPP"] > returns["L+R"] + 1.5  # L+R decides at once: the gain of watching
    assert exact["LCORPP"].cost.estimate > 0.5  # it watches some people


def test_the_rule_reports_its_label_at_once(domain, exact):
    """By hand: P(engaged) by the table of knowledge, and the rates of the rule."""
    place = {"desk": 0.3, "corridor": 0.4, "entrance": 0.3}
    others = {"desk": 0.2, "corridor": 0.5, "entrance": 0.4}
    engaged = 0.3 * (0.8 * 0.85 + 0.2 * 0.6)
    for name, alone, accompanied, hurry in (("entrance", 0.5, 0.3, 0.2), ("corridor", 0.35, 0.15, 0.1)):
        quiet = (1 - others[name]) * alone + others[name] * accompanied
        engaged += place[name] * (0.6 * quiet + 0.4 * hurry)
    expected = engaged * (0.81 * 20 - 0.19 * 10) + (1 - engaged) * (0.64 * 5 - 0.36 * 25)
    assert exact["gaze-rule"].return_.estimate == pytest.approx(expected, abs=1e-9)
    assert exact["gaze-rule"].recall.estimate == pytest.approx(0.81, abs=1e-9)


def test_no_other_strategy_uses_the_baseline(domain, exact, tmp_path):
    """Without the baseline their scores are the same."""
    folder = tmp_path / "without"
    folder.mkdir()
    for file in domain.folder.glob("*.*"):
        (folder / file.name).write_text(file.read_text())
    text = (folder / "domain.toml").read_text()
    begin, end = text.index("[[learning]]                      # the rule"), text.index("[planning]")
    (folder / "domain.toml").write_text(text[:begin] + text[end:])
    comparison = compare_strategies(load_domain(folder), ComparisonOptions(trials=None))
    found = {scores.strategy: scores.return_.estimate for scores in comparison.scores}
    assert set(found) == set(exact) - {"gaze-rule"}
    for name, value in found.items():
        assert value == pytest.approx(exact[name].return_.estimate, abs=1e-9)


def test_trials_draw_the_label_of_the_baseline(domain, exact):
    """Simulated trials agree with the exact scores, also of people whose baseline has a sense of its own."""
    comparison = compare_strategies(domain, ComparisonOptions(trials=2000, seed=3))
    for scores in comparison.scores:
        for name in ("return_", "accuracy"):
            known = getattr(exact[scores.strategy], name).estimate
            interval = getattr(scores, name)
            width = interval.high - interval.low
            assert interval.low - width / 2 < known < interval.high + width / 2


def test_strategies_of_a_domain_with_a_baseline(domain):
    assert [sense.name for sense in domain.senses] == ["motion", "gaze"]
    assert [sense.name for sense in domain.baselines] == ["gaze-rule"]
    names = [sense.name for sense in domain.all_senses]
    rows = list_strategies(names)
    assert [row.name for row in rows if row.uses("gaze-rule")] == ["gaze-rule"]
    assert not any(rows[0].uses(name) for name in ("motion", "gaze"))
    assert find_strategies(["gaze-rule"], names) == rows[:1]
    assert LCORPP.uses("gaze")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("baseline = true", "baseline = false"), "'gaze-rule'; expected letters, digits and _"),
        (('name = "gaze-rule"', 'name = "rule"'), "'rule'; expected names joined by -"),
        (('name = "gaze-rule"', 'name = "LCORPP-gaze"'), "'LCORPP-gaze'; expected names joined by -"),
        (("seconds = 2.0", ""), "windows need `seconds`, their duration"),
        (
            ('features = ["gaze_angle", "gaze_rate"]', 'features = ["gaze"]'),
            "unknown feature 'gaze'; expected one of x,",
        ),
        (('data_groups = "[A-Z]{2}"', 'data_groups = "["'), "'[': unterminated character set"),
    ],
)
def test_wrong_keys_of_a_sense_are_named(domain, tmp_path, change, words):
    for file in domain.folder.glob("*.*"):
        (tmp_path / file.name).write_text(file.read_text().replace(*change, 1))
    with pytest.raises(DomainError) as error:
        load_domain(tmp_path)
    assert words in str(error.value)


@pytest.fixture(scope="module")
def simulated(domain):
    def simulate(name, cases=600):
        sense = domain.find_sense(name)
        return simulate_dataset(
            domain, sense, make_signal_source(domain, sense, None), cases, np.random.default_rng(1)
        )

    return simulate


def test_simulated_faces_have_the_rates_of_the_program(domain, simulated):
    """Those rates were measured on the recordings; on simulated people forest and rule have similar ones."""
    gaze = domain.find_sense("gaze")
    data = simulated("gaze")
    forest = learner(
        "forest", interval=data.interval, inputs=data.channels, features=gaze.features, rate=gaze.feature_rate
    )
    found = cross_validate(forest, data)
    assert found.recalls[0].value == pytest.approx(0.73, abs=0.08)
    assert found.recalls[1].value == pytest.approx(0.86, abs=0.08)
    rule = cross_validate(
        learner("gaze-rule", interval=data.interval, inputs=data.channels, rate=10.0), simulated("gaze-rule")
    )
    assert rule.recalls[0].value == pytest.approx(0.81, abs=0.08)
    assert rule.recalls[1].value == pytest.approx(0.64, abs=0.08)


def read_recordings(domain, sense, features):
    options = {"seed": 0, "features": features, "leave_one_out": True}
    return read_training_data(domain, sense, ENGAGEMENT, **options).dataset


@needs_recordings
def test_recorded_windows_are_classified_better_than_by_the_rule(domain):
    """Each person held out; the windows of pairs without those of their members."""
    found = {}
    for name, kind in (("gaze", "forest"), ("gaze-rule", "gaze-rule")):
        sense = domain.find_sense(name)
        features = sense.features or ("social_engagement",)
        data = read_training_data(
            domain, sense, ENGAGEMENT, seed=0, features=features, leave_one_out=True
        ).dataset
        assert (len(data), set(data.groups)) == (218, {"AA", "FV", "GA", "AA + FV"})
        estimator = learner(
            kind, interval=data.interval, inputs=data.channels, features=features, rate=sense.feature_rate
        )
        found[name] = cross_validate(estimator, data)
        assert len(set(found[name].folds)) == 4
    assert found["gaze"].auc > 0.85
    assert found["gaze-rule"].auc == pytest.approx(0.784, abs=0.005)
    assert found["gaze"].recalls[0].value == pytest.approx(0.73, abs=0.05)
    assert found["gaze"].recalls[1].value == pytest.approx(0.86, abs=0.05)


@needs_recordings
def test_recorded_people_are_tested_by_classifiers_without_them(domain):
    sense = domain.find_sense("gaze")
    setup = train_classifier(domain, sense, TrainingOptions("forest", data=ENGAGEMENT))
    data = read_training_data(
        domain, sense, ENGAGEMENT, seed=0, features=sense.features, leave_one_out=True
    ).dataset
    labels = setup.classifier.classify_many(data.trajectories)
    right = np.mean(np.array(labels) == np.array(data.labels))
    assert right == pytest.approx(setup.report.accuracy.estimate, abs=1e-9)
    refitted = np.mean(np.array(setup.trained.classify_many(data.trajectories)) == np.array(data.labels))
    assert refitted > right + 0.1  # those of the training look better than they are


def test_a_held_out_predictor_takes_new_cases_to_its_estimator():
    data = Dataset(np.random.default_rng(0).normal(size=(6, 2, 5)), 3 * ["a", "b"])
    estimator = learner("summaries", features=["x", "y"], rate=30.0).fit(data.trajectories, data.labels)
    known = np.tile([0.25, 0.75], (6, 1))
    predictor = HeldOutPredictor(estimator, data.trajectories, known)
    new = data.trajectories[:1] + 1.0
    padded = np.concatenate([data.trajectories, np.full((6, 2, 3), np.nan)], axis=2)
    assert np.array_equal(predictor.predict_proba(padded), known)
    assert np.array_equal(
        predictor.predict_proba([new[0], data.trajectories[3]]), [estimator.predict_proba(new)[0], known[3]]
    )
