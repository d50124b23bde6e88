"""Fields of ROS messages, checked as they are read, and warnings about messages that are left out."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from math import inf, nan
from numbers import Integral, Real
from typing import Any

from lcorpp.errors import WorldError

LOG = logging.getLogger("lcorpp.robot")
"""At WARNING one line a kind of fault in the messages of a topic."""

MAX_KINDS = 20
"""Kinds of faults of a topic that are logged; further ones are not."""


_NUMBER = re.compile(r"-?\d[\d.]*(?:e[+-]?\d+)?|\bnan\b|-?\binf\b")


def name_kind(text: str) -> str:
    """Return the text of a fault without its numbers: faults of one kind differ in them."""
    return _NUMBER.sub("", text)


class FaultLog:
    """Log each kind of fault in the messages of a topic once.

    Args:
        place: topic, type or file that the warnings name.
    """

    def __init__(self, place: str) -> None:
        self._place, self._kinds = place, set[str]()

    def warn(self, text: str, kind: str | None = None) -> None:
        """Log a warning, unless its kind, by default its text, was logged before."""
        kind = text if kind is None else kind
        if kind not in self._kinds and len(self._kinds) < MAX_KINDS:
            self._kinds.add(kind)
            LOG.warning("%s: %s", self._place, text)


def read_field(message: Any, *names: str) -> Any:
    """Return a field of a message, or of the message in its field, and so on.

    Raises:
        WorldError: there is no such field.
    """
    for depth, name in enumerate(names):
        if not isinstance(message, Mapping) or name not in message:
            raise WorldError(f"it has no field {'.'.join(names[: depth + 1])!r}")
        message = message[name]
    return message


def read_list(message: Any, name: str) -> list[Any] | tuple[Any, ...]:
    """Return a field that is a list.

    Raises:
        WorldError: there is no such field, or it is not a list.
    """
    found = read_field(message, name)
    if not isinstance(found, list | tuple):
        raise WorldError(f"the field {name!r} is a {type(found).__name__}; expected a list")
    return found


def read_number(message: Any, *names: str) -> float:
    """Return a field that is a number, as a float; NaN for null, which is rosbridge's NaN.

    Raises:
        WorldError: there is no such field, or it is not a number.
    """
    found = read_field(message, *names)
    if found is None:
        return nan
    if isinstance(found, bool) or not isinstance(found, Real):
        raise WorldError(f"the field {'.'.join(names)!r} is a {type(found).__name__}; expected a number")
    try:
        return float(found)
    except OverflowError:
        return inf


def read_text_field(message: Any, *names: str) -> str:
    """Return a field that is a text.

    Raises:
        WorldError: there is no such field, or it is not a text.
    """
    found = read_field(message, *names)
    if not isinstance(found, str):
        raise WorldError(f"the field {'.'.join(names)!r} is a {type(found).__name__}; expected a text")
    return found


def read_stamp(message: Any, *names: str) -> float | None:
    """Return the seconds of a stamp of ROS 1 or 2; None for an empty one.

    Raises:
        WorldError: there is no stamp.
    """
    stamp = read_field(message, *names)
    is_1 = isinstance(stamp, Mapping) and "secs" in stamp
    seconds, part = ("secs", "nsecs") if is_1 else ("sec", "nanosec")
    return read_number(stamp, seconds) + 1e-9 * read_number(stamp, part) or None


def read_id(value: object) -> str | None:
    """Return the id of a person, a text or an integer; None without one: null, NaN or an empty text.

    Raises:
        WorldError: it is of another type.
    """
    if value is None or value != value:
        return None
    if isinstance(value, str):
        return value if value.strip() else None
    if isinstance(value, Integral) and not isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    raise WorldError(f"an id is a {type(value).__name__}; expected a text or an integer")
