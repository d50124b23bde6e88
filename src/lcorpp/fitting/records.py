"""Records: read from a CSV file with a column for each observed term, and grouped."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.errors import DataError, ProgramError, check_type
from lcorpp.files import open_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import name_value, resolve_evidence
from lcorpp.values import Array

MISSING = ("", "?")
"""Cells that are not observed."""


class Record(dict[str, str]):
    """A record of a file, term -> value; `place` is its file and line."""

    place: str


def read_records(path: str | Path) -> Iterator[Record]:
    r"""Read records from a CSV file, one at a time.

    The header names terms, such as ``time`` or ``"roll(d1)"``. A cell is a value; an empty cell and ``?`` are
    not observed.

    Raises:
        FileError: the file cannot be read.
        DataError: it is not a table with a header, or a row has another number of cells.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.fitting import read_records
        >>> _ = Path("tosses.csv").write_text("day, toss\nmonday, heads\ntuesday, ?\n")
        >>> list(read_records("tosses.csv"))
        [{'day': 'monday', 'toss': 'heads'}, {'day': 'tuesday'}]
    """
    with open_text(path) as file:
        reader = csv.reader(file, strict=True, skipinitialspace=True)
        try:
            names = [name.strip() for name in next(reader, [])]
            if not names or not all(names):
                raise DataError(f"{path}:1: expected a header with the name of a term for each column")
            if repeated := [name for name, count in Counter(names).items() if count > 1]:
                raise DataError(f"{path}:1: two columns are named {repeated[0]}")
            for row in reader:
                if not row and len(names) > 1:
                    continue  # an empty line
                cells, place = [cell.strip() for cell in row or [""]], f"{path}:{reader.line_num}"
                if len(cells) != len(names):
                    raise DataError(f"{place}: {len(cells)} cells; expected {len(names)}")
                record = Record(pair for pair in zip(names, cells, strict=True) if pair[1] not in MISSING)
                record.place = place
                yield record
        except csv.Error as error:
            raise DataError(f"{path}:{reader.line_num}: not CSV: {error}") from None
        except UnicodeDecodeError:
            raise DataError(f"{path}:{reader.line_num + 1}: not UTF-8 text") from None


def group_records(
    program: Program, records: Iterable[Mapping[str, str]]
) -> tuple[list[dict[str, str]], list[str], Array]:
    """Group equal records.

    Returns:
        (distinct, places, repeats): the distinct records with canonical names, the place of the first of
        each, such as ``record 1`` or its file and line, and how often each occurs.

    Raises:
        DataError: there are no records.
        ProgramError: a term or value is unknown, or a term has two values.
    """
    places: dict[frozenset[tuple[str, str]], str] = {}
    repeats: Counter[frozenset[tuple[str, str]]] = Counter()

    @cache
    def resolve(name: str, value: Any) -> tuple[str, str]:
        (fact,) = resolve_evidence(program, {name: value}).items()
        return fact

    check_type(records, Iterable, "records", ProgramError)
    for row, record in enumerate(records, start=1):
        place = record.place if isinstance(record, Record) else f"record {row}"
        check_type(record, Mapping, place, ProgramError)
        try:
            facts = frozenset([resolve(name, name_value(value)) for name, value in record.items()])
            if len(facts) < len(record) or len(dict(facts)) < len(facts):  # two names of a term
                facts = frozenset(resolve_evidence(program, record).items())
        except TypeError:  # an unhashable value
            raise ProgramError(f"{place}: expected a mapping from terms to values, not {record!r}") from None
        except ProgramError as error:
            raise ProgramError(f"{place}: {error}") from None
        places.setdefault(facts, place)
        repeats[facts] += 1
    if not places:
        raise DataError("there are no records")
    return list(map(dict, places)), list(places.values()), np.array([float(repeats[f]) for f in places])
