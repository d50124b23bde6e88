from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from lcorpp.errors import FileError, ModelError
from lcorpp.planning import Factored, cpt as table, flatten, format_pomdpx, parse_pomdpx, write_pomdpx
from tests.planning.factored.models import factored_models, rover
from tests.planning.formats.pomdpx.texts import parse
from tests.planning.models import pomdps

SUITE = settings(max_examples=12, suppress_health_check=list(HealthCheck))


def test_a_rule_is_written_before_its_exceptions():
    text = format_pomdpx(rover())
    entries = [line for line in text.splitlines() if line.startswith("<Entry>")]
    begin = text.splitlines().index("<Parent>action rover_0 rock_0</Parent>") + 2
    assert text.splitlines()[begin : begin + 3] == [
        "<Entry><Instance>* * - -</Instance><ProbTable>identity</ProbTable></Entry>",
        "<Entry><Instance>sample left * -</Instance><ProbTable>0.0 1.0</ProbTable></Entry>",
        "</Parameter>",
    ]
    assert (
        "<Entry><Instance>check middle - -</Instance><ProbTable>0.8 0.2 0.2 0.8</ProbTable></Entry>"
        in entries
    )
    assert len(entries) == 19


def written(problem: Factored) -> bytes:
    return format_pomdpx(problem).encode("ascii", "xmlcharrefreplace")


@SUITE
@given(factored_models())
def test_writing_and_reading_gives_the_same_problem(problem):
    back = parse_pomdpx(written(problem))
    assert back.equals(problem)
    mine, theirs = flatten(problem), flatten(back)
    assert mine.fingerprint == theirs.fingerprint
    assert (mine.start == theirs.start).all()


@SUITE
@given(pomdps())
def test_a_flat_problem_is_written_and_read_exactly(pomdp):
    back = flatten(parse_pomdpx(format_pomdpx(pomdp)))
    assert back.fingerprint == pomdp.fingerprint
    assert (back.start == pomdp.start).all()


def test_long_rows_are_written_number_by_number():
    """An exception then also overrides the numbers of its rule with zeros."""
    size = 40
    moves = {"*": "0", "3": "7", "5": {"1": 0.5, "2": 0.5}}
    problem = Factored.of(
        states={"x": range(size)},
        actions="go run stay",
        start={"x": "0"},
        transition={
            "x": table("action x", {f"* {key}": row for key, row in moves.items()} | {"stay 9": "same"})
        },
        reward={"none": 0},
        discount=0.9,
    )
    text = format_pomdpx(problem)
    assert "<Entry><Instance>* * 0</Instance><ProbTable>1.0</ProbTable></Entry>" in text
    assert "<Entry><Instance>* 3 0</Instance><ProbTable>0.0</ProbTable></Entry>" in text
    assert parse(text).equals(problem)


NAMES = st.text(st.characters(exclude_categories=("C", "Z")), min_size=1, max_size=4).filter(
    lambda word: word not in ("*", "-", "null") and not word.endswith("'")
)


@SUITE
@given(st.lists(NAMES, min_size=9, max_size=9, unique=True))
def test_any_word_may_be_a_name(words):
    a, b, c, *values = words
    problem = Factored.of(
        states={a: values[:2]},
        actions={b: values[2:4]},
        observations={c: values[4:]},
        start={a: [0.5, 0.5]},
        transition={a: table([b, a], {("*", "*"): [0.5, 0.5], (values[2], "*"): [1, 0]})},
        observation={c: table([a + "'"], {("*",): [0.5, 0.5]})},
        reward={"reward": table([b], {(values[3],): 1})},
        discount=0.9,
    )
    assert parse(written(problem)).equals(problem)


@pytest.mark.parametrize("names", [("x", "x_0"), ("x", "x_1"), ("x_0", "x_0_0"), ("x", "y"), ("x0", "x")])
def test_names_that_look_like_before_and_after(names, tmp_path):
    one, other = names
    problem = Factored.of(
        states={one: "a b"},
        actions={other: "c d"},
        start={one: "a"},
        transition={one: table([other, one], {("*", "*"): "b"})},
        reward={"none": 0},
        discount=0.9,
    )
    assert parse(written(problem)).equals(problem)
    both = Factored.of(
        states={one: "a b", other: "c d"},
        actions="go",
        start={one: "a", other: "c"},
        transition={one: "same", other: "same"},
        reward={"none": 0},
        discount=0.9,
    )
    assert parse(written(both)).equals(both)


def test_problems_that_the_format_cannot_express_raise_errors(tmp_path):
    problem = Factored.of(
        states={"null": "a"},
        actions="go",
        start={"null": "a"},
        transition={"null": "same"},
        reward=0,
        discount=0.9,
    )
    with pytest.raises(ModelError, match="the name 'null' cannot be written"):
        write_pomdpx(problem, tmp_path / "x.pomdpx")
    with pytest.raises(FileError):
        write_pomdpx(rover(), tmp_path / "missing" / "x.pomdpx")
