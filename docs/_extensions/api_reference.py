"""The reference of Python names, from `__init__.pyi` of a package and the docstrings.

    ```{api-table} lcorpp.planning
    ```

is replaced by a table of the package's names, and

    ```{api} lcorpp.planning
    :modules: formats.pomdp, solvers.__init__
    ```

by the names that it imports from these modules and those below, in the order of `__init__.pyi`; from
`solvers` here without those below. `:names: a, b` chooses single names; without options all are described.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from blocks import expand_blocks
from docstrings import convert_docstring, escape_references
from repository import ROOT, URL


def list_names(package: str) -> dict[str, str]:
    """Return the exported names of a package and the modules, relative to it, that define them.

    Those of the module `lcorpp.errors` are its exceptions.
    """
    if package == "lcorpp.errors":
        errors = import_module(package)
        return {
            name: ""
            for name in vars(errors)
            if isinstance(getattr(errors, name), type) and name.endswith("Error")
        }
    stub = ROOT / "src" / Path(*package.split(".")) / "__init__.pyi"
    nodes = ast.parse(stub.read_text(encoding="utf-8")).body
    imports = [node for node in nodes if isinstance(node, ast.ImportFrom) and node.level == 1]
    return {alias.asname or alias.name: node.module or "" for node in imports for alias in node.names}


def choose_names(package: str, options: Mapping[str, str]) -> list[str]:
    """Return the names of a block.

    Raises:
        ValueError: a module of the block defines no name.
    """
    names = list_names(package)
    if "names" in options:
        return options["names"].split(", ")
    if "modules" not in options:
        return list(names)
    chosen = []
    for prefix in options["modules"].split(", "):
        exact = prefix.removesuffix(".__init__")
        found = [
            name
            for name, module in names.items()
            if module == exact or (prefix == exact and module.startswith(f"{prefix}."))
        ]
        if not found:
            raise ValueError(f"{package} exports nothing from {prefix!r}")
        chosen += found
    return chosen


def describe_names(package: str, options: Mapping[str, str]) -> str:
    """Return directives of autodoc for the names of a block."""
    directives = "\n".join(_describe_name(package, name) for name in choose_names(package, options))
    return f"````{{eval-rst}}\n{directives}\n````\n"


def make_table(package: str, options: Mapping[str, str]) -> str:
    """Return a table of names with the first sentences of their docstrings."""
    rows = []
    for name in choose_names(package, options):
        home = package if package != "lcorpp" else f"lcorpp.{list_names(package)[name]}"
        first = _format_cell(_find_docstring(package, name))
        rows.append(f"| {{py:obj}}`{name} <{home}.{name}>` | {first} |")
    return "\n".join(["| name | what it is or does |", "|---|---|", *rows]) + "\n"


def _describe_name(package: str, name: str) -> str:
    value, path = getattr(import_module(package), name), f"{package}.{name}"
    if inspect.isfunction(value):
        return f".. autofunction:: {path}\n"
    if inspect.isclass(value):
        return _describe_class(value, path)
    text = _find_docstring(package, name).replace("\n", "\n   ")
    shown = repr(value)
    is_short = len(shown) <= 70 and " at 0x" not in shown
    return f".. py:data:: {path}\n" + (f"   :value: {shown}\n" if is_short else "") + f"\n   {text}\n"


def _describe_class(value: type, path: str) -> str:
    if issubclass(value, Exception):
        return f".. autoexception:: {path}\n   :show-inheritance:\n"
    options = ["members:", "member-order: bysource"]
    ours = [base for base in value.__mro__ if base.__module__.startswith("lcorpp.")]
    if len(ours) > 1:  # methods of our bases, not those of object or scikit-learn
        others = sorted({base.__name__ for base in value.__mro__} - {base.__name__ for base in ours})
        options.append(f"inherited-members: {', '.join(others)}")
    if any("__call__" in vars(base) and vars(base)["__call__"].__doc__ for base in ours):
        options.append("special-members: __call__")
    return f".. autoclass:: {path}\n" + "".join(f"   :{option}\n" for option in options)


def _find_docstring(package: str, name: str) -> str:
    """Return the docstring of a function or class, or of a module's variable."""
    value = getattr(import_module(package), name)
    if inspect.isfunction(value) or inspect.isclass(value):
        return inspect.getdoc(value) or ""
    from sphinx.pycode import ModuleAnalyzer  # the lists of names need no Sphinx

    module = f"{package}.{list_names(package)[name]}"
    while True:  # the module may import the name from one of its own
        text = ModuleAnalyzer.for_module(module).find_attr_docs().get(("", name))
        if text is not None:
            return "\n".join(text).strip()
        source = inspect.getsource(import_module(module))
        found = re.search(rf"^from ([\w.]+) import .*\b{name}\b", source, re.MULTILINE)
        if not found:
            return ""
        module = found[1]


