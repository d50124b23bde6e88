"""Several shared variables: values, the joint prior, reports, and the same model with a record."""

import json

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.errors import DomainError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.learning.store import NewTrack, Store, TrackSchema
from lcorpp.reasoning import Enumeration, Reasoner
from lcorpp.simulation.people_stream import DecisionResult

from .deliveries import PLOG, TRIPLES, VARIABLES, write_domain

TABLE = "[planning.reports]\n" + "".join(
    f"give_{'_'.join(triple)} = {json.dumps(triple)}\n" for triple in TRIPLES
)


@pytest.fixture
def folder(tmp_path):
    return write_domain(tmp_path / "deliveries")


def test_values_are_all_combinations(folder):
    domain = load_domain(folder)
    assert domain.shared == ("item", "person", "room")
    assert domain.values == TRIPLES
    assert domain.senses == ()
    assert "shares item, person, room (8 values)" in repr(domain)
    assert domain.reasoning.split(("tea", "bob", "lab")) == {"item": "tea", "person": "bob", "room": "lab"}
    person = {"room": "hall", "time": "noon", "item": "tea", "person": "ann"}
    assert domain.reasoning.join(person) == ("tea", "ann", "hall")


def test_reports_by_a_pattern_or_by_lists_are_the_same(folder, tmp_path):
    pattern = load_domain(folder).planning.reports
    lists = load_domain(write_domain(tmp_path / "lists", reports=TABLE)).planning.reports
    assert pattern == lists == {"give_" + "_".join(triple): triple for triple in TRIPLES}
    assert load_domain(folder).report_action(("soup", "ann", "lab")) == "give_soup_ann_lab"


WRONG = [
    (
        {"reports": 'reports = "give_{item}_{person}"'},
        r"domain\.toml:9: \[planning\] reports: .* each of item, p",
    ),
    (
        {"reports": 'reports = "take_{item}_{person}_{room}"'},
        r"toml:9: .*give\.pomdp:4 has no action 'take_tea_ann",
    ),
    ({"reports": 'reports = "give_{item}_{person}_{room"'}, r"toml:9: \[planning\] reports: 'give_"),
    (
        {"reports": TABLE.replace('"ann", ', "", 1)},
        r"toml:10: .*2 values; expected one for each of item, person, r",
    ),
    (
        {"reports": TABLE.replace('"ann"', '"amy"', 1)},
        r"toml:10: .*person cannot be 'amy' \(.*wishes\.plog:4\)",
    ),
    (
        {"reports": TABLE.rsplit("give_", 1)[0]},
        r"toml:9: \[planning\] reports: no action reports '\(soup, bob, hall\)'",
    ),
    (
        {"observed": '["time", "room"]'},
        r"toml:4: \[reasoning\] observed: 'room' is in \[reasoning\] shared, so it",
    ),
    ({"shared": 'shared = ["item", "item", "room"]'}, r"toml:5: \[reasoning\] shared: a name is repeated"),
    ({"shared": 'shared = ["item", "parson", "room"]'}, r"toml:5: .*wishes\.plog has no attribute 'parson'"),
    (
        {"shared": 'shared = ["item", "person"]'},
        r"toml:6: \[planning\] states: .* makes 'tea_ann', which is not a state of .*give\.pomdp:3",
    ),
]


@pytest.mark.parametrize(("changed", "words"), WRONG, ids=range(len(WRONG)))
def test_wrong_parts_are_located(tmp_path, changed, words):
    with pytest.raises(DomainError, match=words):
        load_domain(write_domain(tmp_path / "deliveries", **changed))


def test_too_many_values(tmp_path):
    sort = ", ".join(f"v{k}" for k in range(30))
    plog = f"many = {{{sort}}}. item : many. person : many. room : many. time : many."
    words = r"toml:5: \[reasoning\] shared: the variables have 27000 values together; expected at most 10000"
    with pytest.raises(DomainError, match=words):
        load_domain(write_domain(tmp_path / "many", plog=plog))


@pytest.mark.parametrize("facts", [{}, {"time": "noon"}, {"time": "night"}])
def test_the_joint_prior_is_that_of_the_enumeration(folder, facts):
    """And not the product of the marginals: who asks, for what and where are correlated."""
    domain = load_domain(folder)
    joint = Reasoner(domain.program).posterior(domain.shared, facts)
    expected = Enumeration(domain.program).posterior(domain.shared, facts)
    assert joint.values == domain.values
    np.testing.assert_allclose(joint.probabilities, expected.probabilities, rtol=0, atol=1e-12)
    prior = domain.prior(joint)
    by_state = dict(zip(domain.pomdp.states, prior, strict=True))
    assert by_state["tea_ann_lab"] == joint[("tea", "ann", "lab")]
    assert dict(domain.marginal(prior)) == pytest.approx(dict(joint), abs=1e-15)
    own = {name: domain.marginalise(joint, name) for name in VARIABLES}
    for name in VARIABLES:
        single = Reasoner(domain.program).posterior(name, facts)
        np.testing.assert_allclose(own[name].probabilities, single.probabilities, rtol=0, atol=1e-12)
    independent = [np.prod([own[n][v] for n, v in domain.reasoning.split(t).items()]) for t in domain.values]
    assert np.abs(joint.probabilities - independent).sum() > 0.2


def test_a_record_gives_the_same_scores_to_the_last_digit(folder, tmp_path):
    """The combined names of a record's values are the names of the planner's states."""
    domain = load_domain(folder)
    names = ["_".join(triple) for triple in TRIPLES]
    rules = "".join(
        f"wish = {name} :- {', '.join(f'{n} = {v}' for n, v in domain.reasoning.split(t).items())}.\n"
        for name, t in zip(names, TRIPLES, strict=True)
    )
    plog = f"{PLOG}wishes = {{{', '.join(names)}}}.\nwish : wishes.\n{rules}"
    record = write_domain(
        tmp_path / "record", shared='target = "wish"', reports='reports = "give_{wish}"', plog=plog
    )
    options = ComparisonOptions(trials=None)
    lists, records = (compare_strategies(load_domain(f), options) for f in (folder, record))
    assert [scores.strategy for scores in lists.scores] == ["R", "P", "R+P"]
    for one, other in zip(lists.scores, records.scores, strict=True):
        assert one.metrics == other.metrics
        assert one.cost_sd == other.cost_sd
        np.testing.assert_array_equal(one.counts, other.counts)
    r, p, both = lists.scores
    assert both.return_.estimate > max(r.return_.estimate, p.return_.estimate)


def test_a_stored_result_keeps_the_tuples(tmp_path):
    result = DecisionResult(("tea", "ann", "lab"), ("soup", "ann", "lab"), 2.0, -10.0)
    none = DecisionResult(("tea", "ann", "lab"), None, 2.0, -2.0)
    with Store(tmp_path / "s", TrackSchema(("x",), 1, ("tea", "soup"))) as store:
        store.append(NewTrack([[0.0, 1.0]], "soup", extra=result.to_extra()))
        store.append(NewTrack([[1.0, 1.0]], None, extra=none.to_extra()))
        assert [DecisionResult.from_stored(track) for track in store.snapshot()] == [result, none]
