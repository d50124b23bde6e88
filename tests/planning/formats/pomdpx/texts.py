"""PomdpX texts shared by several tests."""

from __future__ import annotations

from lcorpp.planning import Factored, parse_pomdpx

# The problem of tests/planning/factored/models.py in PomdpX.
HEAD = """\
<?xml version="1.0" encoding="ISO-8859-1"?>
<pomdpx version="1.0" id="rover" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
  xsi:noNamespaceSchemaLocation="pomdpx.xsd">
<Description>A rock at the left, an exit at the right &amp; a rover between.</Description>
<Discount> 0.95 </Discount>
<Variable>
  <StateVar vnamePrev="rover_0" vnameCurr="rover_1" fullyObs="true">
    <ValueEnum>left middle exit</ValueEnum>
  </StateVar>
  <StateVar vnamePrev="rock_0" vnameCurr="rock_1">
    <ValueEnum>good bad</ValueEnum>
  </StateVar>
  <ObsVar vname="sensor"><ValueEnum>good bad</ValueEnum></ObsVar>
  <ActionVar vname="action"><ValueEnum>west east check sample</ValueEnum></ActionVar>
  <RewardVar vname="moving"/><RewardVar vname="sampling"/>
</Variable>
"""

TABLES = """\
<InitialStateBelief>
  <CondProb><Var>rover_0</Var><Parent>null</Parent><Parameter type="TBL">
    <Entry><Instance>-</Instance><ProbTable>0 1.0 0.0</ProbTable></Entry>
  </Parameter></CondProb>
  <CondProb><Var>rock_0</Var><Parent>null</Parent><Parameter>
    <Entry><Instance>-</Instance><ProbTable>uniform</ProbTable></Entry>
  </Parameter></CondProb>
</InitialStateBelief>
<StateTransitionFunction>
  <CondProb><Var>rover_1</Var><Parent>action rover_0</Parent><Parameter type="TBL">
    <Entry><Instance>* - -</Instance><ProbTable>identity</ProbTable></Entry>
    <Entry><Instance>west - -</Instance><ProbTable>0 0 1  1 0 0  0 0 1</ProbTable></Entry>
    <Entry><Instance>east * -</Instance><ProbTable>0 0 1</ProbTable></Entry>
    <Entry><Instance>east left exit</Instance><ProbTable>0</ProbTable></Entry>
    <Entry><Instance>east left middle</Instance><ProbTable>1</ProbTable></Entry>
    <Entry><Instance>sample middle -</Instance><ProbTable>0 0 1</ProbTable></Entry>
  </Parameter></CondProb>
  <CondProb><Var>rock_1</Var><Parent>action rover_0 rock_0</Parent><Parameter type="TBL">
    <Entry><Instance>* * - -</Instance><ProbTable>1.0 0.0 0.0 1.0</ProbTable></Entry>
    <Entry><Instance>sample left * -</Instance><ProbTable>0 1</ProbTable></Entry>
  </Parameter></CondProb>
</StateTransitionFunction>
<ObsFunction>
  <CondProb><Var>sensor</Var><Parent>action rover_1 rock_1</Parent><Parameter type="TBL">
    <Entry><Instance>* * * -</Instance><ProbTable>1 0</ProbTable></Entry>
    <Entry><Instance>check left - -</Instance><ProbTable>identity</ProbTable></Entry>
    <Entry><Instance>check middle - -</Instance><ProbTable>0.8 0.2 0.2 0.8</ProbTable></Entry>
  </Parameter></CondProb>
</ObsFunction>
<RewardFunction>
  <Func><Var>moving</Var><Parent>action rover_0</Parent><Parameter type="TBL">
    <Entry><Instance>east middle</Instance><ValueTable>10</ValueTable></Entry>
    <Entry><Instance>west left</Instance><ProbTable>-1e2</ProbTable></Entry>
  </Parameter></Func>
  <Func><Var>sampling</Var><Parent>action rover_0 rock_0</Parent><Parameter type="TBL">
    <Entry><Instance>sample middle *</Instance><ValueTable>-100</ValueTable></Entry>
    <Entry><Instance>sample left -</Instance><ValueTable>10 -10</ValueTable></Entry>
  </Parameter></Func>
</RewardFunction>
</pomdpx>
"""


