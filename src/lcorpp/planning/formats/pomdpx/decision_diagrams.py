"""The decision diagrams of PomdpX: a path to a number says what holds in all cases that agree with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcorpp.errors import expected_one_of
from lcorpp.planning.factored.table_builder import Selector, TableBuilder
from lcorpp.planning.factored.variables import AFTER, ALL, EACH
from lcorpp.planning.formats.pomdpx.tables import Function, check_probabilities
from lcorpp.planning.formats.pomdpx.xml import Element

MAX_STEPS = 2**20
"""The most branches followed: templates within templates multiply, so that small files may be huge."""

_SHORTHANDS = {
    "deterministic": ("type", "var", "val"),
    "persistent": ("type", "var"),
    "uniform": ("type", "var"),
    "template": ("type", "idref"),
}

_HOLDERS = {"DAG": (), "Edge": ("val",), "SubDAGTemplate": ("id",)}


def read_diagram(function: Function, cells: TableBuilder) -> None:
    """Put what the decision diagram of a function says into a table; cases that no path agrees with are 0.

    Raises:
        ParseError: it is malformed, goes round in a circle or has too many branches.
    """
    _Diagram(function, cells).read()


class _Diagram:
    def __init__(self, function: Function, cells: TableBuilder) -> None:
        self.function, self.cells = function, cells
        self.document = function.source.document
        self.templates: dict[str, Element] = {}

    def read(self) -> None:
        parameter, document = self.function.parameter, self.document
        for child in document.children(parameter, ("DAG", "SubDAGTemplate"), ("type",)):
            if child.name == "SubDAGTemplate":
                name = document.attribute(child, "id")
                if name in self.templates:
                    raise document.error(child, f"a second template {name!r}")
                self.templates[name] = child
        root = document.only(parameter, "DAG")
        # what holds a branch, the cases that lead there, how many templates on end; too deep to be recursive
        ahead: list[tuple[Element, tuple[Selector, ...], int]] = [(root, (ALL,) * len(self.cells.sizes), 0)]
        steps = 0
        while ahead:
            steps += 1
            if steps > MAX_STEPS:
                raise document.error(root, f"the decision diagram has over {MAX_STEPS} branches")
            holder, place, templates = ahead.pop()
            document.children(holder, ("Node", "SubDAG", "Terminal"), _HOLDERS[holder.name])
            branch = document.only(holder, "Node", "SubDAG", "Terminal")
            if branch.name == "Node":
                ahead += [(edge, taken, 0) for edge, taken in self._edges(branch, place)]
            elif branch.name == "Terminal":
                self._terminal(branch, place)
            elif self._kind(branch) == "template":
                ahead.append((self._template(branch, templates), place, templates + 1))
            else:
                self._shorthand(branch, place)

    def _template(self, element: Element, before: int) -> Element:
        name = self.document.attribute(element, "idref")
        if name not in self.templates:
            raise self.document.error(
                element, f"unknown template {name!r}; {expected_one_of(tuple(self.templates))}"
            )
        if before >= len(self.templates):
            raise self.document.error(element, f"template {name!r} is within itself")
        return self.templates[name]

    def _edges(self, node: Element, place: Sequence[Selector]) -> list[tuple[Element, tuple[Selector, ...]]]:
        edges = self.document.children(node, ("Edge",), ("var",))
        axis = self._axis(node, place)
        found: dict[int, Element] = {}
        for edge in edges:
            value = self._value(edge, axis)
            if value in found:
                raise self.document.error(edge, f"a second edge for {edge.attributes['val']!r}")
            found[value] = edge
        if not found:
            raise self.document.error(node, "<Node> needs <Edge>")
        return [(edge, (*place[:axis], value, *place[axis + 1 :])) for value, edge in found.items()]

    def _terminal(self, element: Element, place: Sequence[Selector]) -> None:
        self.document.word(element)
        value = self.document.numbers(element)
        if self.function.children:
            check_probabilities(self.document, element, value)
        self.cells.put(place, value[0])

    def _kind(self, element: Element) -> str:
        kind = self.document.attribute(element, "type")
        if kind not in _SHORTHANDS:
            raise self.document.error(
                element, f"unknown type {kind!r}; {expected_one_of(tuple(_SHORTHANDS))}"
            )
        self.document.children(element, (), _SHORTHANDS[kind])
        if kind != "template" and not self.function.children:
            raise self.document.error(element, f"{kind!r} is for probabilities, not for rewards")
        return kind

    def _shorthand(self, element: Element, place: Sequence[Selector]) -> None:
        """A distribution over one variable in a word."""
        axis = self._axis(element, place)
        if axis < len(self.function.parents):
            name = element.attributes["var"]
            raise self.document.error(element, f"{name!r} is given here; expected the variable itself")
        kind, size = element.attributes["type"], self.cells.sizes[axis]
        if kind == "uniform":
            self.cells.put(place, 1.0 / size)
        elif kind == "deterministic":
            self.cells.put((*place[:axis], self._value(element, axis), *place[axis + 1 :]), 1.0)
        else:
            self._persistent(element, place, axis)

    def _persistent(self, element: Element, place: Sequence[Selector], axis: int) -> None:
        before = self.function.names[axis].removesuffix(AFTER)
        if before == self.function.names[axis] or before not in self.function.parents:
            raise self.document.error(element, "'persistent' needs the value before the action as a parent")
        earlier = self.function.parents.index(before)
        both = list(place)
        if place[earlier] == ALL:
            diagonal = np.arange(self.cells.sizes[axis])
            both[earlier] = both[axis] = EACH
            self.cells.put_entries(both, (diagonal, diagonal), np.ones(len(diagonal)))
        else:
            both[axis] = place[earlier]
            self.cells.put(both, 1.0)

    def _axis(self, element: Element, place: Sequence[Selector]) -> int:
        """Which variable an element is about; on a path it is the first time."""
        theirs = self.document.attribute(element, "var")
        names, function = self.function.source.names, self.function
        if names.get(theirs) not in function.names:
            known = [theirs for theirs, ours in names.items() if ours in function.names]
            raise self.document.error(element, f"unknown variable {theirs!r} here; {expected_one_of(known)}")
        axis = function.names.index(names[theirs])
        if place[axis] != ALL:
            raise self.document.error(element, f"{theirs!r} is decided already on the way here")
        return axis

    def _value(self, element: Element, axis: int) -> int:
        value, known = self.document.attribute(element, "val"), self.function.numbers[axis]
        if value not in known:
            name = self.function.names[axis]
            raise self.document.error(
                element, f"unknown value {value!r} of {name!r}; {expected_one_of(tuple(known))}"
            )
        return known[value]
