"""Records: a CSV file with a column for each observed term."""

from __future__ import annotations

import csv
from pathlib import Path

from lcorpp.errors import DataError
from lcorpp.files import open_text

MISSING = ("", "?")
"""Cells that are not observed."""


def read_records(path: str | Path) -> list[dict[str, str]]:
    """Read records from a CSV file.

    The header names terms, such as ``time`` or ``"roll(d1)"``. A cell is a value; an empty cell and ``?`` are
    not observed.

    Returns:
        term -> value for each row.

    Raises:
        FileError: the file cannot be read.
        DataError: it is not a table with a header, or a row has another number of cells.
    """
    records = []
    with open_text(path) as file:
        reader = csv.reader(file, strict=True, skipinitialspace=True)
        try:
            names = [name.strip() for name in next(reader, [])]
            if not names or not all(names):
                raise DataError(f"{path}:1: expected a header with the name of a term for each column")
            repeated = next((name for name in names if names.count(name) > 1), None)
            if repeated is not None:
                raise DataError(f"{path}:1: two columns are named {repeated}")
            for row in reader:
                if not row and len(names) > 1:
                    continue  # an empty line
                cells = row or [""]
                if len(cells) != len(names):
                    raise DataError(f"{path}:{reader.line_num}: {len(cells)} cells; expected {len(names)}")
                stripped = [cell.strip() for cell in cells]
                records.append(
                    {name: cell for name, cell in zip(names, stripped, strict=True) if cell not in MISSING}
                )
        except csv.Error as error:
            raise DataError(f"{path}:{reader.line_num}: not CSV: {error}") from None
        except UnicodeDecodeError:
            raise DataError(f"{path}:{reader.line_num + 1}: not UTF-8 text") from None
    return records
