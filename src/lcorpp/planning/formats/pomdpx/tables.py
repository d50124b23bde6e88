"""Tables of PomdpX: entries with ``*`` and ``-``; later entries override earlier ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np

from lcorpp.errors import ParseError, expected_one_of
from lcorpp.planning.factored.table import Table, format_row
from lcorpp.planning.factored.table_builder import Selector, TableBuilder
from lcorpp.planning.factored.variables import ALL, EACH
from lcorpp.planning.formats.numbers import ROW_TOLERANCE
from lcorpp.planning.formats.pomdpx.declarations import Declarations
from lcorpp.planning.formats.pomdpx.document import Document, Element
from lcorpp.planning.pomdp import SUM_TOLERANCE
from lcorpp.values import Array


@dataclass(frozen=True)
class Function:
    """A ``<CondProb>``, or a ``<Func>`` (without children). parents, children: our variable names."""

    declarations: Declarations
    parameter: Element
    parents: tuple[str, ...]
    children: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Parents, then children: the order of an ``<Instance>``."""
        return (*self.parents, *self.children)

    @cached_property
    def value_indices(self) -> tuple[Mapping[str, int], ...]:
        """For each of the names: value -> index."""
        scope = self.declarations.scope
        return tuple({value: i for i, value in enumerate(scope[name].values)} for name in self.names)


def read_entries(function: Function, builder: TableBuilder) -> None:
    """Put the entries of a function into a table; raise a ParseError if one is malformed."""
    for entry in function.declarations.document.check_children(function.parameter, ("Entry",), ("type",)):
        _read_entry(function, builder, entry)


def _read_entry(function: Function, builder: TableBuilder, entry: Element) -> None:
    document = function.declarations.document
    # the documentation itself uses ProbTable for rewards in place of ValueTable
    titles = ("ProbTable",) if function.children else ("ValueTable", "ProbTable")
    document.check_children(entry, ("Instance", *titles))
    instance, numbers = document.only_child(entry, "Instance"), document.only_child(entry, *titles)
    place = _read_place(function, instance)
    keyword = numbers.text.strip().lower()
    if function.children and keyword == "uniform":
        children = slice(len(function.parents), None)
        if not all(isinstance(selector, str) for selector in place[children]):
            raise document.error(numbers, "'uniform' needs '-' for the variable itself", 0)
        rule = [ALL if selector == EACH else selector for selector in place]
        builder.put(rule, 1.0 / prod(builder.sizes[children]))
    elif function.children and keyword == "identity":
        _put_identity(function, builder, place, numbers)
    else:
        values = document.numbers(numbers)
        needed = prod(n for n, selector in zip(builder.sizes, place, strict=True) if selector == EACH)
        if len(values) != needed:
            raise document.error(
                numbers,
                f"{' '.join(instance.words())!r} needs {needed} numbers, found {len(values)}",
                min(needed, len(values) - 1) if len(values) else None,
            )
        if function.children:
            check_probabilities(document, numbers, values)
        builder.put(place, values)


def _put_identity(
    function: Function, builder: TableBuilder, place: Sequence[Selector], numbers: Element
) -> None:
    each = [n for n, selector in zip(builder.sizes, place, strict=True) if selector == EACH]
    if len(each) != 2 or each[0] != each[1] or place[-1] != EACH or len(function.children) != 1:
        raise function.declarations.document.error(
            numbers,
            "'identity' needs '-' for one parent and for the variable itself, and as many values of both",
            0,
        )
    diagonal = np.arange(each[0])
    builder.put_entries(place, (diagonal, diagonal), np.ones(each[0]))


def _read_place(function: Function, instance: Element) -> list[Selector]:
    """Return the selector of each variable in an ``<Instance>``: the index of a value, `ALL` or `EACH`."""
    document = function.declarations.document
    words = document.words(instance)
    if len(words) != len(function.names):
        names = ", ".join(function.names) or "no variable"
        raise document.error(instance, f"expected a value for each of {names}; found {len(words)}")
    place: list[Selector] = []
    for i, (word, indices) in enumerate(zip(words, function.value_indices, strict=True)):
        if word not in indices and word not in (ALL, EACH):
            message = f"unknown value {word!r} of {function.names[i]!r}; {expected_one_of(indices)}"
            raise document.error(instance, message, i)
        place.append(indices.get(word, word))
    return place


def check_probabilities(document: Document, element: Element, values: Array) -> None:
    """Raise a ParseError at the first number that is not a probability."""
    if not values.min() >= 0 or not values.max() <= 1 + ROW_TOLERANCE:
        at = int(np.flatnonzero((values < 0) | (values > 1 + ROW_TOLERANCE))[0])
        raise document.error(element, f"{element.words()[at]} is not a probability", at)


def normalize_rows(function: Function, table: Table) -> Table:
    """Check that each row is present and sums to 1; return the table without the file's rounding errors."""
    sums = table.rows.row_sums()
    errors = np.abs(sums - 1)
    wrong = np.flatnonzero(errors[0] > ROW_TOLERANCE)
    if len(wrong):
        raise _make_row_error(function, table, int(wrong[0]), float(sums[0, wrong[0]]))
    inexact = errors > SUM_TOLERANCE
    if not inexact.any():
        return table
    rows = table.rows.scale_rows(np.where(inexact, 1 / sums, 1.0))
    return Table(table.parents, table.children, table.shape, rows)


def _make_row_error(function: Function, table: Table, row: int, total: float) -> ParseError:
    """Return the error for a row with a wrong sum, at the last entry that sets it."""
    document = function.declarations.document
    what = f"the row of {' '.join(function.children)}{format_row(table, function.declarations.scope, row)}"
    heights = table.shape[: len(table.parents)]
    indices = np.unravel_index(row, heights) if heights else ()
    for entry in reversed(function.parameter.children):
        if entry.name == "Entry":
            instance = document.only_child(entry, "Instance")
            place = _read_place(function, instance)
            if all(s in (ALL, EACH, int(i)) for s, i in zip(place, indices, strict=False)):
                return document.error(instance, f"{what} sums to {total:.10g}, not 1", 0)
    if total:
        return document.error(function.parameter, f"{what} sums to {total:.10g}, not 1")
    return document.error(function.parameter, f"{what} is missing")
