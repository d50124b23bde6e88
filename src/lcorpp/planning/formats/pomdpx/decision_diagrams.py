"""Decision diagrams of PomdpX: each path to a number sets it for all cases that agree with the path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcorpp.errors import expected_one_of
from lcorpp.planning.factored.table_builder import Selector, TableBuilder
from lcorpp.planning.factored.variables import AFTER, ALL, EACH
from lcorpp.planning.formats.pomdpx.document import Element
from lcorpp.planning.formats.pomdpx.tables import Function, check_probabilities

MAX_BRANCHES = 2**20
"""Maximum number of branches visited: nested templates multiply, so a small file can describe a huge tree."""

_SHORTHAND_ATTRIBUTES = {
    "deterministic": ("type", "var", "val"),
    "persistent": ("type", "var"),
    "uniform": ("type", "var"),
    "template": ("type", "idref"),
}

_BRANCH_ATTRIBUTES = {"DAG": (), "Edge": ("val",), "SubDAGTemplate": ("id",)}


class DiagramReader:
    """Puts the numbers of a decision diagram into the table of its function; cases without a path are 0."""

    def __init__(self, function: Function, builder: TableBuilder) -> None:
        self.function, self.builder = function, builder
        self.document = function.declarations.document
        self.error = self.document.error
        self.templates: dict[str, Element] = {}

    def read(self) -> None:
        """Raise a ParseError if the diagram is malformed, has a cycle or too many branches."""
        parameter, document = self.function.parameter, self.document
        for child in document.check_children(parameter, ("DAG", "SubDAGTemplate"), ("type",)):
            if child.name == "SubDAGTemplate":
                name = document.attribute(child, "id")
                if name in self.templates:
                    raise self.error(child, f"a second template {name!r}")
                self.templates[name] = child
        root = document.only_child(parameter, "DAG")
        # depth-first without recursion: parent element, cases on its path, templates in a row before it
        everything = (ALL,) * len(self.builder.sizes)
        stack: list[tuple[Element, tuple[Selector, ...], int]] = [(root, everything, 0)]
        branches = 0
        while stack:
            branches += 1
            if branches > MAX_BRANCHES:
                raise self.error(root, f"the decision diagram has over {MAX_BRANCHES} branches")
            parent, place, templates = stack.pop()
            document.check_children(parent, ("Node", "SubDAG", "Terminal"), _BRANCH_ATTRIBUTES[parent.name])
            branch = document.only_child(parent, "Node", "SubDAG", "Terminal")
            if branch.name == "Node":
                stack += [(edge, next_place, 0) for edge, next_place in self._read_edges(branch, place)]
            elif branch.name == "Terminal":
                value = document.number(branch)
                if self.function.children:
                    check_probabilities(document, branch, np.array([value]))
                self.builder.put(place, value)
            elif self._read_shorthand_type(branch) == "template":
                stack.append((self._find_template(branch, templates), place, templates + 1))
            else:
                self._put_shorthand(branch, place)

    def _find_template(self, element: Element, nesting: int) -> Element:
        name = self.document.attribute(element, "idref")
        if name not in self.templates:
            raise self.error(element, f"unknown template {name!r}; {expected_one_of(self.templates)}")
        if nesting >= len(self.templates):
            raise self.error(element, f"template {name!r} contains itself")
        return self.templates[name]

    def _read_edges(
        self, node: Element, place: Sequence[Selector]
    ) -> list[tuple[Element, tuple[Selector, ...]]]:
        edges = self.document.check_children(node, ("Edge",), ("var",))
        axis = self._find_axis(node, place)
        edge_of: dict[int, Element] = {}
        for edge in edges:
            value = self._read_value(edge, axis)
            if value in edge_of:
                raise self.error(edge, f"a second edge for {edge.attributes['val']!r}")
            edge_of[value] = edge
        if not edge_of:
            raise self.error(node, "<Node> needs <Edge>")
        return [(edge, (*place[:axis], value, *place[axis + 1 :])) for value, edge in edge_of.items()]

    def _read_shorthand_type(self, element: Element) -> str:
        kind = self.document.attribute(element, "type")
        if kind not in _SHORTHAND_ATTRIBUTES:
            raise self.error(element, f"unknown type {kind!r}; {expected_one_of(_SHORTHAND_ATTRIBUTES)}")
        self.document.check_children(element, (), _SHORTHAND_ATTRIBUTES[kind])
        if kind != "template" and not self.function.children:
            raise self.error(element, f"{kind!r} is for probabilities, not for rewards")
        return kind

    def _put_shorthand(self, element: Element, place: Sequence[Selector]) -> None:
        """Put the distribution of one variable that a keyword describes."""
        axis = self._find_axis(element, place)
        if axis < len(self.function.parents):
            name = element.attributes["var"]
            raise self.error(element, f"{name!r} is a parent here; expected the variable itself")
        kind, size = element.attributes["type"], self.builder.sizes[axis]
        if kind == "uniform":
            self.builder.put(place, 1.0 / size)
        elif kind == "deterministic":
            self.builder.put((*place[:axis], self._read_value(element, axis), *place[axis + 1 :]), 1.0)
        else:
            self._put_persistent(element, place, axis)

    def _put_persistent(self, element: Element, place: Sequence[Selector], axis: int) -> None:
        before = self.function.names[axis].removesuffix(AFTER)
        if before == self.function.names[axis] or before not in self.function.parents:
            raise self.error(element, "'persistent' needs the value before the action as a parent")
        parent_axis = self.function.parents.index(before)
        equal = list(place)
        if place[parent_axis] == ALL:
            diagonal = np.arange(self.builder.sizes[axis])
            equal[parent_axis] = equal[axis] = EACH
            self.builder.put_entries(equal, (diagonal, diagonal), np.ones(len(diagonal)))
        else:
            equal[axis] = place[parent_axis]
            self.builder.put(equal, 1.0)

    def _find_axis(self, element: Element, place: Sequence[Selector]) -> int:
        """Return the axis of an element's variable, which must not occur earlier on the path."""
        name = self.document.attribute(element, "var")
        names, function = self.function.declarations.names, self.function
        if names.get(name) not in function.names:
            known = [theirs for theirs, ours in names.items() if ours in function.names]
            raise self.error(element, f"unknown variable {name!r} here; {expected_one_of(known)}")
        axis = function.names.index(names[name])
        if place[axis] != ALL:
            raise self.error(element, f"{name!r} already has a value on this path")
        return axis

    def _read_value(self, element: Element, axis: int) -> int:
        value, known = self.document.attribute(element, "val"), self.function.value_indices[axis]
        if value not in known:
            name = self.function.names[axis]
            raise self.error(element, f"unknown value {value!r} of {name!r}; {expected_one_of(known)}")
        return known[value]
