"""`lcorpp show --write`: the model of a domain or of a file, as .pomdp and .pomdpx."""

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.planning import (
    Factored,
    Pomdp,
    cpt,
    flatten,
    read_factored,
    read_pomdp,
    read_pomdpx,
    write_pomdpx,
)
from tests.cli.planner import AUTHORS, refused


def are_equal(one: Pomdp, other: Pomdp) -> bool:
    names = (one.states, one.actions, one.observations, one.discount)
    tables = (
        (one.transition.dense, other.transition.dense),
        (one.observation.dense, other.observation.dense),
    )
    rest = ((one.reward, other.reward), (one.start, other.start))
    return names == (other.states, other.actions, other.observations, other.discount) and all(
        np.array_equal(a, b) for a, b in (*tables, *rest)
    )


@pytest.mark.parametrize("preset", ["office", "small"])
def test_the_model_of_a_domain_s_function(lcorpp, tmp_path, preset):
    model = load_domain("shopping", preset=preset).pomdp
    for name, read in (("a.pomdp", read_pomdp), ("a.pomdpx", read_pomdpx)):
        ended = lcorpp("show", "shopping", "--preset", preset, "--write", tmp_path / name)
        assert (ended.code, ended.err) == (0, "")
        assert ended.out.endswith(f"wrote the model to {tmp_path / name}\n")
        assert are_equal(read(tmp_path / name), model)


def test_a_file_in_the_other_format(lcorpp, tmp_path):
    ended = lcorpp("show", AUTHORS, "--write", tmp_path / "a.pomdpx")
    assert (ended.code, ended.err) == (0, "")
    assert are_equal(read_pomdpx(tmp_path / "a.pomdpx"), read_pomdp(AUTHORS))


def test_variables_are_kept(lcorpp, tmp_path):
    problem = Factored.of(
        states={"x": "1 2", "y": "1 2"},
        actions="a b",
        observations="o",
        start={"x": "uniform", "y": "uniform"},
        transition={"x": "same", "y": "same"},
        observation=cpt("", "uniform"),
        reward=cpt("action x", {"a 1": 1, "b 2": 1}),
        discount=0.5,
    )
    write_pomdpx(problem, tmp_path / "a.pomdpx")
    assert lcorpp("show", tmp_path / "a.pomdpx", "--write", tmp_path / "b.pomdpx").code == 0
    assert [variable.name for variable in read_factored(tmp_path / "b.pomdpx").states] == ["x", "y"]
    ended = lcorpp("show", tmp_path / "a.pomdpx", "--write", tmp_path / "b.pomdp")
    assert (ended.code, ended.err) == (0, "")
    assert are_equal(read_pomdp(tmp_path / "b.pomdp"), flatten(problem))


def test_what_cannot_be_written_is_refused(lcorpp, tmp_path):
    refused(
        lcorpp("show", "shopping", "--write", tmp_path / "a.txt"), "a.txt: not the name of a model; expected"
    )
    refused(
        lcorpp("show", "shopping", "--write", tmp_path / "no" / "a.pomdp"), "cannot be written: there is no"
    )
    refused(
        lcorpp("show", "shopping", "--preset", "big", "--write", tmp_path / "a.pomdp"), "unknown preset 'big'"
    )
    refused(lcorpp("show", AUTHORS, "--preset", "small"), "--preset small: ", "authors.pomdp is not a domain")
    refused(lcorpp("show", tmp_path), "no folder with a domain.toml")
    assert list(tmp_path.iterdir()) == []
