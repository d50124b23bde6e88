"""ConsoleWorld: actions are shown, answers read, ambiguous ones asked again."""

import pytest

from lcorpp.errors import DecisionError
from lcorpp.worlds import ConsoleWorld, choose


def scripted(*lines: str):
    typed, shown = list(lines), list[str]()
    return lambda question: typed.pop(0), shown


def test_actions_are_shown_and_answers_read():
    ask, shown = scripted("perhaps", "n", "ne")
    world = ConsoleWorld(("pos", "neg", "none"), ask=ask, show=shown.append)
    assert repr(world) == "ConsoleWorld(observations: pos, neg, none)"
    assert world.act("greet") == "neg"
    world.report("report_interested")
    assert shown[0] == "The robot does: greet"
    assert shown[1] == "'perhaps' is ambiguous or unknown; expected one of pos, neg, none"
    assert shown[2].startswith("'n' is ambiguous or unknown")
    assert shown[3:] == ["The robot decides: report_interested"]


def test_a_full_name_wins_over_a_longer_one():
    ask, shown = scripted(" no ")
    assert choose(("none", "no"), "?", ask=ask, show=shown.append) == "no"


def test_the_end_of_the_input_is_an_error():
    def closed(question: str) -> str:
        raise EOFError

    with pytest.raises(DecisionError, match=r"the input ended at the question 'How\?'"):
        choose(("a", "b"), "How?", ask=closed)
