"""Forms of answers that an audit names, in logs of people who tire, repeat, differ, or do not."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from lcorpp.assembly import RobotParts, solve_domain
from lcorpp.assembly.robot_parts import ClassifierPart
from lcorpp.audit.answer_forms import _arrange, list_form_tests
from lcorpp.audit.audit import audit_people
from lcorpp.audit.estimates import Audit
from lcorpp.audit.logged_people import LoggedPeople, read_people
from lcorpp.audit.noisy_copies import NoisyCopies
from lcorpp.audit.report import format_audit, format_patch
from lcorpp.domains import load_domain
from lcorpp.logs.decision_log import FORMAT
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.reasoning import Reasoner
from lcorpp.trust.forms import ByClass, ByNumber, Repeated

Draw = Callable[[np.random.Generator], Sequence[bool]]
"""Whether each answer of a person is wrong."""

PEOPLE = 800


def log_answers(path: Path, draw: Draw, seed: int = 0) -> LoggedPeople:
    """Write a log of people who are greeted three times, and read it."""
    domain, rng = load_domain("intention", preset="paper"), np.random.default_rng(seed)
    policy = solve_domain(domain, cache=find_cache_folder()).policy
    parts = RobotParts(domain, policy, {"motion": ClassifierPart("channel", soft=False)})
    with path.open("w") as file:
        for person in Reasoner(domain.program).sample_many(PEOPLE, rng, {}):
            facts = {name: person[name] for name in domain.observed}
            right = ("pos", "neg") if person["intention"] == "interested" else ("neg", "pos")
            steps = [{"action": "greet", "observation": right[wrong], "belief": {}} for wrong in draw(rng)]
            line = {
                **FORMAT.header,
                "strategy": {"name": "LCORPP"},
                "facts": facts,
                "evidence": {**facts, "classifier": person["classifier"]},
                "steps": steps,
                "parts": parts.description,
            }
            file.write(json.dumps(line) + "\n")
    return read_people(path)


def audit(path: Path, draw: Draw) -> Audit:
    return audit_people(log_answers(path, draw))


def test_answers_that_get_worse_are_named_with_their_rates(tmp_path):
    wrong = np.array([0.1, 0.3, 0.45])
    result = audit(tmp_path / "log", lambda rng: (rng.random(3) < wrong).tolist())
    form = result.form
    assert form is not None
    assert form.name == "number"
    assert form.degrees == 1
    assert len(form.wrong) == 3
    for x, true in zip(form.wrong, wrong, strict=True):
        assert x.share == pytest.approx(1 / 3)
        assert x.rate == pytest.approx(true, abs=0.06)
        assert x.interval[0] < x.rate < x.interval[1]
    text = "they get worse with each question; wrong are, from the first on: 0."
    assert f"The data refute independent answers (p = {form.p_value:.2g}):\n  {text}" in format_audit(result)
    assert f"answers depend on more than the value: {text}" in format_patch(result)


def test_answers_that_stay_are_named(tmp_path):
    result = audit(tmp_path / "log", lambda rng: 3 * [bool(rng.random() < 0.25)])
    assert result.form is not None
    assert result.form.name == "repeated"
    new, again = result.form.wrong
    assert new.share == pytest.approx(1 / 3)
    assert again.rate < 0.01
    assert "the same again unlike before in 0.0" in format_audit(result)


def test_people_of_two_classes_are_named(tmp_path):
    result = audit(tmp_path / "log", lambda rng: (rng.random(3) < rng.choice([0.02, 0.45])).tolist())
    assert result.form is not None
    assert result.form.name == "class"
    assert [x.rate for x in result.form.wrong] == [
        pytest.approx(0.02, abs=0.05),
        pytest.approx(0.45, abs=0.1),
    ]
    assert [x.share for x in result.form.wrong] == [pytest.approx(0.5, abs=0.15)] * 2
    assert "people differ in reliability: " in format_audit(result)


def test_independent_answers_are_not_refuted(tmp_path):
    result = audit(tmp_path / "log", lambda rng: (rng.random(3) < 0.3).tolist())
    assert result.form is None
    assert [x.name for x in result.forms] == ["number", "repeated", "class"]
    assert "The data do not refute answers that are independent given the value." in format_audit(result)


def test_one_answer_of_each_person_says_nothing_about_its_form(tmp_path):
    result = audit(tmp_path / "log", lambda rng: [bool(rng.random() < 0.3)])
    assert result.forms == ()
    assert "independent" not in format_audit(result)


@pytest.mark.parametrize("form", [ByNumber(), Repeated(3), ByClass()])
def test_derivatives_are_those_of_the_log_likelihood(tmp_path, form):
    people = log_answers(tmp_path / "log", lambda rng: (rng.random(3) < 0.3).tolist())
    rates = [np.array([[0.76, 0.24], [0.29, 0.71]])]
    noisy = NoisyCopies(
        people, form, _arrange(people, form, form.make_answers(people.dialogue.tables)), rates
    )
    rng = np.random.default_rng(1)
    logits = [rng.normal(size=prior.shape) for prior in noisy._priors]
    noise = rng.uniform(0.1, 0.9, len(form.groups))
    sizes = np.cumsum([0, *[own.size for own in logits]])

    def split(x):
        parts = [x[a:b].reshape(own.shape) for a, b, own in zip(sizes, sizes[1:], logits, strict=False)]
        rows = [np.exp(own) * (prior > 0) for own, prior in zip(parts, noisy._priors, strict=True)]
        return [own / own.sum(axis=-1, keepdims=True) for own in rows], x[sizes[-1] :]

    point = np.concatenate([*(own.ravel() for own in logits), noise])
    _, slopes, noise_slopes = noisy._evaluate(*split(point))
    found = np.concatenate([*(own.ravel() for own in slopes), noise_slopes])
    expected = approx_fprime(point, lambda x: noisy._evaluate(*split(x))[0], 1e-6)
    np.testing.assert_allclose(found, expected, atol=5e-3, rtol=1e-3)


@pytest.mark.slow  # 100 logs of 800 people
def test_intervals_of_wrong_answers_cover(tmp_path):
    wrong, covered = np.array([0.1, 0.3, 0.45]), list[bool]()
    for seed in range(100):
        people = log_answers(tmp_path / "log", lambda rng: (rng.random(3) < wrong).tolist(), seed)
        number, *_ = list_form_tests(people, people.stated_rates)
        covered += [x.interval[0] <= p <= x.interval[1] for x, p in zip(number.wrong, wrong, strict=True)]
    assert len(covered) == 300
    assert 0.91 < np.mean(covered) < 0.99
