"""Tables as people write them: rules for some of the cases, then their exceptions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.table_builder import Selector, TableBuilder
from lcorpp.planning.factored.variables import AFTER, ALL, EACH, Scope, Variable

Words = str | int | Iterable[object]
"""Several words: a text with blanks between them, or what stands for one word each, such as `range(5)`."""

Row = float | str | Mapping[Any, float] | npt.ArrayLike
"""What holds in one case: probabilities, one for each value; probabilities of some values; a value that is
certain; ``uniform``; ``same``, the value before the action. For a reward it is a number."""

SAME, UNIFORM = "same", "uniform"


@dataclass(frozen=True, eq=False)
class Cpt:
    """A table by cases, see `cpt`."""

    parents: tuple[str, ...]
    rows: Mapping[Any, Row] | npt.ArrayLike


def cpt(parents: Words, rows: Mapping[Any, Row] | npt.ArrayLike) -> Cpt:
    """A table that depends on other variables.

        cpt("action place", {"* *": "same", "east hall": {"kitchen": 0.9, "hall": 0.1}})

    Args:
        parents: the variables it depends on. ``place`` is the value before the action, ``place'`` after it.
        rows: what holds for which values of the parents, in their order; later rows override earlier ones.
            ``*`` stands for every value; so does ``-``, with numbers of its own for each: the row is then an
            array with an axis for each ``-``, before the axis of the values. Or one array with an axis for
            each parent, then one for the values.
    """
    return Cpt(words(parents), rows)


Spec = Cpt | Row
"""A table: by cases, or one row that depends on nothing."""


def words(text: Words) -> tuple[str, ...]:
    """The words of a text or a sequence; anything else is one word."""
    if isinstance(text, str):
        return tuple(text.split())
    return tuple(str(word) for word in text) if isinstance(text, Iterable) else (str(text),)


def distribution(scope: Scope, spec: Spec, children: tuple[str, ...], what: str) -> Table:
    """P(children | parents) as it was given.

    Raises:
        ModelError: a variable or value is not known, or numbers do not have the shape they need.
    """
    after = all(child.endswith(AFTER) for child in children)
    if isinstance(spec, str) and spec == SAME and after and not _is_value(scope, children, SAME):
        spec = cpt([child.removesuffix(AFTER) for child in children], {(ALL,) * len(children): SAME})
    parents, rows = (spec.parents, spec.rows) if isinstance(spec, Cpt) else ((), {"": spec})
    for name in parents:
        if name not in scope:
            raise ModelError(f"{what} depends on {name!r}, which is no variable; {_known(scope)}")
    builder = _Builder(scope, parents, children, what)
    if isinstance(rows, Mapping):
        for key, row in rows.items():
            builder.add(key, row)
    else:
        builder.add((EACH,) * len(parents), rows)
    return builder.cells.table()


class _Builder:
    """One table while its rows are read."""

    def __init__(self, scope: Scope, parents: Sequence[str], children: Sequence[str], what: str) -> None:
        self.scope, self.what = scope, what
        self.parents, self.children = parents, children
        try:
            self.cells = TableBuilder(scope, parents, children)
        except ModelError as error:
            raise ModelError(f"{what}: {error}") from None

    def add(self, key: Words, row: Row) -> None:
        """One row; errors name it."""
        try:
            place = self._place(key)
            if not self.children:
                self._numbers(place, row)
            elif isinstance(row, str | int | np.integer):
                self._word(place, str(row))
            elif isinstance(row, Mapping):
                self._some(place, row)
            else:
                self._numbers((*place, *(EACH for _ in self.children)), row)
        except ModelError as error:
            shown = f", row {' '.join(words(key))!r}" if self.parents else ""
            raise ModelError(f"{self.what}{shown}: {error}") from None

    def _place(self, key: Words) -> tuple[Selector, ...]:
        found = words(key)
        if len(found) != len(self.parents):
            raise ModelError(
                f"{len(found)} values are given for {len(self.parents)} variables: {', '.join(self.parents)}"
            )
        return tuple(
            word if word in (ALL, EACH) else self.scope[name].index(word)
            for name, word in zip(self.parents, found, strict=True)
        )

    def _word(self, place: Sequence[Selector], row: str) -> None:
        """A certain value for each child, or one of the words for a whole distribution."""
        if _is_value(self.scope, self.children, row):
            self._some(place, {row: 1.0})
        elif row == UNIFORM:
            count = int(np.prod([len(self.scope[child].values) for child in self.children]))
            loose = [ALL if selector == EACH else selector for selector in place]
            self.cells.put([*loose, *(ALL for _ in self.children)], 1.0 / count)
        elif row == SAME:
            self._same(place)
        else:
            self._outcome(row)  # names the word that is no value

    def _same(self, place: Sequence[Selector]) -> None:
        before = [child.removesuffix(AFTER) for child in self.children]
        if before == list(self.children):
            raise ModelError(f"{SAME!r} is for a state after an action")
        for name in before:
            if name not in self.parents:
                raise ModelError(f"{SAME!r} needs {name!r} among the variables it depends on")
        axes = [self.parents.index(name) for name in before]
        kept = [
            np.arange(self.cells.sizes[axis]) if isinstance(place[axis], str) else np.array([place[axis]])
            for axis in axes
        ]
        held = [index.reshape(-1) for index in np.meshgrid(*kept, indexing="ij")]
        loose = [ALL if selector == EACH else selector for selector in place]
        for axis in axes:
            loose[axis] = EACH if isinstance(place[axis], str) else place[axis]
        parents = [held[axes.index(axis)] for axis, selector in enumerate(loose) if selector == EACH]
        self.cells.put_some(
            [*loose, *(EACH for _ in self.children)], [*parents, *held], np.ones(len(held[0]))
        )

    def _some(self, place: Sequence[Selector], row: Mapping[str, float]) -> None:
        """Probabilities of some outcomes."""
        outcomes = [self._outcome(key) for key in row]
        loose = [ALL if selector == EACH else selector for selector in place]
        index = [np.array(axis) for axis in zip(*outcomes, strict=True)] or [np.zeros(0)] * len(self.children)
        self.cells.put_some([*loose, *(EACH for _ in self.children)], index, _finite(list(row.values())))

    def _outcome(self, key: Words) -> tuple[int, ...]:
        found = words(key) if len(self.children) > 1 else (str(key),)
        if len(found) != len(self.children):
            raise ModelError(f"{key!r} must be a value of each of {', '.join(self.children)}")
        return tuple(self.scope[child].index(word) for child, word in zip(self.children, found, strict=True))

    def _numbers(self, place: Sequence[Selector], row: Row) -> None:
        """An array with an axis for each `EACH`."""
        if isinstance(row, str | Mapping):
            raise ModelError(f"expected a number, found {row!r}")
        array = _finite(row)
        names = (*self.parents, *self.children)
        axes = [(names[i], self.cells.sizes[i]) for i, selector in enumerate(place) if selector == EACH]
        if array.shape != tuple(n for _, n in axes):
            wanted = " by ".join(f"{n} (the values of {name!r})" for name, n in axes)
            raise ModelError(f"expected {wanted or 'one'} numbers, found the shape {array.shape}")
        self.cells.put(place, array)


def _finite(numbers: npt.ArrayLike) -> npt.NDArray[np.float64]:
    try:
        array = np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError):
        raise ModelError(f"expected numbers, found {numbers!r}") from None
    if not np.isfinite(array).all():
        raise ModelError("a number is not finite")
    return array


def _is_value(scope: Scope, children: Sequence[str], word: str) -> bool:
    return len(children) == 1 and word in scope[children[0]].values


def _known(scope: Mapping[str, Variable]) -> str:
    return "known are " + ", ".join(scope)
