"""The alarm: its statistics by another way, its bound, and what it names."""

import json

import numpy as np
import pytest

from lcorpp.errors import DataError, DecisionError, UndefinedError
from lcorpp.trust import Alarm, Hypotheses
from lcorpp.trust.alarm import ALTERNATIVE_DEGREES, BIASES, REPEATED_NOISES, TIRING_NOISES
from lcorpp.trust.answers import NOISE_DEGREES
from lcorpp.trust.finding import (
    BETTER_CHANGE,
    BIAS_CHANGE,
    HEARING,
    KNOWLEDGE,
    REPEATED_CHANGE,
    WORSE_CHANGE,
)
from lcorpp.values import Likelihood, Step
from tests.decision.fakes import VALUES, FakeDomain
from tests.trust.fakes import ANSWERS, AskDialogue, SkyReasoner

STATED_PROGRAM = SkyReasoner()
UNIFORM_PROGRAM = SkyReasoner(sunny=0.5, grey=0.5)
SWAPPED_PROGRAM = SkyReasoner(sunny=0.2, grey=0.9)
UNINFORMATIVE_RATES = SkyReasoner(rates=(0.5, 0.5))


def make_hypotheses(*reasoners, attributes=("", "wish", "wish", "label")):
    n = len(reasoners)
    changes, priors = [f"change {i}" for i in range(n)], np.full(n, 1 / n)
    return Hypotheses(reasoners, np.eye(n), attributes[:n], changes, priors, FakeDomain(), given=True)


def make_alarm(*reasoners, rate=0.05, **options):
    return Alarm(make_hypotheses(*reasoners, **options), AskDialogue(), rate=rate)


def draw(rng, n, truth=STATED_PROGRAM, wrong=0.25, n_answers=3, bias=0.0):
    """Yield the evidence and steps of n people; with the probability `bias` a nod replaces an answer."""
    for _ in range(n):
        sky = ("sunny", "grey")[rng.integers(2)]
        value = int(rng.random() >= truth.prior[sky])
        label = VALUES[int(rng.random() >= truth.rates[value, 0])]
        answers = [ANSWERS[value ^ int(rng.random() < wrong)] for _ in range(n_answers)]
        if bias:
            answers = [ANSWERS[0] if rng.random() < bias else answer for answer in answers]
        yield {"sky": sky, "label": label}, [Step("ask", a, np.ones(2) / 2) for a in answers]


def test_e_is_the_mean_likelihood_over_that_of_the_null():
    reasoners, rng = (STATED_PROGRAM, UNIFORM_PROGRAM, UNINFORMATIVE_RATES), np.random.default_rng(0)
    alarm = make_alarm(*reasoners, attributes=("", "wish", "label"), rate=1e-300)
    degrees = NOISE_DEGREES[ALTERNATIVE_DEGREES]
    models = [(0.25 + 0.25 * d, None, 0.0) for d in NOISE_DEGREES]
    models += [(0.25 + 0.25 * d, nod, b) for nod in (True, False) for b in BIASES for d in degrees]
    n_plain, forms = len(models), [*TIRING_NOISES, *[own[::-1] for own in TIRING_NOISES], *REPEATED_NOISES]
    likelihood = np.ones((3, n_plain + len(forms)))
    for evidence, steps in draw(rng, 40):
        for f, reasoner in enumerate(reasoners):
            for d, (wrong, nod, bias) in enumerate(models):
                total = 0.0
                for value in (0, 1):
                    p = reasoner.prior[evidence["sky"]] if value == 0 else 1 - reasoner.prior[evidence["sky"]]
                    p *= reasoner.rates[value, VALUES.index(evidence["label"])]
                    for step in steps:
                        heard = wrong if ANSWERS.index(step.observation) != value else 1 - wrong
                        p *= (1 - bias) * heard + bias * (nod == (step.observation == ANSWERS[0]))
                    total += p
                likelihood[f, d] *= total
            for d, noises in enumerate(forms, n_plain):
                total = 0.0
                for value in (0, 1):
                    p = reasoner.prior[evidence["sky"]] if value == 0 else 1 - reasoner.prior[evidence["sky"]]
                    p *= reasoner.rates[value, VALUES.index(evidence["label"])]
                    for n, step in enumerate(steps):
                        degree = noises[n] if len(noises) == 4 else noises[0]
                        is_right = ANSWERS.index(step.observation) == value
                        heard = 0.75 - 0.25 * degree if is_right else 0.25 + 0.25 * degree
                        if len(noises) == 2 and n:
                            heard = (1 - noises[1]) * (0.75 if is_right else 0.25)
                            heard += noises[1] * (step.observation == steps[n - 1].observation)
                        p *= heard
                    total += p
                likelihood[f, d] *= total
        alarm.update(evidence, steps)
    mean = 0.9 * likelihood[:, : len(NOISE_DEGREES)][:, ALTERNATIVE_DEGREES].mean()
    mean += 0.05 * likelihood[0, len(NOISE_DEGREES) : n_plain].mean()
    mean += 0.05 * likelihood[0, n_plain:].mean()
    assert alarm.log_e[KNOWLEDGE] == pytest.approx(np.log(mean / likelihood[0].max()))
    stated = int(np.flatnonzero(NOISE_DEGREES == 0)[0])
    assert alarm.log_e[HEARING] == pytest.approx(np.log(mean / likelihood[:, stated].max()))
    assert alarm.n_people == 40


