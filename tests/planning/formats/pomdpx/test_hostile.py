"""Malicious and damaged PomdpX files."""

from __future__ import annotations

import random
import re

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from lcorpp.errors import LcorppError, ParseError
from lcorpp.planning import Factored, flatten
from lcorpp.planning.formats.pomdpx import decision_diagrams as pomdpx_diagrams
from tests.planning.formats.pomdpx.texts import (
    DIAGRAMS,
    HEAD,
    TEXT,
    function,
    node,
    number,
    parse,
    surely,
    template,
)

SUITE = settings(suppress_health_check=list(HealthCheck))


def test_document_types_are_refused():
    bomb = '<?xml version="1.0"?><!DOCTYPE p [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><pomdpx>&b;</pomdpx>'
    with pytest.raises(ParseError, match="a document type declaration is refused"):
        parse(bomb)
    outside = '<!DOCTYPE p [<!ENTITY a SYSTEM "file:///etc/passwd">]><pomdpx>&a;</pomdpx>'
    with pytest.raises(ParseError, match="a document type declaration is refused"):
        parse(outside)


def test_nesting_is_bounded():
    with pytest.raises(ParseError, match="nested too deeply"):
        parse("<pomdpx>" + "<a>" * 5000)


def make_text(names: list[str], values: str, reward: str) -> str:
    """Return a problem with some state variables that always have the value a."""
    variables = "".join(
        f'<StateVar vnamePrev="{n}_0" vnameCurr="{n}_1"><ValueEnum>{values}</ValueEnum></StateVar>'
        for n in names
    )
    starts = "".join(function("CondProb", f"{n}_0", "null", surely(f"{n}_0", "a")) for n in names)
    moves = "".join(function("CondProb", f"{n}_1", "null", surely(f"{n}_1", "a")) for n in names)
    return f"""<pomdpx><Discount>0.5</Discount><Variable>{variables}
      <ActionVar vname="act"><NumValues>1</NumValues></ActionVar><RewardVar vname="r"/></Variable>
      <InitialStateBelief>{starts}</InitialStateBelief>
      <StateTransitionFunction>{moves}</StateTransitionFunction>
      <RewardFunction>{reward}</RewardFunction></pomdpx>"""


def test_a_diagram_over_many_variables_is_not_too_deep():
    names = [f"x{i}" for i in range(200)]
    path = "".join(f'<Node var="{name}_0"><Edge val="a">' for name in names)
    parents = " ".join(f"{name}_0" for name in names)
    reward = function("Func", "r", parents, path + number(3) + "</Edge></Node>" * len(names))
    assert flatten(parse(make_text(names, "a", reward))).reward.tolist() == [[3.0]]


def test_templates_that_multiply_are_bounded(monkeypatch):
    monkeypatch.setattr(pomdpx_diagrams, "MAX_BRANCHES", 1000)
    names = [f"x{i}" for i in range(12)]
    ways = [f'<SubDAG type="template" idref="t{i}"/>' for i in range(13)]
    templates = "".join(
        template(f"t{i}", node(f"{n}_0", a=ways[i + 1], b=ways[i + 1])) for i, n in enumerate(names)
    )
    parents = " ".join(f"{n}_0" for n in names)
    text = make_text(
        names, "a b", function("Func", "r", parents, ways[0], templates + template("t12", number(1)))
    )
    with pytest.raises(ParseError, match="the decision diagram has over 1000 branches"):
        parse(text)
    monkeypatch.undo()
    assert set(flatten(parse(text)).reward[0]) == {1.0}


def test_a_small_file_cannot_ask_for_much():
    text = TEXT.replace("left middle exit", " ".join(f"s{i}" for i in range(20_000)))
    text = text.replace(
        "<ValueEnum>good bad</ValueEnum>\n  </StateVar>", "<NumValues>20000</NumValues>\n  </StateVar>"
    )
    start = text.index("<Entry><Instance>-</Instance><ProbTable>0 1.0 0.0")
    uniform = "<Entry><Instance>-</Instance><ProbTable>uniform</ProbTable></Entry>"
    text = text[:start] + uniform + text[text.index("</Entry>", start) + len("</Entry>") :]
    moves = text[text.index("<StateTransitionFunction>") : text.index("</StateTransitionFunction>")]
    greedy = function("CondProb", "rover_1", "rover_0 rock_0", number(1))
    with pytest.raises(ParseError, match="a table of 400000000 rows of 20000 numbers is too large"):
        parse(text.replace(moves, "<StateTransitionFunction>" + greedy))
    dense = function("CondProb", "rover_1", "rover_0", number(0.00005))
    with pytest.raises(ParseError, match="has over 67108864 numbers"):
        parse(text.replace(moves, "<StateTransitionFunction>" + dense))


def check_result(data: str | bytes) -> None:
    """Check that the data gives a problem or an error with a position."""
    found: Factored | LcorppError
    try:
        found = parse(data)
    except LcorppError as error:
        found = error
    if isinstance(found, ParseError):
        lines = len(data.splitlines()) + 1
        assert 1 <= found.line <= lines
        assert 1 <= found.column <= len(data) + 1
    assert isinstance(found, Factored) or str(found).startswith("rover.pomdpx:")


@settings(SUITE, max_examples=75)
@given(st.randoms(use_true_random=False), st.sampled_from([TEXT, HEAD + DIAGRAMS]))
def test_damaged_files_give_a_problem_or_an_error(chance: random.Random, text: str):
    """Parts are deleted, repeated and moved, and characters inserted."""
    damaged = list(text)
    for _ in range(chance.randint(1, 4)):
        at, begin = chance.randrange(len(damaged)), chance.randrange(len(damaged))
        kind = chance.randrange(4)
        if kind == 0:
            damaged[at] = chance.choice("<>/\"'&;-*0.1e x\0é\n")
        elif kind == 1:
            del damaged[at : at + chance.randint(1, 30)]
        else:
            source = at if kind == 2 else begin
            damaged[at:at] = damaged[source : source + chance.randint(1, 60)]
    check_result("".join(damaged))


WORD = re.compile(r"[\w.]+|[*-]")


@settings(SUITE, max_examples=50)
@given(st.randoms(use_true_random=False), st.sampled_from([TEXT, HEAD + DIAGRAMS]))
def test_words_in_wrong_places_give_a_problem_or_an_error(chance: random.Random, text: str):
    """Mostly valid XML with wrong values, names, numbers and signs."""
    begin = text.index("<Discount>")
    words = [
        *WORD.findall(text),
        *("*", "-", "null", "nan", "1e999", "-1", "0.5", "2", "identity", "uniform"),
    ]
    for _ in range(chance.randint(1, 3)):
        spot = chance.choice(list(WORD.finditer(text, begin)))
        text = text[: spot.start()] + chance.choice(words) + text[spot.end() :]
    check_result(text)


@settings(SUITE, max_examples=40)
@given(st.binary(max_size=60), st.integers(0, len(TEXT)))
def test_any_bytes_give_a_problem_or_an_error(noise, at):
    data = TEXT.encode()
    check_result(noise)
    check_result(data[:at] + noise + data[at:])
