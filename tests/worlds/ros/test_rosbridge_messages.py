"""Texts of a rosbridge server as messages: fragments in any order, PNG images as the server writes them."""

import base64
import io
import json
from itertools import pairwise
from math import ceil, floor, sqrt

import numpy as np
import pytest
from hypothesis import given, strategies as st
from PIL import Image

from lcorpp.errors import WorldError
from lcorpp.worlds.ros import rosbridge_messages
from lcorpp.worlds.ros.rosbridge_messages import MAX_FRAGMENTED, Fragments, MessageDecoder

MESSAGE = {"op": "publish", "topic": "/people", "msg": {"text": "Grüße \u20ac", "numbers": list(range(40))}}


def fragment(key, data, number, total):
    return {"op": "fragment", "id": key, "data": data, "num": number, "total": total}


def split(message, total, key="f1"):
    text = json.dumps(message)
    ends = np.linspace(0, len(text), total + 1).astype(int).tolist()
    return [fragment(key, text[a:b], n, total) for n, (a, b) in enumerate(pairwise(ends))]


def make_png(text, mode="RGB"):
    """As `rosbridge_library.internal.pngcompression.encode`: a nearly square image, padded with line ends."""
    content, bands = text.encode(), len(mode)
    width = floor(sqrt(len(content) / bands)) or 1
    height = ceil(len(content) / bands / width)
    padded = content.ljust(width * height * bands, b"\n")
    written = io.BytesIO()
    Image.frombytes(mode, (width, height), padded).save(written, "png")
    return {"op": "png", "data": base64.b64encode(written.getvalue()).decode()}


def decode(*messages):
    decoder = MessageDecoder()
    return [decoder.decode(json.dumps(message)) for message in messages]


@given(st.permutations(range(7)), st.lists(st.integers(0, 6), max_size=5))
def test_fragments_are_joined_in_any_order_and_repeated(order, repeated):
    parts = split(MESSAGE, 7)
    *before, last = [parts[number] for number in order]
    again = [parts[number] for number in repeated if number != order[-1]]
    *early, complete = decode(*before, *again, last)
    assert early == [None] * len(early)
    assert complete == MESSAGE


def test_fragments_of_several_messages_are_kept_apart():
    other = {**MESSAGE, "topic": "/other"}
    mixed = [part for pair in zip(split(MESSAGE, 3, "a"), split(other, 3, 7), strict=True) for part in pair]
    assert decode(*mixed) == [None] * 4 + [MESSAGE, other]
    assert decode(*split(MESSAGE, 1)) == [MESSAGE]


def test_an_id_that_is_used_again_begins_another_message():
    assert decode(split(other := {"op": "new"}, 2)[0], *split(MESSAGE, 3)) == [None, None, None, MESSAGE]
    assert decode(split(other, 3)[0], *split(MESSAGE, 3)) == [None, None, None, MESSAGE]


@pytest.mark.parametrize(
    "changes",
    [
        {"id": None},
        {"id": [1]},
        {"data": None},
        {"data": 3},
        {"num": 2},
        {"num": -1},
        {"num": "0"},
        {"num": None},
        {"total": 0},
        {"total": True},
        {"total": None},
    ],
    ids=str,
)
def test_malformed_fragments_are_errors_and_change_nothing(changes):
    first, second = split(MESSAGE, 2)
    decoder = MessageDecoder()
    decoder.decode(json.dumps(first))
    with pytest.raises(WorldError, match="a fragment with"):
        decoder.decode(json.dumps(second | changes))
    assert decoder.decode(json.dumps(second)) == MESSAGE


def test_fragments_that_wait_are_bounded_in_number_and_size(monkeypatch):
    fragments = Fragments()
    for key in range(MAX_FRAGMENTED):
        assert fragments.add(fragment(key, "x", 0, 2)) is None
    with pytest.raises(WorldError, match="whose other fragments did not come are left out"):
        fragments.add(fragment("more", "x", 0, 2))
    assert fragments.size == MAX_FRAGMENTED
    assert fragments.add(fragment(1, "y", 1, 2)) == "xy"
    assert fragments.add(fragment(0, "y", 1, 2)) is None  # the oldest one was dropped
    monkeypatch.setattr(rosbridge_messages, "MAX_SIZE", 1000)
    fragments = Fragments()
    for number in range(20):
        try:
            fragments.add(fragment("large", "x" * 100, number, 10**9))
        except WorldError:
            continue
        assert fragments.size <= 1000


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA"])
def test_a_png_operation_has_the_message_as_its_pixels(mode):
    assert decode(make_png(json.dumps(MESSAGE), mode)) == [MESSAGE]
    assert decode(*split(make_png(json.dumps(MESSAGE)), 4))[-1] == MESSAGE


def test_what_is_no_png_image_is_named(monkeypatch):
    good = make_png(json.dumps(MESSAGE))
    for data in (None, 3, "", "%%%", "abc", base64.b64encode(b"zlib or else").decode()):
        with pytest.raises(WorldError, match="'png' is left out: its data is not a PNG image"):
            decode({"op": "png", "data": data})
    with pytest.raises(WorldError, match="'png' is left out: the image is damaged"):
        decode({"op": "png", "data": good["data"][:80]})
    with pytest.raises(WorldError, match="a message that is not JSON"):
        decode(make_png("no JSON"))
    monkeypatch.setattr(rosbridge_messages, "MAX_SIZE", 100)
    with pytest.raises(WorldError, match="the message is larger than 100 bytes"):
        decode(good)


def test_operations_in_each_other_are_bounded():
    text = json.dumps(MESSAGE)
    for _ in range(5):
        text = json.dumps(fragment("f", text, 0, 1))
    with pytest.raises(WorldError, match="more than 3 nested operations"):
        MessageDecoder().decode(text)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "3", "null", '{"op": 5}', "[" * 100_000, b"\xff\x00"], ids=len
)
def test_texts_without_an_operation_are_errors(text):
    with pytest.raises(WorldError, match="is left out"):
        MessageDecoder().decode(text)
