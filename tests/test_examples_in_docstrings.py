"""Examples in docstrings: each public name has one, and each example prints the output that it shows.

The public names are the functions and classes of `lcorpp` and of the packages that have an `__init__.pyi`.
"""

from __future__ import annotations

import doctest
import importlib
import inspect
import re
import traceback
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "lcorpp"
PACKAGES = [f"lcorpp.{stub.parent.name}" for stub in sorted(SOURCE.glob("*/__init__.pyi"))]
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE | doctest.REPORT_NDIFF


def public_names(package: str) -> dict[str, type]:
    """Return the functions and classes that a package exports; of `lcorpp`, those of no other package."""
    module = importlib.import_module(package)
    values = {name: getattr(module, name) for name in module.__all__}
    others = [] if package != "lcorpp" else [v for other in PACKAGES for v in public_names(other).values()]
    return {
        name: value
        for name, value in values.items()
        if (inspect.isclass(value) or inspect.isroutine(value)) and value not in others
    }


def public_methods(value: type) -> Iterator[tuple[str, object]]:
    """Yield the functions of the public methods and properties that a class defines."""
    for name, member in vars(value).items() if inspect.isclass(value) else ():
        function = getattr(member, "__func__", None) or getattr(member, "fget", None) or member
        function = getattr(function, "func", function)  # of a cached property
        if not name.startswith("_") and inspect.isroutine(function):
            yield name, function


def parse_examples(value: object) -> list[doctest.Example]:
    """Return the examples of a value's own docstring."""
    text = vars(value).get("__doc__") if inspect.isclass(value) else value.__doc__
    return doctest.DocTestParser().get_examples(text or "")


def find_shown_returns(package: str) -> str:
    """Return the return annotations of a package's functions and methods that examples call."""
    found = []
    for value in public_names(package).values():
        shown = "".join(example.source for example in parse_examples(value))
        if shown and inspect.isroutine(value):
            found.append(value)
        for name, method in public_methods(value):
            if parse_examples(method) or re.search(rf"\.{name}\b", shown):
                found.append(method)
    return " ".join(str(getattr(function, "__annotations__", {}).get("return", "")) for function in found)


def find_missing_package(error: BaseException | None) -> str:
    """Return the package without which an example failed, "" if another reason made it fail."""
    while error is not None:
        package = (getattr(error, "name", None) or "").partition(".")[0]
        if isinstance(error, ModuleNotFoundError) and package and not find_spec(package):
            return package
        error = error.__context__  # of an error that names the extra
    return ""


@pytest.mark.parametrize("package", ["lcorpp", *PACKAGES])
def test_examples_are_true(package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    failures, missing = [], set()
    for name, value in public_names(package).items():
        for test in doctest.DocTestFinder().find(value, name, module=False, globs={}):
            try:
                doctest.DebugRunner(optionflags=FLAGS).run(test)
            except doctest.DocTestFailure as failure:
                difference = doctest.OutputChecker().output_difference(failure.example, failure.got, FLAGS)
                failures.append(f"{test.name}: {failure.example.source}{difference}")
            except doctest.UnexpectedException as failure:
                error = failure.exc_info[1]
                absent = find_missing_package(error)
                if absent:
                    missing.add(absent)
                else:
                    lines = traceback.format_exception_only(error)
                    failures.append(f"{test.name}: {failure.example.source}{''.join(lines)}")
    assert not failures, "\n".join(failures)
    if missing:
        pytest.skip(f"examples of {package} need {', '.join(sorted(missing))}")


@pytest.mark.parametrize("package", ["lcorpp", *PACKAGES])
def test_each_public_name_has_an_example(package: str) -> None:
    """A class needs none where an example calls a function or a method that is annotated to return it."""
    returned = set(re.findall(r"\w+", " ".join(map(find_shown_returns, PACKAGES))))
    without, unproved = [], []
    for name, value in public_names(package).items():
        examples = parse_examples(value)
        own = examples or any(parse_examples(method) for _, method in public_methods(value))
        interface = getattr(value, "_is_protocol", False)
        if not own and not interface and not (inspect.isclass(value) and name in returned):
            without.append(name)
        if examples and not any(example.want for example in examples):
            unproved.append(name)
        assert not any(doctest.SKIP in example.options for example in examples), name
    assert not without, f"no example: {', '.join(without)}"
    assert not unproved, f"examples without output: {', '.join(unproved)}"