def node(var: str, **edges: str) -> str:
    """An inner node of a decision diagram."""
    inner = "".join(f'<Edge val="{val}">{branch}</Edge>' for val, branch in edges.items())
    return f'<Node var="{var}">{inner}</Node>'


def number(value: float) -> str:
    """A leaf of a decision diagram."""
    return f"<Terminal>{value}</Terminal>"


def surely(var: str, val: str) -> str:
    """A certain value."""
    return f'<SubDAG type="deterministic" var="{var}" val="{val}"/>'


def function(kind: str, var: str, parents: str, diagram: str, templates: str = "") -> str:
    """A `<CondProb>` or `<Func>` with a decision diagram."""
    return (
        f"<{kind}><Var>{var}</Var><Parent>{parents}</Parent>"
        f'<Parameter type="DD"><DAG>{diagram}</DAG>{templates}</Parameter></{kind}>'
    )


STAYS = '<SubDAG type="persistent" var="{}"/>'
READING = '<SubDAG type="template" idref="reading"/>'

DIAGRAMS = f"""\
<RewardFunction>
{
    function(
        "Func",
        "moving",
        "action rover_0",
        node("action", east=node("rover_0", middle=number(10)), west=node("rover_0", left=number(-100))),
    )
}
{
    function(
        "Func",
        "sampling",
        "action rover_0 rock_0",
        node(
            "action",
            sample=node(
                "rover_0", middle=number(-100), left=node("rock_0", good=number(10), bad=number(-10))
            ),
        ),
    )
}
</RewardFunction>
<ObsFunction>
{
    function(
        "CondProb",
        "sensor",
        "action rover_1 rock_1",
        node(
            "action",
            west=surely("sensor", "good"),
            east=surely("sensor", "good"),
            sample=surely("sensor", "good"),
            check=node(
                "rover_1",
                middle=READING,
                exit=surely("sensor", "good"),
                left=node("rock_1", good=surely("sensor", "good"), bad=surely("sensor", "bad")),
            ),
        ),
        '<SubDAGTemplate id="reading">'
        + node(
            "rock_1",
            good=node("sensor", good=number(0.8), bad=number(0.2)),
            bad=node("sensor", good=number(0.2), bad=number(0.8)),
        )
        + "</SubDAGTemplate>",
    )
}
</ObsFunction>
<InitialStateBelief>
{
    function(
        "CondProb",
        "rover_0 rock_0",
        "null",
        node("rover_0", left=number(0), middle='<SubDAG type="uniform" var="rock_0"/>', exit=number(0)),
    )
}
</InitialStateBelief>
<StateTransitionFunction>
{
    function(
        "CondProb",
        "rover_1",
        "action rover_0",
        node(
            "action",
            west=node(
                "rover_0",
                left=surely("rover_1", "exit"),
                middle=surely("rover_1", "left"),
                exit=STAYS.format("rover_1"),
            ),
            east=node(
                "rover_0",
                left=surely("rover_1", "middle"),
                middle=surely("rover_1", "exit"),
                exit=STAYS.format("rover_1"),
            ),
            check=STAYS.format("rover_1"),
            sample=node(
                "rover_0",
                left=surely("rover_1", "left"),
                middle=surely("rover_1", "exit"),
                exit=surely("rover_1", "exit"),
            ),
        ),
    )
}
{
    function(
        "CondProb",
        "rock_1",
        "action rover_0 rock_0",
        node(
            "action",
            west=STAYS.format("rock_1"),
            east=STAYS.format("rock_1"),
            check=STAYS.format("rock_1"),
            sample=node(
                "rover_0",
                left=surely("rock_1", "bad"),
                middle=STAYS.format("rock_1"),
                exit=STAYS.format("rock_1"),
            ),
        ),
    )
}
</StateTransitionFunction>
</pomdpx>
"""

TEXT = HEAD + TABLES


def parse(text: str | bytes) -> Factored:
    """The problem of a text."""
    return parse_pomdpx(text, file="rover.pomdpx")


def template(name: str, inner: str) -> str:
    """A template of a decision diagram."""
    return f'<SubDAGTemplate id="{name}">{inner}</SubDAGTemplate>'
