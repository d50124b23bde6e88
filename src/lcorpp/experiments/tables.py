"""Tables of results: rows of scores, CSV files, and JSON files with the package versions."""

from __future__ import annotations

import csv
import io
import json
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from lcorpp.experiments.metrics import Scores
from lcorpp.files import write_atomically

METRICS = ("f1", "precision", "recall", "accuracy", "cost", "return")
COLUMNS = ("strategy", *(f"{name}{end}" for name in METRICS for end in ("", "_low", "_high")))
PACKAGES = ("lcorpp", "numpy", "scipy", "clingo", "scikit-learn", "torch")


def to_row(result: Scores) -> dict[str, str | float]:
    """Return the scores of a strategy as a row with the columns `COLUMNS`."""
    cells: dict[str, str | float] = {"strategy": result.strategy}
    for name in METRICS:
        interval = getattr(result, "return_" if name == "return" else name)
        cells |= {name: interval.estimate, f"{name}_low": interval.low, f"{name}_high": interval.high}
    return cells


def find_versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that determine a result."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def write_csv(path: Path, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a CSV file with a header."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(path, text.getvalue())


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file and add the package versions."""
    write_atomically(path, json.dumps({**content, "versions": find_versions()}, indent=2) + "\n")
