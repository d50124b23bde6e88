"""Bounds of the probability of evidence against the exact maximum over worlds."""

from __future__ import annotations

from itertools import product
from math import exp, prod
from random import Random

import pytest

from lcorpp.reasoning import parse_plog
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions import evidence_bound
from lcorpp.reasoning.transitions.evidence_bound import bound_evidence


def bound(text: str, evidence: dict[str, str]) -> float:
    """Bound the probability of evidence in a world."""
    ground = ground_program(parse_plog(text), {})
    possible = {}
    for name, value in evidence.items():
        term = ground.names.index(name)
        possible[term] = 1 << ground.values[term].index(value)
    _, total = bound_evidence(ground, possible, {term: term for term in range(len(ground.names))})
    return exp(total)


@pytest.mark.parametrize("max_rows", [1000, 8, 2])
def test_random_networks_with_hidden_causes(monkeypatch, max_rows):
    """Each sensor has two of six causes; with tables of limited size the bound is larger, never smaller."""
    monkeypatch.setattr(evidence_bound, "MAX_ROWS", max_rows)
    random = Random(2)
    for _ in range(10):
        text = " ".join(f"c{i} : boolean. random(c{i})." for i in range(6))
        sensors = []
        for i in range(7):
            first, second = random.sample(range(6), 2)
            rows = {values: random.randint(1, 9) for values in product(("true", "false"), repeat=2)}
            sensors.append((first, second, rows))
            text += f" s{i} : boolean. random(s{i})."
            for (a, b), number in rows.items():
                text += f" pr(s{i} | c{first}={a}, c{second}={b}) = {number}/10."
        exact = max(
            prod(rows[world[first], world[second]] / 10 for first, second, rows in sensors)
            for world in product(("true", "false"), repeat=6)
        )
        found = bound(text, {f"s{i}": "true" for i in range(7)})
        assert found >= exact * (1 - 1e-12)
        if max_rows == 1000:
            assert found == pytest.approx(exact)


def test_evidence_about_a_parent_selects_the_row():
    text = "p, q : boolean. random(p). random(q). pr(p) = 1/4. pr(q | p) = 1/10. pr(q | p=false) = 9/10."
    assert bound(text, {"q": "true"}) == pytest.approx(0.9)
    assert bound(text, {"p": "true", "q": "true"}) == pytest.approx(0.025)


def test_rows_that_break_a_condition_do_not_count():
    text = "p, q, r : boolean. random(p). random(q). random(r). pr(r | p) = 1/10. pr(r | q) = 1/5. :- p, q."
    assert bound(text, {"r": "true"}) == pytest.approx(0.5)
    assert bound(text, {"p": "true", "r": "true"}) == pytest.approx(0.05)


def test_dynamic_ranges():
    text = (
        "d = {1..3}. a, b : d. random(a). free : d -> boolean. free(D) :- not a=D. #domain d(D)."
        " random(b : {X : free(X)})."
    )
    assert bound(text, {"b": "2"}) == pytest.approx(1)  # the bodies of three rules, each its own attribute


def test_evidence_that_no_world_has():
    text = "c, p, r, t : boolean. random(c). p=false :- c. random(r). pr(r | p=false, c) = 1/10."
    assert bound(f"{text} random(t). pr(t | c) = 1/5.", {"p": "true", "r": "true", "t": "true"}) == 0


def test_many_observed_parents():
    causes = [f"c{i}" for i in range(100)]
    text = " ".join(f"{c} : boolean. random({c})." for c in causes)
    text += f" s : boolean. random(s). pr(s | {', '.join(causes)}) = 1/10."
    assert bound(text, {"s": "true", **dict.fromkeys(causes, "true")}) == pytest.approx(0.1 * 0.5**100)
