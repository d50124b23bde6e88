"""The state of a robot's parts as a key, by which equal points of different decisions are recognised."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

MAX_DEPTH = 12
"""Maximum nesting of the objects in a part; deeper ones have no key, as do those that refer to themselves."""

DIGITS = 12
"""Digits that distinguish numbers: beliefs that different paths reach differ by rounding errors."""


class NoKeyError(Exception):
    """The state of an object cannot be read, e.g. of an iterator or a random generator."""


def make_state_key(value: Any, shared: Collection[int], depth: int = 0) -> Hashable:
    """Return a key that is equal for equal states of an object.

    Args:
        value: the object, with all that it refers to.
        shared: identities (`id`) of objects without a state of their own; they are their own keys.

    Raises:
        NoKeyError: some object has a state that cannot be read.
    """

    def recurse(part: Any) -> Hashable:
        return make_state_key(part, shared, depth + 1)

    if id(value) in shared:
        return id(value)
    if isinstance(value, type | ModuleType | BuiltinFunctionType):
        return value
    if depth > MAX_DEPTH:
        raise NoKeyError
    if isinstance(value, float | np.floating):
        return round(float(value), DIGITS)
    if value is None or isinstance(value, str | bytes | int | np.integer):
        return type(value).__name__, value
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        return value.shape, np.round(value, DIGITS).tobytes()
    if isinstance(value, list | tuple):
        return type(value).__name__, *map(recurse, value)
    if isinstance(value, set | frozenset):
        return frozenset(map(recurse, value))
    if isinstance(value, Mapping):
        return "mapping", *[(recurse(key), recurse(item)) for key, item in value.items()]
    if isinstance(value, MethodType):
        return recurse(value.__func__), recurse(value.__self__)
    if isinstance(value, FunctionType):
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        return value.__code__, recurse(cells), recurse(value.__defaults__)
    # a type with a pickle method of its own may have a state outside of its attributes
    if hasattr(value, "__dict__") and getattr(type(value), "__reduce__", None) is object.__reduce__:
        return type(value), recurse(vars(value))
    raise NoKeyError
