"""Faults of a program's attributes: what they are, and that tables are the programs they stand for."""

from fractions import Fraction
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.fitting import list_faults
from lcorpp.fitting.fault_tables import MAX_TABLES, make_lattice
from lcorpp.fitting.faults import PROGRAM_PRIOR, SIMPLE_PRIOR, TABLE_CHANGE
from lcorpp.logs.watching import make_hypotheses
from lcorpp.reasoning import Reasoner, parse_plog

COIN = """
sides = {{heads, tails}}.  people = {{honest, cheat}}.
who : people.  side : sides.
[w] random(who).  [s] random(side).
pr(side=heads | who=honest) = {}.
pr(side=heads | who=cheat) = {}.
"""


def list_simple(faults, attribute):
    """Return change -> P(side=heads | who) of both, of the simple faults of an attribute."""
    return {
        change: [row @ [r.posterior("side", {"who": w}).probabilities[0] for r in faults.reasoners]
                 for w in ("honest", "cheat")]
        for row, own, change in zip(faults.weights, faults.attributes, faults.changes, strict=True)
        if own == attribute and change != TABLE_CHANGE
    }  # fmt: skip


def test_simple_faults_have_the_numbers_that_they_name():
    faults = list_faults(parse_plog(COIN.format("0.5", "0.9")), ["who", "side"])
    assert set(faults.attributes) == {"", "side"}
    simple = list_simple(faults, "side")
    assert simple == {
        "equally probable values": pytest.approx([0.5, 0.5]),
        "halfway to equally probable values": pytest.approx([0.5, 0.7]),
        "more certain probabilities": pytest.approx([0.5, 0.81 / 0.82]),
        "inverted probabilities": pytest.approx([0.5, 0.1]),
        "who=honest and who=cheat exchanged": pytest.approx([0.9, 0.5]),
    }
    assert faults.weights[0].tolist() == [1.0] + [0.0] * (len(faults.reasoners) - 1)


def test_attributes_have_equal_priors_and_within_one_simple_faults_and_tables():
    faults = list_faults(load_domain("intention").program, ["intention"])
    share = dict.fromkeys(faults.attributes, 0.0)
    simple = dict.fromkeys(faults.attributes, 0.0)
    for name, change, p in zip(faults.attributes, faults.changes, faults.priors, strict=True):
        share[name] += p
        simple[name] += p * (change != TABLE_CHANGE)
    attributes = dict.fromkeys(["time", "location", "intention", "classifier"], (1 - PROGRAM_PRIOR) / 4)
    assert share == pytest.approx({"": PROGRAM_PRIOR, **attributes})
    assert {name: simple[name] / share[name] for name in attributes} == pytest.approx(
        dict.fromkeys(attributes, SIMPLE_PRIOR)
    )


def test_changes_that_leave_the_probabilities_are_no_faults():
    faults = list_faults(parse_plog(COIN.format("0.5", "1/2")), ["who", "side"])
    assert set(faults.changes) == {"", TABLE_CHANGE}
    assert sum(faults.priors[1:]) == pytest.approx(1 - PROGRAM_PRIOR)


def test_missing_rules_are_found_by_the_conditions_of_others():
    """A program without rules about the coin has tables of P(side), and of P(side | who)."""
    program = parse_plog("""
        sides = {heads, tails}.  people = {honest, cheat}.
        who : people.  side, hat : sides.
        random(who).  random(side).  random(hat).
        pr(hat=heads | who=honest) = 0.2.
        pr(hat=heads | who=cheat) = 0.7.
    """)
    faults = list_faults(program, ["side", "hat"], may_lack_rules=["side"])
    own = [f for f, name in enumerate(faults.attributes) if name == "side"]
    assert {faults.changes[f] for f in own} == {TABLE_CHANGE}
    assert faults.priors[own].sum() == pytest.approx((1 - PROGRAM_PRIOR) / 2)
    assert len(own) == len(list(make_lattice(1, 2))) + len(list(make_lattice(2, 2)))
    for f, table in zip(own[-64:], make_lattice(2, 2), strict=True):
        joint = [
            r.posterior("who", {}).probabilities
            * [r.posterior("side", {"who": who}).probabilities[0] for who in ("honest", "cheat")]
            for r in faults.reasoners
        ]
        np.testing.assert_allclose(faults.weights[f] @ joint, table[:, 0] / 2, atol=1e-12)
    assert "side" not in list_faults(program, ["side", "hat"]).attributes


