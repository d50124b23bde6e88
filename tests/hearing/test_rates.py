"""The measured observation model: known answers of noises, assumptions, rates and bins."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.errors import DataError, DomainError
from lcorpp.hearing.answers import assume_said, check_answers, parse_said
from lcorpp.hearing.bins import (
    EDGES,
    ScoredCases,
    choose_bins,
    find_policy,
    list_observations,
    name_bins,
)
from lcorpp.hearing.loop import simulate_loop
from lcorpp.hearing.noises import SPEECH_LEVEL, add_noise, make_noise, parse_noises, set_level
from lcorpp.hearing.rates import (
    HeardCases,
    find_row_intervals,
    make_model,
    make_observation_rows,
    round_rows,
)
from lcorpp.planning import Planner, evaluate

OTHERS = ("talk", "silence")
SAID = {"expected": 0.8, "other": 0.05, "talk": 0.05, "silence": 0.1}


@pytest.fixture(scope="module")
def domain():
    return load_domain("intention")


def test_noises_have_the_stated_ratio():
    rng = np.random.default_rng(0)
    speech = set_level(np.concatenate([np.zeros(500), np.sin(np.arange(16000) / 5), np.zeros(500)]))
    assert len(speech) < 16010  # without the silence at its ends
    assert np.sqrt(np.mean(speech**2)) == pytest.approx(SPEECH_LEVEL)
    talk = [set_level(rng.normal(size=8000)) for _ in range(3)]
    for noise in parse_noises("white:20,babble:10"):
        power = np.mean(make_noise(noise, 50_000, talk, rng) ** 2)
        assert 10 * np.log10(SPEECH_LEVEL**2 / power) == pytest.approx(noise.snr, abs=0.2)
    clean = parse_noises("clean")[0]
    assert np.abs(add_noise(speech, clean, [], rng)[:5000]).max() < 1e-3


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected one of clean, white:SNR, babble:SNR"),
        ("white", "expected one of clean"),
        ("clean:20", "expected one of clean"),
        ("pink:20", "expected one of clean"),
        ("white:loud", "SNR is 'loud'; expected a number from -20 to 60"),
        ("white:nan", "expected a number"),
        ("clean,clean", "one is repeated"),
        ("clean@.5,white:20@.4", "the shares sum to 0.9, not 1"),
        ("clean@2", "share is '2'; expected a number from 0 to 1"),
    ],
)
def test_noises_that_are_none(text, words):
    with pytest.raises(DataError, match=words):
        parse_noises(text)
    assert [noise.share for noise in parse_noises("clean@.6,white:20@.4")] == [0.6, 0.4]


def test_what_people_say_follows_the_stated_model(domain):
    said = assume_said(domain, SAID, OTHERS)
    assert said.kinds == ("pos", "neg", "talk", "silence")
    pomdp = domain.pomdp
    greet, turn, report = map(pomdp.action_index, ("greet", "turn", "report_interested"))
    np.testing.assert_allclose(said.probabilities[greet, 0], [0.8, 0.05, 0.05, 0.1])
    np.testing.assert_allclose(said.probabilities[greet, 1], [0.05, 0.8, 0.05, 0.1])
    np.testing.assert_allclose(said.probabilities[turn, 0], [0, 0, 0, 1])  # a turn that failed
    assert not said.probabilities[report].any()
    assert not said.probabilities[:, 4].any()  # term
    np.testing.assert_allclose(said.is_measured[:3, :4], 1)


def test_assumptions_that_are_wrong():
    assert parse_said("expected=.9,silence=.1", OTHERS) == {"expected": 0.9, "silence": 0.1}
    for text, words in (
        ("expected=.9", "sum to 0.9, not 1"),
        ("pos=.9,silence=.1", "expected one of expected, other, talk, silence, each once"),
        ("expected=.5,expected=.5", "each once"),
        ("expected=x", "expected a probability after the ="),
        ("expected=nan,other=1", "expected a probability"),
        ("", "expected one of"),
    ):
        with pytest.raises(DataError, match=words):
            parse_said(text, OTHERS)


def test_observations_without_sentences_are_errors(tmp_path):
    with pytest.raises(DomainError, match=r"expected \[planning.utterances\] with sentences"):
        check_answers(load_domain("museum"))
    whole = load_domain("intention")
    half = replace(whole, planning=replace(whole.planning, utterances={"pos": ("yes",)}))
    with pytest.raises(DomainError, match="has no sentences for the observation 'neg'"):
        check_answers(half)


def make_cases(heard, observations, kinds=("pos", "neg", "talk", "silence"), n=1000) -> HeardCases:
    """Return n cases of each kind with exact shares heard[kind] (K, O), in sentences of ten cases."""
    counts = np.round(np.array(heard) * n).astype(int)
    said = np.repeat(np.arange(len(kinds)), counts.sum(axis=1))
    which = np.concatenate([np.repeat(np.arange(len(observations)), row) for row in counts])
    return HeardCases(
        said,
        np.zeros_like(said),
        np.arange(len(said)) // 10,
        which,
        kinds,
        ("clean",),
        np.ones(1),
        observations,
    )


def test_the_model_is_the_sum_over_what_is_said(domain):
    observations = ("pos", "neg", "none")
    heard = [[0.9, 0.02, 0.08], [0.04, 0.86, 0.1], [0.1, 0.05, 0.85], [0.0, 0.0, 1.0]]
    cases, said = make_cases(heard, observations), assume_said(domain, SAID, OTHERS)
    rates = cases.estimate(cases.count())
    np.testing.assert_allclose(rates, heard, atol=1e-3)  # pseudo-counts
    assert rates.min() > 0
    model = make_model(domain.pomdp, observations, rates, said)
    greet = model.action_index("greet")
    expected = 0.8 * 0.9 + 0.05 * 0.04 + 0.05 * 0.1
    assert model.observation.dense[greet, 0, 0] == pytest.approx(expected, abs=2e-3)
    np.testing.assert_array_equal(model.observation.dense[:, 4], domain.pomdp.observation.dense[:, 4])
    assert model.observation.dense[:3, :4].min() > 0  # silence, and errors, are always possible
    low, high = find_row_intervals(cases, said, np.random.default_rng(0))
    rows = make_observation_rows(rates, said)[greet, 0]
    assert ((low[greet, 0] <= rows) & (rows <= high[greet, 0])).all()


def test_intervals_count_cases():
    cases = make_cases([[0.9, 0.1]], ("pos", "none"), ("pos",), 100)
    interval, n = cases.interval("pos", "clean", ("pos",))
    assert (n, interval.estimate) == (100, 0.9)
    assert 0.82 < interval.low < 0.9 < interval.high < 0.95
    assert cases.interval("pos", None, ("pos", "none"))[0].estimate == 1


def test_rows_have_four_decimals_and_sum_to_one():
    rows = np.random.default_rng(0).dirichlet(np.full(5, 0.2), size=200)
    rounded = round_rows(rows)
    np.testing.assert_allclose(rounded.sum(axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(rounded, np.round(rounded, 4), atol=1e-12)
    assert np.abs(rounded - rows).max() < 6e-4
    assert rounded.min() >= 1e-4


def make_scored(confidence_of, answers=("pos", "neg"), n=400) -> ScoredCases:
    """Return cases of pos and neg whose answers are right with the confidence that they have."""
    rng = np.random.default_rng(0)
    confidence = confidence_of(rng, 2 * n)
    said = np.repeat([0, 1], n)
    right = rng.random(2 * n) < confidence
    return ScoredCases(
        np.where(right, said, 1 - said)[:, None],
        confidence[:, None],
        said,
        np.zeros(2 * n, int),
        np.arange(2 * n),
        np.zeros(2 * n, bool),
        (*answers, *OTHERS),
        answers,
        ("clean",),
        np.ones(1),
    )


def test_bins_separate_sure_answers_from_guesses(domain):
    """Half of the answers are right for sure, the others are guesses: bins must tell them apart."""
    cases = make_scored(lambda rng, n: np.where(rng.random(n) < 0.5, 0.999, 0.5))
    said = assume_said(domain, SAID, OTHERS)
    bins, value = choose_bins(domain.pomdp, cases, said, levels=(0.9, 0.4))
    assert {own[0] for own in bins.values()} == {("pos", 0.9), ("neg", 0.9)}
    one_bin = name_bins({"pos": (0.02, 0.02), "neg": (0.02, 0.02)})
    heard = cases.hear(one_bin, test=False)
    model = make_model(domain.pomdp, heard.observations, heard.estimate(heard.count()), said)
    assert value > find_policy(model, 1e6).value(model.start) + 1


def test_the_names_of_bins():
    bins = name_bins({"pos": (0.9, 0.5), "neg": (0.7, 0.7)})
    assert bins == {"pos": (("pos", 0.9), ("pos_unsure", 0.5)), "neg": (("neg", 0.7),)}
    assert list_observations(("pos", "neg"), bins) == ("pos", "pos_unsure", "neg", "none")
    assert list(EDGES) == sorted(EDGES, reverse=True)


def test_the_loop_earns_what_its_cases_promise(domain):
    """With the cases of the model itself, the simulated value is the exact one."""
    observations = ("pos", "neg", "none")
    heard = [[0.85, 0.05, 0.1], [0.05, 0.8, 0.15], [0.1, 0.1, 0.8], [0.01, 0.01, 0.98]]
    cases, said = make_cases(heard, observations), assume_said(domain, SAID, OTHERS)
    model = make_model(domain.pomdp, observations, cases.estimate(cases.count()), said)
    policy = find_policy(model, 1e6)
    simulated = simulate_loop(Planner(policy, model), said, cases, 1500, np.random.default_rng(0))
    exact = evaluate(model, policy).interval.estimate
    half = (simulated.high - simulated.low) / 2
    assert abs(simulated.estimate - exact) < 2 * half  # four standard errors
