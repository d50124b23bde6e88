from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest

from lcorpp.errors import FileError, ParseError
from lcorpp.planning import parse_pomdp, read_pomdp
from tests.planning.formats.pomdp.texts import BODY, HEAD, same
from tests.planning.models import TIGER, shared_model


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\n", "\r\n"),
        ("\n", "\r"),
        ("start: 0.5 0.5", "start: uniform#comment"),
        ("start: 0.5 0.5\n", ""),
        ("* -1", "* : -1"),
        ("R:open-left : tiger-left", "R: 1 : 0"),
    ],
)
def test_ways_to_write_the_tiger(old, new):
    assert old in TIGER
    assert same(parse_pomdp(TIGER.replace(old, new)), parse_pomdp(TIGER))


@pytest.mark.parametrize(
    ("start", "belief"),
    [
        ("start: a", [1, 0]),
        ("start: 1", [0, 1]),
        ("start: b a", [0.5, 0.5]),
        ("start: 0.25 0.75", [0.25, 0.75]),
        ("start include: a", [1, 0]),
        ("start exclude: 0", [0, 1]),
        ("start: uniform", [0.5, 0.5]),
        ("start: 1 0", [1, 0]),
        ("start:\n0.25 #one\n.75", [0.25, 0.75]),
        ("start: 0.33333 0.66666", [0.33333 / 0.99999, 0.66666 / 0.99999]),
        ("start include: b 0", [0.5, 0.5]),
        ("start : 01", [0, 1]),
    ],
)
def test_each_form_of_start_gives_its_belief(start, belief):
    assert parse_pomdp(HEAD + start + "\n" + BODY).start.tolist() == belief


def test_entries_rows_matrices_and_overrides():
    text = (
        HEAD
        + "start: b\nT: * uniform\nT: x : a reset\nT: x : b : a 1.0\nT: x : b : b : 0.0\nT: y 1 0 0 1\nO: *\n"
        + "uniform\nO: * : a\n0.25 0.75\nO: y : b : 0.1 0.9\n"
    )
    pomdp = parse_pomdp(text)
    assert pomdp.transition.dense.tolist() == [[[0, 1], [1, 0]], [[1, 0], [0, 1]]]
    assert pomdp.observation.dense.tolist() == [[[0.25, 0.75], [0.5, 0.5]], [[0.25, 0.75], [0.1, 0.9]]]


def test_states_and_observations_may_share_names():
    text = "discount: 0.9\nvalues: reward\nstates: left right\nactions: a\nobservations: right left\n"
    for name in ("left", "right"):
        text += f"T: a : {name} : {name} 1.0\nO: a : {name} : {name} 1.0\n"
    assert parse_pomdp(text).observation.dense.tolist() == [[[0, 1], [1, 0]]]
    with pytest.raises(ParseError, match="number 2 is not among the 1 observations"):
        parse_pomdp(
            "discount: 0.9\nvalues: reward\nstates: 3\nactions: 1\nobservations: 1\n"
            "T: 0 : 0 : 2 1.0\nO: 0 : 0 : 2 1.0\n"
        )


def test_numbers_end_before_a_keyword():
    """As in pomdp-solve, which needs no space there; names may start with digits all the same."""
    glued = (
        "discount:0.5values:reward states:2actions:1observations:2start:0.25 0.75T:0:0uniform T:0:1:0 "
        "0.5T:0:1:1 0.5O:0identity R:0:0:*:*1R:0:1:*:*2"
    )
    pomdp = parse_pomdp(glued)
    assert pomdp.transition.dense.tolist() == [[[0.5, 0.5], [0.5, 0.5]]]
    assert pomdp.observation.dense.tolist() == [[[1, 0], [0, 1]]]
    assert (pomdp.discount, pomdp.start.tolist(), pomdp.reward.tolist()) == (0.5, [0.25, 0.75], [[1, 2]])
    named = "discount: 0.5 values: reward states: 0T 1R actions: 3uniformly observations: 2 "
    named += "T: 3uniformly : 0T : 1R 1 T: 3uniformly : 1R : 0T 1 O: * uniform R: 3uniformly : 0T: * : * 4"
    assert parse_pomdp(named).transition.dense.tolist() == [[[0, 1], [1, 0]]]


