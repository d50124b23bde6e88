"""Read a table of features: CSV or Parquet with a row for each case, a label, and perhaps a group."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

import numpy as np

from lcorpp.errors import DataError
from lcorpp.files import PARQUET_SUFFIXES
from lcorpp.learning.data.csv_reader import CsvFile, Progress, RowBatch
from lcorpp.learning.data.formats.columns import read_header
from lcorpp.learning.data.formats.parquet import ParquetFile
from lcorpp.learning.data.labels import class_of_label, describe_unknown_label
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.values import Array, Dataset, find_perceived

LABEL, GROUPS = "label", ("group", "person")
"""The column of the classes, and the possible names of the column of the groups; all others are features."""


UNNAMED = "unnamed: 0"
"""Name of the first column of a data frame's CSV, if it is an index without a name."""

INDEX = re.compile(r"unnamed: \d+|__index_level_\d+__")
"""Names of columns that are the index of a data frame, which numbers its rows."""


def has_table_columns(names: Collection[str]) -> bool:
    """Whether the columns are those of a table of features, not of tracks."""
    return LABEL in names and not {"track", "time"} & set(names)


def read_table(
    path: Path, labels: Mapping[str, str] | None, repair_log: RepairLog, progress: Progress | None = None
) -> Dataset:
    """Read a table as a data set (cases, features); a row without a group is a group of its own.

    A row without any feature is a person whom the sense did not perceive; it is left out, with a note.

    Args:
        labels: label in the file -> class, as in `read_recording`.

    Raises:
        FileError: the file cannot be read.
        ParseError: in CSV, a feature is missing or no finite number, or a label is unknown, and the repair
            was not requested; a column has no name; or there are no features or no rows.
        DataError: likewise, in Parquet.
    """
    if path.suffix.lower() in PARQUET_SUFFIXES:
        parquet = ParquetFile(path, repair_log)
        features, words = _find_columns(parquet, parquet.names)
        batches = parquet.batches(features, words, progress)
        return _assemble(parquet, batches, features, labels, _note_index(parquet.names))
    names, heading = read_header(path, (LABEL,))
    line, delimiter = heading.line, heading.delimiter
    unread = CsvFile(path, names, (), (), repair_log, header=line, delimiter=delimiter)
    if not names[0]:
        names[0] = UNNAMED
    features, words = _find_columns(unread, names)
    file = CsvFile(path, names, features, words, repair_log, header=line, delimiter=delimiter)
    return _assemble(file, file.batches(progress), features, labels, _note_index(names))


def _note_index(names: list[str]) -> list[str]:
    """Return a note about columns that are the index of a data frame, if there are any."""
    indices = [name for name in names if INDEX.fullmatch(name)]
    return [f"columns that are not used, as they number the rows: {', '.join(indices)}"] if indices else []


def _find_columns(file: RowSource, names: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the columns of features, without an index, and of words: the label, and perhaps the group."""
    for cell, name in enumerate(names, start=1):
        if not name:
            raise file.error_at(file.header, "", f"column {cell} has no name; expected the name of a feature")
    groups = [name for name in GROUPS if name in names]
    if len(groups) > 1:
        raise file.error_at(file.header, groups[1], f"columns {' and '.join(groups)}; expected one of them")
    features = tuple(n for n in names if n not in (LABEL, *GROUPS) and not INDEX.fullmatch(n))
    if not features:
        raise file.error_at(
            file.header, "", f"no features; expected columns of numbers beside {', '.join(names)}"
        )
    return features, (LABEL, *groups)


def _assemble(
    file: RowSource,
    batches: Iterable[RowBatch],
    features: tuple[str, ...],
    labels: Mapping[str, str] | None,
    notes: list[str],
) -> Dataset:
    """Return the rows of all batches that have no fault, or one that a requested repair leaves out."""
    tables: list[Array] = []
    classes: list[str] = []
    groups: list[str] = []
    has_groups, n_rows, n_absent = False, 0, 0
    for batch in batches:
        table = np.stack([batch.numbers[name] for name in features], axis=1)
        is_absent = ~find_perceived(table)
        n_rows, n_absent = n_rows + len(table), n_absent + int(is_absent.sum())
        known = [class_of_label(word, labels) for word in batch.texts[LABEL]]
        is_good = np.isfinite(table).all(axis=1) & np.array([name is not None for name in known], dtype=bool)
        is_good &= ~is_absent
        for row in np.flatnonzero(~(is_good | is_absent)).tolist():
            _report_fault(file, int(batch.lines[row]), table[row], features, batch.texts[LABEL][row], labels)
        rows = np.flatnonzero(is_good).tolist()
        tables.append(table[rows])
        classes += [str(known[row]) for row in rows]
        words = next((batch.texts[name] for name in GROUPS if name in batch.texts), None)
        has_groups = has_groups or words is not None
        groups += [words[row] if words and words[row] else f"row {batch.lines[row]}" for row in rows]
    if not classes:
        if file.repair_log.repairs:
            raise DataError(f"{file.file}: no row remains")
        raise file.error_at(file.header + 1, "", "no rows; expected a row for each case")
    notes = [*notes, *(file.notes() if isinstance(file, CsvFile) else ())]
    if n_absent:
        notes.append(
            f"{n_absent} of {n_rows} rows have no features, as of people whom the sense did not perceive;"
            f" left out: [simulation.present] may state {1 - n_absent / n_rows:.2g}"
        )
    if not has_groups:
        notes.append(
            f"no column {' or '.join(GROUPS)}: each row counts as a person of its own, also when people are"
            " split for training and cross-validation"
        )
    name = Path(file.file).name
    return Dataset(
        np.concatenate(tables), tuple(classes), tuple(groups), name, tuple(notes), channels=features
    )


def _report_fault(
    file: RowSource,
    line: int,
    numbers: Array,
    features: tuple[str, ...],
    word: str,
    labels: Mapping[str, str] | None,
) -> None:
    """Raise the error of a row, or note its repair: a number that is not finite, else its label."""
    bad = np.flatnonzero(~np.isfinite(numbers))
    if len(bad):
        name, what = features[bad[0]], "missing or NaN" if np.isnan(numbers[bad[0]]) else "infinite"
        message = f"the {name} is {what}; expected a finite number"
        file.repair_or_raise("nonfinite", line, message, field=name)
    else:
        file.repair_or_raise("labels", line, describe_unknown_label(word, labels), field=LABEL)
