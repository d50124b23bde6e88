"""From text to the syntax tree of P-log, with the place of every fault.

The grammar stands in `grammar.lark`, what its rules make in `builder.py`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from threading import Lock
from typing import NoReturn

from lark import Lark, UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from lcorpp.errors import ParseError
from lcorpp.files import read_text
from lcorpp.reasoning.builder import Builder
from lcorpp.reasoning.offence import Offence
from lcorpp.reasoning.program import Program
from lcorpp.reasoning.syntax import Arithmetic, Expression, Number, Place, Query, Term, Variable

_TURN = Lock()  # making the parser is dear, so there is one, which knows one file at a time

_SHOWN = {
    "NAME": "a name",
    "VARIABLE": "a variable",
    "INTEGER": "a number",
    "DECIMAL": "a number",
    "_EQUAL": "'='",
    "DOT": "'.'",
    "COMMA": "','",
    "COLON": "':'",
    "LPAR": "'('",
    "RPAR": "')'",
    "LBRACE": "'{'",
    "RBRACE": "'}'",
    "LSQB": "'['",
    "RSQB": "']'",
    "VBAR": "'|'",
    "IF": "':-'",
    "QUESTION": "'?'",
    "NOT": "'not'",
    "OBS": "'obs'",
    "DO": "'do'",
    "$END": "the end",
}


def read_plog(path: str | Path) -> Program:
    """Read and check a P-log program.

    Raises:
        FileError: the file cannot be read.
        ParseError: it does not follow the grammar.
        ProgramError: a name, sort, arity or probability in it is wrong.
    """
    return parse_plog(read_text(path), file=str(path))


def parse_plog(text: str, *, file: str = "<text>") -> Program:
    """Parse and check a P-log program given as text.

    Args:
        file: the name under which errors speak of it.

    Raises:
        ParseError: it does not follow the grammar.
        ProgramError: a name, sort, arity or probability in it is wrong.

    Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 2; the manual of plog 1.0.
    """
    statements = _parse(text, file, "program")
    assert isinstance(statements, tuple)
    return Program(file, statements)


def parse_query(text: str, program: Program) -> Query:
    """Parse a query: ``a``, ``a=v, b=w | obs(c=u), do(d=x)`` or ``?{a=v} | obs(c=u).``.

    A single attribute without value and braces asks for its distribution, anything else for a probability.

    Raises:
        ParseError: it is not a query, or not one about `program`; the file is ``<query>``.
    """
    query = _parse(text, "<query>", "query_text")
    assert isinstance(query, Query)
    try:
        program.check_query(query)
    except Offence as offence:
        _refuse(offence, text)
    return query


def parse_term(text: str, file: str) -> Expression:
    """Parse one term or value, such as the key ``roll(d1)`` of evidence.

    Raises:
        ParseError: it is not one.
    """
    term = _parse(text, file, "expression")
    assert isinstance(term, Number | Variable | Term | Arithmetic)
    return term


def _parse(text: str, file: str, start: str) -> object:
    try:
        with _TURN:
            parser, builder = _parser()
            builder.file = file
            tree: object = parser.parse(text, start=start)
        return builder.value(tree) if start == "expression" else tree
    except Offence as offence:
        _refuse(offence, text)
    except UnexpectedInput as error:
        _refuse(_offence(error, text, file), text)


def _refuse(offence: Offence, text: str) -> NoReturn:
    lines = text.split("\n")
    shown = lines[offence.at.line - 1] if offence.at.line <= len(lines) else ""
    raise ParseError(offence.at.file, offence.at.line, offence.at.column, offence.message, shown) from None


def _offence(error: UnexpectedInput, text: str, file: str) -> Offence:
    if isinstance(error, UnexpectedCharacters):
        return Offence(Place(file, error.line, error.column), f"unexpected character {error.char!r}")
    assert isinstance(error, UnexpectedToken)
    wanted = sorted({_SHOWN[name] for name in error.accepts or error.expected if name in _SHOWN})
    hint = f"; expected {' or '.join(wanted)}" if wanted else ""
    if error.token.type == "$END":
        before = text.rstrip()
        line = before.count("\n") + 1
        column = len(before) - before.rfind("\n")
        return Offence(Place(file, line, max(column, 1)), f"unexpected end of the text{hint}")
    token = str(error.token)
    return Offence(Place(file, error.line, error.column), f"unexpected {token!r}{hint}")


@cache
def _parser() -> tuple[Lark, Builder]:
    builder = Builder()
    grammar = Path(__file__).with_name("grammar.lark").read_text(encoding="utf-8")
    starts = ["program", "query_text", "expression"]
    return Lark(grammar, parser="lalr", lexer="basic", start=starts, transformer=builder), builder
