from __future__ import annotations

import re
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from lcorpp.errors import FileError, PolicyError
from lcorpp.planning import AlphaVectors, Policy, parse_pomdp, read_policy, write_policy
from lcorpp.planning.formats import policy_xml as policy_file
from tests.planning.models import LCORPP, TIGER

tiger = parse_pomdp(TIGER, file='a "b" <ü>.pomdp')
policy = Policy.of(tiger, [[1 / 3, -1e-17], [0.1 + 0.2, -2e2]], [0, 2])

APPL = """\
<?xml version="1.0" encoding="ISO-8859-1"?>
<Policy version="0.1" type="value" model="tiger.pomdp" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"\
 xsi:noNamespaceSchemaLocation="policyx.xsd">
<AlphaVector vectorLength="2" numObsValue="1" numVectors="2">
<Vector action="1" obsValue="0">-81.5972 28.4028 </Vector>
<Vector action="0" obsValue="0">19.3714 19.3714 </Vector>
</AlphaVector> </Policy>
"""

SPARSE = APPL.replace(
    '<Vector action="1" obsValue="0">-81.5972 28.4028 </Vector>',
    '<SparseVector action="1" obsValue="0"><Entry>1 2.5</Entry></SparseVector>',
)


def test_round_trip_is_exact(tmp_path):
    write_policy(policy, tmp_path / "x.policy")
    back = read_policy(tmp_path / "x.policy", tiger)
    assert (back.vectors == policy.vectors).all()
    assert (back.actions == policy.actions).all()


def read(tmp_path, text, model=tiger, blocks=None):
    path = tmp_path / "x.policy"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_policy(path, model, blocks=blocks)


@pytest.mark.parametrize(("text", "vector"), [(APPL, [-81.5972, 28.4028]), (SPARSE, [0.0, 2.5])])
def test_full_and_sparse_vectors_of_appl_are_read(tmp_path, text, vector):
    back = read(tmp_path, text)
    assert back.actions.tolist() == [1, 0]
    assert back.vectors[0].tolist() == vector


def test_a_policy_of_a_changed_model_is_refused(tmp_path):
    write_policy(policy, tmp_path / "x.policy")
    with pytest.raises(PolicyError, match="for another model: the fingerprint"):
        read_policy(tmp_path / "x.policy", parse_pomdp(TIGER.replace("0.85 0.15", "0.8 0.2")))


BOMB = '<?xml version="1.0"?><!DOCTYPE p [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><Policy>&b;</Policy>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", ":1:1: not well-formed XML: no element found"),
        (APPL.replace("</AlphaVector>", ""), ":6:4: not well-formed XML: mismatched tag"),
        (BOMB, "a document type declaration is refused"),
        ("<html></html>", "expected <Policy>, found <html>"),
        ("<Policy></Policy>", "no alpha vector"),
        (APPL.replace('action="1"', 'action="3"'), ":4:1: this policy is for another model: action 3"),
        (APPL.replace('action="1"', 'action="-1"'), "action must be a whole number"),
        (APPL.replace('action="1"', ""), "action must be a whole number"),
        (APPL.replace('obsValue="0">-81', 'obsValue="1">-81'), "factored model"),
        (APPL.replace('numObsValue="1"', 'numObsValue="3"'), "factored model"),
        (APPL.replace('numVectors="2"', 'numVectors="3"'), "the header announces 3 vectors, found 2"),
        (APPL.replace("-81.5972", "-81.5972 7"), "a vector of 3 numbers, the model has 2 states"),
        (APPL.replace("-81.5972", "nan"), "nan is not a finite number"),
        (APPL.replace("-81.5972", "abc"), "expected a number, found 'abc'"),
        (b'<?xml version="1.0" encoding="nonsense"?><Policy/>', "x.policy:"),
        ("<Policy>" * 20, "nested too deeply"),
        (
            APPL.replace("-81.5972", "1_0"),
            ":4:45: expected a number, found '1_0', number 1 of this vector",
        ),
        (APPL.replace("-81.5972", "1 &#1635;"), "found '\u0663', number 2"),
        (APPL.replace("-81.5972", "1e999"), "1e999 is not a finite number"),
        (APPL.replace("-81.5972", "-Infinity"), "-Infinity is not a finite number"),
        (APPL.replace("-81.5972", "1" * 10**6 + "x"), f"expected a number, found '{'1' * 40}'"),
        (APPL.replace('action="1"', 'action="1_0"'), "action must be a whole number, not '1_0'"),
        (SPARSE.replace("1 2.5", "1 2_5"), "expected a number, found '2_5'"),
        (SPARSE.replace("1 2.5", "1_0 2.5"), "an entry is a state's number and a value, not '1_0 2.5'"),
        (SPARSE.replace("1 2.5", "1 2.5 3"), "an entry is a state's number and a value"),
        (SPARSE.replace("1 2.5", "2 2.5"), "state 2 is not among the 2 states"),
        (APPL.replace("19.3714 19", '<Vector action="0"/>19.3714 19'), "cannot be inside another vector"),
        (APPL.replace("</Policy>", '<AlphaVector numVectors="1"/></Policy>'), "a second <AlphaVector>"),
    ],
)
def test_malformed_files(tmp_path, text, message):
    with pytest.raises(PolicyError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value)