@pytest.mark.parametrize(
    ("truth", "attribute", "wrong"),
    [
        (SWAPPED_PROGRAM, "wish", 0.35),
        pytest.param(UNINFORMATIVE_RATES, "label", 0.15, marks=pytest.mark.slow),
    ],
)
def test_the_wrong_attribute_is_named_whatever_the_noise(truth, attribute, wrong):
    alarm, named = (
        make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, SWAPPED_PROGRAM, UNINFORMATIVE_RATES),
        list[str](),
    )
    for seed in range(10):
        alarm = make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, SWAPPED_PROGRAM, UNINFORMATIVE_RATES)
        for evidence, steps in draw(np.random.default_rng(seed), 600, truth, wrong):
            named += [
                name for f in alarm.update(evidence, steps) if f.part == KNOWLEDGE for name in f.attributes
            ]
    assert len(named) == 10
    assert named.count(attribute) >= 9


def test_noisy_answers_are_a_fault_of_hearing_alone():
    alarm = make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, SWAPPED_PROGRAM, UNINFORMATIVE_RATES)
    for evidence, steps in draw(np.random.default_rng(1), 400, wrong=0.4):
        alarm.update(evidence, steps)
    (finding,) = alarm.findings
    assert (finding.part, finding.attributes) == (HEARING, ())
    assert finding.noise > 0.3
    html = alarm._repr_html_()
    assert "<caption>Alarm after 400 people; raised at E = 20</caption>" in html
    assert f"<td>{HEARING}</td><td>{np.exp(alarm.log_e[HEARING]):.3g}</td><td>{finding.person}</td>" in html
    assert repr(alarm).startswith("<Alarm at 20 after 400 people: E(knowledge) = ")


@pytest.mark.parametrize(
    ("change", "wrong"),
    [
        (WORSE_CHANGE, lambda rng, n: rng.random(4) < (0.25, 0.35, 0.45, 0.5)),
        (BETTER_CHANGE, lambda rng, n: rng.random(4) < (0.45, 0.35, 0.25, 0.1)),
        (REPEATED_CHANGE, lambda rng, n: np.full(4, rng.random() < 0.3)),
    ],
)
def test_the_form_of_the_answers_is_named(change, wrong):
    """In each of five streams, maybe after an alarm about noise; the knowledge raises none."""
    for seed in range(5):
        rng, alarm = np.random.default_rng(seed), make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, SWAPPED_PROGRAM)
        for n, (evidence, _) in enumerate(draw(rng, 600)):
            value = int(rng.random() >= STATED_PROGRAM.prior[evidence["sky"]])
            evidence["label"] = VALUES[int(rng.random() >= STATED_PROGRAM.rates[value, 0])]
            answers = [ANSWERS[value ^ int(is_wrong)] for is_wrong in wrong(rng, n)]
            alarm.update(evidence, [Step("ask", a, np.ones(2) / 2) for a in answers])
        assert [(f.part, f.change) for f in alarm.findings][-1] == (HEARING, change)
        assert {f.part for f in alarm.findings[:-1]} <= {HEARING}
        assert [f.change for f in alarm.findings[:-1]] in ([], [""])


@pytest.mark.parametrize("n_answers", [1, 3])
def test_biased_answers_are_no_fault_of_the_knowledge(n_answers):
    more_yes = SkyReasoner(sunny=0.95, grey=0.5)
    alarm = make_alarm(STATED_PROGRAM, more_yes)
    for evidence, steps in draw(np.random.default_rng(1), 600, n_answers=n_answers, bias=0.35):
        alarm.update(evidence, steps)
    assert [(finding.part, finding.change) for finding in alarm.findings] == [(HEARING, BIAS_CHANGE)]


@pytest.mark.slow
def test_false_alarms_are_rarer_than_the_rate():
    alarms = 0
    for seed in range(100):
        alarm = make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, SWAPPED_PROGRAM, UNINFORMATIVE_RATES, rate=0.2)
        for evidence, steps in draw(np.random.default_rng([7, seed]), 100):
            alarm.update(evidence, steps)
        alarms += bool(alarm.findings)
    assert alarms <= 20


def test_equivalent_attributes_are_all_named():
    alarm = make_alarm(STATED_PROGRAM, SWAPPED_PROGRAM, SWAPPED_PROGRAM, attributes=("", "wish", "identity"))
    for evidence, steps in draw(np.random.default_rng(0), 100, SWAPPED_PROGRAM):
        alarm.update(evidence, steps)
    assert [set(finding.attributes) for finding in alarm.findings] == [{"wish", "identity"}]
    assert alarm.findings[0].probability == pytest.approx(1)