def test_rewards_become_expected_rewards():
    text = HEAD + "T: x\n0.25 0.75\n0 1\nT: y identity\nO: *\n0.5 0.5\n0.1 0.9\n"
    text += (
        "R: x : a : * : * 1\nR: x : a : b : * 2\nR: x : a : b : v 3\nR: y : a\n1 2\n3 4\nR: y : b : b\n5 6\n"
    )
    reward = parse_pomdp(text).reward
    assert reward[0, 0] == pytest.approx(0.25 * 1 + 0.75 * (0.1 * 2 + 0.9 * 3))
    assert reward[1] == pytest.approx([0.5 * 1 + 0.5 * 2, 0.1 * 5 + 0.9 * 6])
    assert parse_pomdp(HEAD + BODY + "R: * : * : * : u 2\n").reward == pytest.approx(np.ones((2, 2)))
    assert parse_pomdp(HEAD + BODY + "R: * : * : * : u 2\nR: x : * : * : * 3").reward[:, 0].tolist() == [3, 1]


def test_a_star_needs_no_space_after_it():
    """As for pomdp-solve, whose scanner reads a star as a token."""
    glued = HEAD + "T:*uniform\nT:x:a:*0.5\nO:*:*uniform\nR:*:*:*:*-1\nR:x:*:*:*2\n"
    spaced = (
        HEAD + "T: * uniform\nT: x : a : * 0.5\nO: * : * uniform\nR: * : * : * : * -1\nR: x : * : * : * 2\n"
    )
    assert parse_pomdp(glued).fingerprint == parse_pomdp(spaced).fingerprint
    with pytest.raises(
        ParseError, match=r"7:6: transition matrix of 2 rows needs 4 numbers, found 0 and then '.'"
    ):
        parse_pomdp(HEAD + "O: * uniform\nT: * **\n")


def test_costs_are_negated_once():
    text = (HEAD + BODY).replace("reward", "cost") + "R: x : * : * : * 4"
    reward = parse_pomdp(text).reward
    assert reward.tolist() == [[-4, -4], [0, 0]]
    assert not np.signbit(reward[1]).any()


