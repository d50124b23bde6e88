"""Names that a package exports and imports at first use."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import lazy_loader

from lcorpp.errors import MissingPackageError

EXTRAS = {"matplotlib": "plots"}
"""The extra of lcorpp that installs a package which exported modules import at their top."""


def attach_stub(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package, whose names its `__init__.pyi` lists.

    As `lazy_loader.attach_stub`, with a typed error where an optional package is needed.

    Args:
        package: `__name__` of the package.
        file: `__file__` of the package.
    """
    import_name, list_names, names = lazy_loader.attach_stub(package, file)

    def import_or_explain(name: str) -> Any:
        try:
            return import_name(name)
        except ModuleNotFoundError as error:
            missing = (error.name or "").partition(".")[0]
            if missing not in EXTRAS:
                raise
            raise MissingPackageError(
                f"{package}.{name} needs {missing}, which is not installed:"
                f" pip install 'lcorpp[{EXTRAS[missing]}]'"
            ) from None

    return import_or_explain, list_names, names
