"""A P-log program as a value: checked when it is made, never changed, equal to what its text parses to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from lcorpp.errors import ProgramError
from lcorpp.reasoning.language.checker import check, check_query
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.signature import Attribute, Signature
from lcorpp.reasoning.language.syntax import CrRule, Query, Semantics, SortDefinition, Statement, Term
from lcorpp.reasoning.language.traversal import rename_query_terms


@dataclass(frozen=True)
class Program:
    """A checked program.

    file: where it was read, for errors; it takes no part in equality.
    statements: the syntax tree.
    semantics: what `do` and Condition 1 mean, "2009" or "2018"; see docs/plog.md.
    signature: the declarations found in it.

    Raises:
        ProgramError: a statement is ill-formed; the message begins with file, line and column.
    """

    file: str = field(compare=False)
    statements: tuple[Statement, ...]
    semantics: Semantics = "2009"
    signature: Signature = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "signature", check(self.statements))
        except SourceIssue as issue:
            raise ProgramError(str(issue)) from None

    @property
    def attributes(self) -> Mapping[str, Attribute]:
        """The declared attributes by name."""
        return self.signature.attributes

    @property
    def queries(self) -> tuple[Query, ...]:
        """The queries that stand in the program, in order."""
        return tuple(statement for statement in self.statements if isinstance(statement, Query))

    def is_random(self, term: Term) -> bool:
        """Whether the attribute of a term has a random selection."""
        return term.name in self.signature.selections

    @property
    def has_cr_rules(self) -> bool:
        """Whether there are cr-rules, so that an observation can create possible worlds."""
        return any(isinstance(statement, CrRule) for statement in self.statements)

    def resolve_query(self, query: Query) -> Query:
        """Return a query with resolved overloads after checking it against the program.

        Raises:
            SourceIssue: a name or value is unknown to the program.
        """
        query = rename_query_terms(query, self.signature.resolve_overload)
        check_query(query, self.signature)
        return query

    def __str__(self) -> str:
        marked = any(isinstance(s, SortDefinition) and s.has_sort_expression for s in self.statements)
        chosen = f"#semantics {self.semantics}.\n" if marked or self.semantics == "2018" else ""
        return chosen + "".join(f"{statement}\n" for statement in self.statements)

    def __reduce__(self) -> tuple[type[Program], tuple[str, tuple[Statement, ...], Semantics]]:
        return Program, (self.file, self.statements, self.semantics)  # mappings do not travel


def program_text(program: Program) -> str:
    """A canonical text of the program, one statement a line, that parses to an equal program."""
    return str(program)
