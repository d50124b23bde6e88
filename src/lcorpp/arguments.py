"""Check the arguments of public functions, and the fields of values, by their annotations."""

from __future__ import annotations

import functools
import inspect
import reprlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import fields
from types import NoneType, UnionType
from typing import Any, Literal, ParamSpec, TypeVar, Union, cast, get_args, get_origin

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError

Array = npt.NDArray[np.float64]

P = ParamSpec("P")
R = TypeVar("R")


def check_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function: it raises a DataError for an argument that its annotation does not allow.

    Numpy's numbers are numbers, an array is a sequence, and what a tuple is expected for may be any sequence;
    True is not a number, and a text is not a sequence of texts. Other annotations, such as
    `Any`, allow everything.
    """
    names, source = tuple(inspect.signature(function).parameters), cast(Any, function)

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        given = dict(zip(names, args, strict=False)) | kwargs
        for name, hint in _read_hints(source).items():
            if name in given:
                check_value(given[name], hint, f"{function.__name__}: {name}")
        return function(*args, **kwargs)

    return checked


def check_fields(value: object) -> None:
    """Check the fields of a dataclass, as `check_arguments` does; for `__post_init__`.

    Another sequence where a tuple is expected becomes a tuple.

    Raises:
        DataError: a field has a value that its annotation does not allow.
    """
    kind: Any = type(value)
    hints = _read_hints(kind)
    for field in fields(value):  # type: ignore[arg-type]  # a dataclass
        own, hint = getattr(value, field.name), hints[field.name]
        check_value(own, hint, f"{kind.__name__}: {field.name}")
        if get_origin(hint) is tuple and not isinstance(own, tuple):
            object.__setattr__(value, field.name, tuple(own))  # the dataclass is frozen


@functools.cache
def _read_hints(source: Any) -> dict[str, Any]:
    """Return name -> annotation, evaluated; what is only imported for type checkers is `Any`."""
    module = inspect.getmodule(source)
    hints = {}
    for name, text in inspect.get_annotations(source).items():
        try:
            hints[name] = eval(text, vars(module)) if isinstance(text, str) else text
        except NameError:
            hints[name] = Any
    return hints


def check_value(value: Any, hint: Any, what: str) -> None:
    """Raise a DataError if a value does not fit an annotation; `what` names the value."""
    fault = _find_fault(value, hint, what)
    if fault is not None:
        raise DataError(fault)


def _find_fault(value: Any, hint: Any, what: str) -> str | None:
    """Return why a value does not fit an annotation, None if it fits; `what` names the value."""
    origin, parts = get_origin(hint), get_args(hint)
    if hint is Any or (hint == npt.ArrayLike and _is_numeric(value)):
        return None
    if hint == npt.ArrayLike:
        return f"{what} is {reprlib.repr(value)}; expected an array of numbers"
    if origin in (Union, UnionType):
        faults = [_find_fault(value, part, what) for part in parts]
        if None in faults:
            return None
        element = next((fault for fault in faults if fault and not fault.startswith(f"{what} is ")), None)
        if element is not None:  # the sequence or mapping fits
            return element
    elif origin in (tuple, list, Sequence, Collection) and _is_sequence(value):
        if _has_fitting_types(value, parts):
            return None
        kinds = parts[:1] * len(value) if origin is not tuple or parts[1:] == (...,) else parts
        if len(kinds) == len(value):
            faults = [
                _find_fault(v, kind, f"{what}[{i}]")
                for i, (v, kind) in enumerate(zip(value, kinds, strict=True))
            ]
            return next(filter(None, faults), None)
    elif origin is Mapping and isinstance(value, Mapping):
        faults = [_find_fault(key, parts[0], f"{what}, a key,") for key in value]
        faults += [_find_fault(each, parts[1], f"{what}[{key!r}]") for key, each in value.items()]
        return next(filter(None, faults), None)
    elif _fits(value, hint, origin, parts):
        return None
    return f"{what} is {reprlib.repr(value)}; expected {_describe(hint)}"


def _has_fitting_types(value: Collection[Any], parts: tuple[Any, ...]) -> bool:
    """Whether the elements of a sequence, of which there may be many, fit by their types alone."""
    is_uniform = len(parts) == 1 or parts[1:] == (...,)
    if not is_uniform or not isinstance(parts[0], type) or get_origin(parts[0]) is not None:
        return False
    return all(_fits(each, parts[0], None, ()) for each in {type(each): each for each in value}.values())


def _is_sequence(value: Any) -> bool:
    return isinstance(value, Collection | np.ndarray) and not isinstance(value, str | bytes | Mapping)


def _fits(value: Any, hint: Any, origin: Any, parts: tuple[Any, ...]) -> bool:
    """Whether a value fits an annotation that is not a union, sequence or mapping."""
    if origin is Literal:
        return isinstance(value, str)  # the function names the choices
    if origin is np.ndarray:
        return _is_numeric(value)
    if origin in (tuple, list, Sequence, Collection, Mapping):
        return False
    if hint in (int, float):
        kinds = (int, np.integer) if hint is int else (int, float, np.integer, np.floating)
        return isinstance(value, kinds) and not isinstance(value, bool)
    kind = origin or hint
    is_protocol = getattr(kind, "_is_protocol", False)  # which has no classes to compare with
    return isinstance(value, kind) if isinstance(kind, type) and not is_protocol else True


def _is_numeric(value: Any) -> bool:
    """Whether a value is an array of numbers, or sequences that numpy converts to one."""
    if isinstance(value, str | bytes) or not (isinstance(value, Sequence) or hasattr(value, "__array__")):
        return False
    try:
        return np.asarray(value).dtype.kind in "biuf"
    except ValueError:
        return False


_NAMES = {int: "a whole number", float: "a number", str: "a text", bool: "True or False", NoneType: "None"}


def _describe(hint: Any) -> str:
    """Return what fits an annotation, for a message."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(_describe(part) for part in parts))
    if origin is Literal:
        return f"one of {', '.join(map(str, parts))}"
    if origin is np.ndarray:
        return "an array of numbers"
    if origin in (tuple, list, Sequence, Collection):
        number = "" if origin is not tuple or parts[1:] == (...,) else f" of {len(parts)}"
        return f"a sequence{number}, each {_describe(parts[0])}"
    if origin is Mapping:
        return f"a mapping from {_describe(parts[0])} to {_describe(parts[1])}"
    return _NAMES.get(hint) or f"a {getattr(origin or hint, '__name__', hint)}"


def to_numbers(value: npt.ArrayLike, what: str) -> Array:
    """Convert a value to an array of float64.

    Raises:
        DataError: numpy cannot do that; `what` names the value.
    """
    check_value(value, npt.ArrayLike, what)
    return np.asarray(value, dtype=np.float64)
