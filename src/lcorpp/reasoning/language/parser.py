"""From text to the syntax tree of P-log, with the place of every fault.

A parser by hand, one function for each construct: nothing has to be built before the first text is read,
and a text is read in time proportional to its length. The parts: `lexer`, `expressions`, `sort_expressions`,
`declarations`, `statements`; `completion` then writes out what a dialect leaves unsaid.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn, TypeVar

from lcorpp.errors import ParseError, ProgramError
from lcorpp.files import read_text
from lcorpp.reasoning.language.declared import check_record_names
from lcorpp.reasoning.language.desugar import desugar
from lcorpp.reasoning.language.expressions import value
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lenient import drop_ill_sorted
from lcorpp.reasoning.language.lexer import END, Cursor
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.queries import question
from lcorpp.reasoning.language.statements import statements
from lcorpp.reasoning.language.syntax import Expression, Query, Semantics

_Read = TypeVar("_Read")


def read_plog(path: str | Path, *, semantics: Semantics | None = None, strict: bool = True) -> Program:
    """Read and check a P-log program.

    Args:
        semantics, strict: as in `parse_plog`.

    Raises:
        FileError: the file cannot be read.
        ParseError: it does not follow the grammar.
        ProgramError: a name, sort, arity or probability in it is wrong.
    """
    return parse_plog(read_text(path), file=str(path), semantics=semantics, strict=strict)


def parse_plog(
    text: str, *, file: str = "<text>", semantics: Semantics | None = None, strict: bool = True
) -> Program:
    """Parse and check a P-log program given as text, in the dialect of plog 1.0, plog 2.0 or the papers.

    Args:
        file: the name under which errors speak of it.
        semantics: what `do` and Condition 1 mean. By default what a directive ``#semantics 2018.`` says;
            without one 2018 if the text has a mark of plog 2.0 (a section header, ``#sort``,
            ``random(a, p)``, ``:+``), else 2009.
        strict: whether to refuse what the public systems let pass against their manual: a constant outside of
            its sort, a wrong number of arguments, an attribute with the name of a record. With
            ``strict=False`` statements that so have no instance are left out; see `leniency`.

    Raises:
        ParseError: it does not follow the grammar.
        ProgramError: a name, sort, arity or probability in it is wrong.

    Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 2; Balai, Gelfond and Zhang, 2019, section 3;
    the manual of plog 2.0.
    """

    def program(cursor: Cursor) -> Program:
        found = tuple(statements(cursor))
        marked: Semantics = "2018" if cursor.dialect_2 else "2009"
        told: Semantics | None = cursor.semantics  # type: ignore[assignment]  # one of the two, checked where read
        chosen = semantics or told or marked
        try:
            whole = desugar(found, marked)
            if strict:
                check_record_names(whole)
            else:
                whole = drop_ill_sorted(whole)
        except SourceIssue as issue:
            raise ProgramError(str(issue)) from None
        return Program(file, whole, chosen)

    return _parsed(text, file, program)


def parse_query(text: str, program: Program) -> Query:
    """Parse a query: ``a``, ``a=v, b=w | obs(c=u), do(d=x)`` or ``?{a=v} | obs(c=u).``.

    A single attribute without value and braces asks for its distribution, anything else for a probability.

    Raises:
        ParseError: it is not a query, or not one about `program`; the file is ``<query>``.
    """

    def query(cursor: Cursor) -> Query:
        found = program.named(question(cursor))
        cursor.accept(".")
        cursor.expect(END)
        program.check_query(found)
        return found

    return _parsed(text, "<query>", query)


def parse_term(text: str, file: str) -> Expression:
    """Parse one term or value, such as the key ``roll(d1)`` of evidence.

    Raises:
        ParseError: it is not one.
    """

    def term(cursor: Cursor) -> Expression:
        found = value(cursor)
        cursor.expect(END)
        return found

    return _parsed(text, file, term)


def _parsed(text: str, file: str, read: Callable[[Cursor], _Read]) -> _Read:
    try:
        return read(Cursor(text, file))
    except SourceIssue as issue:
        _refuse(issue, text)


def _refuse(issue: SourceIssue, text: str) -> NoReturn:
    lines = re.split(r"\r\n|\r|\n", text)
    shown = lines[issue.at.line - 1] if issue.at.line <= len(lines) else ""
    raise ParseError(issue.at.file, issue.at.line, issue.at.column, issue.message, shown) from None
