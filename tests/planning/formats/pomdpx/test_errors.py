"""Errors in PomdpX files and their positions: `@` marks the expected position."""

from __future__ import annotations

import pytest

from lcorpp.errors import ParseError
from tests.planning.formats.pomdpx.texts import STAYS, TEXT, function, node, number, parse, surely, template


def swap(old: str, new: str) -> str:
    assert old in TEXT
    return TEXT.replace(old, new, 1)


VALUES = "<ValueEnum>left middle exit</ValueEnum>"
WEST = "0 0 1  1 0 0  0 0 1"
START = TEXT[TEXT.index("<InitialStateBelief>") : TEXT.index("<StateTransitionFunction>")]
LOOKS = TEXT[TEXT.index("<ObsFunction>") : TEXT.index("<RewardFunction>")]

BAD = [
    ("@", "not well-formed XML: no element found"),
    ("@<html/>", "expected <pomdpx>, found <html>"),
    (swap("</Variable>", "</@Variables>"), "not well-formed XML: mismatched tag"),
    (swap("<pomdpx", "@<pomdpx").replace("<Discount> 0.95 </Discount>", ""), "<pomdpx> needs <Discount>"),
    (swap(" 0.95 ", " @2 "), "discount 2 is not between 0 and 1"),
    (swap(" 0.95 ", " @0.9_5 "), "expected a number, found '0.9_5'"),
    (swap(" 0.95 ", " @0.9\u00a05 "), "expected a number, found '0.9\\xa05'"),
    (swap("<Discount> 0.95", "@<Discount>.9 .5"), "<Discount> contains one word, found 2"),
    (swap(" 0.95 ", "@<b/>"), "<Discount> contains words only, found <b>"),
    (swap("<Discount>", "<Discount>.5</Discount>@<Discount>"), "a second <Discount> in <pomdpx>"),
    (
        swap("<Variable>", "@<Values/><Variable>"),
        "unknown <Values> in <pomdpx>; expected one of <Description>",
    ),
    (swap("<Variable>", "<Horizon>@10</Horizon><Variable>"), "finite horizons are not supported"),
    (swap("<Variable>", "@stray <Variable>"), "text among the elements of <pomdpx>: 'stray'"),
    (swap("<Variable>", "<Variable>@stray"), "<Variable> contains no text, found 'stray'"),
    (
        swap('<StateVar vnamePrev="rover_0" vnameCurr="rover_1"', '@<StateVar vnamePrev="r"'),
        "attribute vnameCurr",
    ),
    (swap("<StateVar vname", "@<StateVar fullobs='1' vname"), "unknown attribute 'fullobs' of <StateVar>"),
    (
        swap("<StateVar", "@<StateVar").replace('"true"', '"yes"'),
        "fullyObs must be 'true' or 'false', not 'yes'",
    ),
    (swap(VALUES, "@<ValueEnum>left left</ValueEnum>"), "variable 'rover' has the value 'left' twice"),
    (swap(VALUES, "@<ValueEnum>left * exit</ValueEnum>"), "a value of 'rover' cannot be '*'"),
    (swap(VALUES, "@<ValueEnum/>"), "variable 'rover' has no values"),
    (swap("<StateVar", "@<StateVar").replace(VALUES, ""), "<StateVar> needs <ValueEnum> or <NumValues>"),
    (
        swap(VALUES, "<NumValues>@1e3</NumValues>"),
        "expected a number of values from 1 to 1000000, found '1e3'",
    ),
    (swap(VALUES, "<NumValues>@0</NumValues>"), "expected a number of values from 1 to 1000000, found '0'"),
    (
        swap('<StateVar vnamePrev="rock_0"', '@<StateVar vnamePrev="rover_1"'),
        "two variables have the name 'rover_1'",
    ),
    (swap('<StateVar vnamePrev="rock_0"', '@<StateVar vnamePrev="null"'), "'null' cannot be a name"),
    (swap('<StateVar vnamePrev="rock_0"', '@<StateVar vnamePrev="my rock"'), "vnamePrev must be one word"),
    (
        swap("<Variable>", "@<Variable>").replace("ActionVar", "ObsVar"),
        "needs a variable for the action: <ActionVar>",
    ),
    (swap("<Var>rock_0", "<Var>@rock_2"), "unknown variable 'rock_2'; expected one of rover_0, rock_0"),
    (swap("<Var>rock_0", "<Var>@rock_1"), "'rock_1' is not allowed here; expected one of rover_0, rock_0"),
    (swap("<Var>rock_0", "<Var>@rover_0"), "a second <CondProb> for 'rover_0'"),
    (swap("<Var>rock_0</Var>", "@<Var/>"), "<Var> names no variable"),
    (swap("<Var>rover_0", "<Var>rover_0 rock_0 @rover_0"), "'rover_0' is named twice"),
    (
        swap("rover_1 rock_1</Parent>", "@rover_0 rock_1</Parent>"),
        "'rover_0' is not allowed here; expected one of rover_1",
    ),
    (swap("<Parent>action rover_0 rock_0", "<Parent>action @rock_1 rock_0"), "'rock_1' is named twice"),
    (
        swap("<Instance>west - -", "@<Instance>west -"),
        "expected a value for each of action, rover, rover'; found 2",
    ),
    (swap("west - -", "@weast - -"), "unknown value 'weast' of 'action'; expected one of west, east"),
    (swap("west - -", "west @0 -"), "unknown value '0' of 'rover'; expected one of left"),
    (swap(WEST, "0 0 1  1 0 0  0 @0"), "'west - -' needs 9 numbers, found 8"),
    (swap(WEST, WEST + " @7"), "'west - -' needs 9 numbers, found 10"),
    (swap(WEST, "0 0 1\n1 0 @x\n0 0 1"), "expected a number, found 'x'"),
    (swap(WEST, "0 0 1  1 0 @nan  0 0 1"), "nan is not a finite number"),
    (swap(WEST, "0 0 1  1 0 @1e999  0 0 1"), "1e999 is not a finite number"),
    (swap(WEST, "0 0 1  1 0 @-1  0 0 1"), "-1 is not a probability"),
    (swap(WEST, "0 0 1  1 <!-- here --> 0 @1.1  0 0 1"), "1.1 is not a probability"),
    (swap(f"<ProbTable>{WEST}", "@<ProbTable>"), "'west - -' needs 9 numbers, found 0"),
    (
        swap("west - -", "@west - -").replace(WEST, WEST[:-1] + ".5"),
        "action=west, rover=exit sums to 0.5, not 1",
    ),
    (
        swap("east left middle", "@west left middle"),
        "the row of rover' given action=west, rover=left sums to 2, not 1",
    ),
    (
        swap("action rover_0</Parent><Parameter", "action rover_0</Parent>@<Parameter").replace(
            "* - -", "west - -", 1
        ),
        "the row of rover' given action=check, rover=left is missing",
    ),
    (swap("identity", "@identity 1"), "expected a number, found 'identity'"),
    (
        swap("* - -</Instance><ProbTable>", "- - -</Instance><ProbTable>@"),
        "'identity' needs '-' for one parent",
    ),
    (
        swap("-</Instance><ProbTable>uniform", "good</Instance><ProbTable>@uniform"),
        "'uniform' needs '-' for the var",
    ),
    (
        swap("<ValueTable>10</ValueTable>", "<ValueTable>@uniform</ValueTable>"),
        "expected a number, found 'uniform'",
    ),
    (
        swap("<ProbTable>uniform</ProbTable>", "@<ValueTable>1 0</ValueTable>"),
        "unknown <ValueTable> in <Entry>",
    ),
    (swap("<Entry><Instance>* - -</Instance>", "@<Entry>"), "<Entry> needs <Instance>"),
    (
        swap('<Parameter type="TBL"', '@<Parameter type="CONT"'),
        "unknown parameter type 'CONT'; expected TBL",
    ),
    (swap("<Var>moving", "<Var>@cost"), "unknown reward 'cost'; expected one of moving, sampling"),
    (swap("<Var>sampling", "<Var>@moving"), "a second <Func> for 'moving'"),
    (
        swap('<RewardVar vname="moving"/>', '<RewardVar vname="moving"/>@<RewardVar vname="r"/>'),
        "no <Func> for 'r'",
    ),
    (swap('"moving"/>', '"moving">@<a/></RewardVar>'), "unknown <a> in <RewardVar>; it is empty"),
    (swap("<pomdpx", "@<pomdpx").replace(LOOKS, ""), "there is no <CondProb> for 'sensor' in <ObsFunction>"),
    (swap("<pomdpx", "@<pomdpx").replace(START, ""), "<pomdpx> needs <InitialStateBelief>"),
]


