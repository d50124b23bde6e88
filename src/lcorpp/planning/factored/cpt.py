"""Conditional probability tables from text: rules, then exceptions that override them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.table_builder import Selector, TableBuilder
from lcorpp.planning.factored.variables import AFTER, ALL, EACH, Scope

Words = str | int | Iterable[object]
"""Several words: a text with blanks, or an iterable with one word per item, such as `range(5)`."""

Row = float | str | Mapping[Any, float] | npt.ArrayLike
"""A distribution: probabilities of all values; probabilities of some values; a certain value; ``uniform``; or
``same``, the value before the action. For a reward it is a number."""

SAME, UNIFORM = "same", "uniform"


@dataclass(frozen=True, eq=False)
class Cpt:
    """A conditional probability table in text form; see `cpt`."""

    parents: tuple[str, ...]
    rows: Mapping[Any, Row] | npt.ArrayLike


def cpt(parents: Words, rows: Mapping[Any, Row] | npt.ArrayLike) -> Cpt:
    """Return a table that depends on other variables.

        cpt("action place", {"* *": "same", "east hall": {"kitchen": 0.9, "hall": 0.1}})

    Args:
        parents: the variables it depends on. ``place`` is the value before the action, ``place'`` after it.
        rows: distributions by the parents' values, in their order; later rows override earlier ones. ``*``
            matches every value. So does ``-``, with its own numbers for each value: the row is then an array
            with an axis for each ``-``, before the axis of the values. Alternatively one array, with an axis
            for each parent and then one for the values.

    Examples:
        >>> from lcorpp.planning import cpt
        >>> moves = cpt("action place", {"* *": "same", "east hall": {"kitchen": 0.9, "hall": 0.1}})
        >>> moves.parents
        ('action', 'place')
    """
    return Cpt(split_words(parents), rows)


Spec = Cpt | Row
"""A table: with parents (`cpt`), or a single row."""


def split_words(text: Words) -> tuple[str, ...]:
    """Return the words of a text or an iterable; anything else is one word."""
    if isinstance(text, str):
        return tuple(text.split())
    return tuple(str(word) for word in text) if isinstance(text, Iterable) else (str(text),)


def build_table(scope: Scope, spec: Spec, children: tuple[str, ...], what: str) -> Table:
    """Build P(children | parents) from its text form; raise a ModelError that names table and row."""
    after = all(child.endswith(AFTER) for child in children)
    if isinstance(spec, str) and spec == SAME and after and not _is_value(scope, children, SAME):
        spec = cpt([child.removesuffix(AFTER) for child in children], {(ALL,) * len(children): SAME})
    parents, rows = (spec.parents, spec.rows) if isinstance(spec, Cpt) else ((), {"": spec})
    for name in parents:
        if name not in scope:
            raise ModelError(
                f"{what} depends on {name!r}, which is not a variable; known are {', '.join(scope)}"
            )
    reader = _RowReader(scope, parents, children, what)
    if isinstance(rows, Mapping):
        for key, row in rows.items():
            reader.add(key, row)
    else:
        reader.add((EACH,) * len(parents), rows)
    return reader.builder.build()


class _RowReader:
    """Reads the rows of one table into a `TableBuilder`."""

    def __init__(self, scope: Scope, parents: Sequence[str], children: Sequence[str], what: str) -> None:
        self.scope, self.what = scope, what
        self.parents, self.children, self.each = parents, children, [EACH] * len(children)
        try:
            self.builder = TableBuilder(scope, parents, children)
        except ModelError as error:
            raise ModelError(f"{what}: {error}") from None

    def add(self, key: Words, row: Row) -> None:
        """Read one row; errors name it."""
        try:
            place = self._find_selectors(key)
            rule = [ALL if selector == EACH else selector for selector in place]
            if not self.children:
                self._put_array(place, row)
            elif isinstance(row, str | int | np.integer):
                self._put_word(rule, str(row))
            elif isinstance(row, Mapping):
                self._put_outcomes(rule, row)
            else:
                self._put_array([*place, *self.each], row)
        except ModelError as error:
            which = f", row {' '.join(split_words(key))!r}" if self.parents else ""
            raise ModelError(f"{self.what}{which}: {error}") from None

    def _find_selectors(self, key: Words) -> tuple[Selector, ...]:
        values = split_words(key)
        if len(values) != len(self.parents):
            raise ModelError(
                f"{len(values)} values are given for {len(self.parents)} variables: {', '.join(self.parents)}"
            )
        return tuple(
            word if word in (ALL, EACH) else self.scope[name].index(word)
            for name, word in zip(self.parents, values, strict=True)
        )

    def _put_word(self, place: Sequence[Selector], row: str) -> None:
        """Put a certain value for each child, or a distribution by its name."""
        if _is_value(self.scope, self.children, row):
            self._put_outcomes(place, {row: 1.0})
        elif row == UNIFORM:
            count = int(np.prod([len(self.scope[child].values) for child in self.children]))
            self.builder.put([*place, *(ALL for _ in self.children)], 1.0 / count)
        elif row == SAME:
            self._put_same(place)
        else:
            self._find_outcome(row)  # raises the error for an unknown value

    def _put_same(self, place: Sequence[Selector]) -> None:
        before = [child.removesuffix(AFTER) for child in self.children]
        if before == list(self.children):
            raise ModelError(f"{SAME!r} is for a state after an action")
        for name in before:
            if name not in self.parents:
                raise ModelError(f"{SAME!r} needs {name!r} among the variables it depends on")
        axes = [self.parents.index(name) for name in before]
        # each combination of the values before the action, as far as the place leaves them open
        choices = [np.arange(self.builder.sizes[i]) if place[i] == ALL else [place[i]] for i in axes]
        values = [index.reshape(-1) for index in np.meshgrid(*choices, indexing="ij")]
        opened = [EACH if i in axes and selector == ALL else selector for i, selector in enumerate(place)]
        parents = [values[axes.index(i)] for i, selector in enumerate(opened) if selector == EACH]
        self.builder.put_entries([*opened, *self.each], [*parents, *values], np.ones(len(values[0])))

    def _put_outcomes(self, place: Sequence[Selector], row: Mapping[str, float]) -> None:
        """Put the probabilities of some outcomes."""
        outcomes = [self._find_outcome(key) for key in row]
        index = [np.array(axis) for axis in zip(*outcomes, strict=True)] or [np.zeros(0)] * len(self.children)
        self.builder.put_entries([*place, *self.each], index, _check_finite(list(row.values())))

    def _find_outcome(self, key: Words) -> tuple[int, ...]:
        values = split_words(key) if len(self.children) > 1 else (str(key),)
        if len(values) != len(self.children):
            raise ModelError(f"{key!r} must be a value of each of {', '.join(self.children)}")
        return tuple(self.scope[child].index(word) for child, word in zip(self.children, values, strict=True))

    def _put_array(self, place: Sequence[Selector], row: Row) -> None:
        """Put an array with an axis for each `EACH`."""
        if isinstance(row, str | Mapping):
            raise ModelError(f"expected a number, found {row!r}")
        array = _check_finite(row)
        names = (*self.parents, *self.children)
        axes = [(names[i], self.builder.sizes[i]) for i, selector in enumerate(place) if selector == EACH]
        if array.shape != tuple(n for _, n in axes):
            wanted = " by ".join(f"{n} (the values of {name!r})" for name, n in axes)
            raise ModelError(f"expected {wanted or 'one'} numbers, found the shape {array.shape}")
        self.builder.put(place, array)


def _check_finite(numbers: npt.ArrayLike) -> npt.NDArray[np.float64]:
    try:
        array = np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError):
        raise ModelError(f"expected numbers, found {numbers!r}") from None
    if not np.isfinite(array).all():
        raise ModelError("a number is not finite")
    return array


def _is_value(scope: Scope, children: Sequence[str], word: str) -> bool:
    return len(children) == 1 and word in scope[children[0]].values
