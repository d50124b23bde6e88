"""Own reasoners: their answers decide, they are checked, and errors name the user's line."""

import pickle
import shutil
from dataclasses import replace

import numpy as np
import pytest

from lcorpp import ConfusionMatrix, load_domain, load_robot
from lcorpp.assembly import solve_domain
from lcorpp.assembly.logged_parts import list_changed_files, load_logged_domain
from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.audit import read_people
from lcorpp.decision import LCORPP
from lcorpp.domains import with_reasoner
from lcorpp.domains.inspection import inspect_domain
from lcorpp.domains.loading import SHIPPED_FOLDER
from lcorpp.errors import DomainError, UndefinedError
from lcorpp.logs import DecisionLog
from lcorpp.logs.watching import make_hypotheses
from lcorpp.reasoning import Reasoner
from lcorpp.values import Distribution, Likelihood

OWN = """
import numpy as np
from lcorpp.errors import UndefinedError
from lcorpp.reasoning import Reasoner
from lcorpp.values import Distribution

class Same:
    def __init__(self, program, rates):
        self.reasoner, self.lock = Reasoner(program), (each for each in ())  # a generator has no pickle
    def posterior(self, shared, evidence):
        return {value: p for value, p in reversed(list(self.reasoner.posterior(shared, evidence)))}

class ByRates:
    def __init__(self, program, rates):
        self.rates = rates["classifier"]
    def posterior(self, shared, evidence):
        weights = dict.fromkeys(("interested", "not_interested"), 0.5)
        if "classifier" in evidence:
            for value, rates in self.rates.items():
                weights[value] *= rates[evidence["classifier"]]
        total = sum(weights.values())
        return {value: weight / total for value, weight in weights.items()}

class Part:
    def __init__(self, result):
        self.result = result
    def posterior(self, shared, evidence):
        if self.result == "impossible":
            raise UndefinedError("nobody is there at night")
        if self.result == "fails":
            return evidence["age"]
        return self.result

def fails(program, rates): return Part("fails")
def impossible(program, rates): return Part("impossible")
def none(program, rates): return Part(None)
def unknown(program, rates): return Part({"bored": 1})
def missing(program, rates): return Part({"interested": 1})
def large(program, rates): return Part({"interested": 0.9, "not_interested": 0.2})
def negative(program, rates): return Part({"interested": -0.5, "not_interested": 1.5})
def nan(program, rates): return Part({"interested": np.nan, "not_interested": 1})
def text(program, rates): return Part({"interested": "much", "not_interested": 0.2})
def given(program, rates): return Part(Distribution(("not_interested", "interested"), [0.3, 0.7]))
def huge(program, rates): return Part({"interested": 10**400, "not_interested": 0})
def tiny(program, rates): return Part({"interested": -1e-17, "not_interested": 1})
def number(program, rates): return 3
def a_class(program, rates): return Same
def breaks(program, rates): return rates["gaze"]
"""


@pytest.fixture
def own(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    return tmp_path / "own.py"


def make(own, name):
    domain = with_reasoner(load_domain("intention", preset="paper"), f"{own}:{name}")
    return domain.make_reasoner(domain.program)


def test_the_answers_are_in_the_order_of_the_values(own):
    answer = make(own, "given").posterior("intention", {})
    assert answer.values == ("interested", "not_interested")
    assert answer.probabilities.tolist() == [0.7, 0.3]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("fails", r"own\.py:\d+: posterior\(\) failed: KeyError: 'age'"),
        ("none", r"own\.py:\d+: posterior\(\) returned None; expected value -> probability"),
        ("unknown", r"'bored' is no value; expected one of interested, not_interested"),
        ("missing", r"not_interested is missing; expected a probability of each value"),
        ("large", r"with the sum 1; the sum is 1\.1"),
        ("negative", r"expected probabilities from 0 to 1"),
        ("nan", r"expected probabilities from 0 to 1 with the sum 1"),
        ("text", r"expected numbers as probabilities"),
        ("huge", r"own\.py.*: posterior\(\) failed: OverflowError"),
    ],
)
def test_a_wrong_answer_is_named_with_its_line(own, name, words):
    with pytest.raises(DomainError, match=words):
        make(own, name).posterior("intention", {})


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("number", r"own\.py:\d+: number\(\) returned 3; expected an object with the method posterior"),
        ("a_class", r"a_class\(\) returned the class Same; expected an object"),
        ("breaks", r"own\.py:\d+: breaks\(\) failed: KeyError: 'gaze'"),
        ("absent", r"own\.py has no function 'absent'; expected one of Same, ByRates"),
    ],
)
def test_a_wrong_function_is_named(own, name, words):
    with pytest.raises(DomainError, match=words):
        make(own, name)


def test_a_rounding_error_below_zero_is_zero(own):
    assert make(own, "tiny").posterior("intention", {}).probabilities.tolist() == [0, 1]


def test_impossible_evidence_keeps_its_type(own):
    with pytest.raises(UndefinedError, match="nobody is there at night"):
        make(own, "impossible").posterior("intention", {})


def test_the_rates_are_those_of_the_classifier(own):
    """The program's .76 and .29; a trained matrix with smoothing 1/2 gives 9.5 / 11 and 2.5 / 11."""
    reasoner = make(own, "ByRates")
    assert reasoner.posterior("intention", {"classifier": "one"})["interested"] == pytest.approx(0.76 / 1.05)
    domain = with_reasoner(load_domain("intention"), f"{own}:ByRates")
    confusion = ConfusionMatrix(("interested", "not_interested"), [[9, 1], [2, 8]])
    trained = domain.make_reasoner(domain.program_for({"motion": confusion}))
    assert trained.posterior("intention", {"classifier": "one"})["interested"] == pytest.approx(9.5 / 12)


