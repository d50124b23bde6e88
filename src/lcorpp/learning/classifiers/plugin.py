"""A learner of the user's own: a function in a module or a file that returns a classifier."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Collection, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from lcorpp.errors import DataError, expected

try:  # joblib's own copy, where it has one: what is registered with another one would not count
    from joblib.externals.cloudpickle import register_pickle_by_value
except ModuleNotFoundError:
    from cloudpickle import register_pickle_by_value


def load_learner_plugin(name: str, arguments: Mapping[str, Any], wanted: Collection[str] = ()) -> Any:
    """What the function returns.

    Args:
        name: ``module:function``, the module importable, or ``path/to/file.py:function``.
        arguments: what the function may ask for; it is given those that are among its parameters.
        wanted: those that it has to ask for, as the user has set them.

    Raises:
        DataError: the module or file is not there or fails, it has no such function, the function fails,
            asks for something else or does not ask for what is wanted.
    """
    place, _, function_name = name.rpartition(":")
    if not place or not function_name:
        raise DataError(f"learner {name!r}: expected MODULE:FUNCTION or FILE.py:FUNCTION")
    module = _file(Path(place)) if place.endswith(".py") else _module(place)
    function = getattr(module, function_name, None)
    if not callable(function):
        known = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        raise DataError(f"{place} has no function {function_name!r}; {expected(known)}")
    parameters = inspect.signature(function).parameters.values()
    needed = [
        p.name for p in parameters if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    ]
    for key in needed:
        if key not in arguments:
            raise DataError(f"{name} asks for {key!r}; {expected(list(arguments))}")
    given = {p.name: arguments[p.name] for p in parameters if p.name in arguments}
    for key in wanted:
        if key not in given:
            raise DataError(f"{key} is set, but {name} has no parameter of that name")
    try:
        return function(**given)
    except (Exception, SystemExit) as error:
        raise _blamed(module, place, f"{function_name}() failed", error) from error


def _module(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise DataError(f"learner module {name!r}: {error}; a file is written FILE.py:FUNCTION") from None
    except (Exception, SystemExit) as error:
        raise DataError(
            f"learner module {name!r} cannot be loaded: {type(error).__name__}: {error}"
        ) from error


def _file(path: Path) -> ModuleType:
    """The file as a module that worker processes get by value, as they could not import it by its name."""
    name = f"lcorpp_learner_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise DataError(f"{path}: not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise _blamed(module, str(path), "cannot be loaded", error) from error
    register_pickle_by_value(module)
    return module


def _blamed(module: ModuleType, place: str, what: str, error: BaseException) -> DataError:
    """The user's own error, with the deepest line of the user's own file."""
    file = getattr(module, "__file__", None)
    if isinstance(error, SyntaxError) and error.lineno and error.filename == file:
        return DataError(f"{place}:{error.lineno}: {what}: SyntaxError: {error.msg}")
    frames = traceback.extract_tb(error.__traceback__)
    line = next((frame.lineno for frame in reversed(frames) if frame.filename == file), None)
    return DataError(f"{place}{f':{line}' if line else ''}: {what}: {type(error).__name__}: {error}")
