"""Soft evidence against weighted worlds, and against hard evidence."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ModelError, ProgramError, UndefinedError
from lcorpp.reasoning import Enumeration, Reasoner, parse_plog, read_plog
from lcorpp.values import Likelihood

PROGRAM = read_plog(Path(__file__).parent.parent / "plog" / "lcorpp.plog")
REASONER = Reasoner(PROGRAM)
WORLDS = Enumeration(PROGRAM).worlds
WEIGHT = st.floats(0, 5).filter(lambda w: w == 0 or w > 1e-3)


def weighed(asked: str, facts: dict[str, str], soft: dict[str, Likelihood]) -> dict[str, float]:
    """The marginal by brute force: every world has its measure times the weights of its values."""
    sums: dict[str, float] = {}
    for world in WORLDS:
        if all(world.values[name] == value for name, value in facts.items()):
            mass = float(world.measure)
            for name, likelihood in soft.items():
                mass *= dict(likelihood)[world.values[name]]
            sums[world.values[asked]] = sums.get(world.values[asked], 0.0) + mass
    total = sum(sums.values())
    return {value: mass / total for value, mass in sums.items()}


@settings(max_examples=30)
@given(
    st.lists(WEIGHT, min_size=2, max_size=2).filter(any),
    st.lists(WEIGHT, min_size=3, max_size=3).filter(any),
    st.sampled_from(["identity", "intention", "location", "time", "classifier"]),
    st.sampled_from([{}, {"location": "classroom"}, {"identity": "visitor"}]),
)
def test_likelihoods_weigh_the_enumerated_worlds(classifier, time, asked, facts):
    soft = {
        "classifier": Likelihood(("one", "zero"), classifier),
        "time": Likelihood(("morning", "afternoon", "evening"), time),
    }
    try:
        found = dict(REASONER.posterior(asked, {**facts, **soft}))
    except UndefinedError:  # weights that the facts rule out altogether
        assert not sum(
            float(w.measure) * dict(soft["time"])[w.values["time"]]
            for w in WORLDS
            if facts.items() <= w.values.items()
        )
        return
    for value, p in weighed(asked, facts, soft).items():
        assert found[value] == pytest.approx(p, abs=1e-12)


def test_a_certain_likelihood_equals_a_fact_and_an_even_one_no_evidence():
    facts = {"time": "afternoon", "location": "classroom"}
    sure = REASONER.posterior("intention", {**facts, "classifier": Likelihood(("one", "zero"), [0, 3])})
    hard = REASONER.posterior("intention", {**facts, "classifier": "zero"})
    np.testing.assert_allclose(sure.probabilities, hard.probabilities, atol=1e-15)
    open_minded = REASONER.posterior(
        "intention", {**facts, "classifier": Likelihood(("one", "zero"), [2, 2])}
    )
    nothing = REASONER.posterior("intention", facts)
    np.testing.assert_allclose(open_minded.probabilities, nothing.probabilities, atol=1e-12)


def test_only_ratios_matter_and_the_order_of_values_does_not():
    one = REASONER.posterior("intention", {"classifier": Likelihood(("one", "zero"), [0.2, 0.7])})
    other = REASONER.posterior("intention", {"classifier": Likelihood(("zero", "one"), [700, 200])})
    np.testing.assert_allclose(one.probabilities, other.probabilities, atol=1e-12)


def test_soft_evidence_with_an_intervention():
    soft = {"classifier": Likelihood(("one", "zero"), [1, 3])}
    done = REASONER.posterior("identity", soft, {"intention": "interested"})
    alone = REASONER.posterior("identity", {})
    np.testing.assert_allclose(done.probabilities, alone.probabilities, atol=1e-12)  # it was not their wish


@pytest.mark.parametrize(
    ("evidence", "words"),
    [
        (
            {"classifier": Likelihood(("one", "two"), [1, 1])},
            "a likelihood of one, two for classifier; expected",
        ),
        ({"mood": Likelihood(("a",), [1])}, "'mood'"),
        ({"classifier": Likelihood(("one", "zero"), [1, 2]), "classifier ": "one"}, "gives classifier twice"),
        (
            {"classifier": Likelihood(("one", "zero"), [1, 2]), "time": "noon"},
            "'noon' is not a value of time",
        ),
    ],
)
def test_likelihoods_that_do_not_match_the_program_are_errors(evidence, words):
    with pytest.raises(ProgramError, match=words):
        REASONER.posterior("intention", evidence)


def test_likelihoods_that_contradict_the_facts_are_undefined():
    certain = parse_plog(
        "s={a,b}. x:s. y:s. [r] random(x). [q] random(y). [q] pr(y=a|x=a)=1. [q] pr(y=a|x=b)=0."
    )
    with pytest.raises(UndefinedError, match=r"no possible world of positive measure has x=a, y=a:b as 0:1"):
        Reasoner(certain).posterior("x", {"x": "a", "y": Likelihood(("a", "b"), [0, 1])})
    assert Reasoner(certain).posterior("x", {"y": Likelihood(("a", "b"), [1, 3])})["b"] == pytest.approx(0.75)


def test_programs_with_cr_rules_reject_soft_evidence():
    program = parse_plog("s={a,b}. x:s. x=a :- not x=b. [c] x=b +-.")
    with pytest.raises(ProgramError, match="no meaning for a program with cr-rules"):
        Reasoner(program).posterior("x", {"x": Likelihood(("a", "b"), [1, 1])})


@pytest.mark.parametrize("weights", [[0, 0], [-1, 2], [np.nan, 1], [np.inf, 1], [1]])
def test_invalid_likelihoods_are_errors(weights):
    with pytest.raises(ModelError, match="likelihood"):
        Likelihood(("a", "b"), weights)
    with pytest.raises(ModelError):
        Likelihood(("a", "a"), [1, 2])


def test_likelihoods_can_be_printed_renamed_and_pickled():
    likelihood = Likelihood(("a", "b"), [1, 4])
    assert (str(likelihood), likelihood.most_likely()) == ("a:b as 0.25:1", "b")
    assert dict(likelihood.rename({"a": "x", "b": "y"})) == {"x": 0.25, "y": 1.0}
    assert dict(pickle.loads(pickle.dumps(likelihood))) == {"a": 0.25, "b": 1.0}
