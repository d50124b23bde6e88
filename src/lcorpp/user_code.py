"""Load the user's Python files, and locate their errors in them."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from operator import attrgetter
from pathlib import Path
from types import ModuleType
from typing import Any

from lcorpp.errors import LcorppError, expected_one_of


class UserFunction:
    """A function in the user's file; a call that fails raises a typed error with the file and the line.

    Args:
        path: the file. name: of the function, or of a method of an object: OBJECT.METHOD.
        error: type of the errors.

    Raises:
        error: the file cannot be loaded, or has no such function.
    """

    def __init__(self, path: Path, name: str, error: type[LcorppError]) -> None:
        self.path, self.name, self._error = path, name, error
        self._module = load_file(path, f"lcorpp_user_{path.stem}", error)
        try:
            self.function: Any = attrgetter(name)(self._module)
        except AttributeError:
            self.function = None
        if not callable(self.function):
            known = [key for key, value in vars(self._module).items() if callable(value) and key[0] != "_"]
            raise error(f"{path} has no function {name!r}; {expected_one_of(known)}")

    def __repr__(self) -> str:
        return f"UserFunction({self.path}:{self.name})"

    @property
    def location(self) -> str:
        """``file:line`` of the definition."""
        return self.locate(self.function)

    def locate(self, function: object) -> str:
        """``file:line`` of the definition of another function or method of the file."""
        code = getattr(function, "__code__", None)
        return str(self.path) if code is None else f"{self.path}:{code.co_firstlineno}"

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function. Raises `error` if it fails."""
        with self.locate_failures(f"{self.name}()"):
            return self.function(*arguments, **options)

    @contextmanager
    def locate_failures(self, what: str) -> Iterator[None]:
        """Raise `error` with the file and the line if the user's code fails, e.g. a method of its object.

        Args:
            what: what fails, for the message.
        """
        try:
            yield
        except (Exception, SystemExit) as failure:
            message = describe_failure(failure, str(self.path), self._module, f"{what} failed")
            raise self._error(message) from failure

    def __reduce__(self) -> tuple[type[UserFunction], tuple[Path, str, type[LcorppError]]]:
        return UserFunction, (self.path, self.name, self._error)  # another process loads the file again


def split_function(text: str) -> tuple[Path, str] | None:
    """Return the file and the function of ``FILE.py:NAME``; None if the text is something else."""
    file, _, name = text.rpartition(":")
    return (Path(file), name) if file.endswith(".py") and name else None


def load_file(path: Path, name: str, error: type[LcorppError], *, importable: bool = False) -> ModuleType:
    """Execute a Python file as a module.

    Args:
        name: `__name__` of the module.
        error: type of the error raised.
        importable: whether to add the module to `sys.modules`, as pickle requires.

    Raises:
        error: the file does not exist or fails; the message names the file and the line.
    """
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise error(f"{path}: not a Python file")
    module = importlib.util.module_from_spec(spec)
    if importable:
        sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as failure:
        if importable:
            del sys.modules[name]
        raise error(describe_failure(failure, str(path), module, "cannot be loaded")) from failure
    return module


def describe_failure(failure: BaseException, place: str, module: ModuleType, what: str) -> str:
    """Return ``place:line: what: error``, with the deepest line of the traceback in the module's own file.

    Args:
        failure: the error raised by the user's code.
        place: the file or module as the user names it.
        what: what failed, e.g. ``trajectory() failed``.
    """
    file = Path(getattr(module, "__file__", None) or place).resolve()
    if isinstance(failure, SyntaxError) and failure.filename and Path(failure.filename).resolve() == file:
        return f"{place}:{failure.lineno}: {what}: SyntaxError: {failure.msg}"
    frames = traceback.extract_tb(failure.__traceback__)
    line = next((f.lineno for f in reversed(frames) if Path(f.filename).resolve() == file), None)
    return f"{place}{f':{line}' if line else ''}: {what}: {type(failure).__name__}: {failure}"
