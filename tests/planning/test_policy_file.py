from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import FileError, PolicyError
from lcorpp.planning import Policy, parse_pomdp, read_policy, write_policy
from tests.planning.models import LCORPP, TIGER

tiger = parse_pomdp(TIGER, file='a "b" <ü>.pomdp')
policy = Policy.of(tiger, [[1 / 3, -1e-17], [0.1 + 0.2, 2e300]], [0, 2])

APPL = """\
<?xml version="1.0" encoding="ISO-8859-1"?>
<Policy version="0.1" type="value" model="tiger.pomdp" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"\
 xsi:noNamespaceSchemaLocation="policyx.xsd">
<AlphaVector vectorLength="2" numObsValue="1" numVectors="2">
<Vector action="1" obsValue="0">-81.5972 28.4028 </Vector>
<Vector action="0" obsValue="0">19.3714 19.3714 </Vector>
</AlphaVector> </Policy>
"""


def test_round_trip_is_exact(tmp_path):
    write_policy(policy, tmp_path / "x.policy")
    back = read_policy(tmp_path / "x.policy", tiger)
    assert (back.vectors == policy.vectors).all()
    assert (back.actions == policy.actions).all()


def read(tmp_path, text, model=tiger):
    path = tmp_path / "x.policy"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_policy(path, model)


def test_an_appl_file_is_read(tmp_path):
    back = read(tmp_path, APPL)
    assert back.actions.tolist() == [1, 0]
    assert back.vectors[0].tolist() == [-81.5972, 28.4028]


def test_a_sparse_vector_is_read(tmp_path):
    sparse = '<SparseVector action="1" obsValue="0"><Entry>1 2.5</Entry></SparseVector>'
    text = APPL.replace('<Vector action="1" obsValue="0">-81.5972 28.4028 </Vector>', sparse)
    assert read(tmp_path, text).vectors[0].tolist() == [0.0, 2.5]


def test_the_model_changed_since(tmp_path):
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
        (APPL.replace('numVectors="2"', 'numVectors="3"'), "3 vectors are announced, 2 are there"),
        (APPL.replace("-81.5972", "-81.5972 7"), "a vector of 3 numbers, the model has 2 states"),
        (APPL.replace("-81.5972", "nan"), "nan is not a finite number"),
        (APPL.replace("-81.5972", "abc"), "expected a number, found 'abc'"),
        (b'<?xml version="1.0" encoding="nonsense"?><Policy/>', "x.policy:"),
        ("<Policy>" * 20, "nested too deeply"),
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
