"""Load the user's Python files, with the user's consent, and locate their errors in them."""

from __future__ import annotations

import importlib.util
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from types import ModuleType
from typing import Any

from lcorpp.errors import LcorppError, expected_one_of

PICKLED_CODE = "<dynamic-code>"
"""The filename of code that cloudpickle (3.1.3 and later) has sent to another process."""


PACKAGE = Path(__file__).resolve().parent
"""The code of lcorpp itself."""


@dataclass(frozen=True)
class CodeConsent:
    """Which Python files a command may run.

    It runs those that the user names, and, after a note, those that belong to the user or to root, as does
    their folder. A domain folder, a `robot.toml` or a log may name files of others: they need `trust`.

    named: the files on the command line. note: shows a text to the user. run: False forbids all code.
    """

    trust: bool
    named: frozenset[Path]
    note: Callable[[str], None]
    run: bool = True
    _noted: set[Path] = field(default_factory=set)

    @classmethod
    def of(cls, arguments: Iterable[str], *, trust: bool, note: Callable[[str], None]) -> CodeConsent:
        """Return the consent of a command line; it names a file by ``FILE.py:NAME``, perhaps after ``=``."""
        ends = (argument[start:] for argument in arguments for start in _list_starts(argument))
        parts = (split_function(end) for end in ends)
        return cls(trust, frozenset(part[0].resolve() for part in parts if part is not None), note)

    @contextmanager
    def apply(self) -> Iterator[None]:
        """Apply to all files that are loaded within this block; without, each file may be run."""
        token = _consent.set(self)
        try:
            yield
        finally:
            _consent.reset(token)

    def check(self, path: Path, error: type[LcorppError]) -> None:
        """Raise `error` unless the file may be run."""
        if not self.run:
            raise error(f"{path}: no Python code is run")
        file = path.resolve()
        if file in self.named or file.is_relative_to(PACKAGE):
            return
        owner = _find_other_owner(file)
        if owner is not None and not self.trust:
            raise error(f"{path}: this Python code belongs to the user {owner}; --trust-code runs it")
        if file.parent not in self._noted:
            self._noted.add(file.parent)
            self.note(f"running Python code of {path.parent}")


_consent: ContextVar[CodeConsent | None] = ContextVar("consent", default=None)


NO_CODE = CodeConsent(trust=False, named=frozenset(), note=lambda _: None, run=False)
"""No consent: loading a file raises an error."""


def check_consent(path: Path, error: type[LcorppError]) -> None:
    """Raise `error` if a file may not be run; see `CodeConsent`."""
    consent = _consent.get()
    if consent is not None:
        consent.check(path, error)


def check_owner(path: Path, error: type[LcorppError]) -> None:
    """Raise `error` if a file may not choose installed code, as `check_consent`; it is not code itself."""
    consent = _consent.get()
    if consent is not None and consent.run:
        consent.check(path, error)


def _list_starts(argument: str) -> list[int]:
    """Return where a file name may begin in an argument."""
    return [0, *(index + 1 for index, character in enumerate(argument) if character == "=")]


def _find_other_owner(file: Path) -> str | None:
    """Return the owner of a file or its folder who is neither the user nor root; None without one."""
    if not hasattr(os, "geteuid"):  # Windows
        return None
    for path in (file, file.parent):
        try:
            owner = path.stat().st_uid
        except OSError:  # the reader of the file names the reason
            continue
        if owner not in (0, os.geteuid()):
            return _find_name(owner)
    return None


def _find_name(owner: int) -> str:
    import pwd

    try:
        return pwd.getpwuid(owner).pw_name
    except KeyError:
        return str(owner)


