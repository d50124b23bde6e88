from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lcorpp.errors import FileError, ModelError, ParseError
from lcorpp.planning import Pomdp, format_pomdp, parse_pomdp, read_pomdp, write_pomdp
from tests.planning.models import LCORPP, SHARED, TIGER, pomdps, shared_model

PUBLISHED = sorted(path.name for path in SHARED.glob("*") if path.suffix.lower() == ".pomdp")

HEAD = "discount: 0.9\nvalues: reward\nstates: a b\nactions: x y\nobservations: u v\n"
BODY = "T: * identity\nO: * uniform\n"


def same(left: Pomdp, right: Pomdp) -> bool:
    return left.fingerprint == right.fingerprint and bool((left.start == right.start).all())


@pytest.mark.parametrize("name", PUBLISHED or ["tiger.95.pomdp"])
def test_published_models_are_read_and_written_back(name, tmp_path):
    pomdp = read_pomdp(shared_model(name))
    if len(pomdp.states) < 100:
        write_pomdp(pomdp, tmp_path / "copy.pomdp")
        assert same(read_pomdp(tmp_path / "copy.pomdp"), pomdp)


def test_ways_to_write_the_tiger():
    tiger = parse_pomdp(TIGER)
    assert same(parse_pomdp(TIGER.replace("\n", "\r\n")), tiger)
    assert same(parse_pomdp(TIGER.replace("\n", "\r")), tiger)
    assert same(parse_pomdp(TIGER.replace("start: 0.5 0.5", "start: uniform#comment")), tiger)
    assert same(parse_pomdp(TIGER.replace("start: 0.5 0.5\n", "")), tiger)
    assert same(parse_pomdp(TIGER.replace("* -1", "* : -1")), tiger)
    numeric = TIGER.replace("R:open-left : tiger-left", "R: 1 : 0")
    assert same(parse_pomdp(numeric), tiger)


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
    ],
)
def test_starts(start, belief):
    assert parse_pomdp(HEAD + start + "\n" + BODY).start.tolist() == belief


def test_entries_rows_matrices_and_overrides():
    text = (
        HEAD
        + "start: b\nT: * uniform\nT: x : a reset\nT: x : b : a 1.0\nT: x : b : b : 0.0\nT: y 1 0 0 1\nO: *\n"
        + "uniform\nO: * : a\n0.25 0.75\nO: y : b : 0.1 0.9\n"
    )
    pomdp = parse_pomdp(text)
    assert pomdp.transition.tolist() == [[[0, 1], [1, 0]], [[1, 0], [0, 1]]]
    assert pomdp.observation.tolist() == [[[0.25, 0.75], [0.5, 0.5]], [[0.25, 0.75], [0.1, 0.9]]]


def test_rewards_are_folded():
    text = HEAD + "T: x\n0.25 0.75\n0 1\nT: y identity\nO: *\n0.5 0.5\n0.1 0.9\n"
    text += (
        "R: x : a : * : * 1\nR: x : a : b : * 2\nR: x : a : b : v 3\nR: y : a\n1 2\n3 4\nR: y : b : b\n5 6\n"
    )
    reward = parse_pomdp(text).reward
    assert reward[0, 0] == pytest.approx(0.25 * 1 + 0.75 * (0.1 * 2 + 0.9 * 3))
    assert reward[1] == pytest.approx([0.5 * 1 + 0.5 * 2, 0.1 * 5 + 0.9 * 6])
    assert parse_pomdp(HEAD + BODY + "R: * : * : * : u 2\n").reward == pytest.approx(np.ones((2, 2)))
    assert parse_pomdp(HEAD + BODY + "R: * : * : * : u 2\nR: x : * : * : * 3").reward[:, 0].tolist() == [3, 1]


def test_costs_are_negated_once():
    text = (HEAD + BODY).replace("reward", "cost") + "R: x : * : * : * 4"
    reward = parse_pomdp(text).reward
    assert reward.tolist() == [[-4, -4], [0, 0]]
    assert not np.signbit(reward[1]).any()


def test_rounding_of_the_file_is_taken_out():
    pomdp = parse_pomdp(HEAD + "T: * uniform\nO: * 0.33333 0.66666 0.5 0.5\n")
    assert abs(pomdp.observation.sum(axis=2) - 1).max() < 1e-15


