"""P-log programs: immutable values, checked when they are created."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import ClassVar

from lcorpp.errors import ProgramError
from lcorpp.reasoning.language.checker import check_statement, check_statements
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.signature import Attribute, Signature
from lcorpp.reasoning.language.sorts import SortDefinition, SortSet
from lcorpp.reasoning.language.syntax import SEMANTICS, Query, Rule, Selection, Semantics, Statement, Term
from lcorpp.reasoning.language.traversal import map_literals
from lcorpp.reasoning.quoting import is_quoted

SHOWN_STATEMENTS = 100
"""Maximal number of statements that a notebook shows."""


@dataclass(frozen=True, repr=False)
class Program:
    """A checked program; `str` returns its text.

    file: the file name, for errors; equality ignores it.
    statements: the syntax tree.
    semantics: the meaning of `do` and Condition 1, "2009" or "2018"; see docs/reference/plog/semantics.md.
    names: of a translated program: its names with an apostrophe, and what they are in the source.
    signature: its declarations.

    Raises:
        ProgramError: a statement is ill-formed; the message begins with file, line and column.

    Examples:
        >>> from lcorpp import parse_plog
        >>> die = parse_plog("sides = {1..6}. roll : sides. random(roll).")
        >>> die.attributes["roll"].values
        ('1', '2', '3', '4', '5', '6')
    """

    has_tables: ClassVar[bool] = False
    """Whether its distributions are tables instead of pr-atoms: a Bayesian network."""

    file: str = field(compare=False)
    statements: tuple[Statement, ...]
    semantics: Semantics = "2009"
    names: Mapping[str, str] = field(default_factory=dict, compare=False)
    signature: Signature = field(init=False, compare=False)

    def __post_init__(self) -> None:
        if self.semantics not in SEMANTICS:
            raise ProgramError(f"semantics is {self.semantics!r}; expected {' or '.join(SEMANTICS)}")
        try:
            object.__setattr__(self, "signature", check_statements(self.statements))
        except SourceIssue as issue:
            raise ProgramError(str(issue)) from None

    @property
    def attributes(self) -> Mapping[str, Attribute]:
        """The declared attributes by name."""
        return self.signature.attributes

    @property
    def queries(self) -> tuple[Query, ...]:
        """The queries of the program in order."""
        return tuple(statement for statement in self.statements if isinstance(statement, Query))

    @cached_property
    def has_cr_rules(self) -> bool:
        """Whether the program has cr-rules, so that an observation can create possible worlds."""
        return any(isinstance(s, Rule | Selection) and s.is_cr_rule for s in self.statements)

    @cached_property
    def quoted_names(self) -> frozenset[str]:
        """The names of attributes and values that a program writes in quotes; queries need not."""
        members = (members for members in self.signature.sorts.values())
        return frozenset(filter(is_quoted, {*map(str, self.attributes), *chain.from_iterable(members)}))

    def has_term(self, name: object) -> bool:
        """Whether a text is the name of an attribute without arguments."""
        attribute = self.attributes.get(name) if isinstance(name, str) else None
        return attribute is not None and not attribute.arguments

    @cached_property
    def resolved_terms(self) -> dict[str, Term]:
        """Names that were resolved before, and their terms: a cache of `resolve.resolve_term`."""
        return {}

    def with_statements(self, statements: Iterable[Statement]) -> Program:
        """Return a program with other statements; the numbers of a network are then pr-atoms.

        Raises:
            ProgramError: a statement is ill-formed.
        """
        return Program(self.file, tuple(statements), self.semantics, self.names)

    def is_random(self, term: Term) -> bool:
        """Whether the attribute of a term has a random selection."""
        return term.name in self.signature.selections

    def resolve_query(self, query: Query) -> Query:
        """Return a query with resolved overloads after checking it against the program.

        Raises:
            SourceIssue: a name or value is unknown to the program.
        """
        query = map_literals(query, self.signature.resolve_overload)
        check_statement(query, self.signature)
        return query

    def __str__(self) -> str:
        return "".join(f"{line}\n" for line in self._format_lines())

    def __repr__(self) -> str:
        return (
            f"<Program {self.file}: {len(self.attributes)} attributes, {len(self.statements)} statements,"
            f" semantics of {self.semantics}>"
        )

    def _repr_html_(self) -> str:
        from html import escape  # its table of entities costs more than a small program

        lines = self._format_lines()
        if len(lines) > SHOWN_STATEMENTS:
            lines = [*lines[:SHOWN_STATEMENTS], f"% ... {len(lines) - SHOWN_STATEMENTS} more statements"]
        return f"<pre>{escape(chr(10).join(lines))}</pre>"

    def __reduce__(
        self,
    ) -> tuple[type[Program], tuple[str, tuple[Statement, ...], Semantics, Mapping[str, str]]]:
        return Program, (
            self.file,
            self.statements,
            self.semantics,
            self.names,
        )  # mapping proxies cannot be pickled

    def _format_lines(self) -> list[str]:
        """One line per statement; a directive selects the semantics if the text alone would not."""
        explicit = any(
            isinstance(s, SortDefinition) and not isinstance(s.sort, SortSet) for s in self.statements
        )
        directive = [f"#semantics {self.semantics}."] if explicit or self.semantics == "2018" else []
        return [*directive, *map(str, self.statements)]


def program_text(program: Program) -> str:
    """Return the canonical text of a program, one statement per line; it parses to an equal program.

    Examples:
        >>> from lcorpp.reasoning import parse_plog, program_text
        >>> print(program_text(parse_plog("rain: boolean. random( rain ).  % weather")))
        rain : boolean.
        random(rain).
    """
    return str(program)