def test_other_attributes_are_refused_but_for_labels(own):
    reasoner = make(own, "Same")
    with pytest.raises(DomainError, match="answers about intention alone, not identity"):
        reasoner.posterior("identity", {})
    program = Reasoner(load_domain("intention", preset="paper").program)
    ours = reasoner.posterior("classifier", {})
    np.testing.assert_allclose(ours.probabilities, program.posterior("classifier", {}).probabilities)


def test_it_is_made_again_in_another_process(own):
    again = pickle.loads(pickle.dumps(make(own, "Same")))
    assert again.posterior("intention", {"time": "morning"}).most_likely() == "not_interested"


@pytest.mark.parametrize("name", ["intention", "museum"])
def test_the_program_as_an_own_reasoner_changes_nothing(own, name):
    """Start beliefs, decisions, trust: the same as without it."""
    domain = load_domain(name, changes={"planning": {"time_limit": 5}})
    changed = with_reasoner(domain, f"{own}:Same")
    for ours, theirs in zip(domain.list_starts(), changed.list_starts(), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    solution = solve_domain(domain)
    robots = [load_robot(each, policy=solution.policy) for each in (domain, changed)]
    senses = {s.name: s.classes[0] for s in domain.senses}
    for facts in ({}, {name: values[0] for name, values in domain.reasoning.observed_values.items()}):
        for labels in ({}, senses):
            ours, theirs = (
                robot.robot.reasoner.posterior(domain.shared, domain.evidence(facts, labels))
                for robot in robots
            )
            np.testing.assert_allclose(ours.probabilities, theirs.probabilities, atol=1e-12)
        ours, theirs = (robot.decide(facts, labels=senses, seed=1) for robot in robots)
        assert (ours.report, len(ours.steps)) == (theirs.report, len(theirs.steps))
    if name == "intention":  # all senses are about the shared variable
        trusts = [set_up_trust(r.domain, r.robot.reasoner, r.robot.planner) for r in robots]
        ours, theirs = (trust.posterior(domain.shared, {"classifier": "one"}) for trust in trusts)
        np.testing.assert_allclose(ours.probabilities, theirs.probabilities, atol=1e-12)


def test_soft_evidence_reaches_it(own):
    likelihood = Likelihood(("one", "zero"), np.array([1.0, 0.25]))
    ours = make(own, "Same").posterior("intention", {"classifier": likelihood})
    domain = load_domain("intention", preset="paper")
    theirs = domain.make_reasoner(domain.program).posterior("intention", {"classifier": likelihood})
    np.testing.assert_allclose(ours.probabilities, theirs.probabilities)


@pytest.fixture
def folder(own, tmp_path):
    """The paper's domain with a reasoner in its domain.toml."""
    copy = tmp_path / "mine"
    shutil.copytree(SHIPPED_FOLDER / "intention", copy)
    shutil.copy(own, copy / "own.py")
    text = (copy / "domain.toml").read_text()
    (copy / "domain.toml").write_text(
        text.replace("[reasoning]\n", '[reasoning]\nreasoner = "own.py:Same"\n')
    )
    return copy


def test_a_domain_names_its_reasoner(folder, tmp_path):
    domain = load_domain(folder, preset="paper")
    assert repr(domain.reasoning.own_reasoners).endswith("own.py:Same")
    assert isinstance(domain.make_reasoner(domain.program).posterior("intention", {}), Distribution)
    assert folder / "own.py" in inspect_domain(folder, "paper").code  # which is not run
    text = (folder / "domain.toml").read_text()
    (folder / "domain.toml").write_text(text.replace("own.py:Same", "own"))
    with pytest.raises(DomainError, match=r"reasoner: is 'own'; expected FILE.py:NAME"):
        load_domain(folder)
    (folder / "domain.toml").write_text(text.replace("own.py:Same", "../own.py:Same"))
    with pytest.raises(DomainError, match="outside of the domain folder"):
        load_domain(folder)


def test_a_log_has_the_reasoner(own, folder, tmp_path):
    elsewhere = with_reasoner(load_domain("intention", preset="paper"), f"{own}:Same")
    for domain, source in ((load_domain(folder), "own.py:Same"), (elsewhere, f"{own}:Same")):
        description = load_robot(domain, cache=False).parts.description
        assert description["reasoner"]["source"] == source
        again = load_logged_domain(description)
        assert again.reasoning.own_reasoners is not None
        assert list_changed_files(again, description) == []
    own.write_text(f"{OWN}\n# changed")
    assert list_changed_files(elsewhere, description) == [f"reasoner: {own}:Same"]
    without = replace(elsewhere, reasoning=replace(elsewhere.reasoning, own_reasoners=None))
    assert list_changed_files(without, description) == [f"reasoner: {own}:Same"]


def test_what_needs_the_rules_says_so(own, tmp_path):
    domain = with_reasoner(load_domain("intention", preset="paper"), f"{own}:Same")
    words = "needs the rules of the program, but the reasoner .*own.py:Same decides in"
    with pytest.raises(DomainError, match=f"the alarm {words}"):
        make_hypotheses(domain)
    robot = load_robot(domain, cache=False)
    with DecisionLog(tmp_path / "log.jsonl") as log:
        log.append(robot.parts, LCORPP, {}, robot.decide({}, label="zero", world=9 * ["pos"]))
    with pytest.raises(DomainError, match=f"an audit {words}"):
        read_people(tmp_path / "log.jsonl")
