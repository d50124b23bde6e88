"""Several senses: their sections, evidence and labels, and exact scores that simulation meets."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.decision.strategies import list_strategies, strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DomainError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.values import Likelihood

from .deliveries import GAZE, PLOG, VOICE, write_domain


@pytest.fixture
def domain(tmp_path):
    return load_domain(write_domain(tmp_path / "two", senses=GAZE + VOICE))


WRONG = [
    (
        GAZE
        + VOICE.replace('attribute = "voice"', 'attribute = "gaze"')
        .replace("low", "left")
        .replace("high", "right"),
        r"toml:14: \[learning\[2\]\] attribute: 'gaze' is already the attribute of the sense at .*toml:8: ",
    ),
    (
        GAZE + VOICE.replace('name = "voice"', 'name = "gaze"'),
        r"toml:13: \[learning\[2\]\] name: 'gaze' is already the name of the sense at .*toml:7: ",
    ),
    (GAZE + VOICE.replace('of = "person"', ""), r"toml:12: \[learning\[2\]\] of is missing"),
    (GAZE + VOICE.replace('"bob"', '"bill"'), r"toml:16: \[learning\[2\]\] labels: 'bill' is not among"),
    (
        GAZE + VOICE + "tracks = 1\n",
        r"toml:18: \[learning\[2\]\] tracks: expected a whole number of at least 4",
    ),
    (
        GAZE
        + VOICE.replace('labels = { low = "ann", high = "bob" }', "")
        + '[learning.labels]\nlow = "ann"\nhigh = 3\n',
        r"toml:18: \[learning\[2\]\] labels: expected a table of names",
    ),
    (
        GAZE + 'evidence = "firm"\n' + VOICE,
        r"toml:12: \[learning\[1\]\] evidence: 'firm': expected one of hard, soft, set",
    ),
    (GAZE + "trucks = 1\n" + VOICE, r"toml:12: \[learning\[1\]\] trucks: unknown key"),
    (
        GAZE.replace('"gaze"\nof', '"item"\nof'),
        r"toml:8: \[learning\[1\]\] attribute: 'item' is already shared or obs",
    ),
    (
        GAZE.replace('name = "gaze"', 'name = "the gaze=1"'),
        r"toml:7: \[learning\[1\]\] name: 'the gaze=1'; expected letters, digits and _",
    ),
    (
        GAZE + VOICE + "[simulation.channel.smell]\nann = { low = 1, high = 0 }\n",
        r"toml:18: \[simulation.channel\] smell: unknown key; expected one of gaze, voice",
    ),
    (GAZE.replace('of = "item"', 'of = "time"'), r"toml:9: \[learning\[1\]\] of: 'time' is .*observed"),
]


@pytest.mark.parametrize(("senses", "words"), WRONG, ids=range(len(WRONG)))
def test_wrong_sections_are_located(tmp_path, senses, words):
    with pytest.raises(DomainError, match=words):
        load_domain(write_domain(tmp_path / "wrong", senses=senses))


@pytest.mark.parametrize(("attribute", "line", "key"), [("gaze", 8, "attribute"), ("look", 9, "of")])
def test_a_label_and_what_it_is_about_have_values_in_every_world(tmp_path, attribute, line, key):
    plog = PLOG.replace("time : times.", "looks = {up, down}. look : looks. random(look). time : times.")
    senses = GAZE.replace('of = "item"', 'of = "look"').replace('"tea"', '"up"').replace('"soup"', '"down"')
    load_domain(write_domain(tmp_path / "good", senses=senses, plog=plog))
    plog = plog.replace(f"random({attribute}).", f"random({attribute}) :- time=noon.")
    words = (
        rf"toml:{line}: \[learning\[1\]\] {key}: '{attribute}' needs a value in every possible world .*plog:4"
    )
    with pytest.raises(DomainError, match=words):
        load_domain(write_domain(tmp_path / "wrong", senses=senses, plog=plog))


def test_one_table_or_a_list_of_one_is_the_same(tmp_path):
    listed = load_domain(write_domain(tmp_path / "a", senses=GAZE))
    table = load_domain(write_domain(tmp_path / "b", senses=GAZE.replace("[[learning]]", "[learning]")))
    assert listed.senses == table.senses
    assert listed.find_sense("gaze").classes == ("tea", "soup")


def test_evidence_has_the_label_of_each_sense(domain):
    evidence = domain.evidence({"time": "noon"}, {"gaze": "tea", "voice": Likelihood(("ann", "bob"), [1, 4])})
    assert evidence["gaze"] == "left"
    assert dict(evidence["voice"]) == {"low": 0.25, "high": 1}
    with pytest.raises(DomainError, match=r"domain\.toml: no sense 'nose'; expected one of gaze, voice"):
        domain.evidence({}, {"nose": "tea"})


def test_labels_alone_give_a_product_and_their_mean(domain, tmp_path):
    """The room has no sense, so it is uniform; two senses about one variable are averaged."""
    found = domain.label_marginal({"gaze": "left", "voice": Likelihood(("low", "high"), [1, 4])})
    assert found[("tea", "ann", "lab")] == found[("tea", "ann", "hall")] == pytest.approx(0.1)
    assert found[("tea", "bob", "hall")] == pytest.approx(0.4)
    assert found[("soup", "bob", "hall")] == 0
    assert domain.label_marginal({"time": "noon"}) is None
    both = VOICE.replace('of = "person"', 'of = "item"').replace('"ann"', '"tea"').replace('"bob"', '"soup"')
    rivals = load_domain(write_domain(tmp_path / "rivals", senses=GAZE + both))
    found = rivals.label_marginal({"gaze": "left", "voice": "high"})
    np.testing.assert_allclose(found.probabilities, 1 / 8)


def test_the_class_that_a_report_names(domain, tmp_path):
    assert domain.class_of("voice", ("tea", "bob", "hall")) == "bob"
    shared = 'shared = ["item", "person", "room"]'
    hidden = GAZE.replace('of = "item"', 'of = "voice"').replace("tea", "low").replace("soup", "high")
    other = load_domain(write_domain(tmp_path / "hidden", senses=hidden, shared=shared))
    with pytest.raises(
        DomainError, match="'gaze' classifies voice, which is not shared; a report names item, p"
    ):
        other.class_of("gaze", ("tea", "bob", "hall"))
    assert other.label_marginal({"gaze": "left"}) is None


def test_each_sense_can_be_left_out():
    rows = list_strategies(["gaze", "voice"])
    assert [row.name for row in rows[-3:]] == ["LCORPP", "LCORPP-gaze", "LCORPP-voice"]
    assert [(row.uses("gaze"), row.uses("voice")) for row in rows[-3:]] == [
        (True, True),
        (False, True),
        (True, False),
    ]
    assert strategies(["lcorpp-voice"], ["gaze", "voice"]) == rows[-1:]


def test_exact_scores_and_simulation_agree(domain):
    """Five rows, 1200 people: each mean within 4 standard errors; both senses are worth most."""
    rows = strategies(["L", "R+P", "LCORPP", "LCORPP-gaze", "LCORPP-voice"], ["gaze", "voice"])
    options = ComparisonOptions(rows, trials=None, cache=find_cache_folder())
    exact = compare_strategies(domain, options).scores
    drawn = compare_strategies(domain, replace(options, trials=1200, seed=1)).scores
    for one, other in zip(exact, drawn, strict=True):
        for name in ("accuracy", "cost", "return"):
            interval = other.metrics[name]
            error = (interval.high - interval.low) / 2 / 1.96
            assert abs(interval.estimate - one.metrics[name].estimate) <= 4 * error + 1e-12, (
                one.strategy,
                name,
            )
    value = {scores.strategy: scores.return_.estimate for scores in exact}
    assert value["LCORPP"] > max(value["LCORPP-gaze"], value["LCORPP-voice"])
    assert min(value["LCORPP-gaze"], value["LCORPP-voice"]) > value["R+P"]


def test_presets_may_add_a_sense(tmp_path):
    end = GAZE.replace("[[learning]]", "[[presets.looks.learning]]")
    folder = write_domain(tmp_path / "p", end="[presets.blind]\n" + end)
    assert load_domain(folder).senses == ()
    assert [sense.name for sense in load_domain(folder, preset="looks").senses] == ["gaze"]
    folder = write_domain(tmp_path / "q", end="[presets.blind]\n" + end.replace('"item"', '"items"'))
    with pytest.raises(DomainError, match=r"domain\.toml:14: \[learning\[1\]\] of: .*no attribute 'items'"):
        load_domain(folder, preset="looks")