def _format_cell(docstring: str) -> str:
    paragraph = " ".join(docstring.split("\n\n")[0].split())
    sentence = re.split(r"(?<=[a-z)`\]][.:]) (?=[A-Z`])|: (?=\()", paragraph)[0].rstrip(":")
    parts = re.split(r"(`+[^`]*`+)", sentence)
    return "".join(
        part.replace("|", "\\|") if k % 2 else re.sub(r"([\\*_<>|\[\]$])", r"\\\1", part)
        for k, part in enumerate(parts)
    )


def _process_docstring(_app: Any, what: str, _name: str, value: Any, _options: Any, lines: list[str]) -> None:
    fields = {
        field for base in getattr(value, "__mro__", ()) for field in getattr(base, "__annotations__", {})
    }
    convert_docstring(lines, fields | _list_parameters(value))


def _escape_docstring(
    _app: Any, _what: str, _name: str, _value: Any, _options: Any, lines: list[str]
) -> None:
    escape_references(lines)


def _list_parameters(value: Any) -> set[str]:
    try:
        return set(inspect.signature(value).parameters)
    except (TypeError, ValueError):
        return set()


def _skip_member(_app: Any, _what: str, name: str, value: Any, _skip: bool, _options: Any) -> bool | None:
    """Skip fields of named tuples ("Alias for field number 0") and what scikit-learn adds to estimators."""
    added = re.fullmatch(r"set_\w+_request|get_metadata_routing", name)
    return True if added or type(value).__name__ == "_tuplegetter" else None


def find_source(domain: str, info: Mapping[str, str]) -> str | None:
    """Return the address of a name's source, for `sphinx.ext.linkcode`."""
    from sphinx.pycode import ModuleAnalyzer

    if domain != "py" or not info["module"]:
        return None
    outer, *parts = info["fullname"].split(".")
    value = getattr(import_module(info["module"]), outer, None)
    module, name = getattr(value, "__module__", ""), getattr(value, "__qualname__", "")
    if not module.startswith("lcorpp."):
        return None
    tags = ModuleAnalyzer.for_module(module)
    tags.analyze()
    place = tags.tags.get(".".join([name, *parts])) or tags.tags.get(name)
    file = Path(tags.srcname)
    if place is None or not file.is_relative_to(ROOT):
        return None
    return f"{URL}/blob/main/{file.relative_to(ROOT).as_posix()}#L{place[1]}-L{place[2]}"


def _read_page(_app: Any, _docname: str, source: list[str]) -> None:
    source[0] = expand_blocks(source[0], "api-table", make_table)
    source[0] = expand_blocks(source[0], "api", describe_names)


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx; napoleon reads docstrings with priority 500."""
    app.connect("source-read", _read_page)
    app.connect("autodoc-process-docstring", _process_docstring, priority=400)
    app.connect("autodoc-process-docstring", _escape_docstring, priority=600)
    app.connect("autodoc-skip-member", _skip_member)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
