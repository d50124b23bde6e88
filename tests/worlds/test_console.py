"""The person at the keyboard."""

import pytest

from lcorpp.errors import DecisionError
from lcorpp.worlds import ConsoleWorld
from lcorpp.worlds.console import choose


def scripted(*lines: str):
    typed, told = list(lines), list[str]()
    return lambda question: typed.pop(0), told


def test_actions_are_told_and_answers_read():
    ask, told = scripted("perhaps", "n", "ne")
    world = ConsoleWorld(("pos", "neg", "none"), ask=ask, tell=told.append)
    assert world.act("greet") == "neg"
    world.report("report_interested")
    assert told[0] == "The robot does: greet"
    assert told[1] == "'perhaps' is not clear; expected one of pos, neg, none"
    assert told[2].startswith("'n' is not clear")
    assert told[3:] == ["The robot decides: report_interested"]


def test_a_full_name_wins_over_a_longer_one():
    ask, told = scripted(" no ")
    assert choose(("none", "no"), "?", ask=ask, tell=told.append) == "no"


def test_the_end_of_the_input_is_an_error():
    def closed(question: str) -> str:
        raise EOFError

    with pytest.raises(DecisionError, match=r"the input ended at the question 'How\?'"):
        choose(("a", "b"), "How?", ask=closed)
