"""Requests of the page: one JSON object each, checked completely before anything happens."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

from lcorpp.errors import LcorppError, expected_one_of

MAX_REQUEST = 2**20
"""Characters of a request; a judged trial has all its samples."""
MAX_SAMPLES = 64
"""Samples to classify in a request."""
MAX_LIST = 20_000
"""Elements of other lists."""
MAX_NAME = 200
"""Characters of a name."""


class RequestError(LcorppError):
    """A request that the service refuses.

    Attributes:
        code: "malformed", "unknown_type", "invalid", "out_of_order", "too_large", "unavailable" or "failed".
        id: that of the request, None if it has none.
    """

    def __init__(self, code: str, message: str, id: int | None = None) -> None:
        self.code, self.id = code, id
        super().__init__(message)

    def reply(self) -> dict[str, Any]:
        """Return the reply to the request."""
        return {"id": self.id, "type": "error", "code": self.code, "message": str(self)}


@dataclass(frozen=True)
class Request:
    """A checked request: its type, and its fields by name."""

    id: int
    type: str
    fields: Mapping[str, Any]


def parse_request(text: str | bytes) -> Request:
    """Parse and check a request.

    Raises:
        RequestError: it is too large, no JSON object, of an unknown type, or a field is wrong.
    """
    if len(text) > MAX_REQUEST:
        raise RequestError(
            "too_large", f"a request of {len(text)} characters; expected at most {MAX_REQUEST}"
        )
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RequestError("malformed", f"not JSON: {error}; expected an object") from None
    if not isinstance(content, dict):
        raise RequestError("malformed", f"{_show(content)}; expected an object")
    number = content.get("id")
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < 2**53:
        raise RequestError("malformed", f"id: {_show(number)}; expected a whole number from 0 to 2^53")
    kind = content.get("type")
    if not isinstance(kind, str) or kind not in FIELDS:
        raise RequestError("unknown_type", f"type: {_show(kind)}; {expected_one_of(FIELDS)}", number)
    checks = FIELDS[kind]
    names = content.keys() - {"id", "type"}
    if names != checks.keys():
        raise RequestError(
            "invalid",
            f"{kind}: the fields {', '.join(map(_show, sorted(names))) or 'none'};"
            f" expected {', '.join(checks) or 'none'}",
            number,
        )
    try:
        return Request(number, kind, {name: check(name, content[name]) for name, check in checks.items()})
    except RequestError as error:
        raise RequestError(error.code, f"{kind}: {error}", number) from None


def _check_name(field: str, value: object) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= MAX_NAME:
        _refuse(field, value, "a name")
    return value


def _check_names(field: str, value: object) -> dict[str, str]:
    if not isinstance(value, dict):
        _refuse(field, value, "an object of names")
    return {_check_name(field, name): _check_name(field, own) for name, own in value.items()}


def _check_list(field: str, value: object, limit: int, expected: str) -> list[Any]:
    if not isinstance(value, list) or not 0 < len(value) <= limit:
        _refuse(field, value, f"1 to {limit} {expected}")
    return value


def _check_samples(field: str, value: object) -> list[tuple[float, ...]]:
    samples = _check_list(field, value, MAX_SAMPLES, "samples [time, value, ...]")
    return [_check_sample(field, sample) for sample in samples]


def _check_tracks(field: str, value: object) -> dict[str, list[tuple[float, ...]]]:
    if not isinstance(value, dict):
        _refuse(field, value, "an object of samples")
    return {
        _check_name(field, name): [
            _check_sample(field, sample)
            for sample in _check_list(field, own, MAX_LIST, "samples [time, value, ...]")
        ]
        for name, own in value.items()
    }


def _check_sample(field: str, value: object) -> tuple[float, ...]:
    if not isinstance(value, list) or not 2 <= len(value) <= 9 or not all(map(_is_number, value)):
        _refuse(field, value, "a sample [time, value, ...] of finite numbers")
    return tuple(map(float, value))


def _check_value(field: str, value: object) -> tuple[str, ...]:
    names = _check_list(field, value, MAX_SAMPLES, "values of the shared variables")
    return tuple(_check_name(field, name) for name in names)


def _check_steps(field: str, value: object) -> list[tuple[str, str | None]]:
    return [
        _check_step(field, step)
        for step in _check_list(field, value, MAX_LIST, "steps [action, observation]")
    ]


def _check_step(field: str, value: object) -> tuple[str, str | None]:
    if not isinstance(value, list) or len(value) != 2:
        _refuse(field, value, "a step [action, observation], null for the observation of a report")
    action, observation = value
    return _check_name(field, action), None if observation is None else _check_name(field, observation)


def _is_number(value: object) -> bool:
    limit = sys.float_info.max  # a whole number beyond it has no float
    return isinstance(value, int | float) and not isinstance(value, bool) and -limit <= value <= limit


def _refuse(field: str, value: object, expected: str) -> NoReturn:
    raise RequestError("invalid", f"{field}: {_show(value)}; expected {expected}")


def _show(value: object) -> str:
    """Return the beginning of a value as JSON."""
    try:
        text = json.dumps(value, ensure_ascii=False)
    except RecursionError:
        return "a value nested too deep"
    return text if len(text) <= 60 else f"{text[:57]}..."


FIELDS: Mapping[str, Mapping[str, Callable[[str, object], Any]]] = {
    "start": {},
    "infer": {"facts": _check_names, "labels": _check_names},
    "samples": {"sense": _check_name, "samples": _check_samples},
    "judge": {"facts": _check_names, "samples": _check_tracks, "value": _check_value},
    "log": {"facts": _check_names, "labels": _check_names, "steps": _check_steps},
}
"""Type of request -> its fields with their checks."""
