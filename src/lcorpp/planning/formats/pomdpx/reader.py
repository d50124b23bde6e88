"""Read PomdpX, the XML format of factored POMDPs with mixed observability, as published files use it.

The format: http://bigbird.comp.nus.edu.sg/pmwiki/farm/appl/index.php?n=Main.PomdpXDocumentation, versions 0.1
and 1.0, tables and decision diagrams. Functions may be in any order, also before the variables.
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
from lcorpp.planning.formats.pomdpx.document import Document, Element
from lcorpp.planning.formats.pomdpx.tables import Context, Function, normalize_rows, read_entries
from lcorpp.planning.formats.pomdpx.variables import Declarations
from lcorpp.planning.pomdp import Pomdp, discount_message

_SECTIONS = ("InitialStateBelief", "StateTransitionFunction", "ObsFunction", "RewardFunction")
_PARTS = ("Description", "Discount", "Horizon", "Variable", *_SECTIONS)
_INFINITE_HORIZON = ("inf", "infinite", "infinity")


def read_pomdpx(path: str | Path, *, reachable: bool = False) -> Pomdp:
    """Read a .pomdpx file as a flat POMDP, see `flatten`.

    Args:
        reachable: keep only states that are reachable from the initial belief.

    Raises:
        FileError: the file cannot be read.
        ParseError: it is malformed; the message has file, line and column.
        ModelError: the flat problem would be too large.
    """
    problem = read_factored(path)
    try:
        return flatten(problem, reachable=reachable)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None


def read_factored(path: str | Path) -> Factored:
    """Read a .pomdpx file as a factored problem.

    Raises:
        FileError: the file cannot be read.
        ParseError: it is malformed; the message has file, line and column.
    """
    return parse_pomdpx(read_bytes(path), file=str(path))


def parse_pomdpx(text: str | bytes, *, file: str = "<text>") -> Factored:
    """Parse a text in PomdpX format.

    State variables lose the suffixes ``_0`` and ``_1``, which mean before and after an action. Rows that sum
    to 1 within 1e-4 are normalised. The initial belief may only be missing if all state variables are
    observed; it is uniform then.

    Args:
        text: the text, or the bytes of a file in the encoding that its first line declares.
        file: its name, for messages.

    Raises:
        ParseError: it is malformed; the message has file, line and column.
    """
    return _Reader(Document(text, file, "pomdpx")).read()


class _Reader:
    """Builds the problem from the elements of a document."""

    def __init__(self, document: Document) -> None:
        self.document, root = document, document.root
        self.parts = document.children(root, _PARTS, tuple(root.attributes))
        self.declarations = Declarations(document, document.only_child(root, "Variable"))

    def read(self) -> Factored:
        document, declarations = self.document, self.declarations
        discount = self._read_discount(document.only_child(document.root, "Discount"))
        for part in self.parts:
            if part.name == "Horizon" and document.word(part).lower() not in _INFINITE_HORIZON:
                raise document.error(part, "finite horizons are not supported; expected an infinite one", 0)
        states, actions, observations = declarations.states, declarations.actions, declarations.observations
        before, after = [v.name for v in states], [v.name + AFTER for v in states]
        action_names, observation_names = [v.name for v in actions], [v.name for v in observations]
        try:
            self.context = Context(document, build_scope(states, actions, observations), declarations.names)
            return Factored(
                states,
                actions,
                observations,
                self._read_start(before),
                self._read_tables("StateTransitionFunction", after, [*action_names, *before, *after]),
                self._read_tables(
                    "ObsFunction", observation_names, [*action_names, *after, *observation_names]
                ),
                self._read_rewards([*action_names, *before, *after, *observation_names]),
                discount,
                document.file,
            )
        except ModelError as error:
            raise document.error(document.root, str(error)) from None

    def _read_discount(self, element: Element) -> float:
        self.document.word(element)
        discount = float(self.document.numbers(element)[0])
        if not 0 < discount < 1:
            raise self.document.error(element, discount_message(discount), 0)
        return discount

    def _find_function_elements(self, section: str, kind: str) -> Iterator[Element]:
        for part in self.parts:
            if part.name == section:
                yield from self.document.children(part, (kind,))

    def _read_start(self, names: Sequence[str]) -> tuple[Table, ...]:
        if any(part.name == "InitialStateBelief" for part in self.parts):
            return self._read_tables("InitialStateBelief", names, names)
        if not all(variable.observed for variable in self.declarations.states):
            raise self.document.error(self.document.root, "<pomdpx> needs <InitialStateBelief>")
        return tuple(build_table(self.context.scope, "uniform", (name,), "start") for name in names)

    def _read_tables(
        self, section: str, children: Sequence[str], parents: Sequence[str]
    ) -> tuple[Table, ...]:
        """Return the tables of a section, one for each child variable."""
        document = self.document
        tables = []
        done: set[str] = set()
        for element in self._find_function_elements(section, "CondProb"):
            document.children(element, ("Var", "Parent", "Parameter"))
            variable = document.only_child(element, "Var")
            names = self._read_names(variable, children)
            for i, name in enumerate(names):
                if name in done:
                    raise document.error(variable, f"a second <CondProb> for {variable.words()[i]!r}", i)
            done.update(names)
            if not names:
                raise document.error(variable, "<Var> names no variable")
            parent_names = self._read_names(document.only_child(element, "Parent"), parents, names)
            parameter = document.only_child(element, "Parameter")
            tables.append(self._read_table(Function(self.context, parameter, parent_names, names)))
        for file_name, name in self.declarations.names.items():
            if name in children and name not in done:
                place = next((part for part in self.parts if part.name == section), document.root)
                raise document.error(place, f"there is no <CondProb> for {file_name!r} in <{section}>")
        return tuple(tables)

    def _read_rewards(self, parents: Sequence[str]) -> dict[str, Table]:
        document = self.document
        tables: dict[str, Table] = {}
        for element in self._find_function_elements("RewardFunction", "Func"):
            document.children(element, ("Var", "Parent", "Parameter"))
            variable = document.only_child(element, "Var")
            name = document.word(variable)
            if name not in self.declarations.rewards:
                raise document.error(
                    variable,
                    f"unknown reward {name!r}; {expected_one_of(tuple(self.declarations.rewards))}",
                    0,
                )
            if name in tables:
                raise document.error(variable, f"a second <Func> for {name!r}", 0)
            names = self._read_names(document.only_child(element, "Parent"), parents)
            function = Function(self.context, document.only_child(element, "Parameter"), names, ())
            tables[name] = self._read_table(function)
        for name, element in self.declarations.rewards.items():
            if name not in tables:
                raise document.error(element, f"there is no <Func> for {name!r} in <RewardFunction>")
        return {name: tables[name] for name in self.declarations.rewards}

    def _read_table(self, function: Function) -> Table:
        """Return the table of a function, given by entries or by a decision diagram."""
        document, parameter = self.document, function.parameter
        kind = document.attribute(parameter, "type", "TBL").strip()
        if kind not in ("TBL", "DD"):
            raise document.error(parameter, f"unknown parameter type {kind!r}; expected TBL or DD")
        try:
            builder = TableBuilder(function.context.scope, function.parents, function.children)
            read_entries(function, builder) if kind == "TBL" else read_diagram(function, builder)
            table = builder.build()
        except ModelError as error:
            raise document.error(parameter, str(error)) from None
        return normalize_rows(function, table) if function.children else table

    def _read_names(
        self, element: Element, allowed: Sequence[str], taken: Sequence[str] = ()
    ) -> tuple[str, ...]:
        """Return our names of the variables that an element lists; `null` is the empty list."""
        words = self.document.words(element)
        if words == ["null"] and element.name == "Parent":
            return ()
        names: list[str] = []
        for i, word in enumerate(words):
            name = self.declarations.names.get(word)
            if name is None or name not in allowed:
                theirs = [theirs for theirs, ours in self.declarations.names.items() if ours in allowed]
                what = f"{word!r} is not allowed here" if name else f"unknown variable {word!r}"
                raise self.document.error(element, f"{what}; {expected_one_of(theirs)}", i)
            if name in names or name in taken:
                raise self.document.error(element, f"{word!r} is named twice", i)
            names.append(name)
        return tuple(names)