@dataclass(frozen=True)
class UserFile:
    """A file or module of the user's, for the messages of errors.

    place: as the user names it. file: its absolute path.
    """

    place: str
    file: str

    @classmethod
    def of(cls, place: str | Path, module: ModuleType) -> UserFile:
        """Return the file of a module that the user names `place`."""
        return cls(str(place), str(Path(getattr(module, "__file__", None) or place).resolve()))

    def locate(self, function: object, otherwise: str = "") -> str:
        """Return ``place:line`` of the definition of a function, a method or the `__init__` of a class.

        Args:
            otherwise: the result for what another file defines, by default `place`.
        """
        if not hasattr(function, "__code__"):
            function = getattr(function, "__init__", None)
        code = getattr(function, "__code__", None)
        if code is None or not self._contains(code.co_filename, getattr(function, "__globals__", {})):
            return otherwise or self.place
        return f"{self.place}:{code.co_firstlineno}"

    def describe_failure(self, failure: BaseException, what: str, otherwise: str = "") -> str:
        """Return ``place:line: what: error``, with the deepest line of the traceback in the file.

        Args:
            failure: the error raised by the user's code.
            what: what failed, e.g. ``trajectory() failed``.
            otherwise: the location if no line of the file failed, by default `place`.
        """
        if isinstance(failure, SyntaxError) and failure.filename and self._contains(failure.filename, {}):
            return f"{self.place}:{failure.lineno}: {what}: SyntaxError: {failure.msg}"
        frames = traceback.walk_tb(failure.__traceback__)
        lines = [n for own, n in frames if self._contains(own.f_code.co_filename, own.f_globals)]
        location = f"{self.place}:{lines[-1]}" if lines else otherwise or self.place
        return f"{location}: {what}: {type(failure).__name__}: {failure}"

    @contextmanager
    def locate_failures(self, what: str, error: type[LcorppError]) -> Iterator[None]:
        """Raise `error` with the file and the line if the user's code fails.

        Args:
            what: what fails, for the message.
        """
        try:
            yield
        except (Exception, SystemExit) as failure:
            raise error(self.describe_failure(failure, f"{what} failed")) from failure

    def _contains(self, filename: str, namespace: Mapping[str, Any]) -> bool:
        """Whether code is from this file; a function that was pickled by value keeps its globals alone."""
        if filename == PICKLED_CODE:
            filename = namespace.get("__file__") or filename
        return Path(filename).resolve() == Path(self.file)


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
        module = load_file(path, f"lcorpp_user_{path.stem}", error)
        self.file = UserFile.of(path, module)
        try:
            self.function: Any = attrgetter(name)(module)
        except AttributeError:
            self.function = None
        if not callable(self.function):
            raise error(f"{path} has no function {name!r}; {describe_functions(module)}")

    @classmethod
    def parse(cls, text: str, error: type[LcorppError]) -> UserFunction | None:
        """Return the function that ``FILE.py:NAME`` names; None for another text."""
        parts = split_function(text)
        return None if parts is None else cls(*parts, error)

    def __repr__(self) -> str:
        return f"UserFunction({self.path}:{self.name})"

    @property
    def location(self) -> str:
        """``file:line`` of the definition."""
        return self.file.locate(self.function)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function. Raises `error` if it fails."""
        with self.locate_failures(f"{self.name}()"):
            return self.function(*arguments, **options)

    def locate_failures(self, what: str) -> AbstractContextManager[None]:
        """Return a context that locates failures of the user's code, e.g. of a method of its object."""
        return self.file.locate_failures(what, self._error)

    def __reduce__(self) -> tuple[type[UserFunction], tuple[Path, str, type[LcorppError]]]:
        return UserFunction, (self.path, self.name, self._error)  # another process loads the file again


def describe_functions(module: ModuleType) -> str:
    """Return which functions and classes a module defines itself, for the message about another name."""
    defined = [
        name
        for name, value in vars(module).items()
        if callable(value)
        and name[0] != "_"
        and f"{getattr(value, '__module__', '')}.".startswith(f"{module.__name__}.")
    ]
    return expected_one_of(defined) if defined else "it defines no function"


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
    if not path.exists():
        raise error(f"{path}: there is no such file")
    if spec is None or spec.loader is None or not path.is_file():
        raise error(f"{path}: not a Python file")
    check_consent(path, error)
    module = importlib.util.module_from_spec(spec)
    if importable:
        sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as failure:
        if importable:
            del sys.modules[name]
        message = UserFile.of(path, module).describe_failure(failure, "cannot be loaded")
        raise error(message) from failure
    return module
