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
from lcorpp.planning.factored.variables import AFTER
from lcorpp.planning.formats.memory import report_full_memory
from lcorpp.planning.formats.pomdpx.decision_diagrams import DiagramReader
from lcorpp.planning.formats.pomdpx.declarations import Declarations
from lcorpp.planning.formats.pomdpx.document import Document, Element
from lcorpp.planning.formats.pomdpx.tables import Function, normalize_rows, read_entries
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

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_pomdpx, write_pomdpx
        >>> write_pomdpx(load_domain("intention").pomdp, "intention.pomdpx")
        >>> read_pomdpx("intention.pomdpx").actions[:2]
        ('move_forward', 'greet')
    """
    problem = read_factored(path)
    try:
        with report_full_memory(path):
            return flatten(problem, reachable=reachable)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None


def read_factored(path: str | Path) -> Factored:
    """Read a .pomdpx file as a factored problem.

    Raises:
        FileError: the file cannot be read.
        ParseError: it is malformed; the message has file, line and column.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_factored, write_pomdpx
        >>> write_pomdpx(load_domain("intention").pomdp, "intention.pomdpx")
        >>> [len(variable.values) for variable in read_factored("intention.pomdpx").states]
        [5]
    """
    with report_full_memory(path):
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

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import format_pomdpx, parse_pomdpx
        >>> parse_pomdpx(format_pomdpx(load_domain("intention").pomdp)).discount
        0.99
    """
    return _ProblemReader(Document(text, file, "pomdpx")).read()


class _ProblemReader:
    """Builds the problem from the elements of a document."""

    def __init__(self, document: Document) -> None:
        self.document, root = document, document.root
        self.parts = document.check_children(root, _PARTS, tuple(root.attributes))
        self.declarations = Declarations(document, document.only_child(root, "Variable"))

    def read(self) -> Factored:
        document, declarations = self.document, self.declarations
        element = document.only_child(document.root, "Discount")
        discount = document.number(element)
        if not 0 <= discount <= 1:
            raise document.error(element, discount_message(discount), 0)
        for part in self.parts:
            if part.name == "Horizon" and document.word(part).lower() not in _INFINITE_HORIZON:
                raise document.error(part, "finite horizons are not supported; expected an infinite one", 0)
        variables = declarations.states, declarations.actions, declarations.observations
        before, actions, observations = ([variable.name for variable in kind] for kind in variables)
        after = [name + AFTER for name in before]
        try:
            return Factored(
                *variables,
                self._read_start(before),
                self._read_tables("StateTransitionFunction", after, [*actions, *before, *after]),
                self._read_tables("ObsFunction", observations, [*actions, *after, *observations]),
                self._read_rewards([*actions, *before, *after, *observations]),
                discount,
                document.file,
            )
        except ModelError as error:
            raise document.error(document.root, str(error)) from None

    def _find_functions(self, section: str, kind: str) -> Iterator[tuple[Element, Element]]:
        """Yield the functions of a section, each with its ``<Var>``."""
        for part in self.parts:
            for element in self.document.check_children(part, (kind,)) if part.name == section else ():
                self.document.check_children(element, ("Var", "Parent", "Parameter"))
                yield element, self.document.only_child(element, "Var")

    def _read_start(self, names: Sequence[str]) -> tuple[Table, ...]:
        if any(part.name == "InitialStateBelief" for part in self.parts):
            return self._read_tables("InitialStateBelief", names, names)
        if not all(variable.observed for variable in self.declarations.states):
            raise self.document.error(self.document.root, "<pomdpx> needs <InitialStateBelief>")
        return tuple(build_table(self.declarations.scope, "uniform", (name,), "start") for name in names)

    def _read_tables(
        self, section: str, children: Sequence[str], parents: Sequence[str]
    ) -> tuple[Table, ...]:
        """Return the tables of a section, one for each child variable."""
        document = self.document
        tables = []
        done: set[str] = set()
        for element, variable in self._find_functions(section, "CondProb"):
            names = self._read_names(variable, children)
            for i, name in enumerate(names):
                if name in done:
                    raise document.error(variable, f"a second <CondProb> for {variable.words()[i]!r}", i)
            done.update(names)
            if not names:
                raise document.error(variable, "<Var> names no variable")
            tables.append(self._read_table(element, parents, names))
        for file_name, name in self.declarations.names.items():
            if name in children and name not in done:
                place = next((part for part in self.parts if part.name == section), document.root)
                raise document.error(place, f"there is no <CondProb> for {file_name!r} in <{section}>")
        return tuple(tables)

    def _read_rewards(self, parents: Sequence[str]) -> dict[str, Table]:
        document, rewards = self.document, self.declarations.rewards
        tables: dict[str, Table] = {}
        for element, variable in self._find_functions("RewardFunction", "Func"):
            name = document.word(variable)
            if name not in rewards:
                raise document.error(variable, f"unknown reward {name!r}; {expected_one_of(rewards)}", 0)
            if name in tables:
                raise document.error(variable, f"a second <Func> for {name!r}", 0)
            tables[name] = self._read_table(element, parents, ())
        for name, element in rewards.items():
            if name not in tables:
                raise document.error(element, f"there is no <Func> for {name!r} in <RewardFunction>")
        return {name: tables[name] for name in rewards}

    def _read_table(self, element: Element, parents: Sequence[str], children: tuple[str, ...]) -> Table:
        """Return the table of a function, given by entries or by a decision diagram."""
        document = self.document
        names = self._read_names(document.only_child(element, "Parent"), parents, children)
        parameter = document.only_child(element, "Parameter")
        function = Function(self.declarations, parameter, names, children)
        kind = document.attribute(parameter, "type", "TBL").strip()
        if kind not in ("TBL", "DD"):
            raise document.error(parameter, f"unknown parameter type {kind!r}; expected TBL or DD")
        try:
            builder = TableBuilder(self.declarations.scope, names, children)
            read_entries(function, builder) if kind == "TBL" else DiagramReader(function, builder).read()
            table = builder.build()
        except ModelError as error:
            raise document.error(parameter, str(error)) from None
        return normalize_rows(function, table) if children else table

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