def with_section(section: str, inner: str) -> str:
    """The rover with another section."""
    begin, end = f"<{section}>", f"</{section}>"
    return TEXT.replace(TEXT[TEXT.index(begin) : TEXT.index(end)], begin + inner)


def diagram(inner: str, templates: str = "") -> str:
    """The rover with another decision diagram for its rock."""
    return with_section(
        "StateTransitionFunction",
        function("CondProb", "rover_1", "rover_0", STAYS.format("rover_1"))
        + function("CondProb", "rock_1", "action rock_0", inner, templates),
    )


WITHIN = '<SubDAG type="template" idref="{}"/>'

BAD_DIAGRAMS = [
    (diagram("").replace("<DAG></DAG>", "@<DAG></DAG>"), "<DAG> needs <Node> or <SubDAG> or <Terminal>"),
    (diagram("<Terminal>@-1</Terminal>"), "-1 is not a probability"),
    (diagram(number(1)), "the row of rock' given action=west, rock=good sums to 2, not 1"),
    (
        diagram("@" + node("rover_0", left=number(1))),
        "unknown variable 'rover_0' here; expected one of rock_0, rock_1",
    ),
    (diagram('@<Node var="action"/>'), "<Node> needs <Edge>"),
    (
        diagram('<Node var="action">@<Edge val="west"/></Node>'),
        "<Edge> needs <Node> or <SubDAG> or <Terminal>",
    ),
    (
        diagram('<Node var="action">@<Edge val="up">1</Edge></Node>'),
        "unknown value 'up' of 'action'; expected one of",
    ),
    (diagram('<Node var="action"><Edge val="west"/>@<Edge val="west"/></Node>'), "a second edge for 'west'"),
    (
        diagram(node("action", west="@" + node("action", west=number(1)))),
        "'action' already has a value on this path",
    ),
    (diagram(node("action", west=STAYS.format("rock_1"))), "given action=east, rock=good is missing"),
    (diagram("@" + STAYS.format("action")), "'action' is a parent here; expected the variable itself"),
    (diagram("@" + surely("rock_1", "ugly")), "unknown value 'ugly' of \"rock'\"; expected one of good, bad"),
    (
        diagram('@<SubDAG type="random" var="rock_1"/>'),
        "unknown type 'random'; expected one of deterministic, pers",
    ),
    (diagram('@<SubDAG type="uniform" var="rock_1" val="good"/>'), "unknown attribute 'val' of <SubDAG>"),
    (diagram("@" + WITHIN.format("t")), "unknown template 't'; none is known"),
    (diagram(number(1), template("t", number(1)) + "@" + template("t", number(1))), "a second template 't'"),
    (
        diagram(WITHIN.format("t"), template("t", WITHIN.format("u")) + template("u", WITHIN.format("t"))),
        "contains itself",
    ),
    (
        with_section(
            "RewardFunction", function("Func", "moving", "action rover_0", "@" + surely("action", "west"))
        ),
        "'deterministic' is for probabilities, not for rewards",
    ),
    (
        with_section("ObsFunction", function("CondProb", "sensor", "action", "@" + STAYS.format("sensor"))),
        "'persistent' needs the value before the action as a parent",
    ),
    (
        with_section(
            "StateTransitionFunction",
            function("CondProb", "rover_1", "rock_1", '<SubDAG type="uniform" var="rover_1"/>')
            + function("CondProb", "rock_1", "rover_1", '<SubDAG type="uniform" var="rock_1"/>'),
        ),
        "in transition, rover' depends on rock' depends on rover': a cycle",
    ),
]


@pytest.mark.parametrize(("text", "message"), BAD + BAD_DIAGRAMS, ids=[m[:50] for _, m in BAD + BAD_DIAGRAMS])
def test_malformed_files(text, message):
    with pytest.raises(ParseError) as caught:
        parse(text.replace("@", ""))
    assert message in str(caught.value)
    if "@" in text:
        before = text[: text.index("@")]
        place = (before.count("\n") + 1, len(before) - before.rfind("\n"))
        assert (caught.value.line, caught.value.column) == place


def test_the_caret_marks_the_word():
    with pytest.raises(ParseError) as caught:
        parse(swap("0.8 0.2 0.2 0.8", "0.8 0.2\n  0.2 much"))
    assert str(caught.value) == (
        "rover.pomdpx:44:7: expected a number, found 'much'\n      0.2 much</ProbTable></Entry>\n          ^"
    )
