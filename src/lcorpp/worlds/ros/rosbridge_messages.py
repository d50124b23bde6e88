"""Messages of a rosbridge server: JSON, in fragments or as PNG images, and replies about goals.

Source: the rosbridge v2.0 protocol specification, "fragment" and "png"; the server's `pngcompression`, which
writes the bytes of the JSON text as the pixels of an RGB image and pads it with line ends.
"""

from __future__ import annotations

import base64
import io
import json
from dataclasses import dataclass, field
from typing import Any

from lcorpp.errors import ActionFailedError, WorldError
from lcorpp.worlds.ros.connection import CANCELLED, NOTHING_LEFT, SUCCEEDED, Message
from lcorpp.worlds.ros.stop_report import Cancellation

MAX_SIZE = 2**24
"""Bytes of a message, and characters of the fragments that wait."""
MAX_FRAGMENTED = 16
"""Messages whose fragments wait; above it the oldest one is dropped."""
MAX_DEPTH = 3
"""Operations in each other, e.g. a PNG image in fragments."""

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


@dataclass
class _Parts:
    """The fragments of a message so far. total: their number. parts: number -> text. size: characters."""

    total: int
    parts: dict[int, str] = field(default_factory=dict)
    size: int = 0


class Fragments:
    """Fragments of messages, which arrive in any order; a bounded number of characters waits."""

    def __init__(self) -> None:
        self._waiting = dict[str, _Parts]()  # the one with the latest fragment comes last

    @property
    def size(self) -> int:
        """The characters that wait."""
        return sum(parts.size for parts in self._waiting.values())

    def add(self, message: dict[str, Any]) -> str | None:
        """Add a fragment; return the text of its message if it is complete.

        A fragment that is repeated is left out; one that contradicts the others begins another message.

        Raises:
            WorldError: it is malformed, or an incomplete message was dropped.
        """
        key, data, number, total = (message.get(name) for name in ("id", "data", "num", "total"))
        if not isinstance(key, str | int) or not isinstance(data, str):
            raise WorldError("a fragment without id or data is left out")
        if type(number) is not int or type(total) is not int or not 0 <= number < total:
            raise WorldError(f"a fragment with the number {number!r} of {total!r} is left out")
        name = f"{type(key).__name__} {key}"
        old = self._waiting.pop(name, None)
        if old is None or old.total != total or old.parts.get(number, data) != data:
            old = _Parts(total)
        if number not in old.parts:
            old.parts[number] = data
            old.size += len(data)
        if len(old.parts) == total:
            return "".join(old.parts[place] for place in range(total))
        self._waiting[name] = old
        self._drop_oldest()
        return None

    def _drop_oldest(self) -> None:
        has_dropped = False
        while len(self._waiting) > MAX_FRAGMENTED or self.size > MAX_SIZE:
            del self._waiting[next(iter(self._waiting))]
            has_dropped = True
        if has_dropped:
            raise WorldError("fragments of messages whose other fragments did not come are left out")


class MessageDecoder:
    """Decode the texts of a rosbridge server."""

    def __init__(self) -> None:
        self._fragments = Fragments()

    def decode(self, text: str | bytes, depth: int = 0) -> dict[str, Any] | None:
        """Return the message in a text; None for a fragment of one that is not complete.

        Raises:
            WorldError: the text is not a message, and is left out.
        """
        try:
            message = json.loads(text)
        except (ValueError, RecursionError):
            raise WorldError("a message that is not JSON is left out") from None
        if not isinstance(message, dict) or not isinstance(message.get("op"), str):
            raise WorldError("a message without an operation is left out")
        kind = message["op"]
        if kind not in ("fragment", "png"):
            return message
        if depth == MAX_DEPTH:
            raise WorldError(f"more than {MAX_DEPTH} nested operations are left out")
        inner = self._fragments.add(message) if kind == "fragment" else read_png(message.get("data"))
        return None if inner is None else self.decode(inner, depth + 1)


def read_png(data: object) -> bytes:
    """Return the text in the data of a png operation: base64 of an image whose pixels are its bytes.

    Raises:
        WorldError: the data is not a PNG image, is too large, or pillow is not installed.
    """
    fault = "an operation 'png' is left out: "
    try:
        content = base64.b64decode(data, validate=False) if isinstance(data, str) else b""
    except ValueError:
        content = b""
    if not content.startswith(PNG_SIGNATURE):
        raise WorldError(f"{fault}its data is not a PNG image; expected messages without compression")
    try:
        from PIL import Image
    except ImportError:
        raise WorldError(f"{fault}pillow is not installed; expected messages without compression") from None
    try:
        with Image.open(io.BytesIO(content), formats=["PNG"]) as image:
            if image.width * image.height * len(image.getbands()) > MAX_SIZE:
                raise WorldError(f"{fault}the message is larger than {MAX_SIZE} bytes")
            return image.tobytes()
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise WorldError(f"{fault}the image is damaged: {type(error).__name__}") from None


def read_cancellation(reply: Message | None) -> Cancellation:
    """Return what is known about a cancellation from the reply of the server, None without one."""
    if reply is None:
        return Cancellation.NO_REPLY
    values = reply.get("values") if reply.get("result") else None
    is_done = isinstance(values, dict) and values.get("return_code") in NOTHING_LEFT
    return Cancellation.CONFIRMED if is_done else Cancellation.FAILED


def read_result(name: str, reply: Message) -> Message:
    """Return the result of a goal; some servers put the status beside it, others around it, or as a text.

    Raises:
        ActionFailedError: the goal is not reached.
    """
    values, status = reply.get("values"), reply.get("status")
    if status is None and isinstance(values, dict) and values.keys() >= {"status", "result"}:
        values, status = values["result"], values["status"]
    if isinstance(status, str) and status.isdecimal():
        status = int(status)
    if status == SUCCEEDED and reply.get("result"):
        return values if isinstance(values, dict) else {}
    how = "was cancelled by others" if status == CANCELLED else "was refused or aborted"
    reason = f": {values}" if isinstance(values, str) else ""
    raise ActionFailedError(f"the goal of {name} {how}{reason}")
