"""P-log text as tokens, and a cursor over them that remembers what it looked for.

Both dialects share the tokens. A word such as `random` or `not` is a name here; the place where it stands
tells the parser what it means.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.syntax import Expression, Place

NAME, VARIABLE, INTEGER, DECIMAL, HASH_NAME, UNKNOWN, END = (
    "a name",
    "a variable",
    "a number",
    "a decimal number",
    "a sort",
    "an unknown character",
    "the end",
)
"""The kinds of tokens that are no signs, in the words of messages; a sign is its own kind."""

_KINDS = {"N": NAME, "V": VARIABLE, "I": INTEGER, "D": DECIMAL, "H": HASH_NAME, "U": UNKNOWN}

_NAMED = frozenset({*_KINDS.values(), END})

_UNTOLD = frozenset(
    {"+", "-", "*", "/", "\\", "mod", "==", "!=", "<>", "<", "<=", ">", ">=", "+-", ":+", DECIMAL}
)
"""What messages do not offer, as it may stand nearly everywhere."""

_TOKEN = re.compile(
    r"[ \t\r\n\f]+|%[^\r\n]*"
    r"|(?P<N>[a-z][A-Za-z0-9_']*)"
    r"|(?P<V>_*[A-Z][A-Za-z0-9_']*|_(?![A-Za-z0-9_]))"
    r"|(?P<D>[0-9]*\.[0-9]+)"
    r"|(?P<I>[0-9]+)"
    r"|(?P<H>#[a-z][A-Za-z0-9_']*)"
    r"|(?P<S>:-|:\+|\+-(?![0-9])|\.\.|->|==|!=|<>|<=|>=|[.,:;=<>!+*/\\(){}\[\]|?&-])"
    r"|(?P<U>.)",
    re.DOTALL,
)

_LINE_END = re.compile(r"\r\n|\r|\n")

MAX_DEPTH = 100
"""How deep anything may be nested, so that a recursive function can walk it."""


def _without_blocks(text: str) -> str:
    """The text with spaces for its comments `%* ... *%`, line ends kept; `%*` that no `*%` ends is a line's.

    Both readings are needed: block comments are plog 2.0's, and programs for plog 1.0 have lines `%*Title*`.
    """
    if "%*" not in text or "*%" not in text:
        return text
    last = text.rindex("*%")
    parts: list[str] = []
    done = start = 0
    while (start := text.find("%", start)) >= 0:
        if not text.startswith("%*", start) or start + 2 > last:
            end = _LINE_END.search(text, start)
            if end is None:
                break
            start = end.start()
            continue
        depth, end_of = 1, start + 2
        while depth:
            mark = _MARK.search(text, end_of)
            if mark is None:
                break
            depth += 1 if mark.group() == "%*" else -1
            end_of = mark.end()
        parts += [text[done:start], _VISIBLE.sub(" ", text[start:end_of])]
        done = start = end_of
    return "".join([*parts, text[done:]])


_MARK = re.compile(r"%\*|\*%")

_VISIBLE = re.compile(r"[^\r\n]")


class Cursor:
    """Where a parser stands in a text, and what it knows of it so far.

    constants: the values of `#const`.
    dialect_2: whether a mark of plog 2.0 has been met.
    semantics: what a `#semantics` directive says.
    anonymous: how many `_` the statement has so far.
    """

    def __init__(self, text: str, file: str) -> None:
        self.file, self.text = file, text
        self.kinds: list[str] = []
        self.texts: list[str] = []
        self._starts: list[int] = []
        for found in _TOKEN.finditer(_without_blocks(text)):
            group = found.lastgroup
            if group is None:
                continue
            token = found.group()
            self.kinds.append(_KINDS.get(group, token))
            self.texts.append(token)
            self._starts.append(found.start())
        self.kinds += [END, END]  # two, as the parser looks one token ahead of the next
        self.texts += ["", ""]
        self._lines = [0, *(found.end() for found in _LINE_END.finditer(text))]
        self.index = 0
        self.constants: dict[str, Expression] = {}
        self.dialect_2 = False
        self.semantics: str | None = None
        self.anonymous = 0
        self._depth = 0
        self._wanted: set[str] = set()

    @property
    def kind(self) -> str:
        """The kind of the next token."""
        return self.kinds[self.index]

    @property
    def following(self) -> str:
        """The kind of the token after the next."""
        return self.kinds[self.index + 1]

    @property
    def word(self) -> str:
        """The text of the next token."""
        return self.texts[self.index]

    @property
    def at(self) -> Place:
        """The place of the next token; at the end of the text that behind its last visible character."""
        if self.kind == END:
            return self._place(len(self.text.rstrip()))
        return self._place(self._starts[self.index])

    def _place(self, offset: int) -> Place:
        line = bisect_right(self._lines, offset)
        return Place(self.file, line, offset - self._lines[line - 1] + 1)

    def take(self) -> str:
        """The text of the next token, which is passed."""
        token = self.texts[self.index]
        self.index += 1
        self._wanted.clear()
        return token

    def accept(self, kind: str) -> bool:
        """Pass the next token if it is of this kind."""
        if self.kinds[self.index] == kind:
            self.take()
            return True
        self._wanted.add(kind)
        return False

    def accept_word(self, word: str) -> bool:
        """Pass the next token if it is this name."""
        if self.kinds[self.index] == NAME and self.texts[self.index] == word:
            self.take()
            return True
        self._wanted.add(word)
        return False

    def sees(self, *kinds: str) -> bool:
        """Whether the next token is of one of these kinds."""
        if self.kinds[self.index] in kinds:
            return True
        self._wanted.update(kinds)
        return False

    def expect(self, kind: str) -> str:
        """The text of the next token, which must be of this kind and is passed."""
        if self.kinds[self.index] != kind:
            raise self.unexpected((kind,))
        return self.take()

    def unexpected(self, wanted: Iterable[str] = ()) -> SourceIssue:
        """The next token as an error, with everything that was looked for in its place."""
        kinds = {*self._wanted, *wanted} - _UNTOLD
        names = {kind if kind in _NAMED else f"'{kind}'" for kind in kinds}
        hint = f"; expected {' or '.join(sorted(names))}" if names else ""
        if self.kind == UNKNOWN:
            return SourceIssue(self.at, f"unexpected character {self.word!r}")
        if self.kind == END:
            return SourceIssue(self.at, f"unexpected end of the text{hint}")
        return SourceIssue(self.at, f"unexpected {self.word!r}{hint}")

    def enter(self) -> None:
        """Go one level deeper, and count it."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise SourceIssue(self.at, f"an expression nested deeper than {MAX_DEPTH}")

    def leave(self) -> None:
        """Come back from a level."""
        self._depth -= 1
