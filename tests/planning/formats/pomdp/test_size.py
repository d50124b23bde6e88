"""Memory is linear in the length of the text; too large models are refused."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import ModelError, ParseError
from lcorpp.planning import parse_pomdp
from lcorpp.planning.formats.pomdp import tables as pomdp_tables
from tests.planning.formats.pomdp.texts import head

MANY = 100_000


def test_a_hundred_thousand_states():
    moved = range(0, MANY, 50)
    text = head(MANY, "x y", "u v") + "T: * identity\nO: * uniform\n"
    text += "".join(f"T: x : {s} : {s} 0\nT: x : {s} : {(s + 1) % MANY} 1\n" for s in moved)
    text += "".join(f"R: y : {s} : * : * 2\n" for s in moved)
    text += "R: x : * : 1 : * 5\nR: x : * : 51 : v 7\n"
    pomdp = parse_pomdp(text)
    assert len(pomdp.transition.values) == 2 * MANY
    assert pomdp.transition.row(0, 50)[0].tolist() == [51]
    assert pomdp.transition.row(1, 50)[0].tolist() == [50]
    assert pomdp.reward[1].sum() == 2 * len(moved)
    # one state moves to 1 and stays there; so does 51, but its reward depends on the observation
    assert np.flatnonzero(pomdp.reward[0]).tolist() == [0, 1, 50, 51]
    assert pomdp.reward[0, [0, 1, 50, 51]].tolist() == [5, 5, 3.5, 3.5]


def test_repeated_statements_need_no_memory():
    text = head(MANY, 2, 2) + "T: * identity\nO: * uniform\n" + "O: * : * : 0 0.5\nT: 1 identity\n" * 2000
    text += "R: * : * : * : * 1\nR: * : * : 7 : * 2\n" * 2000
    pomdp = parse_pomdp(text)
    assert len(pomdp.transition.values) == 2 * MANY
    assert pomdp.reward[:, 6:9].tolist() == [[1, 2, 1]] * 2


def test_overridden_statements_need_no_memory():
    wide = "".join(f"T: * : * : {s} 0.5\n" for s in range(2000))
    text = head(MANY, 1, 1) + wide + "T: * uniform\n" + wide + "T: * identity\nO: * uniform\n"
    assert len(parse_pomdp(text).transition.values) == MANY


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            head(MANY, 3, 2) + "T: * uniform",
            r"\(3, 100000, 100000\) give 30000000000 numbers, 335.3 GiB",
        ),
        (head(MANY, 3, 2) + "T: * reset", "the transition table"),
        (head(300, 3, 100_000) + "O: * uniform", "the observation table"),
        (head(MANY, 3, 2) + "T: * : * : * 0.5", "give 30000000000 numbers"),
        (
            head(MANY, 3, 2) + "T: * identity\n" + "".join(f"T: * : * : {s} 0\n" for s in range(500)),
            "give 150300000 numbers",
        ),
        (head(999999999, 1, 1), "999999999 states are too many; at most 1000000"),
        (head("9" * 10**6, 1, 1), "9999 states are too many"),
        (head(2, 2, "1000001"), "1000001 observations are too many"),
        (head(100000, 1000, 1), "1000 actions in 100000 states are too many"),
        (
            head(1000, 1, 1000) + "T: * uniform\nO: * uniform\nR: * : * : 1 : 0 5\n",
            "are sums over 1000000000 cases",
        ),
    ],
)
def test_too_large_models_are_refused(text, message):
    with pytest.raises(ModelError, match=message):
        parse_pomdp(text + ("" if "T:" in text else "\nT: * identity\nO: * uniform\n"))


def test_rows_of_one_number_do_not_add_up(monkeypatch):
    """A statement with ``*`` as its column is short, however many columns there are."""
    monkeypatch.setattr(pomdp_tables, "MAX_NUMBERS", 5000)
    text = head(1, 1, 1000) + "T: * identity\n" + "".join(f"O: * : * : * 0.{i}\n" for i in range(1, 9))
    with pytest.raises(ModelError, match=r"the observation table .* give 6000 numbers"):
        parse_pomdp(text)


LONG = 200_000


@pytest.mark.parametrize(
    ("rest", "message"),
    [
        ("T: 0 : 0 : 0 " + "1" * LONG + "x", "transition entry needs a number, found 0 and then '1111"),
        ("T: 0 : 0 : 0 " + "1" * LONG, "is too large for a number"),
        ("T: 0 : " + "1" * LONG, "is not among the 2 states"),
        ("T: 0 " + "1 " * LONG, "too many numbers: 1 is left over"),
        ("T: 0 " + "# " * LONG, "needs 4 numbers, found 0 before the end of the file"),
        ("T: 0 " + "#\n" * LONG + "1", "needs 4 numbers, found 1 before the end of the file"),
        ("T:" + " " * LONG + "x", "unknown action 'x'"),
        ("T:" * LONG, "unknown action 'T'"),
        (":" * LONG, "expected one of discount:"),
        ("T: 0 : 0 : 1 0.5\n" * 20_000, "transition row for '0', '0' sums to 1.5, not 1"),
        ("T: 0 : 0 : * 0.5\n" * 3_000 + "T: 0 : 0 : 0 2", "2 is not a probability in transition entry"),
    ],
)
def test_long_texts_end_in_one_error(rest, message):
    with pytest.raises(ParseError) as caught:
        parse_pomdp(head("2", "2", "2") + "start: 1\nT: * identity\nO: * uniform\n" + rest)
    assert message in caught.value.message
    assert len(str(caught.value)) < 2000


def test_a_matrix_that_cannot_fit_the_text():
    """The numbers of the text are counted; no array for the missing ones is allocated."""
    with pytest.raises(ParseError, match="needs 10000000000 numbers, found 3 before the end of the file"):
        parse_pomdp(head(MANY, 1, 1) + "T: 0\n0 0 1\n")


def test_rewards_of_dense_tables():
    """So many cases that a matrix product replaces the look-up, compared with explicit sums."""
    text = head(150, 1, 150) + "T: * uniform\nO: * uniform\nR: * : * : * : 0 3\nR: * : 7 : * : * 1\n"
    reward = parse_pomdp(text).reward
    expected = np.full(150, 3 / 150)
    expected[7] = 1
    assert reward[0] == pytest.approx(expected, rel=1e-12)