def test_rounding_errors_are_removed():
    pomdp = parse_pomdp(HEAD + "T: * uniform\nO: * 0.33333 0.66666 0.5 0.5\n")
    assert abs(pomdp.observation.row_sums() - 1).max() < 1e-15


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("", (1, 1), "missing preamble: discount, values, states, actions, observations"),
        (HEAD.replace("values: reward\n", "") + BODY, (5, 1), "missing preamble: values"),
        (HEAD + "discount: 0.8\n" + BODY, (6, 1), "duplicate preamble: 'discount'"),
        (HEAD.replace("0.9", "1.1") + BODY, (1, 11), "discount 1.1 is not between 0 and 1"),
        (HEAD.replace("0.9", "-0.5") + BODY, (1, 11), "discount -0.5 is not between 0"),
        (HEAD.replace("reward", "money") + BODY, (2, 9), "values must be 'reward' or 'cost', found 'money'"),
        (HEAD.replace("a b", "a 3") + BODY, (3, 11), "expected a name among the states, found '3'"),
        (HEAD.replace("a b", "a a") + BODY, (3, 11), "'a' appears twice among the states"),
        (HEAD.replace("a b", "0") + BODY, (3, 9), "at least one of the states"),
        (HEAD.replace("a b", "") + BODY, (4, 1), "expected a count or names after 'states:'"),
        (HEAD + "T: z identity", (6, 4), "unknown action 'z'; expected one of x, y"),
        (HEAD + "T: x : c : a 1", (6, 8), "unknown state 'c'; expected one of a, b"),
        (HEAD + "O: x : a : w 1", (6, 12), "unknown observation 'w'; expected one of u, v"),
        (HEAD + "T: 7 identity", (6, 4), "number 7 is not among the 2 actions"),
        (HEAD + "T: x\n1 0\n0\nO: * uniform", (9, 1), "needs 4 numbers, found 3 and then 'O'"),
        (HEAD + "T: x\n1 0\n0", (8, 2), "needs 4 numbers, found 3 before the end"),
        (HEAD + "T: x\n1 0\n0 1 1\n", (8, 5), "too many numbers: 1 is left over"),
        (HEAD + "T: x : a\n1.5 -0.5", (7, 5), "negative probability -0.5"),
        (HEAD + "T: x : a : a 2", (6, 14), "2 is not a probability"),
        (HEAD + "T: x : a : a nan", (6, 14), "found 0 and then 'nan'"),
        (HEAD + BODY + "R: x : a : a : u 1e999", (8, 18), "1e999 is too large"),
        (HEAD + BODY + "R: x 4", (8, 6), "expected ':', found '4'"),
        (HEAD + "T: * identity\nO: x uniform", (4, 12), "action 'y' has no observation rows"),
        (HEAD + "T: * : a uniform\nO: * uniform", (4, 10), "transition row for 'x', 'b' is missing"),
        (HEAD + BODY + "start: a", (8, 1), "'start' must come before the first T, O or R"),
        (HEAD + "start: 0.5 0.4\n" + BODY, (6, 8), "the start belief sums to 0.9, not 1"),
        (HEAD + "start exclude: a b\n" + BODY, (6, 16), "no state is left"),
        (HEAD + "start: *\n" + BODY, (6, 8), "'*' is not a state to start in"),
        (HEAD + "start:\n" + BODY, (7, 1), "expected states to start in"),
        (HEAD + "O: x reset\n", (6, 6), "'reset' is not allowed for this observation matrix"),
        (HEAD + "T: x : a identity\n", (6, 10), "'identity' is not allowed for this transition row"),
        ("hello " + HEAD + BODY, (1, 1), "expected one of discount:, values:"),
        (
            TIGER.replace("0.85 0.15\n", "0.85 0.10\n"),
            (15, 1),
            "observation row for 'listen', 'tiger-left' sums to 0.95, not 1",
        ),
        (  # a row inside a matrix
            HEAD + "O: * uniform\nT: *\n1 0 # right\n\n0 # a comment: 1\n.5\n",
            (10, 1),
            "transition row for 'x', 'b' sums to 0.5, not 1",
        ),
        (  # the first wrong row of the text
            HEAD + "O: * uniform\nT: x\n1 0\n0 1\nT: y : b\n1 .5\nT: y : a : * 0\nT: x : b 0 0\n",
            (11, 1),
            "transition row for 'y', 'b' sums to 1.5, not 1",
        ),
    ],
)
def test_malformed_text_is_located(text, place, message):
    with pytest.raises(ParseError) as caught:
        parse_pomdp(text, file="x.pomdp")
    line, column = place
    assert str(caught.value).startswith(f"x.pomdp:{line}:{column}: ")
    assert message in str(caught.value)
    assert (caught.value.line, caught.value.column) == place


def test_a_missing_file():
    with pytest.raises(FileError, match=r"missing\.pomdp"):
        read_pomdp("missing.pomdp")


def test_a_model_with_one_state_accepts_every_form_of_start():
    head = HEAD.replace("a b", "alone")
    for start in ("start: 1", "start: 1.0", "start: alone", "start: uniform"):
        pomdp = parse_pomdp(head + start + "\nT: x identity\nT: y : 0 identity\nO: * : * uniform")
        assert pomdp.start.tolist() == [1]
        assert pomdp.transition.dense.tolist() == [[[1]], [[1]]]


def test_reset_means_the_start_belief():
    text = HEAD + "start: 0.25 0.75\nT: * identity\nT: x : b reset\nO: * uniform\nT: y reset\n"
    transition = parse_pomdp(text).transition
    assert transition.dense.tolist() == [[[1, 0], [0.25, 0.75]], [[0.25, 0.75], [0.25, 0.75]]]


@pytest.mark.parametrize("colon", [":", " :", ": ", " : ", " :#colon\n", "\n:\t"])
def test_colons_with_and_without_space(colon):
    text = HEAD + BODY + "T: x : a : b 1\nT: x : a : a 0\nO: x : a 0.25 0.75\nR: y : b : a : v 3"
    assert same(parse_pomdp(text.replace(": ", colon)), parse_pomdp(text))


