"""Requests that are refused: each has a typed error with its reason."""

import json
import random

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from lcorpp.web.requests import FIELDS, MAX_REQUEST, RequestError, parse_request
from tests.web.conftest import Asker, play

REFUSED = {
    "no JSON": ("{", "malformed", "not JSON"),
    "a list": ("[1]", "malformed", "[1]; expected an object"),
    "no id": ('{"type": "start"}', "malformed", "id: null; expected a whole number"),
    "an id of text": ('{"id": "1", "type": "start"}', "malformed", 'id: "1"; expected a whole number'),
    "no type": ('{"id": 1}', "unknown_type", "type: null; expected one of start"),
    "an unknown type": ('{"id": 1, "type": "quit"}', "unknown_type", 'type: "quit"; expected one of start'),
    "a missing field": ('{"id": 1, "type": "infer", "facts": {}}', "invalid", "expected facts, labels"),
    "an unknown field": (
        '{"id": 1, "type": "start", "now": 1}',
        "invalid",
        'the fields "now"; expected none',
    ),
    "a value that is no list": (
        '{"id": 1, "type": "judge", "facts": {}, "samples": {}, "value": "a"}',
        "invalid",
        'value: "a"; expected 1 to 64 values of the shared variables',
    ),
    "a sample of NaN": (
        '{"id": 1, "type": "judge", "facts": {}, "samples": {"m": [[0, NaN]]}, "value": ["a"]}',
        "invalid",
        "samples: [0, NaN]; expected a sample",
    ),
    "a step without an observation": (
        '{"id": 1, "type": "log", "facts": {}, "labels": {}, "steps": [["greet"]]}',
        "invalid",
        'steps: ["greet"]; expected a step [action, observation]',
    ),
    "no samples": (
        '{"id": 1, "type": "samples", "sense": "m", "samples": []}',
        "invalid",
        "expected 1 to 64",
    ),
    "a sample of 401 digits": (
        f'{{"id": 1, "type": "samples", "sense": "m", "samples": [[0, 1{"0" * 400}]]}}',
        "invalid",
        "expected a sample [time, value, ...] of finite numbers",
    ),
    "facts of numbers": (
        '{"id": 1, "type": "infer", "facts": {"a": 1}, "labels": {}}',
        "invalid",
        "facts: 1",
    ),
    "a deep request": ("[" * 60_000, "malformed", "not JSON"),
    "a long request": (" " * (MAX_REQUEST + 1), "too_large", "expected at most 1048576"),
}


@pytest.mark.parametrize(("text", "code", "message"), REFUSED.values(), ids=REFUSED)
def test_refused(text, code, message):
    with pytest.raises(RequestError) as caught:
        parse_request(text)
    assert caught.value.code == code
    assert message in str(caught.value)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(sorted(FIELDS)), st.data())
def test_any_fields_are_accepted_or_refused_with_a_reason(asker, type, data):
    fields = {name: data.draw(JSON) for name in FIELDS[type]}
    reply = asker.service.handle(json.dumps({"id": 3, "type": type, **fields}))
    assert reply["id"] == 3
    assert reply.get("code") in (None, "invalid")


def test_three_thousand_hostile_messages_leave_the_service_usable(intention):
    logged = []
    asker = Asker(intention, log=logged.append)
    rng = random.Random(0)
    steps = play(asker)
    valid = [
        {"type": "start"},
        {"type": "infer", "facts": {"time": "morning"}, "labels": {"motion": "interested"}},
        {"type": "samples", "sense": "motion", "samples": [[0.5, 1.0, 2.0]]},
        {"type": "judge", "facts": {}, "samples": {"motion": [[0.5, 1.0, 2.0]]}, "value": ["interested"]},
        {"type": "log", "facts": {}, "labels": {}, "steps": steps},
    ]
    values = [
        None,
        True,
        -1,
        1e308,
        "",
        "x" * 300,
        [],
        {},
        [[1e9, -1e300, 5]],
        [["a"]],
        [["greet", "pos"], ["report_interested", None]],
        "__proto__",
        "\ud800",
    ]
    for number in range(3_000):
        message = {"id": number, **rng.choice(valid)}
        if rng.random() < 0.7:
            message[rng.choice([*message, "more"])] = rng.choice(values)
        text = json.dumps(message)
        if rng.random() < 0.1:
            text = text[: rng.randrange(len(text))]
        reply = asker.service.handle(text)
        assert "type" in reply
        json.dumps(reply)
    assert asker.send("start")["type"] == "started"
    assert len(set(logged)) == 1  # the valid decision alone