def test_a_table_is_the_program_with_its_numbers():
    faults = list_faults(parse_plog(COIN.format("0.2", "1/3")), ["who", "side"])
    tables = [
        row for row, change in zip(faults.weights, faults.changes, strict=True) if change == TABLE_CHANGE
    ]
    lattice = list(make_lattice(2, 2))
    assert len(tables) == len(lattice) == 64
    for row, table in list(zip(tables, lattice, strict=True))[::9]:
        numbers = [str(Fraction(float(p)).limit_denominator(1000)) for p in table[:, 0]]
        direct = Reasoner(parse_plog(COIN.format(*numbers)))
        for side in ("heads", "tails"):
            joint = [
                r.posterior("side", {}).probabilities[int(side == "tails")]
                * r.posterior("who", {"side": side}).probabilities
                for r in (*faults.reasoners, direct)
            ]
            np.testing.assert_allclose(row @ joint[:-1], joint[-1], atol=1e-12)


@pytest.mark.parametrize(("n_rows", "n_values"), [(1, 2), (3, 2), (3, 3), (2, 5), (9, 4)])
def test_a_lattice_has_distributions_as_rows_and_is_not_too_large(n_rows, n_values):
    tables = np.array(list(make_lattice(n_rows, n_values)))
    assert tables.shape[1:] == (n_rows, n_values)
    assert len(np.unique(tables.reshape(len(tables), -1), axis=0)) > 20
    assert len(tables) <= MAX_TABLES
    np.testing.assert_allclose(tables.sum(axis=2), 1)
    assert tables.min() > 0


@pytest.mark.parametrize("given", [False, True])
def test_hypotheses_of_tables_are_the_programs_with_their_numbers(given):
    """Also if facts are given, where probabilities are no longer affine in the table."""
    domain = SimpleNamespace(
        shared="who",
        values=("honest", "cheat"),
        label_attributes=(),
        observed=("side",),
        reasoning=SimpleNamespace(shared=("who",)),
        check_program_decides=lambda what: None,
    )
    hypotheses = make_hypotheses(domain, parse_plog(COIN.format("0.2", "0.9")), given=given)
    found = hypotheses.predict({"side": "heads"})
    kinds = zip(hypotheses.attributes, hypotheses.changes, strict=True)
    own = [f for f, kind in enumerate(kinds) if kind == ("side", TABLE_CHANGE)]
    for f, table in zip(own, make_lattice(2, 2), strict=True):
        joint = table[:, 0] / 2
        np.testing.assert_allclose(found[f], joint / joint.sum() if given else joint, atol=1e-12)


@pytest.mark.slow
def test_overlapping_conditions_and_arguments_have_simple_faults_alone():
    faults = list_faults(load_domain("shopping").program, ["time", "item", "person", "room"])
    kinds = {
        (name, change == TABLE_CHANGE) for name, change in zip(faults.attributes, faults.changes, strict=True)
    }
    expected = {(name, tables) for name, tables in product(("requester", "person"), (False, True))}
    assert kinds == {("", False), ("item", False), ("place", False), *expected}
    museum = load_domain("museum")
    faults = list_faults(museum.program, [*museum.observed, "wish"])
    wish = [c for name, c in zip(faults.attributes, faults.changes, strict=True) if name == "wish"]
    assert TABLE_CHANGE not in wish
    assert "alone and family exchanged" not in wish
    assert "group=alone and group=family exchanged" in wish


def test_the_exchange_of_a_hidden_parent_names_the_equivalent_one():
    faults = list_faults(load_domain("intention").program, ["time", "location", "classifier", "intention"])
    change = "identity=professor and identity=visitor exchanged, or in all of time, location instead"
    assert faults.attributes[faults.changes.index(change)] == "intention"
