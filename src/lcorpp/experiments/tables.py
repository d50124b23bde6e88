"""Tables and descriptions of results as files: CSV, Parquet, and JSON with versions."""

from __future__ import annotations

import io
import json
import platform
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import lcorpp
from lcorpp.csv_text import format_records
from lcorpp.files import hash_files, write_atomically

PACKAGES = ("lcorpp", "numpy", "scipy", "clingo", "scikit-learn", "torch")
"""Packages that determine a result; their versions are in each JSON file."""


def write_csv(path: Path, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a CSV file with a header.

    Raises:
        FileError: it cannot be written.
    """
    write_atomically(path, format_records(columns, rows))


def has_parquet() -> bool:
    """Whether tables are written as Parquet, too: with the extra `parquet`."""
    return find_spec("pyarrow") is not None


def write_parquet(path: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write a Parquet file, and return its path.

    Raises:
        FileError: it cannot be written.
    """
    import pyarrow
    from pyarrow import parquet

    content = io.BytesIO()
    parquet.write_table(pyarrow.Table.from_pylist([dict(row) for row in rows]), content)
    write_atomically(path, content.getvalue())
    return path


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file and add the versions of Python and of `PACKAGES`.

    Raises:
        FileError: it cannot be written.
    """
    complete = {**content, "versions": read_versions()}
    write_atomically(path, json.dumps(complete, indent=2) + "\n")


def read_versions() -> dict[str, str]:
    """Return the versions of Python and of `PACKAGES`."""
    versions = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed"
    return versions


@cache
def hash_code() -> str:
    """Return the fingerprint of lcorpp's code and domains, so that a changed program computes again."""
    return hash_files(Path(lcorpp.__file__).parent, (".py", ".plog", ".pomdp", ".toml"))[:16]
