"""Error messages of factored problems."""

from __future__ import annotations

import dataclasses

import pytest

from lcorpp.errors import ModelError
from lcorpp.planning import Factored, Table, Variable, cpt as table, flatten
from tests.planning.factored.models import rover


def test_the_parts_are_frozen():
    problem = rover()
    with pytest.raises(dataclasses.FrozenInstanceError):
        problem.discount = 0.5
    with pytest.raises(TypeError):
        problem.reward["moving"] = None
    assert flatten(dataclasses.replace(problem, discount=0.5)).discount == 0.5


BAD = [
    ({"discount": 1.5}, "discount 1.5 is not between 0 and 1"),
    ({"states": {"rover": "a a", "rock": "good"}}, "variable 'rover' has the value 'a' twice"),
    ({"states": {"rover": [], "rock": "good"}}, "variable 'rover' has no values"),
    ({"states": {"rover": ["a b"], "rock": "good"}}, "must be one word of printable characters, not 'a b'"),
    ({"states": {"rover'": "a", "rock": "good"}}, 'ends in "\'", the suffix of the value after the action'),
    ({"states": {"*": "a"}}, "the name of a variable cannot be '*'"),
    ({"states": {}, "observed": ()}, "a POMDP needs states"),
    ({"actions": ""}, "variable 'action' has no values"),
    ({"actions": {}}, "a POMDP needs actions"),
    ({"actions": {"rock": "a"}}, "two variables have the name 'rock'"),
    ({"observed": "robot"}, "unknown state variable 'robot' is 'observed'; expected one of rover, rock"),
    ({"start": {"rover": "middle"}}, "start has no table for 'rock'"),
    ({"start": {"rover": "kitchen", "rock": "good"}}, "start of 'rover': unknown value 'kitchen' of 'rover'"),
    (
        {"start": {"rover": "middle", "rock": "same"}},
        "start of 'rock': 'same' is for a state after an action",
    ),
    ({"start": {"rover": "middle", "rock": [0.5, 0.4]}}, "start of 'rock' sums to 0.9, not 1"),
    (
        {"start": {"rover": "middle", "rock": [0.5, 0.4, 0.1]}},
        "expected 2 (the values of 'rock') numbers, found",
    ),
    ({"start": {"rover": "middle", "rock": {"good": "x"}}}, "expected numbers, found ['x']"),
    ({"start": {"rover": "middle", "rock": [float("nan"), 1]}}, "a number is not finite"),
    ({"transition": {"rover": "same"}}, "transition has no table for 'rock'"),
    (
        {"transition": {"rover": "same", "rook": "same"}},
        "transition has a table for unknown 'rook'; expected one",
    ),
    (
        {"transition": {"rover": table("action rover", {"west *": "same"}), "rock": "same"}},
        "transition of 'rover' given action=east, rover=left is missing",
    ),
    (
        {"transition": {"rover": table("action rover", {"* *": [0.5, 0.5, 0.1]}), "rock": "same"}},
        "transition of 'rover' given action=west, rover=left sums to 1.1, not 1",
    ),
    (
        {"transition": {"rover": table("rover", {"*": [1.5, -0.5, 0]}), "rock": "same"}},
        "transition of 'rover' given rover=left has a negative probability, -0.5",
    ),
    (
        {"transition": {"rover": table("action rover", {"west midle": "left"}), "rock": "same"}},
        "transition of 'rover', row 'west midle': unknown value 'midle' of 'rover'; expected one of left",
    ),
    (
        {"transition": {"rover": table("action rover", {"west": "left"}), "rock": "same"}},
        "transition of 'rover', row 'west': 1 values are given for 2 variables: action, rover",
    ),
    (
        {"transition": {"rover": table("action", {"*": "same"}), "rock": "same"}},
        "'same' needs 'rover' among the variables it depends on",
    ),
    (
        {"transition": {"rover": table("action place", {"* *": "left"}), "rock": "same"}},
        "transition of 'rover' depends on 'place', which is not a variable; known are rover, rock, action",
    ),
    (
        {"transition": {"rover": table("rock'", {"*": "left"}), "rock": table("rover'", {"*": "bad"})}},
        "in transition, rover' depends on rock' depends on rover': a cycle",
    ),
    (
        {"transition": {"rover": table("sensor", {"*": "left"}), "rock": "same"}},
        "transition of 'rover' cannot depend on 'sensor'",
    ),
    (
        {"transition": {"rover": table("rover'", {"*": "left"}), "rock": "same"}},
        'a table names "rover\'" twice',
    ),
    ({"observation": {}}, "observation has no table for 'sensor'"),
    (
        {"observation": table("rover", {"*": "good"})},
        "cannot depend on 'rover', the value before the action; \"rover'\" is the value after it",
    ),
    ({"observations": {"a": "b", "c": "d"}}, "observation is one table for 2 variables; give them by name"),
    (
        {"start": {"rover": table("rock'", {"*": "left"}), "rock": "good"}},
        "cannot depend on \"rock'\", the value after the action; 'rock' is the value before it",
    ),
    ({"reward": {"rock": 1}}, "a reward has the name of variable 'rock'"),
    ({"reward": {"a b": 1}}, "the name of a reward must be one word"),
    ({"reward": {"moving": "much"}}, "reward 'moving': expected a number, found 'much'"),
    ({"reward": {"moving": table("action", {"-": [1, 2]})}}, "expected 4 (the values of 'action') numbers"),
    ({"reward": {"moving": table("action", [1, 2, 3])}}, "expected 4 (the values of 'action') numbers"),
    ({"reward": {"moving": 1e200}}, "adds up to more than"),
]


@pytest.mark.parametrize(("changes", "message"), BAD, ids=[message[:40] for _, message in BAD])
def test_errors_name_the_fault(changes, message):
    with pytest.raises(ModelError) as caught:
        flatten(rover(**changes))
    assert message in str(caught.value)


def test_tables_of_wrong_shape():
    with pytest.raises(ModelError, match="are not a table of x"):
        Table(("x",), (), (3,), Table.of((), ("x",), [0.5, 0.5]).rows)
    problem = rover()
    with pytest.raises(ModelError, match=r"has the shape \(2,\); its variables have \(3,\) values"):
        dataclasses.replace(problem, start=(Table.of((), ("rover",), [0.5, 0.5]), problem.start[1]))
    with pytest.raises(ModelError, match="start has two tables for 'rock'"):
        dataclasses.replace(problem, start=(problem.start[1], *problem.start))
    with pytest.raises(ModelError, match="start has a table without children"):
        dataclasses.replace(problem, start=(*problem.start, Table.of((), (), 1.0)))
    with pytest.raises(ModelError, match="it must not have children"):
        dataclasses.replace(problem, reward={"r": problem.start[0]})
    with pytest.raises(ModelError, match="is not a state variable"):
        dataclasses.replace(problem, actions=(Variable("action", ("a",), observed=True),))


def test_a_table_too_large_is_rejected():
    names = {f"x{i}": range(10) for i in range(9)}
    with pytest.raises(ModelError, match="reward 'r': a table of 1000000000 rows of 1 numbers is too large"):
        Factored.of(
            states=names,
            actions="go",
            start=dict.fromkeys(names, 0),
            transition=dict.fromkeys(names, "same"),
            reward={"r": table(list(names), {"*" + " *" * 8: 1})},
            discount=0.9,
        )