def test_a_policy_for_another_model(tmp_path):
    with pytest.raises(PolicyError, match="its vectors have 2 numbers, the model has 5 states"):
        read(tmp_path, APPL, parse_pomdp(LCORPP))


def test_a_missing_file():
    with pytest.raises(FileError):
        read_policy("missing.policy", tiger)


def test_infinity_does_not_slip_in():
    with pytest.raises(PolicyError, match="not finite"):
        Policy.of(tiger, np.full((1, 2), np.inf), [0])


def test_the_model_is_named_as_xml_wants_it(tmp_path):
    write_policy(policy, tmp_path / "x.policy")
    assert b'model="a &quot;b&quot; &lt;&#252;&gt;.pomdp"' in (tmp_path / "x.policy").read_bytes()


lcorpp = parse_pomdp(LCORPP)
in_sets = Policy.of_sets(
    lcorpp,
    [
        AlphaVectors(np.array([0, 2]), np.array([[1 / 3, 2.0], [0.5, -1.0]]), np.array([1, 0])),
        AlphaVectors(np.array([1, 3, 4]), np.array([[7.0, 8.0, 9e-300]]), np.array([4])),
    ],
)


def test_vector_sets_are_filled_with_the_floor(tmp_path):
    write_policy(in_sets, tmp_path / "x.policy")
    back = read_policy(tmp_path / "x.policy", lcorpp)
    floor = -80 / (1 - 0.99)
    assert back.vectors == pytest.approx(
        np.array(
            [[1 / 3, floor, 2, floor, floor], [0.5, floor, -1, floor, floor], [floor, 7, floor, 8, 9e-300]]
        )
    )
    assert (back.vectors == in_sets.vectors).all()
    assert back.actions.tolist() == [1, 0, 4]
    for belief in ([0.25, 0, 0.75, 0, 0], [0, 0.5, 0, 0.25, 0.25]):
        assert back.value_and_action(np.array(belief)) == in_sets.value_and_action(np.array(belief))


def test_a_large_policy_is_written_set_by_set(tmp_path, monkeypatch):
    monkeypatch.setattr(policy_file, "MAX_BYTES", 100)
    write_policy(in_sets, tmp_path / "x.policy")
    text = (tmp_path / "x.policy").read_text()
    assert "<!-- lcorpp pieces 0,2 1,3-4 -->" in text
    assert '<AlphaVector vectorLength="3" numObsValue="2" numVectors="3">' in text
    back = read_policy(tmp_path / "x.policy", lcorpp)
    for read_part, part in zip(back.vector_sets, in_sets.vector_sets, strict=True):
        assert read_part.states.tolist() == part.states.tolist()
        assert (read_part.vectors == part.vectors).all()
        assert read_part.actions.tolist() == part.actions.tolist()
    for wrong, words in (
        ("0,2 1,3-9", "increasing ranges of the model's state indices, found '1,3-9'"),
        ("0,2 3-1", "increasing ranges of the model's state indices, found '3-1'"),
        ("0,2 1,3-4 0", "observed variables have 2 values, those of the model 3"),
        ("0,2 1", "a vector of 3 numbers"),
        ("0,2", "observed variables have 2 values, those of the model 1"),
    ):
        with pytest.raises(PolicyError, match=words):
            read(tmp_path, text.replace("0,2 1,3-4", wrong), lcorpp)
    write_policy(Policy.of(lcorpp, np.zeros((9, 5)), np.zeros(9)), tmp_path / "flat.policy")
    assert "pieces" not in (tmp_path / "flat.policy").read_text()


