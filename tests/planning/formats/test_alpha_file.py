from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from lcorpp.errors import FileError, PolicyError
from lcorpp.planning import AlphaVectors, Policy, parse_pomdp, read_alphas, write_alphas
from lcorpp.planning.formats import alpha_file
from tests.planning.models import LCORPP, TIGER

tiger = parse_pomdp(TIGER)

# as pomdp-solve writes it
SOLVED = """\
1
-81.5972000000000008412825991399586200714111 28.4028000000000000468958205601666122674942 

0
19.3713683559737184112691466 19.3713683559737184112691466 

"""  # noqa: W291


def read(tmp_path, text, model=tiger):
    (tmp_path / "x.alpha").write_bytes(text.encode())
    return read_alphas(tmp_path / "x.alpha", model)


def test_reads_a_file_of_pomdp_solve(tmp_path):
    found = read(tmp_path, SOLVED)
    assert found.actions.tolist() == [1, 0]
    assert found.vectors.tolist() == [[-81.5972, 28.4028], [19.371368355973718, 19.371368355973718]]
    assert found.fingerprint == tiger.fingerprint


@pytest.mark.parametrize(
    "text",
    [
        SOLVED.replace("\n", "\r\n"),
        SOLVED.replace("\n", "\r"),
        SOLVED.replace("\n\n", "\n"),
        SOLVED.replace(" 28", "\n28").replace("\n\n", "\n\n\n"),
        "\n\n" + SOLVED.replace("1\n", "  01\t\n", 1).rstrip(),
    ],
)
def test_line_ends_empty_lines_and_wrapped_vectors_do_not_matter(tmp_path, text):
    found, expected = read(tmp_path, text), read(tmp_path, SOLVED)
    assert (found.vectors == expected.vectors).all()
    assert (found.actions == expected.actions).all()


def test_write_gives_action_numbers_and_empty_line_for_each_vector(tmp_path):
    write_alphas(Policy.of(tiger, [[1, -2.5], [1 / 3, 1e300]], [2, 0]), tmp_path / "x.alpha")
    text = (tmp_path / "x.alpha").read_text()
    assert text == "2\n1.0 -2.5\n\n0\n0.3333333333333333 1e+300\n\n"


@given(
    st.lists(
        st.tuples(st.integers(0, 4), st.lists(st.floats(-1e140, 1e140, width=64), min_size=5, max_size=5)),
        min_size=1,
        max_size=6,
    )
)
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_write_then_read_is_the_same(tmp_path, vectors):
    lcorpp = parse_pomdp(LCORPP)
    lcorpp = replace(lcorpp, reward=[[1e145] * 5, *[[-1e145] * 5] * (len(lcorpp.actions) - 1)])
    policy = Policy.of(lcorpp, [vector for _, vector in vectors], [action for action, _ in vectors])
    write_alphas(policy, tmp_path / "x.alpha")
    back = read_alphas(tmp_path / "x.alpha", lcorpp)
    assert back.vectors.tobytes() == policy.vectors.tobytes()
    assert (back.actions == policy.actions).all()


def test_vector_sets_are_filled_with_the_floor(tmp_path, monkeypatch):
    pieces = [
        AlphaVectors(np.array([1]), np.array([[7.0]]), np.array([2])),
        AlphaVectors(np.array([0]), np.array([[3.0]]), np.array([1])),
    ]
    policy = Policy.of_sets(tiger, pieces)
    write_alphas(policy, tmp_path / "x.alpha")
    assert read_alphas(tmp_path / "x.alpha", tiger).vectors.tolist() == [[policy.floor, 7], [3, policy.floor]]
    monkeypatch.setattr(alpha_file, "MAX_BYTES", 10)
    with pytest.raises(PolicyError, match="over all 2 states take about 0 MB"):
        write_alphas(policy, tmp_path / "y.alpha")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "x.alpha:1:1: the file contains no alpha vector"),
        ("\n \n", "x.alpha:1:1: the file contains no alpha vector"),
        ("listen\n1 2\n", "x.alpha:1:1: expected the number of an action, found 'listen'"),
        ("0 0\n1 2\n", "x.alpha:1:1: expected the number of an action, found '0 0'"),
        ("\n  -1\n1 2\n", "x.alpha:2:3: expected the number of an action, found '-1'"),
        ("3\n1 2\n", "x.alpha:1:1: these vectors are for another model: action 3 is not among its 3 actions"),
        ("9" * 5000 + "\n1 2\n", "is not among its 3 actions, counted from 0"),
        ("0\n1 2\n\n1\n1 2 3\n", "x.alpha:5:1: these vectors are for another model: the one that begins"),
        ("0\n1\n\n", "the one that begins in line 1 has 1 numbers, the model has 2 states"),
        (
            "0\n1 2\n\n1\n\n",
            "x.alpha:4:1: these vectors are for another model: the one that begins in line 4",
        ),
        ("0\n1 1_0\n", "x.alpha:2:3: expected a number, found '1_0'"),
        ("0\n  1\tnan\n", "x.alpha:2:5: nan is not a finite number"),
        ("0\n1 1e999\n", "x.alpha:2:3: 1e999 is not a finite number"),
        ("0\n1 # 2\n", "x.alpha:2:3: expected a number, found '#'"),
        ("0\n" + "1" * 10**6 + "x 2\n", "x.alpha:2:1: expected a number, found '1111"),
    ],
)
def test_malformed_files_raise_errors_with_line_and_column(tmp_path, text, message):
    with pytest.raises(PolicyError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_missing_files_and_folders_raise_file_errors(tmp_path):
    with pytest.raises(FileError):
        read_alphas(tmp_path / "missing.alpha", tiger)
    with pytest.raises(FileError):
        write_alphas(read(tmp_path, SOLVED), tmp_path / "missing" / "x.alpha")


WORDS = st.sampled_from(["0", "1", "2", "7", "\n", "\n\n", "-1.5", "1e3", "1_0", "x", "\r", "\u2028", "\x0b"])


@given(st.text() | st.lists(WORDS).map(" ".join))
@settings(max_examples=75, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_text_ends_in_a_policy_or_a_typed_error(tmp_path, text):
    (tmp_path / "x.alpha").write_bytes(text.encode("utf-8", "surrogatepass"))
    with suppress(PolicyError, FileError):
        assert isinstance(read_alphas(tmp_path / "x.alpha", tiger), Policy)
