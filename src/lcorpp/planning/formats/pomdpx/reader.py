"""Reading PomdpX, the XML format of factored problems with observed parts, as published files use it.

The format: http://bigbird.comp.nus.edu.sg/pmwiki/farm/appl/index.php?n=Main.PomdpXDocumentation, versions 0.1
and 1.0, tables as well as decision diagrams. Functions may come in any order, and before the variables.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.files import read_bytes
from lcorpp.planning.factored.cpt import build_table
from lcorpp.planning.factored.flatten import flatten
from lcorpp.planning.factored.model import Factored
from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.table_builder import TableBuilder
from lcorpp.planning.factored.variables import AFTER, build_scope
from lcorpp.planning.formats.pomdpx.decision_diagrams import read_diagram
from lcorpp.planning.formats.pomdpx.tables import Function, Source, checked, read_entries
from lcorpp.planning.formats.pomdpx.variables import Declared
from lcorpp.planning.formats.pomdpx.xml import Document, Element
from lcorpp.planning.pomdp import Pomdp, discount_message

_SECTIONS = ("InitialStateBelief", "StateTransitionFunction", "ObsFunction", "RewardFunction")
_PARTS = ("Description", "Discount", "Horizon", "Variable", *_SECTIONS)
_ENDLESS = ("inf", "infinite", "infinity")


def read_pomdpx(path: str | Path, *, reachable: bool = False) -> Pomdp:
    """Read a .pomdpx file as a flat problem, see `flatten`.

    Args:
        reachable: leave out the states that the start cannot lead to.

    Raises:
        FileError: the file cannot be read.
        ParseError: it is malformed; file, line and column are told.
        ModelError: the problem is too large to be written out.
    """
    problem = read_factored(path)
    try:
        return flatten(problem, reachable=reachable)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None


def read_factored(path: str | Path) -> Factored:
    """Read a .pomdpx file with its variables.

    Raises:
        FileError: the file cannot be read.
        ParseError: it is malformed; file, line and column are told.
    """
    return parse_pomdpx(read_bytes(path), file=str(path))


def parse_pomdpx(text: str | bytes, *, file: str = "<text>") -> Factored:
    """The problem that a text in PomdpX format describes.

    A state variable is called as in the file, less the ``_0`` and ``_1`` that tell before from after. Rows
    that sum to 1 within 1e-4 are normalised. Without a start belief, which only a
    problem without hidden parts may lack, every state is equally likely.

    Args:
        text: the text, or the bytes of a file in the encoding that its first line tells.
        file: its name, for messages.

    Raises:
        ParseError: it is malformed; file, line and column are told.
    """
    return _Reader(Document(text, file, "pomdpx")).read()


class _Reader:
    """The problem in the elements of a document."""

    def __init__(self, document: Document) -> None:
        self.document, root = document, document.root
        self.parts = document.children(root, _PARTS, tuple(root.attributes))
        self.declared = Declared(document, document.only(root, "Variable"))

    def read(self) -> Factored:
        document, declared = self.document, self.declared
        discount = self._discount(document.only(document.root, "Discount"))
        for part in self.parts:
            if part.name == "Horizon" and document.word(part).lower() not in _ENDLESS:
                raise document.error(part, "a horizon is refused: problems without an end are read", 0)
        states, actions, seen = declared.states, declared.actions, declared.observations
        before, after = [v.name for v in states], [v.name + AFTER for v in states]
        acts, looks = [v.name for v in actions], [v.name for v in seen]
        try:
            self.source = Source(document, build_scope(states, actions, seen), declared.names)
            return Factored(
                states,
                actions,
                seen,
                self._start(before),
                self._tables("StateTransitionFunction", after, [*acts, *before, *after]),
                self._tables("ObsFunction", looks, [*acts, *after, *looks]),
                self._rewards([*acts, *before, *after, *looks]),
                discount,
                document.file,
            )
        except ModelError as error:
            raise document.error(document.root, str(error)) from None

    def _discount(self, element: Element) -> float:
        self.document.word(element)
        discount = float(self.document.numbers(element)[0])
        if not 0 < discount < 1:
            raise self.document.error(element, discount_message(discount), 0)
        return discount

    def _functions(self, section: str, kind: str) -> Iterator[Element]:
        for part in self.parts:
            if part.name == section:
                yield from self.document.children(part, (kind,))

    def _start(self, names: Sequence[str]) -> tuple[Table, ...]:
        if any(part.name == "InitialStateBelief" for part in self.parts):
            return self._tables("InitialStateBelief", names, names)
        if not all(variable.observed for variable in self.declared.states):
            raise self.document.error(self.document.root, "<pomdpx> needs <InitialStateBelief>")
        return tuple(build_table(self.source.scope, "uniform", (name,), "start") for name in names)

    def _tables(self, section: str, children: Sequence[str], parents: Sequence[str]) -> tuple[Table, ...]:
        """The tables of a section, which are to be about these children."""
        document = self.document
        tables = []
        taken: set[str] = set()
        for element in self._functions(section, "CondProb"):
            document.children(element, ("Var", "Parent", "Parameter"))
            variable = document.only(element, "Var")
            names = self._names(variable, children)
            for i, name in enumerate(names):
                if name in taken:
                    raise document.error(variable, f"a second <CondProb> for {variable.words()[i]!r}", i)
            taken.update(names)
            if not names:
                raise document.error(variable, "<Var> names no variable")
            given = self._names(document.only(element, "Parent"), parents, names)
            tables.append(
                self._table(Function(self.source, document.only(element, "Parameter"), given, names))
            )
        for theirs, name in self.declared.names.items():
            if name in children and name not in taken:
                place = next((part for part in self.parts if part.name == section), document.root)
                raise document.error(place, f"there is no <CondProb> for {theirs!r} in <{section}>")
        return tuple(tables)

    def _rewards(self, parents: Sequence[str]) -> dict[str, Table]:
        document = self.document
        tables: dict[str, Table] = {}
        for element in self._functions("RewardFunction", "Func"):
            document.children(element, ("Var", "Parent", "Parameter"))
            variable = document.only(element, "Var")
            name = document.word(variable)
            if name not in self.declared.rewards:
                raise document.error(
                    variable, f"unknown reward {name!r}; {expected_one_of(tuple(self.declared.rewards))}", 0
                )
            if name in tables:
                raise document.error(variable, f"a second <Func> for {name!r}", 0)
            names = self._names(document.only(element, "Parent"), parents)
            function = Function(self.source, document.only(element, "Parameter"), names, ())
            tables[name] = self._table(function)
        for name, element in self.declared.rewards.items():
            if name not in tables:
                raise document.error(element, f"there is no <Func> for {name!r} in <RewardFunction>")
        return {name: tables[name] for name in self.declared.rewards}

    def _table(self, function: Function) -> Table:
        """The table of a function, whichever way it is written down."""
        document, parameter = self.document, function.parameter
        kind = document.attribute(parameter, "type", "TBL").strip()
        if kind not in ("TBL", "DD"):
            raise document.error(parameter, f"a parameter of type {kind!r} is not read; expected TBL or DD")
        try:
            cells = TableBuilder(function.source.scope, function.parents, function.children)
            read_entries(function, cells) if kind == "TBL" else read_diagram(function, cells)
            table = cells.build()
        except ModelError as error:
            raise document.error(parameter, str(error)) from None
        return checked(function, table) if function.children else table

    def _names(self, element: Element, allowed: Sequence[str], taken: Sequence[str] = ()) -> tuple[str, ...]:
        """The variables that an element names, as we call them; `null` for none."""
        words = self.document.words(element)
        if words == ["null"] and element.name == "Parent":
            return ()
        found: list[str] = []
        for i, word in enumerate(words):
            name = self.declared.names.get(word)
            if name is None or name not in allowed:
                theirs = [theirs for theirs, ours in self.declared.names.items() if ours in allowed]
                what = f"{word!r} cannot stand here" if name else f"unknown variable {word!r}"
                raise self.document.error(element, f"{what}; {expected_one_of(theirs)}", i)
            if name in found or name in taken:
                raise self.document.error(element, f"{word!r} is named twice", i)
            found.append(name)
        return tuple(found)