def test_a_stray_colon_before_the_numbers_is_skipped():
    text = (
        HEAD
        + BODY
        + "T: x : a\n.5 .5\nT: y\n.5 .5\n.5 .5\nO: x\nuniform\nR: x : a : b : u 2\nR: x : b : a\n.5 2"
    )
    strayed = text.replace("\n.5", " : .5").replace(" : .5 .5 : .5", " : .5 .5\n.5").replace("u 2", "u : 2")
    strayed = strayed.replace("O: x\nuniform", "O: x :\nuniform")
    assert same(parse_pomdp(strayed), parse_pomdp(text))


def test_declared_names_and_used_numbers():
    text = HEAD + BODY + "T: y : b : a 1\nT: y : b : b 0\nO: x : a : v 1\nO: x : a : u 0\nR: y : b : a : v 3"
    numbers = (
        HEAD + BODY + "T: 1 : 1 : 0 1\nT: 1 : 1 : 01 0\nO: 0 : 0 : 1 1\nO: 0 : 00 : 0 0\nR: 1 : 1 : 0 : 1 3"
    )
    assert same(parse_pomdp(numbers), parse_pomdp(text))


def test_keywords_as_names():
    text = HEAD.replace("a b", "uniform T").replace("x y", "reset O") + "start: uniform\n" + BODY
    pomdp = parse_pomdp(text + "T: reset : uniform : T 1\nT: reset : uniform : uniform 0\nR: O : T : * : * 1")
    assert pomdp.start.tolist() == [1, 0]
    assert pomdp.transition[0].tolist() == [[0, 1], [0, 1]]
    assert pomdp.reward.tolist() == [[0, 0], [0, 1]]


def test_a_wildcard_column_sets_a_whole_row():
    text = HEAD + "T: * : * : * 0\nT: * : * : b 1\nO: * : * : * 0.5\n"
    pomdp = parse_pomdp(text)
    assert pomdp.transition.dense.tolist() == [[[0, 1], [0, 1]]] * 2
    assert len(pomdp.transition.values) == 4
    assert pomdp.observation.dense.tolist() == [[[0.5, 0.5], [0.5, 0.5]]] * 2


def test_zeros_that_override_ones():
    """As in light_maze: an identity, then entries that move its ones."""
    pomdp = read_pomdp(shared_model("light_maze.POMDP"))
    start, branch = pomdp.state_index("start-rewardright"), pomdp.state_index("branch-rewardright")
    columns, values = pomdp.transition.row(pomdp.action_index("forward"), start)
    assert (columns.tolist(), values.tolist()) == ([branch], [1.0])
    columns, _ = pomdp.observation.row(pomdp.action_index("lookup"), start)
    assert [pomdp.observations[o] for o in columns] == ["start-red"]


def test_errors_are_the_same_among_many_entries():
    """Plain entries are read in batches, a wrong one by itself."""
    right = HEAD + BODY + "T: x : a : a 1\n" * 1000
    for line, column, message in (
        ("T: x : a : a 2", 14, "2 is not a probability in transition entry"),
        ("T: x : c : a 1", 8, "unknown state 'c'; expected one of a, b"),
        ("T: x : a : a 1e", 14, "transition entry needs a number, found 0 and then '1e'"),
        ("T: x : a : a 1 1", 16, "too many numbers: 1 is left over"),
        ("T: x : a : a -.1", 14, "negative probability -.1 in transition entry"),
        ("T: x : a : b 1", 14, "transition row for 'x', 'a' sums to 2, not 1"),
    ):
        with pytest.raises(ParseError) as caught:
            parse_pomdp(right + line + "\n" + ("O: x : a : u 0.5\n" * 100))
        assert message in str(caught.value)
        assert (caught.value.line, caught.value.column) == (1008, column)


def test_a_pomdpx_file_is_passed_to_its_reader(monkeypatch):
    reader = ModuleType("lcorpp.planning.formats.pomdpx.reader")
    reader.read_pomdpx = lambda path: ("read", path)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, reader.__name__, reader)
    assert read_pomdp("Some.POMDPX") == ("read", "Some.POMDPX")
