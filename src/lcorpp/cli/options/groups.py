"""Groups of options that commands share: a dataclass whose fields are options."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, get_type_hints


def take_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command for typer: each parameter that is a group is replaced by the options of its fields.

    A group is a dataclass; its fields are options of their names with defaults, or groups.
    """
    own = list(signature(command, eval_str=True).parameters.values())
    flat = [option for parameter in own for option in _list_options(parameter)]

    @wraps(command)
    def call(**values: Any) -> None:
        command(**{parameter.name: _take_value(parameter, values) for parameter in own})

    call.__annotations__ = {option.name: option.annotation for option in flat}
    vars(call)["__signature__"] = Signature(flat)
    return call


def _list_options(parameter: Parameter) -> Iterator[Parameter]:
    if not is_dataclass(parameter.annotation):
        yield parameter.replace(kind=Parameter.KEYWORD_ONLY)
    for field in _list_fields(parameter.annotation):
        yield from _list_options(field)


def _take_value(parameter: Parameter, values: dict[str, Any]) -> Any:
    if not is_dataclass(parameter.annotation):
        return values.pop(parameter.name)
    parts = {field.name: _take_value(field, values) for field in _list_fields(parameter.annotation)}
    group: Any = parameter.annotation
    return group(**parts)


def _list_fields(group: Any) -> Iterator[Parameter]:
    if not is_dataclass(group):
        return
    hints = get_type_hints(group, include_extras=True)
    for field in fields(group):
        default = Parameter.empty if field.default is MISSING else field.default
        yield Parameter(field.name, Parameter.KEYWORD_ONLY, default=default, annotation=hints[field.name])
