"""Learner plug-ins: functions in the user's modules or files that return a classifier."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Collection, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.contract import Origin, ensure_predict_proba, with_origin
from lcorpp.user_code import UserFile, load_file

try:  # joblib's own copy, if it has one, because joblib ignores modules registered with another
    from joblib.externals.cloudpickle import register_pickle_by_value
except ModuleNotFoundError:
    from cloudpickle import register_pickle_by_value


def load_learner_plugin(name: str, arguments: Mapping[str, Any], required: Collection[str] = ()) -> Any:
    """Call the user's function and return its classifier, which names the function in errors.

    Args:
        name: ``module:function``, the module importable, or ``path/to/file.py:function``.
        arguments: the arguments available; the function receives those that are among its parameters.
        required: arguments that must be among its parameters, because the user has set them.

    Raises:
        DataError: the module or file does not exist or fails, it has no such function, the function fails,
            needs another argument, lacks a required parameter, or returns no classifier.
    """
    place, _, function_name = name.rpartition(":")
    if not place or not function_name:
        raise DataError(f"learner {name!r}: expected MODULE:FUNCTION or FILE.py:FUNCTION")
    if place.endswith(".py"):
        path = Path(place)
        module = load_file(path, f"lcorpp_learner_{path.stem}", DataError, importable=True)
        register_pickle_by_value(module)  # worker processes cannot import it by name
    else:
        module = _import_module(place)
    function = getattr(module, function_name, None)
    if not callable(function):
        known = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        raise DataError(f"{place} has no function {function_name!r}; {expected_one_of(known)}")
    parameters = inspect.signature(function).parameters.values()
    mandatory = [
        p.name for p in parameters if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    ]
    for key in mandatory:
        if key not in arguments:
            raise DataError(f"{name} needs the argument {key!r}; {expected_one_of(list(arguments))}")
    passed = {p.name: arguments[p.name] for p in parameters if p.name in arguments}
    for key in required:
        if key not in passed:
            raise DataError(f"{key} is set, but {name} has no parameter of that name")
    file = UserFile.of(place, module)
    location = file.locate(function)
    with file.locate_failures(f"{function_name}()", DataError):
        estimator = function(**passed)
    try:
        return with_origin(ensure_predict_proba(estimator), Origin(name, file, location))
    except DataError as error:
        raise DataError(f"{location}: the learner {name}: {error}") from None


def _import_module(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise DataError(f"learner module {name!r}: {error}; a file is written FILE.py:FUNCTION") from None
    except (Exception, SystemExit) as error:
        raise DataError(
            f"learner module {name!r} cannot be loaded: {type(error).__name__}: {error}"
        ) from error
