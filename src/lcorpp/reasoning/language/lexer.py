"""Lexer: the tokens of a P-log text, and a cursor over them that records the expected tokens for messages.

Both dialects share the tokens. Keywords such as `random`, but `not` and `mod`, are names here; the parser
recognises them.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Container, Iterable, Sequence
from typing import TypeVar

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.syntax import Number, Semantics, Term
from lcorpp.reasoning.quoting import unquote

NAME, VARIABLE, INTEGER, DECIMAL = "a name", "a variable", "a number", "a decimal number"
HASH_NAME, UNKNOWN, END = "a sort", "an unknown character", "the end"
"""Token kinds as shown in messages. A sign such as `:-`, `not` and `mod` are their own kinds."""

_KINDS = {"N": NAME, "V": VARIABLE, "I": INTEGER, "D": DECIMAL, "H": HASH_NAME, "U": UNKNOWN}

_NAMED_KINDS = frozenset({*_KINDS.values(), END})

_HINTS_OMITTED = frozenset(
    {"+", "-", "*", "/", "\\", "mod", "==", "!=", "<>", "<", "<=", ">", ">=", "+-", ":+", DECIMAL}
)
"""Tokens that messages do not list, as they are valid nearly everywhere."""

_TOKEN = re.compile(
    r"[ \t\r\n\f]+|%[^\r\n]*"
    r"|(?P<K>(?:not|mod)(?![A-Za-z0-9_']))"
    r"|(?P<N>[a-z][A-Za-z0-9_']*)"
    r"|(?P<V>_*[A-Z][A-Za-z0-9_']*|_(?![A-Za-z0-9_]))"
    r"|(?P<D>[0-9]*\.[0-9]+)"
    r"|(?P<I>[0-9]+)"
    r"|(?P<H>#[a-z][A-Za-z0-9_']*)"
    r"|(?P<Q>'(?:[^'\\\r\n]|\\.)*')"
    r"|(?P<S>:-|:\+|\+-(?![0-9])|\.\.|->|==|!=|<>|<=|>=|[.,:;=<>!+*/\\(){}\[\]|?&-])"
    r"|(?P<U>.)",
    re.DOTALL,
)

_LINE_END = re.compile(r"\r\n|\r|\n")

_COMMENT_MARK = re.compile(r"%\*|\*%")

_NO_LINE_END = re.compile(r"[^\r\n]")

MAX_DEPTH = 60
"""Maximal nesting depth, so that recursive functions are safe."""

_Item = TypeVar("_Item")


def _erase_block_comments(text: str) -> str:
    """Replace block comments `%* ... *%` by spaces; keep line ends. `%*` without `*%` is a line comment.

    Block comments are plog 2.0's and nest; programs for plog 1.0 contain lines such as `%*Title*`.
    """
    if "%*" not in text or "*%" not in text:
        return text
    last_close = text.rindex("*%")
    parts: list[str] = []
    copied = start = 0  # `parts` covers text[:copied]
    while (start := text.find("%", start)) >= 0:
        if not text.startswith("%*", start) or start + 2 > last_close:  # a line comment
            line_end = _LINE_END.search(text, start)
            if line_end is None:
                break
            start = line_end.start()
            continue
        depth, end = 1, start + 2
        while depth:
            mark = _COMMENT_MARK.search(text, end)
            if mark is None:
                break
            depth += 1 if mark.group() == "%*" else -1
            end = mark.end()
        parts += [text[copied:start], _NO_LINE_END.sub(" ", text[start:end])]
        copied = start = end
    return "".join([*parts, text[copied:]])


def list_line_starts(text: str) -> list[int]:
    """List the offsets at which the lines of a text begin."""
    return [0, *(line_end.end() for line_end in _LINE_END.finditer(text))]


def find_place(file: str, line_starts: Sequence[int], offset: int) -> Place:
    """Find the place of an offset; see `list_line_starts`."""
    line = bisect_right(line_starts, offset)
    return Place(file, line, offset - line_starts[line - 1] + 1)


class Cursor:
    """A position in the tokens of a text, and the state of the parser.

    Args:
        names: names with a capital letter, which need no quotes as the text has no variables.

    kinds, texts, starts: the kind, the text and the offset of each token.
    constants: the values of `#const`.
    uses_plog2: whether a construct of plog 2.0 occurred.
    semantics: the argument of the `#semantics` directive, None without one.
    anonymous_count: the number of `_` in the statement so far.
    """

    def __init__(self, text: str, file: str, names: Container[str] = ()) -> None:
        self.file, self.text = file, text
        self.kinds: list[str] = []
        self.texts: list[str] = []
        self.starts: list[int] = []
        for token_match in _TOKEN.finditer(_erase_block_comments(text)):
            group = token_match.lastgroup
            if group is not None:
                token = token_match.group()
                if group == "Q" or (group == "V" and token in names):
                    token, group = unquote(token) if group == "Q" else token, "N"
                self.kinds.append(token if group in "KS" else _KINDS[group])
                self.texts.append(token)
                self.starts.append(token_match.start())
        self.kinds += [END, END]  # two: `second_kind` looks ahead
        self.texts += ["", ""]
        self._lines = list_line_starts(text)
        self.index = 0
        self.constants: dict[str, Number | Term] = {}
        self.uses_plog2 = False
        self.semantics: Semantics | None = None
        self.anonymous_count = 0
        self._depth = 0
        self._expected_kinds: set[str] = set()

    @property
    def kind(self) -> str:
        """The kind of the next token."""
        return self.kinds[self.index]

    @property
    def second_kind(self) -> str:
        """The kind of the token after the next."""
        return self.kinds[self.index + 1]

    @property
    def word(self) -> str:
        """The text of the next token."""
        return self.texts[self.index]

    @property
    def at(self) -> Place:
        """The place of the next token; at the end of the text, the place after its last visible character."""
        offset = len(self.text.rstrip()) if self.kind == END else self.starts[self.index]
        return find_place(self.file, self._lines, offset)

    def take(self) -> str:
        """Consume the next token and return its text."""
        token = self.texts[self.index]
        self.skip_to(self.index + 1)
        return token

    def skip_to(self, index: int) -> None:
        """Consume the tokens before an index."""
        self.index = index
        self._expected_kinds.clear()

    def is_on_one_line(self, first: int, last: int) -> bool:
        """Whether the tokens from one index to another begin on one line."""
        return bisect_right(self._lines, self.starts[first]) == bisect_right(self._lines, self.starts[last])

    def accept(self, kind: str) -> bool:
        """Return whether the next token is of this kind or name; if so, consume it, else messages list it."""
        if kind in (self.kinds[self.index], self.texts[self.index]):
            self.take()
            return True
        self._expected_kinds.add(kind)
        return False

    def next_is(self, *kinds: str) -> bool:
        """Return whether the next token is of one of these kinds; if not, messages list them as expected."""
        if self.kinds[self.index] in kinds:
            return True
        self._expected_kinds.update(kinds)
        return False

    def expect(self, kind: str) -> str:
        """Consume a token of this kind and return its text.

        Raises:
            SourceIssue: the next token is of another kind.
        """
        if self.kinds[self.index] != kind:
            raise self.make_unexpected_error((kind,))
        return self.take()

    def make_unexpected_error(self, expected: Iterable[str] = ()) -> SourceIssue:
        """Return the error for the next token, with all tokens expected in its place."""
        kinds = {*self._expected_kinds, *expected} - _HINTS_OMITTED
        names = {kind if kind in _NAMED_KINDS else f"'{kind}'" for kind in kinds}
        hint = f"; expected {' or '.join(sorted(names))}" if names else ""
        if self.kind == UNKNOWN:
            return SourceIssue(self.at, f"unexpected character {self.word!r}")
        found = "end of the text" if self.kind == END else repr(self.word)
        return SourceIssue(self.at, f"unexpected {found}{hint}")

    def parse_list(self, parse_item: Callable[[Cursor], _Item], separator: str = ",") -> list[_Item]:
        """Parse one or more items with a separator between them."""
        items = [parse_item(self)]
        while self.accept(separator):
            items.append(parse_item(self))
        return items

    def parse_nested(self, parse_inside: Callable[[Cursor], _Item], closing: str | None = None) -> _Item:
        """Parse a nested expression, and its closing bracket if it has one.

        Raises:
            SourceIssue: there are more than `MAX_DEPTH` levels.
        """
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise make_depth_error(self.at)
        inside = parse_inside(self)
        self._depth -= 1
        if closing:
            self.expect(closing)
        return inside


def make_depth_error(at: Place) -> SourceIssue:
    """Make the error for an expression with too many levels."""
    return SourceIssue(at, f"an expression nested deeper than {MAX_DEPTH} levels; each operator is one")
