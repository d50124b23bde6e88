"""The tables of PomdpX: entries with ``*`` and ``-``, of which later ones override earlier ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np

from lcorpp.errors import ParseError, expected_one_of
from lcorpp.planning.factored.table import Table, format_row
from lcorpp.planning.factored.table_builder import Selector, TableBuilder
from lcorpp.planning.factored.variables import ALL, EACH, Scope
from lcorpp.planning.formats.pomdp.tokens import ROW_TOLERANCE
from lcorpp.planning.formats.pomdpx.xml import Document, Element
from lcorpp.planning.pomdp import SUM_TOLERANCE
from lcorpp.values import Array


@dataclass(frozen=True)
class Source:
    """What the functions of a document speak of. names: our names of the variables by those of the file."""

    document: Document
    scope: Scope
    names: Mapping[str, str]


@dataclass(frozen=True)
class Function:
    """A ``<CondProb>``, or a ``<Func>`` without children. parents, children: our names of the variables."""

    source: Source
    parameter: Element
    parents: tuple[str, ...]
    children: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Parents, then children: the order of an ``<Instance>``."""
        return (*self.parents, *self.children)

    @cached_property
    def numbers(self) -> tuple[Mapping[str, int], ...]:
        """For each of the names, the numbers of its values."""
        scope = self.source.scope
        return tuple({value: i for i, value in enumerate(scope[name].values)} for name in self.names)


def read_entries(function: Function, cells: TableBuilder) -> None:
    """Put what the entries of a function say into a table.

    Raises:
        ParseError: an entry is malformed.
    """
    for entry in function.source.document.children(function.parameter, ("Entry",), ("type",)):
        _read_entry(function, cells, entry)


def _read_entry(function: Function, cells: TableBuilder, entry: Element) -> None:
    document = function.source.document
    # the documentation itself has a ProbTable where a reward wants a ValueTable
    titles = ("ProbTable",) if function.children else ("ValueTable", "ProbTable")
    document.children(entry, ("Instance", *titles))
    instance, numbers = document.only(entry, "Instance"), document.only(entry, *titles)
    place = _place(function, instance)
    keyword = numbers.text.strip().lower()
    if function.children and keyword == "uniform":
        _uniform(function, cells, place, numbers)
    elif function.children and keyword == "identity":
        _identity(function, cells, place, numbers)
    else:
        values = document.numbers(numbers)
        wanted = prod(n for n, selector in zip(cells.sizes, place, strict=True) if selector == EACH)
        if len(values) != wanted:
            raise document.error(
                numbers,
                f"{' '.join(instance.words())!r} needs {wanted} numbers, found {len(values)}",
                min(wanted, len(values) - 1) if len(values) else None,
            )
        if function.children:
            check_probabilities(document, numbers, values)
        cells.put(place, values)


def _uniform(function: Function, cells: TableBuilder, place: Sequence[Selector], numbers: Element) -> None:
    own = slice(len(function.parents), None)
    if not all(isinstance(selector, str) for selector in place[own]):
        raise function.source.document.error(numbers, "'uniform' needs '-' for the variable itself", 0)
    loose = [ALL if selector == EACH else selector for selector in place]
    cells.put(loose, 1.0 / prod(cells.sizes[own]))


def _identity(function: Function, cells: TableBuilder, place: Sequence[Selector], numbers: Element) -> None:
    each = [n for n, selector in zip(cells.sizes, place, strict=True) if selector == EACH]
    if len(each) != 2 or each[0] != each[1] or place[-1] != EACH or len(function.children) != 1:
        raise function.source.document.error(
            numbers,
            "'identity' needs '-' for one parent and for the variable itself, and as many values of both",
            0,
        )
    diagonal = np.arange(each[0])
    cells.put_entries(place, (diagonal, diagonal), np.ones(each[0]))


def _place(function: Function, instance: Element) -> list[Selector]:
    """What an ``<Instance>`` names: for each variable the number of a value, or one of the signs for all."""
    document = function.source.document
    words = document.words(instance)
    if len(words) != len(function.names):
        names = ", ".join(function.names) or "no variable"
        raise document.error(instance, f"expected a value for each of {names}; found {len(words)}")
    place: list[Selector] = []
    for i, (word, known) in enumerate(zip(words, function.numbers, strict=True)):
        if word not in known and word not in (ALL, EACH):
            message = f"unknown value {word!r} of {function.names[i]!r}; {expected_one_of(tuple(known))}"
            raise document.error(instance, message, i)
        place.append(known.get(word, word))
    return place


def check_probabilities(document: Document, element: Element, values: Array) -> None:
    """Refuse numbers that no probability can have; the place is that of the number."""
    if not values.min() >= 0 or not values.max() <= 1 + ROW_TOLERANCE:
        at = int(np.flatnonzero((values < 0) | (values > 1 + ROW_TOLERANCE))[0])
        raise document.error(element, f"{element.words()[at]} is no probability", at)


def checked(function: Function, table: Table) -> Table:
    """The table, of which every row sums to 1; rounding of the file is taken out.

    Raises:
        ParseError: a row is missing or its sum is wrong.
    """
    sums = table.rows.row_sums()
    off = np.abs(sums - 1)
    wrong = np.flatnonzero(off[0] > ROW_TOLERANCE)
    if len(wrong):
        raise _row_error(function, table, int(wrong[0]), float(sums[0, wrong[0]]))
    inexact = off > SUM_TOLERANCE
    if not inexact.any():
        return table
    rows = table.rows.scale_rows(np.where(inexact, 1 / sums, 1.0))
    return Table(table.parents, table.children, table.shape, rows)


def _row_error(function: Function, table: Table, row: int, total: float) -> ParseError:
    """What is wrong with a row, at the last entry that speaks of it."""
    document = function.source.document
    what = f"the row of {' '.join(function.children)}{format_row(table, function.source.scope, row)}"
    heights = table.shape[: len(table.parents)]
    own = np.unravel_index(row, heights) if heights else ()
    for entry in reversed(function.parameter.children):
        if entry.name == "Entry":
            instance = document.only(entry, "Instance")
            if all(s in (ALL, EACH, int(i)) for s, i in zip(_place(function, instance), own, strict=False)):
                return document.error(instance, f"{what} sums to {total:.10g}, not 1", 0)
    if total:
        return document.error(function.parameter, f"{what} sums to {total:.10g}, not 1")
    return document.error(function.parameter, f"{what} is missing")
