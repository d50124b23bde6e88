"""Explanations of answers: conditions, worlds and fired rules."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from lcorpp.errors import ProgramError, TooLargeError
from lcorpp.reasoning import Enumeration, Reasoner, explain, parse_plog, parse_query, read_plog

PLOG = Path(__file__).parent.parent / "plog"
LCORPP = read_plog(PLOG / "lcorpp.plog")


def asked(program, text, **options):
    return explain(Reasoner(program), parse_query(text, program), **options)


def test_each_condition_is_left_out_in_turn():
    found = asked(LCORPP, "intention | obs(time=morning), obs(classifier!=zero), do(location=library)")
    assert [condition for condition, _ in found.without] == [
        "obs(time=morning)", "obs(classifier!=zero)", "do(location=library)",
    ]  # fmt: skip
    worlds = Enumeration(LCORPP)
    assert found.answer == worlds.ask(found.query)
    rests = ["obs(classifier!=zero), do(location=library)", "obs(time=morning), do(location=library)",
             "obs(time=morning), obs(classifier!=zero)"]  # fmt: skip
    for (_, answer), rest in zip(found.without, rests, strict=True):
        assert answer == worlds.ask(parse_query(f"intention | {rest}", LCORPP))


@pytest.mark.parametrize("name", ["lcorpp", "monty_hall", "rat", "simpson", "robot", "tree", "dice"])
def test_the_worlds_are_the_most_probable_ones(name):
    program = read_plog(PLOG / f"{name}.plog")
    term, value = next(iter(Enumeration(program).worlds[0].values.items()))
    found = asked(program, f"?{{not {term}={value}}}", count=4)
    best = sorted((world.measure for world in Enumeration(program).worlds), reverse=True)[:4]
    assert [world.measure for world, _ in found.worlds] == best


def test_worlds_given_evidence():
    found = asked(LCORPP, "intention | obs(time=morning)", count=100)
    assert sum(world.measure for world, _ in found.worlds) == 1
    assert {world.values["time"] for world, _ in found.worlds} == {"morning"}
    interested = sum(w.measure for w, _ in found.worlds if w.values["intention"] == "interested")
    assert interested == found.answer["interested"]


def test_explanations_list_the_fired_rules_of_each_world():
    program = parse_plog(
        "p, q, r : boolean.\nrandom(p).\nrandom(q) :- p.\nq=false :- p=false.\npr(q | p) = 3/4.\n"
        "r :- q, not p=false.\nr=false :- not r."
    )
    (world, fired), (other, others) = asked(program, "?{r}", count=2).worlds
    assert world.values == {"p": "false", "q": "false", "r": "false"}
    assert world.measure == Fraction(1, 2)
    assert [(rule.at.line, rule.effect) for rule in fired] == [
        (2, "p is random, here false"), (4, "q=false"), (7, "r=false"),
    ]  # fmt: skip
    assert other.values == {"p": "true", "q": "true", "r": "true"}
    assert [(rule.at.line, rule.effect) for rule in others] == [
        (2, "p is random, here true"), (3, "q is random, here true"),
        (5, "q=true with probability 3/4"), (6, "r=true"),
    ]  # fmt: skip
    assert others[3].statement == str(program.statements[-2])
    html = asked(program, "?{r}", count=2)._repr_html_()
    assert "<td>answer</td><td>?{r=true}.</td><td>0.375</td>" in html
    assert "<td>world of 0.5</td><td>{p=false, q=false, r=false}</td>" in html
    assert "random(p)" not in html
    assert "<td>q</td><td>false</td>" in world._repr_html_()


def test_intervened_terms_are_not_explained_as_random():
    program = read_plog(PLOG / "rat.plog")
    ((_, fired), *_) = asked(program, "?{arsenic} | do(death)").worlds
    assert not any("death is random" in rule.effect or rule.effect.startswith("death=") for rule in fired)
    assert any(rule.effect.startswith("arsenic is random") for rule in fired)


def test_explanation_of_impossible_conditions():
    program = parse_plog("p, q : boolean. random(p). random(q). :- p, q.")
    found = asked(program, "?{p} | obs(p), obs(q)")
    assert found.answer is None
    assert found.without == (("obs(p=true)", 0), ("obs(q=true)", 1))
    assert found.worlds == ()


def test_explanation_if_the_answer_is_undefined_without_a_condition():
    program = parse_plog("p, q : boolean. random(p). random(q) :- p.", file="a.plog")
    found = asked(program, "q | obs(p)")
    assert found.answer == {"true": Fraction(1, 2), "false": Fraction(1, 2)}
    ((condition, words),) = found.without
    assert condition == "obs(p=true)"
    assert words == "a.plog: q has no value with probability 1/2; ask for q=value instead"


def test_cr_rules_are_answered_without_worlds():
    program = read_plog(PLOG / "heart.plog")
    found = asked(program, "?{active} | obs(slow)")
    assert found.answer == Fraction(40, 43)
    assert found.worlds == ()
    assert found.without[0][1] == 0


def test_errors():
    with pytest.raises(ProgramError, match="'weather' is not declared"):
        explain(
            Reasoner(LCORPP), parse_query("?{weather}", parse_plog("weather : boolean. random(weather)."))
        )


def test_too_large(monkeypatch):
    monkeypatch.setattr("lcorpp.reasoning.diagram.decision_diagram.build_decision_diagram.__defaults__", (1,))
    with pytest.raises(TooLargeError):
        asked(LCORPP, "intention")
