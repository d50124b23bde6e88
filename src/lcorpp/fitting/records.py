"""Records: read from a table with a column for each observed term, and grouped."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.errors import DataError, ProgramError, check_type
from lcorpp.files import open_text
from lcorpp.fitting.parquet_records import is_parquet, read_columns, read_rows
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import name_value, resolve_evidence
from lcorpp.values import Array, Indices

MISSING = ("", "?")
"""Cells that are not observed."""


_Mixture = tuple[tuple[frozenset[tuple[str, str]], float], ...]


class Record(dict[str, str]):
    """A record of a file, term -> value; `place` is its file and line."""

    place: str


@dataclass(frozen=True)
class SoftRecord:
    """A record of which some terms are known by a likelihood only.

    facts: the observed terms, term -> value.
    alternatives: possible values of further terms, the same ones in each, with P(what was observed | values)
        up to a factor of the record.

    Examples:
        >>> from lcorpp import parse_plog
        >>> from lcorpp.fitting import SoftRecord, fit
        >>> program = parse_plog("toss: {heads, tails}. random(toss). pr(toss = heads) = 0.4.")
        >>> seen = SoftRecord({}, (({"toss": "heads"}, 0.9), ({"toss": "tails"}, 0.1)))
        >>> float(fit(program, [seen, {"toss": "tails"}]).numbers[0].value)
        0.4375
    """

    facts: Mapping[str, str]
    alternatives: tuple[tuple[Mapping[str, str], float], ...]

    def __post_init__(self) -> None:
        weights = [weight for _, weight in self.alternatives]
        if not all(isfinite(weight) and weight >= 0 for weight in weights) or not sum(weights) > 0:
            raise DataError(f"a record has the likelihoods {weights}; expected numbers from 0, not all 0")


def read_records(path: str | Path) -> Iterator[Record]:
    r"""Read records from a CSV or Parquet file, one at a time.

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
    rows = _read_rows(path)
    names = _check_header(*next(rows, ([], f"{path}:1")))
    for cells, place in rows:
        if not cells and len(names) > 1:
            continue  # an empty line
        cells = [cell.strip() for cell in cells or [""]]
        if len(cells) != len(names):
            raise DataError(f"{place}: {len(cells)} cells; expected {len(names)}")
        record = Record(pair for pair in zip(names, cells, strict=True) if pair[1] not in MISSING)
        record.place = place
        yield record


def read_header(path: str | Path) -> list[str]:
    """Return the names of the columns of records.

    Raises:
        FileError, DataError: as `read_records`.
    """
    with closing(_read_rows(path)) as rows:
        return _check_header(*next(rows, ([], f"{path}:1")))


def _read_rows(path: str | Path) -> Generator[tuple[list[str], str]]:
    """Yield the names of the columns and the cells of each row, with their place."""
    if is_parquet(path):
        yield read_columns(path), str(path)
        for number, cells in enumerate(read_rows(path), start=1):
            yield cells, f"{path}: row {number}"
        return
    with open_text(path) as file:
        reader = csv.reader(file, strict=True, skipinitialspace=True)
        try:
            for cells in reader:
                yield cells, f"{path}:{reader.line_num}"
        except csv.Error as error:
            raise DataError(f"{path}:{max(reader.line_num, 1)}: not CSV: {error}") from None
        except UnicodeDecodeError:
            raise DataError(f"{path}:{reader.line_num + 1}: not UTF-8 text") from None


def _check_header(header: list[str], place: str) -> list[str]:
    names = [name.strip() for name in header]
    if not names or not all(names):
        raise DataError(f"{place}: expected a header with the name of a term for each column")
    if repeated := [name for name, count in Counter(names).items() if count > 1]:
        raise DataError(f"{place}: two columns are named {repeated[0]}")
    return names


@dataclass(frozen=True, eq=False)
class GroupedRecords:
    """Distinct records with canonical names; each is a mixture of records that state all its values.

    places: (n,) of the first of each, such as ``record 1`` or its file and line.
    repeats: (n,) how often each occurs.
    stated: the records of the mixtures, term -> value.
    parts: (n, V) the stated records of each. likelihoods: (n, V) their weights.
    """

    places: list[str]
    repeats: Array
    stated: list[dict[str, str]]
    parts: Indices
    likelihoods: Array


def group_records(program: Program, records: Iterable[Mapping[str, str] | SoftRecord]) -> GroupedRecords:
    """Group equal records.

    Raises:
        DataError: there are no records.
        ProgramError: a term or value is unknown, or a term has two values.
    """
    places: dict[_Mixture, str] = {}
    repeats: Counter[_Mixture] = Counter()

    @cache
    def resolve(name: str, value: Any) -> tuple[str, str]:
        (fact,) = resolve_evidence(program, {name: value}).items()
        return fact

    def find_facts(record: Mapping[str, str], place: str) -> frozenset[tuple[str, str]]:
        check_type(record, Mapping, place, ProgramError)
        try:
            facts = frozenset([resolve(name, name_value(value)) for name, value in record.items()])
            if len(facts) < len(record) or len(dict(facts)) < len(facts):  # two names of a term
                facts = frozenset(resolve_evidence(program, record).items())
        except TypeError:  # an unhashable value
            raise ProgramError(f"{place}: expected a mapping from terms to values, not {record!r}") from None
        except ProgramError as error:
            raise ProgramError(f"{place}: {error}") from None
        return facts

    check_type(records, Iterable, "records", ProgramError)
    for row, record in enumerate(records, start=1):
        place = record.place if isinstance(record, Record) else f"record {row}"
        if isinstance(record, SoftRecord):
            mixture = tuple(
                (find_facts({**record.facts, **values}, place), weight)
                for values, weight in record.alternatives
                if weight
            )
        else:
            mixture = ((find_facts(record, place), 1.0),)
        places.setdefault(mixture, place)
        repeats[mixture] += 1
    if not places:
        raise DataError("there are no records")
    numbers: dict[frozenset[tuple[str, str]], int] = {}
    size = max(map(len, places))
    parts, likelihoods = np.zeros((len(places), size), dtype=np.intp), np.zeros((len(places), size))
    for i, mixture in enumerate(places):
        for v, (facts, weight) in enumerate(mixture):
            parts[i, v], likelihoods[i, v] = numbers.setdefault(facts, len(numbers)), weight
    return GroupedRecords(
        list(places.values()),
        np.array([float(repeats[mixture]) for mixture in places]),
        list(map(dict, numbers)),
        parts,
        likelihoods,
    )