def test_bad_row_is_located():
    with pytest.raises(ParseError) as caught:
        parse_pomdp(TIGER.replace("0.85 0.15\n", "0.85 0.10\n"), file="tiger.pomdp")
    assert (caught.value.line, caught.value.column) == (15, 1)
    assert "tiger.pomdp:15:1: observation row for 'listen', 'tiger-left' sums to 0.95, not 1" in str(
        caught.value
    )


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("", (1, 1), "missing preamble: discount, values, states, actions, observations"),
        (HEAD.replace("values: reward\n", "") + BODY, (5, 1), "missing preamble: values"),
        (HEAD + "discount: 0.8\n" + BODY, (6, 1), "duplicate preamble: 'discount'"),
        (HEAD.replace("0.9", "1.0") + BODY, (1, 11), "discount 1 is refused"),
        (HEAD.replace("0.9", "-0.5") + BODY, (1, 11), "discount -0.5 is not between"),
        (HEAD.replace("reward", "money") + BODY, (2, 9), "values must be 'reward' or 'cost', found 'money'"),
        (HEAD.replace("a b", "a 3") + BODY, (3, 11), "expected a name among the states, found '3'"),
        (HEAD.replace("a b", "a a") + BODY, (3, 11), "'a' is twice among the states"),
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
        (HEAD + "T: x : a : a 2", (6, 14), "2 is no probability"),
        (HEAD + "T: x : a : a nan", (6, 14), "found 0 and then 'nan'"),
        (HEAD + BODY + "R: x : a : a : u 1e999", (8, 18), "1e999 is too large"),
        (HEAD + BODY + "R: x 4", (8, 6), "expected ':', found '4'"),
        (HEAD + "T: * identity\nO: x uniform", (4, 12), "action 'y' has no observation rows"),
        (HEAD + "T: * : a uniform\nO: * uniform", (4, 10), "transition row for 'x', 'b' is missing"),
        (HEAD + BODY + "start: a", (8, 1), "'start' must come before the first T, O or R"),
        (HEAD + "start: 0.5 0.4\n" + BODY, (6, 8), "the start belief sums to 0.9, not 1"),
        (HEAD + "start exclude: a b\n" + BODY, (6, 16), "no state is left"),
        (HEAD + "start: *\n" + BODY, (6, 8), "'*' is no state to start in"),
        (HEAD + "start:\n" + BODY, (7, 1), "expected states to start in"),
        (HEAD + "O: x reset\n", (6, 6), "'reset' cannot stand for this observation matrix"),
        (HEAD + "T: x : a identity\n", (6, 10), "'identity' cannot stand for this transition row"),
        ("hello " + HEAD + BODY, (1, 1), "expected one of discount:, values:"),
    ],
)
def test_malformed_text_is_located(text, place, message):
    with pytest.raises(ParseError) as caught:
        parse_pomdp(text)
    assert message in str(caught.value)
    assert (caught.value.line, caught.value.column) == place


@pytest.mark.parametrize("count", ["100000", "99999999999999999999999"])
def test_huge_models_are_refused(count):
    with pytest.raises(ModelError, match=r"GiB|too many"):
        parse_pomdp(HEAD.replace("a b", count) + BODY)


def test_a_missing_file():
    with pytest.raises(FileError, match=r"missing\.pomdp"):
        read_pomdp("missing.pomdp")


@given(pomdps())
@settings(max_examples=60, deadline=None)
def test_write_then_read_is_the_same(pomdp):
    assert same(parse_pomdp(format_pomdp(pomdp)), pomdp)


@pytest.mark.parametrize("name", ["two words", "T", "3", "a:b", "*", "x#"])
def test_names_that_cannot_be_written(name):
    pomdp = parse_pomdp(HEAD + BODY)
    unwritable = Pomdp(
        (name, "b"),
        *(getattr(pomdp, f) for f in ("actions", "observations", "transition", "observation")),
        pomdp.reward,
        0.9,
        pomdp.start,
    )
    with pytest.raises(ModelError, match="cannot be written"):
        format_pomdp(unwritable)


WORDS = st.sampled_from(
    [*HEAD.split(), *BODY.split(), "R:", "start:", ":", "*", "0.5", "1", "-1", "include", "\n", "#"]
)


@given(
    st.one_of(
        st.text(), st.lists(WORDS).map(" ".join), st.lists(WORDS).map(lambda w: HEAD + BODY + " ".join(w))
    )
)
@example(LCORPP)
@settings(max_examples=300, deadline=None)
def test_any_text_ends_in_a_model_or_a_typed_error(text):
    with suppress(ParseError, ModelError):
        assert isinstance(parse_pomdp(text), Pomdp)