FACTORED = parse_pomdp(
    "discount: 0.9\nvalues: reward\nstates: x0y0 x0y1 x1y0 x1y1\nactions: a b\nobservations: o\n"
    "T: * identity\nO: * uniform\nR: * : x0y0 : * : * -1\nR: b : * : * : * 1\n"
)
MOMDP = """\
<?xml version="1.0" encoding="ISO-8859-1"?>
<Policy version="0.1" type="value" model="factored.pomdpx">
<AlphaVector vectorLength="2" numObsValue="2" numVectors="3">
<Vector action="1" obsValue="1">3 4 </Vector>
<Vector action="0" obsValue="0">1 2 </Vector>
<SparseVector action="0" obsValue="1"><Entry>1 5</Entry></SparseVector>
</AlphaVector> </Policy>
"""


def test_a_policy_of_a_factored_model_has_several_vector_sets(tmp_path):
    found = read(tmp_path, MOMDP, FACTORED, blocks=[[0, 1], [3, 2]])
    assert [piece.states.tolist() for piece in found.vector_sets] == [[0, 1], [2, 3]]
    assert [piece.vectors.tolist() for piece in found.vector_sets] == [[[1, 2]], [[4, 3], [5, 0]]]
    assert [piece.actions.tolist() for piece in found.vector_sets] == [[0], [1, 0]]
    assert found.value_and_action(np.array([0, 0, 0.25, 0.75])) == (0.25 * 4 + 0.75 * 3, 1)
    assert found.floor == pytest.approx(-10)


def test_a_flat_policy_is_flat_whatever_the_blocks(tmp_path):
    assert read(tmp_path, APPL, blocks=[[1], [0]]).vectors[0].tolist() == [-81.5972, 28.4028]


@pytest.mark.parametrize(
    ("text", "blocks", "message"),
    [
        (MOMDP, None, ":3:1: this policy is for a factored model with 2 values"),
        (MOMDP, [[0], [1], [2, 3]], "its observed variables have 2 values, those of the model 3"),
        (MOMDP, [[0], [1, 2]], "its vectors have 2 numbers, the model has 1 values of the hidden variables"),
        (
            MOMDP.replace('obsValue="1">3', 'obsValue="2">3'),
            [[0, 1], [2, 3]],
            "obsValue 2 is not among the 2",
        ),
        (MOMDP.replace("3 4", "3 4 5"), [[0, 1], [2, 3]], "a vector of 3 numbers"),
        (MOMDP.replace("1 5", "2 5"), [[0, 1], [2, 3]], "state 2 is not among the 2 states"),
        (MOMDP, [[0, 1], [7, 2]], "a state index is outside 0 to 3"),
        (MOMDP, [[0, 1], [2, 2]], "the states of a vector set must be increasing"),
    ],
)
def test_factored_policies_that_do_not_fit(tmp_path, text, blocks, message):
    with pytest.raises(PolicyError, match=re.escape(message)):
        read(tmp_path, text, FACTORED, blocks=blocks)


PIECES = st.sampled_from(
    [
        "<Vector action='0' obsValue='0'>",
        "</Vector>",
        "1_0",
        "\x00",
        "&amp;",
        "9" * 30,
        "<!-- x -->",
        "é",
        "<",
    ]
)


@given(
    cuts=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 12), PIECES | st.text(max_size=3)), max_size=4)
)
@settings(max_examples=75, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_files_end_in_a_policy_or_a_typed_error(tmp_path, cuts):
    text = SPARSE
    for place, length, piece in cuts:
        at = int(place * len(text))
        text = text[:at] + piece + text[at + length :]
    with suppress(PolicyError):
        assert isinstance(read(tmp_path, text.encode("utf-8", "surrogatepass")), Policy)