def test_a_likelihood_counts_as_the_labels_that_it_mixes():
    hypotheses = make_hypotheses(STATED_PROGRAM, UNINFORMATIVE_RATES)
    labels = [hypotheses.predict({"sky": "sunny", "label": label}) for label in VALUES]

    class SoftReasoner(SkyReasoner):
        def posterior(self, attribute, evidence):
            label = evidence.get("label")
            if attribute == "label" or label is None:
                return super().posterior(attribute, evidence)
            rows = self.rates @ label.weights
            p = np.array([self.prior["sunny"], 1 - self.prior["sunny"]]) * rows
            return type(super().posterior("wish", {}))(VALUES, p / p.sum())

    soft = Hypotheses([SoftReasoner()], np.eye(1), [""], [""], np.ones(1), FakeDomain(), given=True)
    weights = np.array([1.0, 0.25])
    found = soft.predict({"sky": "sunny", "label": Likelihood(VALUES, weights)})
    np.testing.assert_allclose(
        found, weights @ np.array([table[:1] for table in labels])[:, 0][:, None].transpose(1, 0, 2)
    )


def test_other_hypotheses_about_the_same_faults_continue():
    alarm = make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM)
    assert alarm.replace_hypotheses(make_hypotheses(UNINFORMATIVE_RATES, UNIFORM_PROGRAM))
    assert not alarm.replace_hypotheses(make_hypotheses(STATED_PROGRAM, UNIFORM_PROGRAM, UNINFORMATIVE_RATES))


@pytest.mark.parametrize("n_before", [0, 7, 200])
def test_a_restart_goes_on_exactly(n_before):
    people = list(draw(np.random.default_rng(5), 300, SWAPPED_PROGRAM, wrong=0.4))
    whole = make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, SWAPPED_PROGRAM, UNINFORMATIVE_RATES)
    for evidence, steps in people[:n_before]:
        whole.update(evidence, steps)
    restarted = make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, SWAPPED_PROGRAM, UNINFORMATIVE_RATES)
    restarted.restore(json.loads(json.dumps(whole.state(), allow_nan=False)))
    assert restarted.findings == whole.findings
    for evidence, steps in people[n_before:]:
        assert restarted.update(evidence, steps) == whole.update(evidence, steps)
    assert restarted.findings == whole.findings != []
    assert restarted.state() == whole.state()


def test_a_state_that_does_not_fit_is_refused():
    alarm = make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM)
    for evidence, steps in draw(np.random.default_rng(0), 5):
        alarm.update(evidence, steps)
    state = json.loads(json.dumps(alarm.state()))
    with pytest.raises(DecisionError, match="the alarm already counts 5 people; expected a new one"):
        alarm.restore(state)
    with pytest.raises(DecisionError, match="an alarm with other hypotheses; expected its own"):
        make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, UNINFORMATIVE_RATES).restore(state)
    with pytest.raises(DecisionError, match=r"with .*'rate': 0\.05\}; expected .*'rate': 0\.01\}"):
        make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, rate=0.01).restore(state)
    finding = {"attributes": ["wish"], "colour": "red"}
    for damage in ({"posterior": [1]}, {"log_m": None}, {"knowledge": "x"}, {"findings": [finding]}):
        with pytest.raises(DecisionError, match="the state of the alarm is damaged"):
            make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM).restore(state | damage)
    for name in state:
        with pytest.raises(DecisionError, match=f"damaged .*{name}"):
            make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM).restore(
                {key: value for key, value in state.items() if key != name}
            )


def test_bad_arguments_are_refused():
    with pytest.raises(
        DecisionError, match="the rate of false alarms is 1; expected a number between 0 and 1"
    ):
        make_alarm(STATED_PROGRAM, UNIFORM_PROGRAM, rate=1)
    with pytest.raises(DecisionError, match="the first hypothesis is another program"):
        Hypotheses([STATED_PROGRAM], np.zeros((1, 1)), [""], [""], np.ones(1), FakeDomain())
    with pytest.raises(DecisionError, match=r"weights of shape \(2, 1\); expected \(1, 1\)"):
        Hypotheses([STATED_PROGRAM], np.ones((2, 1)), [""], [""], np.ones(1), FakeDomain())
    with pytest.raises(DataError, match="hypotheses: priors is 'even'; expected an array of numbers"):
        Hypotheses([STATED_PROGRAM], np.eye(1), [""], [""], "even", FakeDomain())
    assert Hypotheses([STATED_PROGRAM], [[1]], [""], [""], [1], FakeDomain()).priors.tolist() == [1.0]


def test_evidence_that_the_stated_program_excludes_is_an_error_others_have_probability_0():
    class Excluding(SkyReasoner):
        def posterior(self, attribute, evidence):
            raise UndefinedError("impossible")

    evidence = {"sky": "sunny", "label": "yes"}
    assert make_hypotheses(STATED_PROGRAM, Excluding()).predict(evidence)[1].tolist() == [0, 0]
    with pytest.raises(UndefinedError):
        make_hypotheses(Excluding(), STATED_PROGRAM).predict(evidence)
