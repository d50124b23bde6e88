"""Rejection sampling against exact answers."""

from __future__ import annotations

from pathlib import Path

import pytest

from lcorpp.errors import ProgramError
from lcorpp.reasoning import Enumeration, Program, parse_plog, parse_query, read_plog
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions.rejection_sampling import SampleCounts, sample_worlds
from lcorpp.reasoning.transitions.transition_system import build_transition_system

PLOG = Path(__file__).parents[2] / "plog"
CASES = [
    ("lcorpp", "intention", {"time": "morning", "classifier": "one"}, {}),
    ("lcorpp", "identity", {"location": "library"}, {"time": "evening"}),
    ("monty_hall", "prize", {"selected": "1", "open": "2"}, {}),
    ("simpson", "recover", {"drug": "true"}, {}),
    ("rat", "arsenic", {"death": "true"}, {}),
    ("robot", "in(1)", {"broken": "true"}, {}),
    ("dice", "roll(d1)", {}, {}),
]


def sample(
    program: Program,
    query: str,
    evidence: dict[str, str],
    samples: int,
    seed: int = 0,
    do: dict[str, str] | None = None,
) -> SampleCounts:
    conditions = ", ".join(f"obs({term}={value})" for term, value in evidence.items())
    asked = parse_query(f"{query} | {conditions}" if evidence else query, program)
    ground = ground_program(program, do or {}, [observation.formula for observation in asked.observations])
    return sample_worlds(ground, build_transition_system(ground, (query,)), query, samples, seed)


@pytest.mark.parametrize(("name", "query", "evidence", "do"), CASES)
def test_shares_are_within_five_standard_errors(name, query, evidence, do):
    program = read_plog(PLOG / f"{name}.plog")
    exact = Enumeration(program).exact(query, evidence, do)
    found = sample(program, query, evidence, 5000, do=do)
    assert sum(found.counts.values()) == found.accepted
    assert 300 < found.accepted <= found.drawn == 5000
    for value, p in exact.items():
        # one in two million fails by chance, and the seed is fixed
        error = (float(p * (1 - p)) / found.accepted) ** 0.5
        assert abs(found.counts[value] / found.accepted - float(p)) <= 5 * error
    assert found.counts[""] == 0


def test_evidence_with_equal_probability_in_all_worlds_rejects_none():
    program = parse_plog(
        "n = {1..1000}. a, b : n. c : boolean. random(a). random(b). random(c). pr(b=7) = 1/100000."
    )
    found = sample(program, "c", {"a": "3", "b": "7"}, 500)
    assert found.accepted == found.drawn == 500


def test_the_bound_is_that_of_the_probability_table():
    """P(alarm) is .02 at most and .015 on average, so that three of four worlds are accepted."""
    program = parse_plog(
        "t, alarm : boolean. random(t). random(alarm). pr(alarm | t) = 1/50. pr(alarm | t=false) = 1/100."
    )
    found = sample(program, "t", {"alarm": "true"}, 4000)
    assert found.accepted / found.drawn == pytest.approx(0.75, abs=0.03)
    assert found.counts["true"] / found.accepted == pytest.approx(2 / 3, abs=0.04)


def test_the_same_seed_gives_the_same_worlds():
    dice = read_plog(PLOG / "dice.plog")
    first, again, other = (sample(dice, "roll(d1)", {}, 200, seed).counts for seed in (1, 1, 2))
    assert first == again != other


def test_no_value_is_an_outcome():
    program = parse_plog("p, q : boolean. random(p). random(q) :- p.")
    found = sample(program, "q", {}, 2000)
    assert found.counts[""] / 2000 == pytest.approx(0.5, abs=0.06)


def test_improbable_evidence_ends_early_and_broken_conditions_are_errors():
    program = parse_plog("p, q : boolean. random(p). q :- p. :- p, q.", file="a.plog")
    found = sample(program, "p", {"p": "true"}, 100)
    assert (found.accepted, found.drawn, found.possible) == (0, 100, True)
    assert not sample(parse_plog("p : boolean. random(p). :- p. :- p=false."), "p", {}, 100).accepted
    broken = parse_plog("p, q : boolean. random(p). random(q). pr(q) = 1/2. pr(q | p) = 1/2.", file="b.plog")
    with pytest.raises(ProgramError, match=r"b\.plog:1:\d+: Condition 2: .* in a world drawn at random"):
        sample(broken, "q", {}, 100)


def test_terms_that_no_rule_reads_are_not_drawn():
    """The worlds of a program with 50 idle terms are those of the program without them."""
    text = "p, q : boolean. random(p). pr(p) = 1/4. random(q) :- p."
    idle = "n = {1..50}. idle : n -> boolean. random(idle(X))."
    alone, among = (sample(parse_plog(program), "q", {}, 300) for program in (text, f"{text} {idle}"))
    assert alone == among


def test_batches_continue_until_enough_worlds_are_accepted(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("lcorpp.reasoning.transitions.rejection_sampling.BATCH", 50)
    program = parse_plog(
        "e : boolean. random(e). pr(e) = 1/4. y : boolean. y :- e, x. x : boolean. random(x)."
    )
    found = sample(program, "x", {"y": "true"}, 120)
    assert found.accepted == 100
    assert 600 < found.drawn < 1000
