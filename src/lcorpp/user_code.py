"""Load the user's Python files, and locate their errors in them."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from pathlib import Path
from types import ModuleType

from lcorpp.errors import LcorppError


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
