"""Element tree of a PomdpX document in which each word has a line and a column."""

from __future__ import annotations

import re
from collections.abc import Sequence

from lcorpp.errors import ParseError, expected_one_of
from lcorpp.planning.formats.numbers import find_invalid_number, parse_numbers
from lcorpp.planning.formats.xml import XmlReader
from lcorpp.values import Array

MAX_DEPTH = 1000
"""Maximum nesting: a decision diagram takes two levels for each variable on a path."""

_WORD = re.compile(r"[^ \t\r\n]+")
_LINE_END = re.compile(r"\r\n|\r|\n")
_NO_ATTRIBUTES: dict[str, str] = {}


class Element:
    """An element with its position. Its text precedes its first child."""

    __slots__ = ("attributes", "children", "column", "length", "line", "name", "pieces", "text")

    def __init__(self, name: str, attributes: dict[str, str], line: int, column: int) -> None:
        self.name, self.attributes, self.line, self.column = name, attributes, line, column
        self.children: list[Element] = []
        self.text = ""
        self.length = 0  # of the text so far, during parsing
        self.pieces: list[tuple[int, int, int]] = []  # offset, line and column of each piece of text

    def words(self) -> list[str]:
        """Split the text at white space."""
        return _WORD.findall(self.text)

    def position(self, word: int | None) -> tuple[int, int]:
        """Return the line and the column of a word of the text, or of the element."""
        if word is None:
            return self.line, self.column
        offsets = [match.start() for match in _WORD.finditer(self.text)]
        offset = offsets[word] if word < len(offsets) else len(self.text)
        begin, line, column = max(
            piece for piece in self.pieces or [(0, self.line, self.column)] if piece[0] <= offset
        )
        return line, column + offset - begin


class Document:
    """A parsed document: access to its elements, and errors with their positions.

    Args:
        data: the text, or the bytes of a file in the encoding that its first line declares.
        file: its name, for messages.
        root: required name of the outermost element.

    Raises:
        ParseError: it is not well-formed, is nested too deeply, or has a document type declaration.
    """

    def __init__(self, data: str | bytes, file: str, root: str) -> None:
        self.file, self._data = file, data
        builder = _TreeBuilder(self, root)
        builder.parse(data)
        self.root = builder.root

    def error_at(self, line: int, column: int, message: str) -> ParseError:
        """Return a ParseError at a position."""
        if isinstance(self._data, str):
            text = self._data
        else:
            try:
                is_utf16 = self._data[:2] in (b"\xff\xfe", b"\xfe\xff")
                text = self._data.decode("utf-16" if is_utf16 else "utf-8-sig")
            except UnicodeDecodeError:
                text = self._data.decode("latin-1")
        begin = 0
        for _, match in zip(range(line - 1), _LINE_END.finditer(text), strict=False):
            begin = match.end()
        end = _LINE_END.search(text, begin)
        return ParseError(self.file, line, column, message, text[begin : end.start() if end else None])

    def error(self, element: Element, message: str, word: int | None = None) -> ParseError:
        """Return a ParseError at an element, or at a word of its text."""
        return self.error_at(*element.position(word), message)

    def check_children(
        self, element: Element, names: Sequence[str], attributes: Sequence[str] = ()
    ) -> list[Element]:
        """Check that an element has no text and only these children and attributes; return the children."""
        self._check_attributes(element, attributes)
        if element.words():
            raise self.error(
                element, f"<{element.name}> contains no text, found {element.words()[0][:40]!r}", 0
            )
        for child in element.children:
            if child.name not in names:
                known = expected_one_of([f"<{name}>" for name in names]) if names else "it is empty"
                raise self.error(child, f"unknown <{child.name}> in <{element.name}>; {known}")
        return element.children

    def only_child(self, element: Element, name: str, *others: str) -> Element:
        """Return the only child of an element with one of the names."""
        matches = [child for child in element.children if child.name in (name, *others)]
        what = " or ".join(f"<{n}>" for n in (name, *others))
        if not matches:
            raise self.error(element, f"<{element.name}> needs {what}")
        if len(matches) > 1:
            raise self.error(matches[1], f"a second {what} in <{element.name}>")
        return matches[0]

    def words(self, element: Element) -> list[str]:
        """Split the text of an element without children and attributes at white space."""
        if element.children:
            inner = element.children[0]
            raise self.error(inner, f"<{element.name}> contains words only, found <{inner.name}>")
        self._check_attributes(element, ())
        return element.words()

    def word(self, element: Element) -> str:
        """Return the only word of an element."""
        words = self.words(element)
        if len(words) != 1:
            raise self.error(element, f"<{element.name}> contains one word, found {len(words)}")
        return words[0]

    def numbers(self, element: Element) -> Array:
        """Return (n,) the numbers in an element."""
        words = self.words(element)
        numbers = parse_numbers(element.text)
        # white space of other scripts is none in XML: it would turn one word into several numbers
        if numbers is None or len(numbers) != len(words):
            index, message = find_invalid_number(words)
            raise self.error(element, message, index)
        return numbers

    def number(self, element: Element) -> float:
        """Return the only number in an element."""
        self.word(element)
        return float(self.numbers(element)[0])

    def attribute(self, element: Element, name: str, default: str | None = None) -> str:
        """Return the value of an attribute; required if there is no default."""
        if name in element.attributes:
            return element.attributes[name]
        if default is None:
            raise self.error(element, f"<{element.name}> needs the attribute {name}")
        return default

    def _check_attributes(self, element: Element, names: Sequence[str]) -> None:
        for name in element.attributes:
            if name not in names:
                known = expected_one_of(names) if names else "there is none"
                raise self.error(element, f"unknown attribute {name!r} of <{element.name}>; {known}")


class _TreeBuilder(XmlReader):
    """Builds the tree of elements."""

    root: Element

    def __init__(self, document: Document, root: str) -> None:
        super().__init__(root=root, max_depth=MAX_DEPTH)
        self._document = document
        self._open: list[Element] = []
        self._texts: list[list[str]] = []  # pieces of text of each open element

    def start(self, name: str, attributes: dict[str, str]) -> None:
        element = Element(name, attributes or _NO_ATTRIBUTES, *self.position)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)
        self._texts.append([])

    def end(self, name: str) -> None:
        self._open.pop().text = "".join(self._texts.pop())

    def text(self, text: str) -> None:
        element, pieces = self._open[-1], self._texts[-1]
        if text.isspace():
            if pieces:
                pieces.append(" ")
                element.length += 1
            return
        if element.children:
            raise self.error(f"text among the elements of <{element.name}>: {text.strip()[:40]!r}")
        element.pieces.append((element.length, *self.position))
        element.length += len(text)
        pieces.append(text)

    def make_error(self, line: int, column: int, message: str) -> ParseError:
        return self._document.error_at(line, column, message)
