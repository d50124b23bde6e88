"""Reader: the tokens of a Prolog text, and the terms of its clauses.

Operators are those of ProbLog, which differ from ISO Prolog: a minus binds more tightly than `^`, and `::` is
an operator. Block comments do not nest.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import MAX_DEPTH, find_place, list_line_starts, make_depth_error
from lcorpp.reasoning.language.translation.prolog_terms import (
    EMPTY_LIST,
    Compound,
    PrologTerm,
    PrologVariable,
    Real,
    make_list,
)

NAME, VARIABLE, NUMBER, QUOTED, STRING, SIGN, STOP, UNKNOWN, END = (
    "name", "variable", "number", "quoted", "string", "sign", "stop", "unknown", "end"
)  # fmt: skip
"""Token kinds; `STOP` is the full stop that ends a clause."""

_TOKEN = re.compile(
    r"\s+|\A#![^\r\n]*|%[^\r\n]*|/\*.*?\*/"
    rf"|(?P<{NUMBER}>0x[0-9a-fA-F]+|[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)"
    rf"|(?P<{VARIABLE}>[A-Z_]\w*)"
    rf"|(?P<{NAME}>[^\W\d_]\w*)"
    rf"|(?P<{QUOTED}>'(?:\\.|[^'\\])*')"
    rf"|(?P<{STRING}>\"(?:\\.|[^\"\\])*\")"
    rf"|(?P<{STOP}>\.(?![0-9(]))"
    rf"|(?P<{SIGN}>-->|\*->|=:=|=\\=|=@=|=\.\.|\\=@=|\\==|@=<|@>=|~==|:-|::|->|<-|<<|>>|><|>=|=<|==|=>|@<|@>"
    r"|\\\+|\\=|\\/|/\\|//|\*\*|[-+*/\\^<>=:;,|!?~#&()\[\]])"
    rf"|(?P<{UNKNOWN}>.)",
    re.DOTALL,
)

_INFIX: dict[str, tuple[int, str]] = {
    **dict.fromkeys((":-", "<-", "-->"), (1200, "xfx")),
    **dict.fromkeys((";", "|"), (1100, "xfy")),
    "->": (1050, "xfy"),
    ",": (1000, "xfy"),
    **dict.fromkeys(("::", "~"), (1000, "xfx")),
    **dict.fromkeys(
        (
            "=", "\\=", "==", "\\==", "is", "as", "=:=", "=\\=", "<", ">", "=<", ">=", "=..", "=@=", "\\=@=",
            "@<", "@>", "@=<", "@>=", "~==",
        ),
        (700, "xfx"),
    ),
    "=>": (700, "yfx"),
    ":": (600, "xfy"),
    **dict.fromkeys(("+", "-", "/\\", "\\/", "xor", "#", "><"), (500, "yfx")),
    **dict.fromkeys(("*", "/", "//", "mod", "rem", "div", "rdiv", "<<", ">>"), (400, "yfx")),
    "^": (400, "xfy"),
    "**": (200, "xfx"),
    "*->": (200, "xfy"),
}  # fmt: skip
"""Priority and type of the operators between two operands."""

_PREFIX: dict[str, tuple[int, str]] = {
    ":-": (1200, "fx"),
    "\\+": (900, "fy"),
    "not": (900, "fy"),
    "~": (900, "fx"),
    "-": (200, "fy"),
    "+": (200, "fy"),
    "\\": (200, "fy"),
}
"""Priority and type of the operators before their operand."""

_MAX_ARGUMENT = 999
"""The priority of arguments, below that of the comma."""

_NEGATIONS = ("\\+", "not")


class Token(NamedTuple):
    """A token: kind, text, offset, and whether an opening bracket follows directly."""

    kind: str
    text: str
    start: int
    is_functor: bool


def list_tokens(text: str) -> list[Token]:
    """List the tokens of a text; the last one is of the kind END."""
    tokens = [
        Token(found.lastgroup, found.group(), found.start(), text.startswith("(", found.end()))
        for found in _TOKEN.finditer(text)
        if found.lastgroup
    ]
    return [*tokens, Token(END, "", len(text.rstrip()), False)]


class PrologReader:
    """Reads the clauses of a text, with the places of terms.

    Args:
        tokens: those of the text.
    """

    def __init__(self, text: str, file: str, tokens: Sequence[Token]) -> None:
        self._file, self._tokens, self._lines = file, tokens, list_line_starts(text)
        self._index = 0
        self._depth = 0
        self._anonymous_count = 0

    def read_clauses(self) -> Iterator[tuple[Place, PrologTerm]]:
        """Read the terms that end with a full stop.

        Raises:
            SourceIssue: the text is not Prolog.
        """
        while self._token.kind != END:
            self._anonymous_count = 0
            at = self._place()
            term, _ = self._parse(1200)
            if self._token.kind != STOP:
                raise self._make_error("'.'")
            self._index += 1
            yield at, term

    @property
    def _token(self) -> Token:
        return self._tokens[self._index]

    def _place(self) -> Place:
        return find_place(self._file, self._lines, self._token.start)

    def _make_error(self, expected: str) -> SourceIssue:
        kind, word = self._token.kind, self._token.text
        if kind == UNKNOWN:
            words = {"'": "a quoted name without end", '"': "a string without end"}
            return SourceIssue(self._place(), words.get(word, f"unexpected character {word!r}"))
        is_operator = kind in (SIGN, NAME) and (word in _INFIX or word in _PREFIX)
        hint = "an operator that needs brackets here" if is_operator else f"expected {expected}"
        found = "end of the text" if kind == END else repr(word)
        return SourceIssue(self._place(), f"unexpected {found}; {hint}")

    def _accept(self, sign: str) -> bool:
        if self._token.kind == SIGN and self._token.text == sign:
            self._index += 1
            return True
        return False

    def _expect(self, sign: str) -> None:
        if not self._accept(sign):
            raise self._make_error(f"'{sign}'")

    def _parse(self, most: int) -> tuple[PrologTerm, int]:
        """Parse a term of at most this priority; return it with its priority."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise make_depth_error(self._place())
        at = self._place()
        left, priority = self._parse_operand(most)
        while self._token.kind in (SIGN, NAME) and self._token.text in _INFIX:
            name = self._token.text
            strength, kind = _INFIX[name]
            if strength > most or priority > strength - (kind[0] == "x"):
                break
            if name in (",", ";"):
                left = self._parse_sequence(name, left, strength - 1)
            else:
                self._index += 1
                right, _ = self._parse(strength - (kind[2] == "x"))
                left = Compound(name, (left, right), at)
            priority = strength
        self._depth -= 1
        return left, priority

    def _parse_sequence(self, sign: str, first: PrologTerm, most: int) -> PrologTerm:
        """Parse the rest of a conjunction or disjunction, which may have hundreds of parts."""
        items, places = [first], []
        while self._token.kind == SIGN and self._token.text == sign:
            self._index += 1
            places.append(self._place())
            items.append(self._parse(most)[0])
        last = items.pop()
        while items:
            last = Compound(sign, (items.pop(), last), places.pop())
        return last

    def _parse_operand(self, most: int) -> tuple[PrologTerm, int]:
        token, at = self._token, self._place()
        kind, word = token.kind, token.text
        if kind in (SIGN, NAME) and word in _PREFIX and self._is_prefix(token):
            priority, form = _PREFIX[word]
            if priority > most:
                raise self._make_error("a term")
            self._index += 1
            operand, _ = self._parse(priority - (form == "fx"))
            if word == "-" and isinstance(operand, int | Real):
                return _negate(operand), 0
            return Compound("\\+" if word in _NEGATIONS else word, (operand,), at), priority
        if kind == NUMBER:
            self._index += 1
            return _make_number(word), 0
        if kind == VARIABLE:
            self._index += 1
            if word == "_":
                self._anonymous_count += 1
                word = f"_'{self._anonymous_count}"
            return PrologVariable(word), 0
        if kind in (QUOTED, STRING, NAME) or (kind == SIGN and self._is_constant(token)):
            self._index += 1
            return self._parse_rest_of_compound(word, at, token.is_functor), 0
        if self._accept("("):
            inner, _ = self._parse(1200)
            self._expect(")")
            return inner, 0
        if self._accept("["):
            return self._parse_list(at), 0
        raise self._make_error("a term")

    def _is_prefix(self, token: Token) -> bool:
        """Whether a prefix operator is one here, and neither a constant nor written as `-(1,2)`."""
        if token.is_functor and token.text not in (*_NEGATIONS, ":-"):
            return False
        following = self._tokens[self._index + 1]
        is_infix = (
            following.kind in (SIGN, NAME) and following.text in _INFIX and following.text not in _PREFIX
        )
        return not (is_infix or following.kind in (STOP, END) or following.text in (")", "]"))

    def _is_constant(self, token: Token) -> bool:
        if token.text in ("(", ")", "[", "]", ",", "|", "&"):
            return False
        following = self._tokens[self._index + 1]
        return token.text in ("!", "?") or token.is_functor or following.text in (",", ")", "]")

    def _parse_rest_of_compound(self, name: str, at: Place, is_functor: bool) -> PrologTerm:
        if not is_functor:
            return Compound(name, (), at)
        if name in _INFIX or name in _PREFIX:
            name = f"'{name}'"
        self._expect("(")
        arguments = [self._parse(_MAX_ARGUMENT)[0]]
        while self._accept(","):
            arguments.append(self._parse(_MAX_ARGUMENT)[0])
        self._expect(")")
        return Compound(name, tuple(arguments), at)

    def _parse_list(self, at: Place) -> PrologTerm:
        if self._accept("]"):
            return EMPTY_LIST
        items = [self._parse(_MAX_ARGUMENT)[0]]
        while self._accept(","):
            items.append(self._parse(_MAX_ARGUMENT)[0])
        tail = self._parse(_MAX_ARGUMENT)[0] if self._accept("|") else EMPTY_LIST
        self._expect("]")
        return make_list(items, tail, at)


def _make_number(word: str) -> int | Real:
    if word.startswith("0x"):
        return int(word, 16)
    return Real(float(word), Fraction(word)) if any(letter in ".eE" for letter in word) else int(word)


def _negate(number: int | Real) -> int | Real:
    if isinstance(number, Real):
        return Real(-number, None if number.exact is None else -number.exact)
    return -number
