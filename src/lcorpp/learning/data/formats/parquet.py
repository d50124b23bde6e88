"""Read Parquet files with the columns of the long CSV format, with pyarrow (extra `parquet`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from weakref import finalize

import numpy as np

from lcorpp.errors import DataError
from lcorpp.files import MAX_MAPPED_BYTES
from lcorpp.input_files import open_input
from lcorpp.learning.data.csv_reader import BATCH_LINES, Progress, RowBatch
from lcorpp.learning.data.formats.columns import (
    REQUIRED,
    describe_missing_column,
    find_columns,
    note_unused_columns,
    rename_columns,
)
from lcorpp.learning.data.ingest import ReadOptions, assemble_tracks
from lcorpp.learning.data.measures import TIMES
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.learning.data.tracks import Track
from lcorpp.notebook import join_some


def import_pyarrow() -> Any:
    """Import pyarrow with the modules for Parquet files, or raise a DataError."""
    try:
        import pyarrow
        import pyarrow.compute
        import pyarrow.parquet
    except ImportError:
        raise DataError("Parquet files need pyarrow; install lcorpp[parquet], or use CSV") from None
    return pyarrow


class ParquetFile(RowSource):
    """A Parquet file; its rows count from 1.

    Args:
        columns: the names that the caller chooses, as in `rename_columns`.
    """

    def __init__(self, path: Path, repair_log: RepairLog, columns: Mapping[str, str] | None = None) -> None:
        super().__init__(path, repair_log)
        self._arrow = import_pyarrow()
        file = open_input(path, MAX_MAPPED_BYTES)
        finalize(self, file.close)
        try:
            self._table = self._arrow.parquet.ParquetFile(file)
        except (OSError, ValueError) as error:  # pyarrow's own errors are both
            raise DataError(f"{path}: not a Parquet file, or a damaged one: {error}") from None
        names = [name.strip().lower() for name in self._table.schema_arrow.names]
        self.names = rename_columns(names, columns or {})
        if len(set(self.names)) < len(self.names):
            raise DataError(f"{path}: a column appears twice: {', '.join(self.names)}")

    def error_at(self, line: int, field: str, message: str) -> DataError:
        """Return a DataError with the row and the column."""
        column = f", column {field!r}" if field else ""
        return DataError(f"{self.file}: row {line}{column}: {message}")

    def has_dates(self, name: str) -> bool:
        """Whether a column has dates with a time."""
        column = self._table.schema_arrow.field(self.names.index(name))
        return bool(self._arrow.types.is_timestamp(column.type))

    def batches(
        self, numbers: tuple[str, ...], words: tuple[str, ...], progress: Progress | None = None
    ) -> Iterator[RowBatch]:
        """Yield all rows; null is NaN or the empty word."""
        wanted = {name: self._table.schema_arrow.names[self.names.index(name)] for name in (*numbers, *words)}
        line, rows = 1, self._table.metadata.num_rows
        try:
            for part in self._table.iter_batches(batch_size=BATCH_LINES, columns=list(wanted.values())):
                yield RowBatch(
                    np.arange(line, line + part.num_rows, dtype=np.int64),
                    {name: self._numbers(part.column(wanted[name]), name) for name in numbers},
                    {name: self._words(part.column(wanted[name]), name) for name in words},
                )
                line += part.num_rows
                if progress is not None:
                    progress(line - 1, rows)
        except (OSError, ValueError) as error:
            raise DataError(f"{self.file}: damaged after row {line}: {error}") from None

    def _numbers(self, column: Any, name: str) -> Any:
        types = self._arrow.types
        if types.is_timestamp(column.type) and name == "time":
            per_second = TIMES[column.type.unit]
            return self._numbers(self._arrow.compute.cast(column, self._arrow.int64()), name) / per_second
        if not (types.is_integer(column.type) or types.is_floating(column.type)):
            raise self.error_at(1, name, f"the column is of type {column.type}; expected numbers")
        values = self._arrow.compute.cast(column, self._arrow.float64(), safe=False)
        return self._arrow.compute.fill_null(values, float("nan")).to_numpy(zero_copy_only=False)

    def _words(self, column: Any, name: str) -> list[str]:
        types = self._arrow.types
        if types.is_dictionary(column.type):
            column = column.dictionary_decode()
        if types.is_floating(column.type) and name == "track":  # ids with a missing one, in pandas
            numbers = column.drop_null().to_numpy()
            if (numbers % 1 == 0).all():
                column = self._arrow.compute.cast(column, self._arrow.int64())
        if types.is_floating(column.type) or types.is_nested(column.type):
            raise self.error_at(
                1, name, f"the column is of type {column.type}; expected words or whole numbers"
            )
        words = self._arrow.compute.cast(column, self._arrow.string())
        return ["" if word is None else word.strip() for word in words.to_pylist()]


def read_parquet(path: Path, options: ReadOptions) -> tuple[list[Track], tuple[str, ...]]:
    """Read a Parquet file of tracks; return the tracks, in metres, and notes about the file."""
    file = ParquetFile(path, options.repair_log, options.columns)
    for name in REQUIRED:
        if name not in file.names:
            raise DataError(
                f"{path}: {describe_missing_column(name, file.names)}; not {join_some(file.names)}"
            )
    if options.measures.per_second is not None and file.has_dates("time"):
        raise file.error_at(1, "time", "the times are dates; expected no --time-unit or --fps")
    numbers, words = find_columns(file.names)
    batches = file.batches(numbers, ("track", *words), options.progress)
    tracks = assemble_tracks(file, batches, options, DataError(f"{path}: no rows"), numbers[1:], words)
    return tracks, note_unused_columns(file.names)
