"""Records from a Parquet file, with pyarrow (extra `parquet`)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lcorpp.errors import DataError
from lcorpp.files import MAX_MAPPED_BYTES, PARQUET_SUFFIXES
from lcorpp.input_files import open_input


def is_parquet(path: str | Path) -> bool:
    """Whether the name of a file is that of a Parquet file."""
    return Path(path).suffix.lower() in PARQUET_SUFFIXES


def read_columns(path: str | Path) -> list[str]:
    """Return the names of the columns.

    Raises:
        FileError: the file cannot be read.
        DataError: it is no Parquet file, or pyarrow is not installed.
    """
    with open_input(Path(path), MAX_MAPPED_BYTES) as file:
        return [str(name) for name in _open(path, file).schema_arrow.names]


def read_rows(path: str | Path) -> Iterator[list[str]]:
    """Yield the cells of each row as text; null and NaN are empty, truth values are true and false.

    Raises:
        FileError, DataError: as `read_columns`; the file is damaged.
    """
    with open_input(Path(path), MAX_MAPPED_BYTES) as file:
        table = _open(path, file)
        try:
            for batch in table.iter_batches():
                columns = [column.to_pylist() for column in batch.columns]
                for row in zip(*columns, strict=True):
                    yield [_format(cell) for cell in row]
        except (OSError, ValueError) as error:
            raise DataError(f"{path}: a damaged Parquet file: {error}") from None


def _open(path: str | Path, file: Any) -> Any:
    from lcorpp.learning.data.formats.parquet import import_pyarrow  # other tables do without

    try:
        return import_pyarrow().parquet.ParquetFile(file)
    except (OSError, ValueError) as error:  # pyarrow's own errors are both
        raise DataError(f"{path}: not a Parquet file, or a damaged one: {error}") from None


def _format(cell: object) -> str:
    if cell is None or cell != cell:  # nothing, or not a number
        return ""
    if isinstance(cell, float) and cell.is_integer():  # as a column of whole numbers with gaps is stored
        return str(int(cell))
    return str(cell).lower() if isinstance(cell, bool) else str(cell).strip()
