"""Text of CSV files: the same quotes and line ends in each file that lcorpp writes."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def format_csv(rows: Iterable[Iterable[object]]) -> str:
    """Return the lines of rows of cells; a cell with a comma, a quote or a line break is quoted."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def format_records(columns: Sequence[str], records: Iterable[Mapping[str, Any]]) -> str:
    """Return a header and the lines of records; a missing cell is empty.

    Raises:
        ValueError: a record has another column.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()
