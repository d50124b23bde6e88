"""The planner's model of a domain: a file, or a function in a Python file of the domain folder."""

from __future__ import annotations

import inspect
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from lcorpp.domains.sections.files import find_file, find_function
from lcorpp.domains.sections.reasoning import ReasoningSection
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, ModelError
from lcorpp.planning import Pomdp
from lcorpp.planning.formats.model_file import read_model
from lcorpp.user_code import UserFunction

if TYPE_CHECKING:
    from lcorpp.planning import Factored


def read_planner_model(
    table: TomlTable, folder: Path, reasoning: ReasoningSection
) -> tuple[Pomdp, Factored | None]:
    """Read the key `model`: a .pomdp or .pomdpx file, or ``FILE.py:NAME``.

    The function NAME returns a `Pomdp` or a `Factored`. If it has a parameter, it is called with the values
    of the shared variables: ``{"item": ("cup", "pen"), ...}``.

    Returns:
        The flat model, and its variables if it has them.

    Raises:
        DomainError: the function fails, or returns something else; or the discount is 1.
        FileError, ParseError, ModelError: the file is wrong, or the flat model too large.
    """
    pomdp, problem = _read_model(table, folder, reasoning)
    if pomdp.discount == 1:
        raise DomainError(
            f"{table.location('model')}: the discount of {pomdp.file} is 1; expected one below 1: a dialogue"
            " may go on forever"
        )
    return pomdp, problem


def _read_model(table: TomlTable, folder: Path, reasoning: ReasoningSection) -> tuple[Pomdp, Factored | None]:
    name = table.text("model")
    parts = find_function(table, "model", folder)
    if parts is None and name.endswith(".py"):
        raise DomainError(f"{table.location('model')}: {name!r} names no function; expected {name}:NAME")
    if parts is None:
        return read_model(find_file(table, "model", folder))
    from lcorpp.planning import Factored, flatten  # files without variables do without

    function = UserFunction(*parts, DomainError)
    values = {shared: reasoning.program.attributes[shared].values for shared in reasoning.shared}
    model = function(values) if _has_parameter(function) else function()
    if isinstance(model, Pomdp):
        return replace(model, file=function.location), None
    if not isinstance(model, Factored):
        raise DomainError(
            f"{table.location('model')}: {function.location}: {function.name}() returned"
            f" {type(model).__name__}; expected a Pomdp or a Factored"
        )
    problem = replace(model, file=function.location)
    try:
        return flatten(problem), problem
    except ModelError as error:
        raise ModelError(f"{function.location}: {error}") from None


def _has_parameter(function: UserFunction) -> bool:
    """Whether the user's function takes the values of the shared variables."""
    try:
        return bool(inspect.signature(function.function).parameters)
    except (TypeError, ValueError):  # a function without a signature, e.g. of C
        return False
