"""A P-log program as a value: checked when it is made, never changed, equal to what its text parses to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from lcorpp.errors import ProgramError
from lcorpp.reasoning.checker import check, check_query
from lcorpp.reasoning.offence import Offence
from lcorpp.reasoning.signature import Attribute, Signature
from lcorpp.reasoning.syntax import Query, Selection, Statement, Term


@dataclass(frozen=True)
class Program:
    """A checked program.

    file: where it was read, for errors; it takes no part in equality.
    statements: the syntax tree.
    signature: the declarations found in it.

    Raises:
        ProgramError: a statement is ill-formed; the message begins with file, line and column.
    """

    file: str = field(compare=False)
    statements: tuple[Statement, ...]
    signature: Signature = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "signature", check(self.statements))
        except Offence as offence:
            raise ProgramError(str(offence)) from None

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
        return any(isinstance(s, Selection) and s.term.name == term.name for s in self.statements)

    def check_query(self, query: Query) -> None:
        """Check a query as those in the program are.

        Raises:
            Offence: it names what the program does not know.
        """
        check_query(query, self.statements, self.signature)

    def __str__(self) -> str:
        return "".join(f"{statement}\n" for statement in self.statements)

    def __reduce__(self) -> tuple[type[Program], tuple[str, tuple[Statement, ...]]]:
        return Program, (self.file, self.statements)  # mappings that cannot be written do not travel


def program_text(program: Program) -> str:
    """A canonical text of the program, one statement a line, that parses to an equal program."""
    return str(program)
